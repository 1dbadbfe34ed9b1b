"""Scan and map update at the settings of the exploration projects.

They stand besides the rates that those projects quote.

ARiADNE, Explore-Bench and HouseExpo are not on PyPI. Their rates were measured once on an AMD Zen 5 core,
each with its own code, map and defaults, and are quoted; ours runs with one robot on floors of our own of the
same size.
"""

import math

from lidarium.benchmarks.speed.harness.lines import Line, faster_than_quoted
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Effort, interleaved, repeated
from lidarium.benchmarks.speed.scenes.floors import straight_floor
from lidarium.benchmarks.speed.scenes.teams import DrivenTeam, full_circle
from lidarium.envs.settings.lidar import Lidar

CORES = 1

NOTES = (
    "*Scan and map update*: `KinematicWorld.step` with one robot at the settings of ARiADNE (8d726ad), Explore-Bench "
    "(ce3b98a) and HouseExpo (45e2b25), whose rates are quoted for their own code and defaults.",
)


def measure(effort: Effort) -> list[Line]:
    """Hold our rates against the quoted ones."""
    house_lidar = Lidar(beams=258, field_of_view=math.pi, range_max=5.0, noise_floor=0.1)
    teams = {
        "ARiADNE": DrivenTeam(straight_floor(480, 640, resolution=0.1), 1, full_circle(720, 8.0)),
        "Explore-Bench": DrivenTeam(straight_floor(250, 250, resolution=0.1), 1, full_circle(720, 3.5)),
        "HouseExpo": DrivenTeam(straight_floor(512, 512, resolution=0.04), 1, house_lidar),
    }
    quoted = {"ARiADNE": (31.0, 600.0), "Explore-Bench": (26.0, 700.0), "HouseExpo": (981.0, 20.0)}
    seconds = interleaved({name: repeated(team.step, 1, team.start) for name, team in teams.items()}, effort)
    return [
        faster_than_quoted(
            f"scan and map update at {name}'s settings", seconds[name], name, *quoted[name], unit="scans/s"
        )
        for name in teams
    ]


if __name__ == "__main__":
    run_alone(measure, "Scan and map update at the settings of exploration projects.")
