"""Writes pages: the built front end with its data in it.

The front end is ``evaluation/report/data/page.html``, built by npm from ``evaluation/report/web``.
"""

import html
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lidarium.evaluation.report.page.replay_content import Replay
from lidarium.mapping.files.names import printable
from lidarium.mapping.files.output import write_text

FRONT_END = Path(__file__).parents[1] / "data" / "page.html"
"""The page without data."""

_TITLE, _DATA = "<!--title-->", "<!--data-->"


def write_page(path: Path, content: Mapping[str, Any], replays: Sequence[Replay]) -> None:
    """Write a page with data and replays, whole or not at all.

    Parameters
    ----------
    path : Path
        The file, by custom an ``.html``.
    content : mapping
        What `page_content` returns.
    replays : sequence of Replay
        Replays, in the order in which the content names them.

    Raises
    ------
    OSError
        Where nothing can be written there.
    """
    listed = [{"title": replay.title, "lacks": replay.lacks} for replay in replays]
    data = [_script("application/json", "page-data", _json({**content, "replays": listed}))]
    data += [_script("text/plain", f"replay-{place}", replay.text) for place, replay in enumerate(replays)]
    before, after = FRONT_END.read_text(encoding="utf-8").split(_DATA)
    head = before.replace(_TITLE, html.escape(printable(str(content["title"]))))
    write_text(path, head + "\n".join(data) + after)


def write_replay_page(path: Path, replay: Replay) -> None:
    """Write the page of one episode; raises as `write_page`."""
    write_page(path, {"kind": "replay", "title": replay.title}, [replay])


def _json(content: Mapping[str, Any]) -> str:
    """Return JSON in which nothing can end the script that it stands in."""
    text = json.dumps(content, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").encode("utf-8", "backslashreplace").decode()


def _script(kind: str, name: str, text: str) -> str:
    return f'<script type="{kind}" id="{name}">{text}</script>'
