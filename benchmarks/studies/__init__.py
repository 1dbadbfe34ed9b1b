"""Studies: published results, each made anew by ``lidarium reproduce NAME``."""

from lidarium.benchmarks.studies.study import Study
from lidarium.registry import Registry

STUDIES: Registry[Study] = Registry("study")
"""Studies by name; the page of one is ``docs/results/NAME.md``."""

_PACKAGE = "lidarium.benchmarks.studies"
STUDIES.register(
    "leaderboard",
    f"{_PACKAGE}.leaderboard.study:STUDY",
    "all policies on generated and real floors, 1 to 3 robots, known starts",
)
STUDIES.register(
    "merging",
    f"{_PACKAGE}.merging.study:STUDY",
    "map merging on a bank of maps that robots made, beside the thesis and ROS map_merge",
)
STUDIES.register(
    "srt",
    f"{_PACKAGE}.srt.study:STUDY",
    "the sensor-based random tree towards goals, full exploration, ablations of localization",
)
STUDIES.register(
    "supervisor",
    f"{_PACKAGE}.supervisor.study:STUDY",
    "teams with unknown starts under the supervisor, beside bounds of what merging can reach",
)
