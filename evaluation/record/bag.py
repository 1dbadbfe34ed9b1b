"""Records as bags of ROS 2: the episode runs again, and its scans, poses and maps are written."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.floor import Floor
from lidarium.envs.simulation.people.crowd import crowd_of
from lidarium.evaluation.episodes.watching import Watcher
from lidarium.evaluation.record.episode_record import EpisodeRecord
from lidarium.evaluation.record.replay import drive_again, first_difference, is_same
from lidarium.evaluation.truth.beliefs import maps_on_floor
from lidarium.mapping.files.bags.writing import BagWriter, bag
from lidarium.mapping.geometry.rigid import composed, relative
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN

MAP_PERIOD_S, PATH_PERIOD_S = 2.0, 10.0
"""Times between maps, and between paths [s]."""

PATH_STEP_S = 0.5
"""Time between poses of a path [s]."""

MAP_FRAME = "map"
"""The floor's frame."""


def write_bag(path: Path, record: EpisodeRecord, floor: str | Floor | None = None) -> None:
    """Write a recorded episode as a bag, whole or not at all.

    Topics are ``/map`` (the sum of all maps), and of each robot ``/robot_0/scan``, ``odom`` (dead reckoning of its
    wheels from its start), ``map`` (its own map) and ``path`` (its true path). ``/tf`` leads
    from ``map`` by ``robot_0/odom`` to ``robot_0/base_link`` at the true pose, ``/tf_static`` from there to
    ``robot_0/laser``. People are frames ``person_0`` below ``map``; ``/door_0`` is a path from end to end of the leaf
    of a door, written when one moves.
    """
    with bag(path) as writer:
        recorder = _BagRecorder(writer)
        env = drive_again(record, floor, [recorder])
        if not is_same(record, env):
            raise ValueError(f"the episode does not run as it was recorded: {first_difference(record, env)}")
        recorder.finish(env)


class _BagRecorder(Watcher):
    """Writes an episode to a bag as it runs."""

    def __init__(self, writer: BagWriter) -> None:
        self._writer = writer

    def begin(self, env: ExplorationEnv) -> None:
        """Write the mounts of the lasers, and the first scans."""
        self._starts = env.world.poses.copy()
        self._times: list[float] = []
        self._poses: list[NDArray[np.float64]] = []
        self._opened: list[float] = []
        for robot in env.possible_agents:
            self._writer.transform(
                f"{robot}/base_link",
                f"{robot}/laser",
                0.0,
                np.zeros(3),
                height=env.settings.lidar.height,
                is_static=True,
            )
        self._write(env)

    def step(self, env: ExplorationEnv, commands: NDArray[np.float64], /) -> None:
        """Write the measurements of this step."""
        self._write(env)

    def finish(self, env: ExplorationEnv) -> None:
        """Write the last maps and paths."""
        self._write_maps(env, _time_of(env))
        self._write_paths(env, _time_of(env))

    def _write(self, env: ExplorationEnv) -> None:
        time_s, poses, steps = _time_of(env), env.world.poses, int(env.world.steps[0])
        reckoned = env.simulation.dead_reckoning
        odom_on_map = composed(poses, relative(reckoned, np.zeros_like(poses)))
        lidars = env.settings.team_lidars
        for row, robot in enumerate(env.possible_agents):
            odom, base = f"{robot}/odom", f"{robot}/base_link"
            self._writer.transform(MAP_FRAME, odom, time_s, odom_on_map[row])
            self._writer.transform(odom, base, time_s, reckoned[row])
            self._writer.odometry(f"/{robot}/odom", odom, base, time_s, reckoned[row])
            if steps % env.settings.scan_steps == 0:
                self._writer.scan(f"/{robot}/scan", f"{robot}/laser", time_s, env.simulation.ranges[row], lidars[row])
        self._write_crowd(env, time_s)
        if _is_due(env, steps, PATH_STEP_S):
            self._times.append(time_s)
            self._poses.append(poses.copy())
        if _is_due(env, steps, MAP_PERIOD_S):
            self._write_maps(env, time_s)
        if _is_due(env, steps, PATH_PERIOD_S):
            self._write_paths(env, time_s)

    def _write_crowd(self, env: ExplorationEnv, time_s: float) -> None:
        """Write where people are, and the ends of the leaves of doors: a leaf that is open has no length."""
        crowd = crowd_of(env.simulation.population)
        if crowd is None:
            return
        for number, (x, y, _) in enumerate(crowd.people):
            self._writer.transform(MAP_FRAME, f"person_{number}", time_s, (x, y, 0.0))
        if crowd.opened.tolist() != self._opened:
            self._opened = crowd.opened.tolist()
            for number, leaf in enumerate(crowd.leaves):
                ends = np.array([(*leaf[:2], 0.0), (*leaf[2:], 0.0)])
                self._writer.path(f"/door_{number}", MAP_FRAME, time_s, [time_s, time_s], ends)

    def _write_maps(self, env: ExplorationEnv, time_s: float) -> None:
        tables, resolution = env.world.floors[0], env.settings.occupancy.resolution
        assert tables is not None
        maps = maps_on_floor(env)
        named = {f"/{robot}/map": own for robot, own in zip(env.possible_agents, maps, strict=True)}
        for topic, log_odds in {"/map": np.sum(maps, axis=0, dtype=np.int16), **named}.items():
            levels = np.where(log_odds > 0, OCCUPIED, np.where(log_odds < 0, FREE, UNKNOWN)).astype(np.uint8)
            self._writer.grid(topic, MAP_FRAME, time_s, levels, tables.laser.origin, resolution)

    def _write_paths(self, env: ExplorationEnv, time_s: float) -> None:
        for row, robot in enumerate(env.possible_agents):
            poses = np.stack([each[row] for each in self._poses])
            self._writer.path(f"/{robot}/path", MAP_FRAME, time_s, self._times, poses)


def _time_of(env: ExplorationEnv) -> float:
    return int(env.world.steps[0]) * env.settings.time_step


def _is_due(env: ExplorationEnv, steps: int, period_s: float) -> bool:
    return steps % max(round(period_s / env.settings.time_step), 1) == 0
