"""The kernels that run episodes: who follows, who waits, whose run ends."""

import numpy as np
import pytest
from driven_teams import HALL, ROBOTS, ROOMS, Teams

from lidarium.envs.engine.running import (
    Run,
    begin_decisions,
    follow_some,
    note_ends,
    run_parallel,
    run_serial,
)
from lidarium.envs.levels.level import DECIDES, SENSES, STEPS, WAITS
from lidarium.envs.observing.writer import ObservationWriter
from lidarium.envs.onboard.driving.path_following import ARRIVED, DRIVING
from lidarium.envs.onboard.radio.messages import Orders, Target
from lidarium.envs.simulation.endings import make_rules
from lidarium.mapping.kernels.work_queue import new_work

FIRST = np.array([True, False])


@pytest.fixture
def teams():
    return Teams((ROOMS, HALL), (1, 2))


def live_rules(teams):
    rules = make_rules(teams.simulation, teams.settings)
    rules.live[:] = True
    return rules


def ordered(teams):
    """Let all robots drive a metre."""
    targets = Orders.of([Target(1.0, 0.0)] * teams.rows)
    teams.driver.assign(teams.every, targets)
    teams.driver.prepare()
    return teams.driver.drives


def test_robots_wait_at_the_start_of_the_decisions_that_begin(teams):
    drives, waiting = teams.driver.drives, np.array([True, True, True, True])
    drives.is_ordered[:], drives.states[:] = True, DRIVING
    drives.states[1] = ARRIVED
    begin_decisions(FIRST, ROBOTS, drives, waiting)
    assert waiting.tolist() == [False, True, True, True]


def test_robots_follow_their_paths_in_the_episodes_that_decide(teams):
    drives, commands = ordered(teams), np.full((teams.rows, 2), 9.0)
    follow_some(FIRST, ROBOTS, teams.simulation.table, drives, teams.driver.following, commands)
    assert np.array_equal(commands[:ROBOTS], teams.driver.commands()[:ROBOTS])
    assert commands[:ROBOTS].any()
    assert (commands[ROBOTS:] == 9.0).all()


def test_a_run_ends_when_something_happens_to_a_robot_or_a_decision_is_carried_out(teams):
    drives, rules, waiting = teams.driver.drives, live_rules(teams), np.zeros(teams.rows, np.bool_)

    def ends(*modes):
        modes = np.array(modes, np.int8)
        note_ends(modes, ROBOTS, teams.simulation.table, drives, rules, waiting)
        return modes.tolist()

    assert ends(DECIDES, DECIDES) == [DECIDES, DECIDES]
    teams.simulation.world.failed[3] = 1
    assert ends(DECIDES, DECIDES) == [DECIDES, WAITS]
    rules.live[3] = False
    assert ends(STEPS, STEPS) == [STEPS, STEPS]
    drives.is_ordered[0], drives.states[0] = True, ARRIVED
    assert ends(STEPS, STEPS) == [STEPS, STEPS]
    assert ends(DECIDES, DECIDES) == [WAITS, DECIDES]
    waiting[0] = True
    assert ends(DECIDES, WAITS) == [DECIDES, WAITS]


def run_all(teams, run, modes, threads=1, longest=7):
    writer = ObservationWriter(teams.simulation, teams.settings, teams.offsets)
    seen = np.array([True, False, True, True])
    arrays = {name: np.zeros_like(array) for name, array in writer.buffers().items()}
    sources, observed = writer.arguments(arrays)
    rows = teams.rows
    call = Run(
        teams.simulation.table,
        ROBOTS,
        np.array(modes, np.int8),
        np.full((rows, 2), 0.1),
        longest,
        np.zeros(rows, np.bool_),
        seen,
        sources,
    )
    driver, work = teams.driver, new_work(np.arange(len(modes)), threads)
    run(call, driver.drives, driver.following, live_rules(teams), observed, work)
    return arrays


@pytest.mark.parametrize("run", [run_serial, run_parallel])
def test_each_episode_runs_by_its_mode(run, teams):
    ordered(teams)
    before = teams.simulation.world.poses.copy()
    observed = run_all(teams, run, (DECIDES, WAITS))
    assert teams.simulation.world.steps.tolist() == [7, 0]
    moved = np.abs(teams.simulation.world.poses - before).max(axis=1) > 1e-3
    assert moved.tolist() == [True, True, False, False]
    assert [bool(scan.any()) for scan in observed["scan"]] == [True, False, False, False]
    before = teams.simulation.world.poses.copy()
    run_all(teams, run, (SENSES, STEPS))
    assert teams.simulation.world.steps.tolist() == [8, 1]
    moved = (teams.simulation.world.poses != before).any(axis=1)
    assert moved.tolist() == [False, False, True, True]


def test_threads_change_nothing():
    poses = []
    for run, threads in ((run_serial, 1), (run_parallel, 2)):
        teams = Teams((ROOMS, HALL), (1, 2))
        ordered(teams)
        run_all(teams, run, (DECIDES, STEPS), threads)
        poses.append(teams.simulation.world.poses)
    assert np.array_equal(*poses)
