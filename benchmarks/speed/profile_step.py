"""Where the time of an agent step is spent.

Its parts, each by itself, stand beside the whole.

python benchmarks/speed/profile_step.py                      # prints the table
python benchmarks/speed/profile_step.py --out docs/results   # and writes profile.md
"""

import argparse
import statistics
from collections.abc import Mapping, Sequence
from pathlib import Path

from lidarium.benchmarks.speed.harness.report import about, heading, with_effort
from lidarium.benchmarks.speed.harness.timing import EFFORTS, Effort, interleaved, on_cores, repeated
from lidarium.benchmarks.speed.scenes.floors import BenchFloor, straight_floor, turned_floor
from lidarium.benchmarks.speed.step_parts import ROBOTS, StepParts
from lidarium.mapping.files.output import check_writable, write_text

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
            f" {spent[name]:.2f} | {100.0 * spent[name] / spent[WHOLE]:.0f} % |"
            for spent, _, _ in profiles.values()
        )
        lines.append(f"| {name} |{cells}")
    return "\n".join(lines)


def rates(profiles: Mapping[str, tuple[Mapping[str, float], float, float]]) -> Sequence[str]:
    """Say how many rays and cells that is in a second."""
    return [
        f"- {floor}: {rays:.0f} rays and {cells:,.0f} cells in an agent step; "
        f"{rays / spent['ray casting']:.0f} M rays/s cast, "
        f"{cells / 1e3 / (spent['area seen through noise'] + spent['map update']):.2f} G cells/s found and "
        "put into the map, "
        f"{cells / 1e3 / spent['map update']:.1f} G cells/s put into the map once found."
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
            name: profile(floor, effort)
            for name, floor in (("straight", straight), ("turned", turned_floor(straight)))
        }
    print(profile_table(profiles), *rates(profiles), sep="\n")
    if chosen.out is not None:
        command = f"python benchmarks/speed/profile_step.py --effort {chosen.effort} --out {chosen.out}"
        chosen.out.mkdir(parents=True, exist_ok=True)
        write_text(chosen.out / "profile.md", profile_page(profiles, effort, command))


def profile_page(
    profiles: Mapping[str, tuple[Mapping[str, float], float, float]], effort: Effort, command: str
) -> str:
    """Write the page of the profile."""
    return "\n".join(
        [
            *heading("Profile of a step", about(command)),
            f"One thread; medians of {effort.rounds} rounds in which all parts run in turn for "
            f"{effort.block_s:g} s each.",
            "",
            profile_table(profiles),
            "",
            f"A team of {ROBOTS} on the floor of 512 x 512 cells of 2.5 cm, straight and turned by 17 deg; "
            "720 noisy beams over 240 deg to "
            "5.6 m, maps at 2.5 cm. Every part runs by itself on the same poses and scans, so what it needs "
            "lies in nearer caches than in "
            "the whole step, and the rest holds that difference, too. The observation (scan, pose, velocity, "
            "bumper, egocentric maps) is "
            "no part of the kernel's step.",
            "",
            *rates(profiles),
            "",
            "What the parts are, and what limits them: [profiling](../profiling.md).",
            "",
        ]
    )


if __name__ == "__main__":
    main()
