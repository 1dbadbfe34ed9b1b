"""Profiles the step of an environment: which part takes how long."""

import argparse
import statistics
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from lidarium.benchmarks.results_page import about, publish
from lidarium.benchmarks.speed.harness.batches import OBSERVED
from lidarium.benchmarks.speed.harness.report import with_effort
from lidarium.benchmarks.speed.harness.timing import EFFORTS, Effort, interleaved, on_cores, repeated
from lidarium.benchmarks.speed.peers.catalogue import outside_versions
from lidarium.benchmarks.speed.scenes.floors import BenchFloor, straight_floor, turned_floor
from lidarium.benchmarks.speed.scenes.teams import DrivenTeam
from lidarium.envs.observing.writer import ObservationWriter
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.coverage import mark_seen
from lidarium.envs.simulation.disturbances.noise import GAUSSIAN_TABLE, fill_gaussian
from lidarium.envs.simulation.kernels.contact import TeamBodies
from lidarium.envs.simulation.kernels.masks import window_corner
from lidarium.envs.simulation.kernels.motion import body_grids, move_robots
from lidarium.envs.simulation.kernels.ray_casting import cast_scan
from lidarium.mapping.files.output import check_writable
from lidarium.mapping.grids.pooled_maps import touched_words
from lidarium.mapping.grids.scan_geometry import Beams, beam_directions
from lidarium.mapping.grids.scan_integration import SeenScan, integrate_scan
from lidarium.mapping.grids.scan_polygon import fill_scan_polygon, scan_ends, window_rows, window_words
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import grid_at

ROBOTS, WARM_STEPS = 16, 30


@kernel
def _move(floor: Array, frame: Array, team: TeamBodies, commands: Array, duration: float) -> None:
    move_robots(body_grids(floor, frame), team, commands, duration)


@kernel
def _directions(poses: Array, unit_vectors: Array, directions: Array) -> None:
    for row in range(poses.shape[0]):
        beam_directions(poses[row, 2], unit_vectors, directions[row])


@kernel
def _rays(
    floor: Array, places: Array, directions: Array, angle_first: float, increment: float, reach: float, lengths: Array
) -> None:
    for row in range(places.shape[0]):
        x, y, heading = places[row]
        beams = Beams(x, y, heading, angle_first, increment, directions[row], reach)
        cast_scan(floor, beams, lengths[row])


@kernel
def _noise(table: Array, draws: Array) -> None:
    for row in range(draws.shape[0]):
        fill_gaussian(np.uint32(row), table, draws[row])


@kernel
def _fill(
    lengths: Array, directions: Array, places: Array, increment: float, ends: Array, bits: Array, boxes: Array
) -> None:
    """Fill the areas seen, with their end points and the clearing of the bits."""
    for row in range(lengths.shape[0]):
        bits[row] = 0
        x, y = places[row, 0], places[row, 1]
        scan_ends(lengths[row], directions[row], x, y, ends[row])
        box = fill_scan_polygon(lengths[row], directions[row], ends[row], x, y, increment, False, bits[row])
        boxes[row, 0], boxes[row, 1], boxes[row, 2], boxes[row, 3] = box


@kernel
def _score(masks: Array, bits: Array, boxes: Array, corners: Array, news: Array) -> None:
    for row in range(bits.shape[0]):
        own = grid_at(masks[row, 0], masks[row, 3], masks[row, 4], np.uint64)
        counted = grid_at(masks[row, 2], masks[row, 3], masks[row, 4], np.uint64)
        box = (boxes[row, 0], boxes[row, 1], boxes[row, 2], boxes[row, 3])
        mark_seen(own, counted, bits[row], box, corners[row, 0], corners[row, 1] >> 6, news[row])


@kernel
def _map(
    maps: Array,
    bits: Array,
    boxes: Array,
    ends: Array,
    is_hit: Array,
    corners: Array,
    increments: Array,
    hit_bits: Array,
) -> None:
    for row in range(bits.shape[0]):
        hit_bits[row] = 0
        log_odds = grid_at(maps[row, 0], maps[row, 1], maps[row, 2], np.int8)
        box = (boxes[row, 0], boxes[row, 1], boxes[row, 2], boxes[row, 3])
        touched = grid_at(maps[row, 3], maps[row, 4], touched_words(maps[row, 2]), np.uint64)
        seen = SeenScan(bits[row], hit_bits[row], box, ends[row], is_hit[row], corners[row, 0], corners[row, 1])
        integrate_scan(log_odds, seen, increments, touched)


class StepParts:
    """The parts of the step of a team of 16 robots.

    Each is a function that does it for all robots.

    `parts`: functions by the name of the part; none changes what another one reads; `whole`: a whole step of the world
    from the same poses; `observation`: the observations of all robots; `rays`, `cells`: rays, and cells seen through
    noise, of an agent step.
    """

    def __init__(self, floor: BenchFloor) -> None:
        team = DrivenTeam(floor, ROBOTS, scales=ExplorationSettings().egocentric_scales)
        for _ in range(WARM_STEPS):
            team.step()
        simulation, lidar = team.simulation, team.simulation.lidars[0]
        beams, reach = lidar.beams, lidar.range_max / floor.resolution
        poses, velocities, commands = (simulation.world.poses.copy(), simulation.world.velocities.copy(), team.commands)
        places = poses / [floor.resolution, floor.resolution, 1.0]
        corners = np.array([window_corner(x, y, reach) for x, y in places[:, :2]])
        inside = places[:, :2] - corners[:, ::-1]
        directions, lengths = np.empty((ROBOTS, 4, beams)), np.empty((ROBOTS, beams))
        noisy = np.minimum(simulation.ranges.astype(np.float64) / floor.resolution, reach)
        is_hit = np.isfinite(simulation.ranges)
        clean_bits, noisy_bits, hit_bits = (
            np.zeros((ROBOTS, window_rows(reach), window_words(reach)), np.uint64) for _ in range(3)
        )
        clean_boxes, noisy_boxes, news = (np.zeros((ROBOTS, 4), np.int64) for _ in range(3))
        clean_ends, noisy_ends = np.empty((ROBOTS, 2, beams)), np.empty((ROBOTS, 2, beams))
        moved, speeds = poses.copy(), velocities.copy()
        bumpers, contacts, touched = (
            np.zeros((ROBOTS, 3), np.int8),
            np.zeros(ROBOTS, np.uint8),
            np.zeros(ROBOTS, np.int64),
        )
        floor_row = simulation.floor_rows[0]

        def move() -> None:
            moved[:], speeds[:] = poses, velocities
            team_bodies = TeamBodies(
                simulation.world.bodies,
                simulation.world.moves,
                moved,
                speeds,
                bumpers,
                contacts,
                np.zeros(ROBOTS),
                touched,
            )
            _move(floor_row, simulation.frames[0], team_bodies, commands, simulation.time_step)

        def step() -> None:
            simulation.world.poses[:], simulation.world.velocities[:] = poses, velocities
            simulation.step(commands)

        increment = lidar.angle_increment
        self.parts: dict[str, Callable[[], object]] = {
            "motion and contact": move,
            "directions of the beams": partial(_directions, poses, lidar.unit_vectors, directions),
            "ray casting": partial(_rays, floor_row, places, directions, lidar.angle_first, increment, reach, lengths),
            "noise": partial(_noise, GAUSSIAN_TABLE, np.empty((ROBOTS, beams), np.float32)),
            "area seen by the true beams": partial(
                _fill, lengths, directions, inside, increment, clean_ends, clean_bits, clean_boxes
            ),
            "scorer": partial(_score, simulation.score.mask_rows, clean_bits, clean_boxes, corners, news),
            "area seen through noise": partial(
                _fill, noisy, directions, inside, increment, noisy_ends, noisy_bits, noisy_boxes
            ),
            "map update": partial(
                _map,
                simulation.beliefs.belief_rows,
                noisy_bits,
                noisy_boxes,
                noisy_ends,
                is_hit,
                corners,
                simulation.beliefs.increments,
                hit_bits,
            ),
        }
        self.whole: Callable[[], object] = step
        settings = make_settings(robots=ROBOTS, lidar=lidar, resolution=floor.resolution, observe=OBSERVED)
        writer = ObservationWriter(simulation, settings, np.zeros((ROBOTS, 2)))
        self.observation: Callable[[], object] = partial(writer.write, writer.buffers())
        for part in self.parts.values():
            part()
        self.rays, self.cells = float(beams), float(np.bitwise_count(noisy_bits).sum()) / ROBOTS


WHOLE, OBSERVATION, REST = (
    "whole step of the kernel",
    "observation",
    "rest: teammates in the beams, ranges as told, sharing out, the call",
)


def profile(floor: BenchFloor, effort: Effort) -> tuple[dict[str, float], float, float]:
    """Return the microseconds of an agent step by part, and its rays and cells."""
    step = StepParts(floor)
    contenders = {**step.parts, WHOLE: step.whole, OBSERVATION: step.observation}
    seconds = interleaved({name: repeated(function, ROBOTS) for name, function in contenders.items()}, effort)
    rest = [
        whole - sum(parts)
        for whole, *parts in zip(seconds[WHOLE], *(seconds[name] for name in step.parts), strict=True)
    ]
    ordered = {
        **{name: seconds[name] for name in step.parts},
        REST: rest,
        WHOLE: seconds[WHOLE],
        OBSERVATION: seconds[OBSERVATION],
    }
    return {name: 1e6 * statistics.median(values) for name, values in ordered.items()}, step.rays, step.cells


def profile_table(profiles: Mapping[str, tuple[Mapping[str, float], float, float]]) -> str:
    """Write the parts as a markdown table, a pair of columns for each floor."""
    names = list(next(iter(profiles.values()))[0])
    header = "".join(f" {floor}: us per agent step | share of the whole |" for floor in profiles)
    lines = [f"| part |{header}", f"|---|{'---:|---:|' * len(profiles)}"]
    for name in names:
        cells = "".join(
            f" {spent[name]:.2f} | {100.0 * spent[name] / spent[WHOLE]:.0f} % |" for spent, _, _ in profiles.values()
        )
        lines.append(f"| {name} |{cells}")
    return "\n".join(lines)


def rates(profiles: Mapping[str, tuple[Mapping[str, float], float, float]]) -> Sequence[str]:
    """Say how many rays and cells that is in a second."""
    return [
        f"- {floor}: {rays:.0f} rays and {cells:,.0f} cells in an agent step; {rays / spent['ray casting']:.0f} M "
        f"rays/s cast, {cells / 1e3 / (spent['area seen through noise'] + spent['map update']):.2f} G cells/s found "
        f"and put into the map, {cells / 1e3 / spent['map update']:.1f} G cells/s put into the map once found."
        for floor, (spent, rays, cells) in profiles.items()
    ]


def main() -> None:
    """Measure, print, and write where asked to."""
    parser = with_effort(
        argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    )
    parser.add_argument("--out", type=Path, help="folder of profile.md")
    chosen = parser.parse_args()
    if chosen.out is not None:
        check_writable(chosen.out)
    effort = EFFORTS[chosen.effort]
    straight = straight_floor()
    with on_cores(1):
        profiles = {
            name: profile(floor, effort) for name, floor in (("straight", straight), ("turned", turned_floor(straight)))
        }
    print(profile_table(profiles), *rates(profiles), sep="\n")
    if chosen.out is not None:
        command = f"python benchmarks/speed/profile_step.py --effort {chosen.effort} --out {chosen.out}"
        chosen.out.mkdir(parents=True, exist_ok=True)
        publish(chosen.out / "profile.md", profile_page(profiles, effort), about(command, outside_versions()))


def profile_page(profiles: Mapping[str, tuple[Mapping[str, float], float, float]], effort: Effort) -> str:
    """Write the page of the profile."""
    return "\n".join(
        [
            "# Profile of a step",
            f"One thread; medians of {effort.rounds} rounds in which all parts run in turn for "
            f"{effort.block_s:g} s each.",
            "",
            profile_table(profiles),
            "",
            f"A team of {ROBOTS} on the floor of 512 x 512 cells of 2.5 cm, straight and turned by 17 deg; 720 noisy "
            "beams over 240 deg to 5.6 m, maps at 2.5 cm. Every part runs alone on the same poses and scans, with its "
            "data in nearer caches than in the whole step; the rest includes that difference. The observation (scan, "
            "pose, velocity, bumper, egocentric maps) is not part of the kernel's step. The parts and their limits: "
            "[profiling](profiling.md).",
            "",
        ]
    )


if __name__ == "__main__":
    main()
