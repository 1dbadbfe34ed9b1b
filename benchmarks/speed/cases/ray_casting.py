"""Exact ranges alone, beside f1tenth's scan simulator and PyBullet's rayTestBatch."""

import itertools

import numpy as np

from lidarium.benchmarks.speed.harness.lines import Line, faster, faster_than_quoted, shown
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Contender, Effort, interleaved, rate, repeated
from lidarium.benchmarks.speed.peers import f1tenth_scans
from lidarium.benchmarks.speed.peers.bullet import bullet_scan
from lidarium.benchmarks.speed.peers.f1tenth_scans import F1tenthScanner
from lidarium.benchmarks.speed.scenes.floors import BenchFloor, free_poses, straight_floor, turned_floor
from lidarium.benchmarks.speed.scenes.teams import BEAMS, LIDAR, RANGE_MAX
from lidarium.envs.simulation.kernels.ray_casting import cast_scans

POSES = 32
F1TENTH_RAYS = 10e6
"""Rays per second of f1tenth's scan simulator. Measured on an AMD Zen 5 core on floors like these (9 to 12 M)."""

CORES = 1
LARGE_TURNED_RAYS = 130e6
"""Rays a second that are to be reached on the large turned floor."""

NOTES = (
    "*Rays alone*: `cast_scans` on 32 poses, 720 beams over 240 deg to 5.6 m, without noise or map. The larger floor "
    "has 2000 x 2000 cells of 2.5 cm.",
    "*f1tenth's scan simulator*: the original code (f1tenth/f1tenth_gym 02ca878, `laser_models.py`) on the same "
    "poses, noise included. Without that file its rate is quoted, about 10 M rays/s.",
)


def all_floors() -> dict[str, BenchFloor]:
    """Return the small and the large floor, straight and turned."""
    small, large = straight_floor(512, 512), straight_floor(2000, 2000)
    floors = (small, turned_floor(small), large, turned_floor(large))
    return {floor.name: floor for floor in floors}


def our_scans(floor: BenchFloor) -> Contender:
    """Cast the scans of all poses in one call; a unit is a ray."""
    tables = floor.tables()
    poses = free_poses(floor, POSES) / [floor.resolution, floor.resolution, 1.0]
    ranges = np.empty((POSES, BEAMS))
    reach = RANGE_MAX / floor.resolution

    def cast() -> None:
        cast_scans(
            tables.rays.addresses, poses, LIDAR.unit_vectors, LIDAR.angle_first, LIDAR.angle_increment, reach, ranges
        )

    cast()
    return repeated(cast, POSES * BEAMS)


def f1tenth_scans_of(floor: BenchFloor) -> Contender:
    """Let f1tenth's scan simulator cast the scans of all poses in turn. A unit is a ray."""
    scanner = F1tenthScanner(floor, BEAMS, RANGE_MAX)
    poses = itertools.cycle(free_poses(floor, POSES))
    scanner.scan(next(poses))
    return repeated(lambda: scanner.scan(next(poses)), BEAMS)


def measure(effort: Effort) -> list[Line]:
    """Compare the ray casters."""
    floors = all_floors()
    contenders: dict[str, Contender] = {}
    for name, floor in floors.items():
        contenders[name] = our_scans(floor)
        if f1tenth_scans.is_there():
            contenders[f"f1tenth {name}"] = f1tenth_scans_of(floor)
    small = next(iter(floors.values()))
    scan = bullet_scan(small.boxes, free_poses(small, POSES), BEAMS, RANGE_MAX)
    if scan is not None:
        contenders["bullet"] = repeated(scan, BEAMS)
    seconds = interleaved(contenders, effort)
    lines = []
    for name, floor in floors.items():
        wanted = 15.0 if len(floor.boxes) else 2.5
        line = f"rays alone, exact, {name} cells" if len(floor.boxes) else f"rays alone, exact, {name}"
        if f1tenth_scans.is_there():
            lines.append(
                faster(line, seconds[name], "f1tenth's scan simulator", seconds[f"f1tenth {name}"], wanted, "rays/s")
            )
        else:
            lines.append(
                faster_than_quoted(line, seconds[name], "f1tenth's scan simulator", F1TENTH_RAYS, wanted, "rays/s")
            )
    slowest = list(floors)[-1]
    rays = rate(seconds[slowest])
    lines.append(
        Line(f"rays alone, {slowest}, rate", f"{shown(rays)} rays/s", "-", None, LARGE_TURNED_RAYS, rays, unit="rays/s")
    )
    lines.append(
        faster(
            f"rays alone, exact, {small.name} cells",
            seconds[small.name],
            "PyBullet rayTestBatch",
            seconds.get("bullet"),
            60.0,
            "rays/s",
        )
    )
    return lines


if __name__ == "__main__":
    run_alone(measure, "Exact ranges beside f1tenth and PyBullet.")
