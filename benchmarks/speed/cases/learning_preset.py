"""Whole steps of a batch at the preset for learning, beside VMAS.

VMAS has few rays on the same floor; both use two threads.
"""

import math
from typing import Any

from lidarium.benchmarks.speed.harness.batches import EPISODES, OBSERVED, ROBOTS, DrivenBatch, can_use
from lidarium.benchmarks.speed.harness.lines import Line, faster, needs_threads
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Contender, Effort, interleaved, repeated
from lidarium.benchmarks.speed.peers.vmas_peer import VmasProcess
from lidarium.benchmarks.speed.scenes.floors import free_poses, straight_floor
from lidarium.benchmarks.speed.scenes.teams import HOLD

CORES = 2
PEER_RAYS, PEER_BATCHES = 64, (32, 128, 512, 1024, 2048)
WANTED, WANTED_WITHOUT_CROPS = 20.0, 25.0

NOTES = (
    f"*Learning preset*: `lidarium.vector_env` with {EPISODES} episodes of {ROBOTS} robots, `lidar_360_6m` (180 beams "
    f"to 6 m, no noise), maps at 5 cm, observations as in the *batch*. VMAS has as many agents, {PEER_RAYS} rays to 6 "
    "m, no map, and the best of the batch sizes 32 to 2048. *Without egocentric maps* the observations are those of "
    "VMAS; maps and rewards are still computed.",
)


def driving(batch: DrivenBatch) -> Contender:
    """Return what lets a batch drive, on blank maps every third block."""
    blocks = 0

    def start() -> None:
        nonlocal blocks
        if blocks % 3 == 0:
            batch.start(blocks // 3)
        blocks += 1

    def drive() -> None:
        for _ in range(HOLD):
            batch.step()

    return repeated(drive, HOLD * batch.agents, start)


def measure(effort: Effort) -> list[Line]:
    """Compare the whole step with VMAS."""
    title = f"learning preset, {EPISODES} episodes x {ROBOTS} robots, two threads"
    if not can_use(CORES):
        return [needs_threads(title, WANTED)]
    floor = straight_floor()
    preset: dict[str, Any] = {"lidar": "lidar_360_6m", "resolution": 0.05}
    batch = DrivenBatch(floor, CORES, **preset)
    plain = DrivenBatch(floor, CORES, **preset, observe=tuple(name for name in OBSERVED if name != "egocentric_map"))
    reach = batch.env.settings.lidar.range_max
    contenders: dict[str, Contender] = {"ours": driving(batch), "plain": driving(plain)}
    poses = free_poses(floor, ROBOTS, 0.5)
    with VmasProcess(floor.boxes, poses, PEER_RAYS, reach, 2.0 * math.pi, CORES, PEER_BATCHES) as vmas:
        if vmas.is_there:
            contenders["vmas"] = vmas.run
        seconds = interleaved(contenders, effort)
    peer = f"{vmas.name}, two threads"
    return [
        faster(title, seconds["ours"], peer, seconds.get("vmas"), WANTED),
        faster(f"{title}, without egocentric maps", seconds["plain"], peer, seconds.get("vmas"), WANTED_WITHOUT_CROPS),
    ]


if __name__ == "__main__":
    run_alone(measure, "Whole steps of a batch at the preset for learning beside VMAS.", CORES)
