"""Episodes of a batch run by their modes, in one kernel or step by step."""

import numpy as np
import pytest
from linked_rooms import ROOM, TWO_ROOMS

from lidarium.envs.engine.batch_run import BatchRun
from lidarium.envs.levels.row_levels import make_level
from lidarium.envs.engine.running import DECIDES, SENSES, STEPS, WAITS
from lidarium.envs.engine.episode_start import make_simulation
from lidarium.envs.observing.writer import ObservationWriter
from lidarium.envs.onboard.perception import Perception
from lidarium.envs.onboard.software import Software
from lidarium.envs.simulation.endings import make_rules
from lidarium.envs.onboard.radio.messages import Orders, Target
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.kernels.floor_cache import floor_tables

FLOORS = (ROOM, TWO_ROOMS)


class Batch:
    """Two episodes of a robot alone that are placed and have not sensed yet."""

    def __init__(self, level="velocity", is_staged=False, **options):
        self.settings = settings = make_settings(robots=1, stop_coverage=None, **options)
        self.simulation = simulation = make_simulation(settings, 2)
        offsets = np.zeros((2, 2))
        perception = Perception(simulation, settings, offsets)
        software, self.rules = Software(perception, settings), make_rules(simulation, settings)
        software.is_staged = is_staged
        self.level = make_level(level, perception, settings)
        writer = ObservationWriter(simulation, settings, offsets)
        self._run = BatchRun(simulation, settings, software, self.level, self.rules, writer)
        self.observed = {name: np.zeros_like(array) for name, array in writer.buffers().items()}
        self.rules.live[:] = True
        for episode, floor in enumerate(FLOORS):
            laser, body = settings.lidar.height, settings.robot.height
            tables = floor_tables(floor, settings.raster_resolution, laser, body)
            simulation.place(episode, tables, floor.starts[:1], 5 + episode, settings.known_starts)
            perception.start(None, episode)
            software.start(episode, 5 + episode)
            self.level.start(episode)

    def run(self, modes, commands=((0.3, 0.2), (0.3, -0.2)), seen=(True, True)):
        self.modes = np.array(modes, np.int8)
        self._run.run(self.modes, np.array(commands), np.array(seen), self.observed)
        return self.simulation.world.steps.tolist()


def test_an_episode_waits_takes_the_scan_at_the_start_or_steps():
    batch = Batch()
    poses = batch.simulation.world.poses
    assert batch.run((SENSES, SENSES)) == [0, 0]
    assert np.array_equal(poses, [ROOM.starts[0], TWO_ROOMS.starts[0]])
    assert batch.run((WAITS, STEPS)) == [0, 1]
    assert np.array_equal(poses[0], ROOM.starts[0])
    assert poses[1, 0] > TWO_ROOMS.starts[0, 0]
    assert batch.modes.tolist() == [WAITS, STEPS]


def test_rows_that_are_not_seen_keep_what_was_observed():
    batch = Batch()
    batch.run((SENSES, SENSES), seen=(True, False))
    assert batch.observed["scan"][0].any()
    assert not batch.observed["scan"][1].any()
    batch.run((WAITS, STEPS))
    assert batch.observed["scan"][1].any()


def test_a_decision_ends_at_the_horizon_when_a_robot_arrives_or_in_time():
    batch = Batch("waypoint", decision_period_s=3.0, horizon_s=5.0)
    batch.run((SENSES, SENSES))
    places = batch.simulation.beliefs.believed[:, :2] + [[0.12, 0.0], [2.5, 0.0]]
    for modes, wanted in (((STEPS, STEPS), [30, 30]), ((WAITS, STEPS), [30, 50])):
        modes = np.array(modes, np.int8)
        batch.level.carry_out(Orders.of([Target(*place) for place in places]), batch.rules.live, modes)
        steps = batch.run(modes)
        assert steps[1] == wanted[1]
        assert 1 < steps[0] < 30
    assert batch.level.driver.is_done(0)
    assert not batch.level.driver.is_done(1)


@pytest.mark.parametrize(("level", "mode"), [("velocity", STEPS), ("waypoint", DECIDES)])
def test_step_by_step_comes_to_what_the_kernel_does(level, mode):
    batches = [Batch(level, is_staged, noise="datasheet") for is_staged in (False, True)]
    for batch in batches:
        batch.run((SENSES, SENSES))
        for _ in range(4):
            if mode == DECIDES:
                targets = Orders.of([Target(3.0, 2.0), Target(3.0, 2.0)])
                batch.level.carry_out(targets, batch.rules.live, np.full(2, STEPS, np.int8))
            batch.run((mode, mode))
            assert batch.modes.tolist() == [mode, mode]
    fused, staged = batches
    assert np.array_equal(fused.simulation.world.steps, staged.simulation.world.steps)
    assert np.array_equal(fused.simulation.world.poses, staged.simulation.world.poses)
    for name, array in fused.observed.items():
        assert np.array_equal(array, staged.observed[name]), name
