from lidarium.benchmarks.studies.shared import study
from lidarium.evaluation.bounds.bound import KnownFloorBound


def test_a_bound_begins_where_explorers_do(monkeypatch):
    seen = {}

    def bound(floor, settings, starts):
        seen.update(starts=starts, robots=settings.robots)
        return KnownFloorBound(12.0, 1.0, 1.0, 0.99, [])

    monkeypatch.setattr(study, "known_floor_bound", bound)
    team = study.Bounded("apartment:7", 2, {"resolution": 0.05})
    assert study.measure_bound(team) == {"floor": "apartment:7", "robots": 2, "known_s": 12.0}
    assert len(seen["starts"]) == seen["robots"] == 2
    assert team.key == "apartment:7 | 2"
