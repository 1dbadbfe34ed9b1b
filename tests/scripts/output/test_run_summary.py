"""What the console says of a station."""

from lidarium.scripts.output.run_summary import _of_station

KNOWN = {
    "decisions": 9,
    "redirections": 3,
    "stops": 2,
    "pauses": 0,
    "resumes": 0,
    "by_rule": {"0": 4, "3": 5},
    "joined": 1,
    "dropped": 0,
}


def orders(**more):
    return dict(_of_station({"supervisor": KNOWN | more, "merges": {"wrong": 0}}))["orders"]


def test_pauses_are_named_where_there_were_any():
    assert orders() == "3 redirections and 2 stops of 9 decisions; 5 by rule 3"
    assert orders(pauses=2, resumes=1).startswith("3 redirections, 2 pauses, 1 resumes and 2 stops of 9 ")


def test_without_a_station_nothing_is_said():
    assert _of_station({"supervisor": None, "merges": None}) == []
