"""The questions themselves, at the least effort: that they measure what they say, not how fast it is."""

import os
import subprocess
import sys

import numpy as np
import pytest

from lidarium.benchmarks.speed.cases import (
    cached_start,
    frontier_decision,
    predicted_window,
    tour_decision,
    waypoint_decision,
)
from lidarium.benchmarks.speed.cases.learners import masked_training
from lidarium.benchmarks.speed.cases.waypoint_decision import Deciders
from lidarium.benchmarks.speed.harness import batches
from lidarium.benchmarks.speed.harness.batches import DrivenBatch
from lidarium.benchmarks.speed.harness.timing import Effort
from lidarium.benchmarks.speed.peers.catalogue import PEERS, missing_peers
from lidarium.benchmarks.speed.profile_step import OBSERVATION, REST, WHOLE, profile, profile_page
from lidarium.benchmarks.speed.scenes.floors import straight_floor
from lidarium.mapping.prediction.network import MapNetwork, load_weights

LEAST = Effort(rounds=1, block_s=0.0)


@pytest.fixture
def few_episodes(monkeypatch):
    for module in (batches, waypoint_decision):
        monkeypatch.setattr(module, "EPISODES", 4)


def test_the_kernel_alone_takes_the_steps_of_the_whole(few_episodes):
    whole, kernel = (DrivenBatch(straight_floor(), 1, lidar="lidar_360_6m", resolution=0.05) for _ in range(2))
    for batch in (whole, kernel):
        batch.start(3)
    began = whole.poses.copy()
    for _ in range(3):
        whole.step()
        kernel.step_kernel()
    assert np.array_equal(whole.poses, kernel.poses)
    assert (np.abs(whole.poses - began).max(axis=1) > 0.0).all()
    assert np.array_equal(
        whole.env.engine.simulation.beliefs.log_odds[5], kernel.env.engine.simulation.beliefs.log_odds[5]
    )


def test_waypoints_are_free_cells_some_way_off(few_episodes):
    deciders = Deciders(1)
    deciders.start()
    assert min(deciders.run(0.0)) > 0.0
    beliefs = deciders._deciding.engine.simulation.beliefs
    for row in range(8):
        place = deciders._drawn(row)
        distance = float(np.hypot(*(place - beliefs.believed[row, :2])))
        column, line = ((place - beliefs.origins[row]) / 0.025).astype(int)
        assert 0.5 <= distance <= 3.0
        assert beliefs.log_odds[row][line, column] < 0


def test_decisions_by_frontiers_are_counted_by_robot(monkeypatch):
    monkeypatch.setattr(frontier_decision, "EPISODES", 2)
    monkeypatch.setattr(frontier_decision, "FLOORS", "apartment")
    monkeypatch.setattr(frontier_decision, "WARM_DECISIONS", 1)
    choosers = frontier_decision.Choosers(3)
    assert choosers.decide() == 6
    assert choosers.run(0.0) > 0.0
    lines = frontier_decision.measure(LEAST)
    assert [line.to_reach for line in lines] == [3500.0, 3000.0, 8000.0, 6000.0]
    assert [line.name.endswith(", fast") for line in lines] == [False, False, True, True]
    assert all(line.judged > 0.0 and line.unit == "rows/CPU s" for line in lines)


def test_plans_of_tours_and_decisions_at_their_level_are_measured(monkeypatch):
    monkeypatch.setattr(tour_decision, "EPISODES", 2)
    monkeypatch.setattr(tour_decision, "WARM_STEPS", 4)
    monkeypatch.setattr(tour_decision, "ROLLOUT", 4)
    monkeypatch.setattr(masked_training, "WARM_DECISIONS", 8)
    monkeypatch.setattr(masked_training, "TIMED_ROLLOUTS", 1)
    monkeypatch.setattr(tour_decision, "OPTIONS", {**tour_decision.OPTIONS, "stop_coverage": 0.4})
    plan, predicted, decisions, training = tour_decision.measure(LEAST)
    assert (training.to_reach, training.unit) == (800.0, "decisions/s")
    assert (plan.to_reach, plan.is_upper_bound, plan.unit) == (1.2, True, "ms")
    assert (predicted.to_reach, predicted.is_upper_bound, predicted.unit) == (20.0, True, "ms")
    assert (decisions.to_reach, decisions.unit) == (800.0, "decisions/s")
    assert 0.0 < plan.judged < predicted.judged


def test_a_window_is_predicted_alike_by_the_peer():
    torch = pytest.importorskip("torch", reason="torch is not installed: extra [rl]")
    threads = torch.get_num_threads()
    levels = predicted_window.half_seen_room()
    found = predicted_window.by_torch(levels)()
    np.testing.assert_allclose(MapNetwork(load_weights())(levels), found, atol=1e-4)
    assert torch.get_num_threads() == threads
    own, beside = predicted_window.measure(LEAST)
    assert (own.to_reach, own.is_upper_bound, own.unit) == (15.0, True, "ms")
    assert beside.judged > 0.0


def test_the_profile_has_all_parts_and_they_make_up_the_whole(tmp_path):
    spent, rays, cells = profile(straight_floor(), Effort(rounds=1, block_s=0.001))
    parts = [name for name in spent if name not in (WHOLE, OBSERVATION)]
    assert len(parts) == 9
    assert sum(spent[name] for name in parts) == pytest.approx(spent[WHOLE])
    assert all(spent[name] > 0.0 for name in spent if name != REST)
    assert (rays, cells > 1000) == (720, True)
    page = profile_page({"straight": (spent, rays, cells)}, LEAST)
    assert "| ray casting |" in page
    assert "profiling.md" in page


def test_a_second_start_compiles_nothing():
    told = cached_start.start()
    if told.compiled:  # the first start of this machine
        told = cached_start.start()
    assert told.compiled == 0
    assert told.loaded > 0


@pytest.mark.skipif(sys.platform == "win32", reason="folders are made read-only in another way there")
def test_nothing_but_the_temporary_folder_takes_files_in_the_read_only_environment(tmp_path):
    environment = cached_start.read_only_environment(tmp_path)
    program = (
        "import lidarium, os; from lidarium.mapping.kernels import cache_folders, compilation; "
        "print(lidarium.__file__, compilation._FOLDER, "
        "cache_folders.is_writable(cache_folders.user_cache_folder()), "
        "sep=os.linesep)"
    )
    told = subprocess.run(
        [sys.executable, "-c", program],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
        cwd=tmp_path,
    )
    package, folder, has_home = told.stdout.splitlines()
    assert package.startswith(str(tmp_path / "package"))
    assert folder.startswith(str(tmp_path / "temporary") + os.sep)
    assert has_home == "False"
    for each in [tmp_path / "home", *(path for path in (tmp_path / "package").rglob("*") if path.is_dir())]:
        each.chmod(0o755)


def test_peers_that_are_not_there_are_named_with_how_to_get_them(monkeypatch):
    monkeypatch.setenv("LIDARIUM_F1TENTH", "laser_models.py")
    monkeypatch.setenv("LIDARIUM_VMAS_PYTHON", "python")
    assert not [line for line in missing_peers() if "VMAS" in line or "f1tenth" in line]
    monkeypatch.delenv("LIDARIUM_F1TENTH")
    assert [line for line in missing_peers() if "laser_models.py in LIDARIUM_F1TENTH" in line]
    assert all(peer.how for peer in PEERS)
