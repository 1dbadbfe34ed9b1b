"""A page is the front end with its data in it."""

import json

import pytest
from page_reader import Scripts

from lidarium.evaluation.report.page.document import FRONT_END, write_page, write_replay_page
from lidarium.evaluation.report.page.replay_content import Replay


def test_replays_stand_in_the_order_in_which_the_content_names_them(tmp_path):
    path = tmp_path / "page.html"
    replays = [Replay("first", "AAA"), Replay("second", "BBB", lacks="another version")]
    write_page(path, {"kind": "report", "title": "<b>", "number": 1.5}, replays)
    scripts = Scripts(path.read_text(encoding="utf-8"))
    data = json.loads(scripts.found["page-data"])
    assert data["number"] == 1.5
    assert data["replays"] == [
        {"title": "first", "lacks": ""},
        {"title": "second", "lacks": "another version"},
    ]
    assert tuple(scripts.found[f"replay-{place}"].strip() for place in (0, 1)) == ("AAA", "BBB")


def test_a_title_is_text_and_data_cannot_end_their_script(tmp_path):
    path = tmp_path / "page.html"
    evil = "</script><b>\ud800"
    write_replay_page(path, Replay(evil, "AAA"))
    text = path.read_text(encoding="utf-8")
    assert "</script><b>" not in text
    assert "&lt;/script&gt;&lt;b&gt;" in text
    assert text.endswith(FRONT_END.read_text(encoding="utf-8").split("<!--data-->")[1])
    assert json.loads(Scripts(text).found["page-data"])["title"].startswith("</script><b>")


def test_what_is_no_number_leaves_no_page(tmp_path):
    with pytest.raises(ValueError, match="JSON"):
        write_page(tmp_path / "page.html", {"title": "a", "value": float("nan")}, [])
    assert list(tmp_path.iterdir()) == []
