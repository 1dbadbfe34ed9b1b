"""Steps of this code besides those of another checkout.

Both are driven alternately; the comparison shows what a change of the kernels gained.

    python benchmarks/speed/against.py OTHER_PYTHON [--threads 1] [--rounds 3] [--blocks 40] [--tours]

OTHER_PYTHON is the interpreter of a virtual environment in which the other checkout is installed. Each runs
in a process of its own, and they take turns block by block, so that both meet the same noise of the machine.
With ``--tours`` they plan tours instead: a block is an episode of ``tour_frontier`` on a validation floor; times are
those of the processor.
"""

import argparse
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

import lidarium

KINDS = (
    "all observations",
    "without egocentric maps",
    "one environment",
    "waypoint decisions",
    "frontier decisions",
    "frontier decisions of three",
)
TOUR_KINDS = ("plans of tours of two robots",)
FLOOR = "building:3"
STEPS = 20
"""Steps of a block."""


def serve_tours() -> None:
    """Explore a floor for each line of standard input, which ends with its number; print the mean time of a plan [us].

    It is the processor's time of a plan of two robots.
    """
    options: dict[str, Any] = {"robots": 2, "resolution": 0.05, "stop_coverage": 0.99, "horizon_s": 1800.0}
    floors = lidarium.floor_set("set:validation:8")
    for line in sys.stdin:
        seed, seconds = int(line.rpartition(" ")[2]), list[float]()
        env = lidarium.parallel_env(floors[seed % len(floors)], **options)
        lidarium.run_episode(_timed(lidarium.policy("tour_frontier"), seconds), env, seed=seed)
        print(1e6 * float(np.mean(seconds)), flush=True)


def _timed(policy: Any, seconds: list[float]) -> Any:  # noqa: ANN401
    """Return a policy that notes the time of the processor of each of its plans."""
    choose = policy.choose

    def noted(*given: Any) -> Any:  # noqa: ANN401
        began = time.process_time()
        chosen = choose(*given)
        seconds.append(time.process_time() - began)
        return chosen

    policy.choose = noted
    return policy


def serve(threads: int) -> None:
    """Drive a block of a kind for each line of standard input that names it.

    Its time per agent step [us] is printed. Public names alone are used, so that any version can take part.
    """
    preset: dict[str, Any] = {
        "robots": 2,
        "lidar": "lidar_360_6m",
        "resolution": 0.05,
        "horizon_s": None,
        "stop_coverage": None,
    }
    plain = ("scan", "pose", "velocity", "bumper", "map")
    rows: dict[str, Any] = {
        KINDS[0]: lidarium.vector_env(
            64, FLOOR, threads=threads, copy=False, observe=(*plain, "egocentric_map"), **preset
        ),
        KINDS[1]: lidarium.vector_env(64, FLOOR, threads=threads, copy=False, observe=plain, **preset),
        KINDS[2]: lidarium.parallel_env(FLOOR, **{**preset, "robots": 3}),
        KINDS[3]: lidarium.vector_env(64, FLOOR, threads=threads, level="waypoint", copy=False, **preset),
        **{
            kind: lidarium.vector_env(
                16, "set:validation", threads=threads, level="frontier", copy=False, robots=robots, resolution=0.05
            )
            for kind, robots in ((KINDS[4], 1), (KINDS[5], 3))
        },
    }
    generator = np.random.default_rng(0)
    for line in sys.stdin:
        kind, _, place = line.strip().partition(" from ")
        env = rows[kind]
        if place:
            # Versions differ in where robots start by default, and the time of a scan depends on it.
            env.reset(seed=int(place), options={} if kind in KINDS[4:] else {"starts": "fixed"})
        steps = 3 if kind in KINDS[3:] else STEPS
        if kind == KINDS[2]:
            agents = env.possible_agents
            actions: list[Any] = [dict.fromkeys(agents, action) for action in generator.uniform(-0.5, 1.0, (steps, 2))]
        elif kind in KINDS[4:]:
            # Each robot takes the cheapest of its frontiers.
            agents = range(env.num_envs)
            actions = list(np.zeros((steps, env.num_envs), np.int64))
        else:
            agents = range(env.num_envs)
            bounds = (-1.0, 1.0) if kind == KINDS[3] else (-0.5, 1.0)
            actions = list(generator.uniform(*bounds, (steps, env.num_envs, 2)).astype(np.float32))
        began = time.perf_counter()
        for action in actions:
            env.step(action)
        print((time.perf_counter() - began) / steps / len(agents) * 1e6, flush=True)


def times(pythons: list[str], kinds: tuple[str, ...], threads: int, rounds: int, blocks: int) -> dict[str, np.ndarray]:
    """Return the times per agent step of each kind [us]. The shape is (pythons, rounds * blocks)."""
    tours = kinds == TOUR_KINDS
    command = [str(Path(__file__).resolve()), "--serve", "--threads", str(threads), *["--tours"] * tours]
    processes = [
        subprocess.Popen([python, *command], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        for python in pythons
    ]
    found: dict[str, np.ndarray] = {kind: np.zeros((len(pythons), rounds * blocks)) for kind in kinds}
    try:
        for process in processes if tours else ():
            _answer(process, f"{kinds[0]} from 0\n")  # kernels are compiled, floors are read
        for block in range(rounds * blocks):
            # Blocks of a round go on where the one before ended; a round begins with blank maps.
            place = f" from {block}" if tours else f" from {block // blocks}" if block % blocks == 0 else ""
            for kind in kinds:
                for k, process in enumerate(processes):
                    answer = _answer(process, f"{kind}{place}\n")
                    if not answer:
                        raise RuntimeError(f"{pythons[k]} has ended; is lidarium with its benchmarks installed there?")
                    found[kind][k, block] = float(answer)
    finally:
        for process in processes:
            with suppress(BrokenPipeError):
                process.communicate()
    return found


def _answer(process: "subprocess.Popen[str]", question: str) -> str:
    """Return the line with which a process answers; nothing if it has ended."""
    assert process.stdin is not None
    assert process.stdout is not None
    with suppress(BrokenPipeError):
        process.stdin.write(question)
        process.stdin.flush()
    return process.stdout.readline()


def main() -> None:
    """Compare two checkouts and print medians with quartiles."""
    parser = argparse.ArgumentParser(description="Steps of this code beside those of another checkout.")
    parser.add_argument("other", nargs="?", help="interpreter of a virtual environment with the other checkout")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--rounds", type=int, default=3, help="each begins with blank maps")
    parser.add_argument("--blocks", type=int, default=40, help=f"blocks of {STEPS} steps in a round")
    parser.add_argument("--tours", action="store_true", help="plans of tours alone")
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        if options.tours:
            serve_tours()
        else:
            serve(options.threads)
        return
    if options.other is None or min(options.threads, options.rounds, options.blocks) < 1:
        parser.error("want the other checkout's interpreter, and threads, rounds and blocks of at least 1")
    for kind, (ours, other) in times(
        [sys.executable, options.other],
        TOUR_KINDS if options.tours else KINDS,
        options.threads,
        options.rounds,
        options.blocks,
    ).items():
        low, middle, high = np.quantile(ours / other, [0.25, 0.5, 0.75])
        unit = "us" if options.tours else "us an agent step"
        rates = f"{np.median(ours):.2f} {unit}, the other {np.median(other):.2f}"
        print(f"{kind}: {rates}; {middle:.3f} of its time (quartiles {low:.3f} to {high:.3f})")


if __name__ == "__main__":
    main()
