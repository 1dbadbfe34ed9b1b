import json

import numpy as np
import pytest
from published_pages import assert_published, keep

from lidarium.agents.zoo.network import network_shapes
from lidarium.agents.zoo.policy import zoo_files
from lidarium.benchmarks.studies import zoo

NEAREST = "nearest_frontier"


def line(policy, floor, time_s, robots=2, training="", world="", joined_s=None):
    return {
        "policy": policy,
        "training": training,
        "floor": floor,
        "robots": robots,
        "world": world,
        "joined_s": joined_s,
        "early": 0.5 if time_s is None else min(60.0 / time_s, 1.0),
        "time_s": time_s,
    }


def keep_training(folder, team, seed, coverage):
    """A training of two points whose network ranks frontiers as explore_lite does."""
    trained = folder / zoo.LESSONS / f"{team}-{seed}"
    trained.mkdir(parents=True)
    (trained / zoo.CURVE).write_text(f"step,coverage\n0,0.5\n10,{coverage}\n")
    zeros = {name: np.zeros(shape, np.float32) for name, shape in network_shapes("frontier").items()}
    zoo_files("").save(trained / zoo.WEIGHTS, {**zeros, "steepness": np.ones(1, np.float32)})


def test_a_part_runs_the_teams_that_ship(tmp_path, monkeypatch):
    monkeypatch.setattr(zoo, "FLOORS", ("apartment:7",))
    monkeypatch.setattr(zoo, "MORE_FLOORS", ("apartment:8",))
    monkeypatch.setattr(zoo, "CLASSICS", ("nearest_frontier",))
    monkeypatch.setattr(zoo, "TEAMS", {"ppo-2": 1})
    monkeypatch.setattr(zoo, "LARGE", 3)
    monkeypatch.setattr(zoo, "HORIZON_S", 20.0)
    done = [what for what, _, _ in zoo.work(tmp_path, None, 2, 1)]
    assert done == ["runs"] * 13
    lines = zoo.kept_lines(tmp_path / zoo.RUNS_FILE)
    assert [(each["policy"], each["robots"]) for each in lines] == [
        ("nearest_frontier", 2),
        ("untrained", 2),
        ("zoo:ppo-2", 2),
        ("nearest_frontier", 4),
        ("untrained", 4),
        ("nearest_frontier", 3),
        ("untrained", 3),
        ("zoo:ppo-2", 3),
        ("nearest_frontier", 2),
        ("untrained", 2),
        ("zoo:ppo-2", 2),
        ("nearest_frontier", 4),
        ("untrained", 4),
    ]
    assert [each["floor"] for each in lines] == ["apartment:7"] * 8 + ["apartment:8"] * 5
    assert zoo_files("").load(tmp_path / "untrained.safetensors")["steepness"] == 1.0
    assert "| `nearest_frontier` | 1 |" in zoo.page(tmp_path)


def test_a_team_for_another_world_runs_there_beside_others(tmp_path, monkeypatch):
    monkeypatch.setattr(zoo, "FLOORS", ("apartment:7",))
    monkeypatch.setattr(zoo, "MORE_FLOORS", ("apartment:8",))
    monkeypatch.setattr(zoo, "CLASSICS", ())
    monkeypatch.setattr(zoo, "SIZES", ())
    monkeypatch.setattr(zoo, "LARGE_FLOORS", 0)
    monkeypatch.setattr(zoo, "BESIDE", (NEAREST,))
    monkeypatch.setattr(zoo, "TEAMS", {"signal-2": 1, "supervised-2": 1})
    monkeypatch.setattr(zoo, "HORIZON_S", 20.0)
    keep_training(tmp_path, "supervised-2", 0, 0.6)
    keep(tmp_path / zoo.LESSONS_FILE, [{"team": "supervised-2", "seed": 0, "processor_s": 60.0}])
    list(zoo.work(tmp_path, None, 2, 1))
    lines = zoo.kept_lines(tmp_path / zoo.RUNS_FILE)
    assert [(each["policy"], each["world"]) for each in lines] == [
        (NEAREST, "signal"),
        ("zoo:signal-2", "signal"),
        (NEAREST, "supervised"),
        ("zoo:supervised-2", "supervised"),
    ]
    assert [each["training"] for each in lines] == ["", zoo.SHIPPED, "", "0"]
    page = zoo.page(tmp_path)
    assert "| `signal-2` | shipped | 204,800 | 67.3 % | 73.5 % |" in page
    assert "| `supervised-2` | 0 | 10 | 50.0 % | 60.0 % |" in page


def test_trainings_that_are_there_are_not_run_again(tmp_path):
    pytest.importorskip("torch", reason='PyTorch is not installed: extra "rl"')
    lesson = zoo.Lesson("ppo-2", 3, tmp_path / "ppo-2-3")
    kept = [{"team": "ppo-2", "seed": 3, "processor_s": 60.0}]
    (tmp_path / zoo.LESSONS_FILE).write_text(
        json.dumps({"key": lesson.key, **kept[0], "version": zoo_version()}) + "\n"
    )
    assert list(zoo.do_missing(tmp_path / zoo.LESSONS_FILE, "lessons", [lesson], zoo.learn, 1)) == []
    assert zoo.kept_lines(tmp_path / zoo.LESSONS_FILE)[0]["processor_s"] == 60.0


def zoo_version():
    import lidarium

    return lidarium.__version__


def test_the_page_tells_what_is_reached_over_floors_and_seeds(tmp_path):
    floors = zoo.FLOORS[:8]
    lines = [line("nearest_frontier", floor, 100.0 + k) for k, floor in enumerate(floors)]
    lines += [line("tour_frontier", floor, 70.0 + k) for k, floor in enumerate(floors)]
    lines += [line("untrained", floor, None) for floor in floors]
    lines += [
        line("zoo:ppo-2", floor, (100.0 + k) * (0.78 + 0.01 * seed + 0.01 * (k % 3)), training=str(1 + seed))
        for k, floor in enumerate(floors)
        for seed in range(2)
    ]
    lines += [line(policy, floor, 50.0, robots=8) for floor in floors for policy in ("nearest_frontier", "zoo:ppo-2")]
    lines += [line(policy, floor, 60.0, robots=4) for floor in floors for policy in ("nearest_frontier", "zoo:ppo-4")]
    for seed in (1, 2):
        keep_training(tmp_path, "ppo-2", seed, 0.5 + seed / 10)
    lessons = [{"team": "ppo-2", "seed": seed, "processor_s": 90.0} for seed in (1, 2)]
    lines += [line("zoo:signal-2", floor, 80.0, world="signal") for floor in floors]
    lines += [line(NEAREST, floor, 100.0, world="signal") for floor in floors]
    lines += [
        line("zoo:supervised-2", floor, 90.0, world="supervised", joined_s=30.0 + k) for k, floor in enumerate(floors)
    ]
    lines += [line(NEAREST, floor, 100.0, world="supervised", joined_s=None) for floor in floors]
    keep(tmp_path / zoo.RUNS_FILE, lines)
    keep(tmp_path / zoo.LESSONS_FILE, lessons)
    page = zoo.page(tmp_path)
    assert_published("zoo", page, tmp_path, absent=("All floors",))
    shares = [0.78 + 0.01 * seed + 0.01 * (k % 3) for k in range(8) for seed in range(2)]
    ratio = np.exp(np.mean(np.log(shares)))
    assert f"| 2 robots, `zoo:ppo-2` over `nearest_frontier` | at most 0.90, interval below 1 | {ratio:.2f} (" in page
    assert (
        "| 2 robots, `zoo:ppo-2`: runs that reach 99 % | as many as `nearest_frontier` | 100.0 % (100.0 %) | yes |"
        in page
    )
    assert "| untrained network | 8 | 50.0 % | 1200.0 s |" in page
    assert "| `ppo-2` | 2 | 10 | 50.0 % | 70.0 % | 0.80" in page
    assert "| 1.5 min |" in page
    assert "| 10 | - | 65.0 % | - | - | - | - | - | - | - | - |" in page
    assert "## Teams of 2 whose radio breaks" in page
    assert "| `zoo:signal-2` | 8 | 75.0 % | 80.0 s | 0.80" in page
    assert "| `zoo:supervised-2` | 8 of 8 | 33.5 s |" in page
    assert "| `nearest_frontier` | 0 of 8 | - |" in page
    assert "trained again" not in page
    assert "| 4 robots, `zoo:ppo-4` over `nearest_frontier` | at most 0.90, interval below 1 | 1.00" in page


def test_a_training_that_was_made_again_is_told_by_itself(tmp_path):
    floors = zoo.FLOORS[:8]
    lines = [line(NEAREST, floor, 100.0) for floor in floors]
    times = {zoo.SHIPPED: 80.0, "0": 80.0, "1": 70.0, "2": 75.0}
    lines += [line("zoo:ppo-2", floor, time_s, training=seed) for floor in floors for seed, time_s in times.items()]
    for seed in times:
        keep_training(tmp_path, "ppo-2", seed, 0.6)
    keep(tmp_path / zoo.RUNS_FILE, lines)
    keep(tmp_path / zoo.LESSONS_FILE, [{"team": "ppo-2", "seed": k, "processor_s": None} for k in range(3)])
    page = zoo.page(tmp_path)
    assert "| within 0.70 to 0.75, as other seeds | 0.80, the same weights to the byte | **no** |" in page
    assert "| `zoo:ppo-2` | 24 |" in page
    assert f"| {np.exp(np.mean(np.log([0.8, 0.7, 0.75]))):.2f} (" in page
    assert "| `ppo-2` | 0 | 10 | 50.0 % | 60.0 % | 0.80" in page


def test_teams_are_compared_on_the_floors_that_all_have(tmp_path):
    floors, harder = zoo.FLOORS[:8], zoo.MORE_FLOORS[:8]
    lines = [line(NEAREST, floor, 100.0) for floor in floors] + [line(NEAREST, floor, 300.0) for floor in harder]
    lines += [line("zoo:ppo-2", floor, 66.0, training=zoo.SHIPPED) for floor in floors]
    lines += [line("zoo:ppo-2", floor, 240.0, training=zoo.SHIPPED) for floor in harder]
    lines += [line("zoo:vdn-2", floor, 71.0, training="1") for floor in floors]
    keep(tmp_path / zoo.RUNS_FILE, lines)
    keep(tmp_path / zoo.LESSONS_FILE, [])
    page = zoo.page(tmp_path)
    assert "| 2 robots, `zoo:ppo-2` over `nearest_frontier` | at most 0.90, interval below 1 | 0.66" in page
    assert page.index("| `zoo:ppo-2` | 8 |") < page.index("| `zoo:vdn-2` | 8 |")
    assert "Shipped teams and classic policies on 16 floors." in page
    assert "| `zoo:ppo-2` | 16 |" in page
    assert "| `zoo:vdn-2` | 16 |" not in page


def test_a_training_that_broke_off_is_none(tmp_path):
    keep_training(tmp_path, "qmix-2", 0, 0.6)
    keep(tmp_path / zoo.LESSONS_FILE, [])
    assert zoo._trainings(tmp_path) == {}
    keep(tmp_path / zoo.LESSONS_FILE, [{"team": "qmix-2", "seed": 0, "processor_s": 1.0}])
    assert list(zoo._trainings(tmp_path)) == [("qmix-2", "0")]


def test_other_weights_are_another_run(tmp_path):
    path = tmp_path / "weights.safetensors"
    path.write_bytes(b"a")
    first = zoo.Run("zoo:ppo-2", "0", "apartment", 2, path).key
    other = tmp_path / "other.safetensors"
    other.write_bytes(b"b")
    assert zoo.Run("zoo:ppo-2", "0", "apartment", 2, other).key != first
    assert zoo.Run("nearest_frontier", "", "apartment", 2, None).key.endswith(" | ")


def test_floors_count_alike_however_many_trainings_ran_there():
    ours = [line("a", "f", 50.0), line("a", "g", 200.0), line("a", "g", 200.0), line("a", "g", 200.0)]
    others = [line(NEAREST, "f", 100.0), line(NEAREST, "g", 100.0)]
    assert zoo._ratio(ours, others).estimate == pytest.approx(1.0)


def test_trainings_are_compared_on_the_floors_that_all_of_them_have():
    others = [line(NEAREST, floor, 100.0) for floor in "fgh"]
    ours = [line("a", floor, 80.0, training="0") for floor in "fgh"]
    ours += [line("a", floor, 120.0, training="1") for floor in "fg"]
    found = zoo._ratio(ours, others)
    assert found.estimate == pytest.approx(np.sqrt(0.8 * 1.2))
    assert found.size == 2
