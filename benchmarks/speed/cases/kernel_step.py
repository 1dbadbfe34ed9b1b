"""A whole step of the world, beside VMAS and IR-SIM on the same floor.

Ours moves 16 robots with contact, casts 720 beams for each with mutual visibility and noise, scores what the
team has seen and updates 16 maps. VMAS and IR-SIM move and cast; they keep no map.
"""

from lidarium.benchmarks.speed.harness.lines import Line, faster
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Contender, Effort, interleaved, repeated
from lidarium.benchmarks.speed.peers.irsim_world import fastest_irsim_step
from lidarium.benchmarks.speed.peers.vmas_peer import VmasProcess
from lidarium.benchmarks.speed.scenes.floors import free_poses, straight_floor, turned_floor
from lidarium.benchmarks.speed.scenes.teams import BEAMS, RANGE_MAX, DrivenTeam

ROBOTS = 16
PEER_ROBOTS = 3
TRIAL_POSES = 6

CORES = 1

NOTES = (
    "*Kernel step*: one call of `KinematicWorld.step` for 16 robots: motion with contact, 720 noisy beams "
    "over 240 deg to 5.6 m, teammates "
    "as obstacles of bodies and beams, scorer, and the update of 16 maps at 2.5 cm. The floor has 512 x 512 "
    "cells of 2.5 cm with rooms, "
    "doors and boxes; every block starts with blank maps at other places.",
    "*VMAS* runs its lidar with 720 rays on the same boxes, 3 agents an environment, at the batch size that "
    "was best in a short trial; it "
    "has no map. It is an outside program and runs in a process of its own. Boxes cost it the same whichever "
    "way they lie, so "
    "its straight floor is the peer of our turned floor too.",
    "*IR-SIM* runs its lidar2d with 720 beams and noise for one robot, on the same floor as rectangles and "
    "as a grid map, at that of six "
    "poses where it is fastest; it keeps no map here.",
)


def measure(effort: Effort) -> list[Line]:
    """Compare the fused step with VMAS and IR-SIM."""
    straight = straight_floor()
    teams = {
        name: DrivenTeam(floor, ROBOTS)
        for name, floor in (("straight", straight), ("turned", turned_floor(straight)))
    }
    contenders: dict[str, Contender] = {
        name: repeated(team.step, ROBOTS, team.start) for name, team in teams.items()
    }
    for shape in ("rectangles", "grid map"):
        step = fastest_irsim_step(straight, free_poses(straight, TRIAL_POSES, 0.5), shape, BEAMS, RANGE_MAX)
        if step is not None:
            contenders[shape] = repeated(step, 1)
    with VmasProcess(straight.boxes, free_poses(straight, PEER_ROBOTS, 0.5), BEAMS, RANGE_MAX) as vmas:
        if vmas.is_there:
            contenders["vmas"] = vmas.run
        seconds = interleaved(contenders, effort)
        vmas_name = vmas.name
    return [
        faster(
            "kernel step, 16 robots, straight floor",
            seconds["straight"],
            vmas_name,
            seconds.get("vmas"),
            40.0,
        ),
        faster(
            "kernel step, 16 robots, floor turned by 17 deg",
            seconds["turned"],
            vmas_name,
            seconds.get("vmas"),
            33.0,
        ),
        faster(
            "kernel step, 16 robots, straight floor",
            seconds["straight"],
            "IR-SIM, rectangles",
            seconds.get("rectangles"),
            60.0,
        ),
        faster(
            "kernel step, 16 robots, straight floor",
            seconds["straight"],
            "IR-SIM, grid map",
            seconds.get("grid map"),
            1000.0,
        ),
    ]


if __name__ == "__main__":
    run_alone(measure, "The fused step of the world beside VMAS and IR-SIM.")
