"""Studies: published results, each made by ``lidarium reproduce NAME``."""

from lidarium.benchmarks.studies.shared.study import Study
from lidarium.registry import Registry

STUDIES: Registry[Study] = Registry("study")
"""Studies by name; the page of one is ``docs/results/NAME.md``."""

_PACKAGE = "lidarium.benchmarks.studies"
STUDIES.register(
    "bounds",
    f"{_PACKAGE}.bounds:STUDY",
    "what a team that knows the floor needs, how tight that is, and explorers beside it",
)
STUDIES.register(
    "dungeons",
    f"{_PACKAGE}.dungeons:STUDY",
    "ways on public dungeon maps, beside those of other planners there",
)
STUDIES.register(
    "floors",
    f"{_PACKAGE}.floors:STUDY",
    "every real floor, dungeons and 200 generated floors explored with 1 to 3 robots",
)
STUDIES.register(
    "interval_coverage",
    f"{_PACKAGE}.interval_coverage:STUDY",
    "how often the intervals of reports hold a known truth",
)
STUDIES.register(
    "leaderboard",
    f"{_PACKAGE}.leaderboard.study:STUDY",
    "all policies on generated and real floors, 1 to 3 robots, known starts",
)
STUDIES.register(
    "learned",
    f"{_PACKAGE}.learned:STUDY",
    "learned explorers beside classic ones and beside bounds, on floors that no training has seen",
)
STUDIES.register(
    "machines",
    f"{_PACKAGE}.machines:STUDY",
    "10^5 episodes, two nodes of a Ray cluster beside one, and nodes that are killed",
)
STUDIES.register(
    "merging",
    f"{_PACKAGE}.merging.study:STUDY",
    "map merging on a bank of maps that robots made, beside the thesis and ROS map_merge",
)
STUDIES.register(
    "parity",
    f"{_PACKAGE}.parity:STUDY",
    "random driving in the world of PyBullet beside the kinematic one, on 20 floors",
)
STUDIES.register(
    "realism",
    f"{_PACKAGE}.realism:STUDY",
    "how well robots know where they are with noise, wheels that slip, and SLAM",
)
STUDIES.register(
    "slam",
    f"{_PACKAGE}.slam.study:STUDY",
    "SLAM on recorded laser logs and on a simulated robot: errors and times",
)
STUDIES.register(
    "sparse",
    f"{_PACKAGE}.sparse.study:STUDY",
    "sparse 3D maps of furnished places: quantisation, paths beside grids, memory",
)
STUDIES.register(
    "splines",
    f"{_PACKAGE}.splines.study:STUDY",
    "maps of walls as B-splines and localization on them, also in buildings",
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
