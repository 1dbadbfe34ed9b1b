"""Notebooks of robots that tell each other news, and agreements."""

import pytest

from lidarium.agents.meetings.agreements import (
    Agreement,
    MeetingSettings,
    News,
    Notebook,
    next_meeting_s,
    tour_length,
)


def news(time_s, known=100, is_done=False):
    return News(time_s, (0.0, 0.0), (0.0, 0.0), known, is_done)


def test_newer_news_and_the_later_agreement_are_taken_over_older_ones_are_not():
    book = Notebook({"a": news(10.0), "b": news(5.0)}, Agreement(2, (1.0, 1.0), 50.0, ("a", "b")))
    book.read({"a": news(9.0, 7), "b": news(8.0, 9), "c": news(1.0)}, Agreement(1, (9.0, 9.0), 99.0, ("a",)))
    assert book.news == {"a": news(10.0), "b": news(8.0, 9), "c": news(1.0)}
    assert book.agreement.number == 2
    book.read({}, Agreement(3, (9.0, 9.0), 99.0, ("a",)))
    assert book.agreement.number == 3


def test_a_robot_that_was_given_up_is_expected_again_with_its_next_news():
    book = Notebook({"a": news(30.0), "b": news(5.0)}, given_up={"b"})
    assert book.expects("a", 29.0, 0.005) == []
    book.read({"b": news(20.0)}, None)
    assert book.expects("a", 29.0, 0.005) == ["b"]


def test_a_teammate_must_know_what_it_was_told():
    book = Notebook({"a": news(0.0, 100), "b": news(0.0, 100, is_done=True)})
    for time_s in (0.0, 3.0):
        book.read({"b": news(time_s, 100, is_done=True)}, None)
        book.news["a"] = news(time_s, 100)
        book.note_shared("a", time_s - 1.0, 3.0)
    book.news["a"] = news(60.0, 100)
    assert book.shared == {"b": 100}
    assert book.expects("a", 59.0, 0.005) == []
    book.news["a"] = news(60.0, 120)
    assert book.expects("a", 59.0, 0.005) == ["b"]


def test_a_contact_too_short_for_maps_shares_nothing():
    book = Notebook({"a": news(0.0), "b": news(0.0)})
    for time_s in (0.0, 1.0):
        book.read({"b": news(time_s)}, None)
        book.news["a"] = news(time_s)
        book.note_shared("a", time_s - 1.0, 3.0)
    assert book.shared == {}


def test_the_time_to_the_next_meeting_grows_with_the_tour_and_is_bounded():
    settings = MeetingSettings(interval=2.0, minimum_s=40.0, maximum_s=120.0)
    assert tour_length((0.0, 0.0), [(3.0, 0.0), (1.0, 0.0), (-4.0, 0.0)]) == pytest.approx(1.0 + 2.0 + 7.0)
    assert next_meeting_s(settings, 60.0, 4, 0.5) == pytest.approx(60.0)
    assert next_meeting_s(settings, 0.0, 4, 0.5) == 40.0
    assert next_meeting_s(settings, 1e4, 4, 0.5) == 120.0


def test_settings_that_make_no_sense_are_refused():
    with pytest.raises(ValueError, match=r"rule of meetings is 'never'; want one of meeting, pursuit, none"):
        MeetingSettings(rule="never")
    with pytest.raises(ValueError, match=r"minimum_s of meetings is 200.0; want at most maximum_s"):
        MeetingSettings(minimum_s=200.0, maximum_s=100.0)
