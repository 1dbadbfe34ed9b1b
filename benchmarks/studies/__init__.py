"""Studies: published results, each made by ``lidarium reproduce NAME``."""

from lidarium.benchmarks.studies.shared.study import Study
from lidarium.registry import Registry

STUDIES: Registry[Study] = Registry("study")
"""Studies by name; the page of one is ``docs/results/NAME.md``."""

_PACKAGE = "lidarium.benchmarks.studies"
for _name, _module, _summary in (
    ("bounds", "bounds", "what a team that knows the floor needs, how tight that is, and explorers beside it"),
    ("dungeons", "dungeons", "ways on public dungeon maps, beside those of other planners there"),
    ("fast", "fast", "explorers in the world for learners, realism fast, beside the full world"),
    ("floors", "floors", "every real floor, dungeons and 200 generated floors explored with 1 to 3 robots"),
    ("interval_coverage", "interval_coverage", "how often the intervals of reports hold a known truth"),
    ("leaderboard", "leaderboard.study", "all policies on generated and real floors, 1 to 3 robots, known starts"),
    (
        "learned",
        "learned",
        "learned explorers beside classic ones and bounds, on floors that no training has seen",
    ),
    ("machines", "machines", "10^5 episodes, two nodes of a Ray cluster beside one, and nodes that are killed"),
    ("meetings", "meetings", "teams whose radio breaks: meetings, beside pursuit, robots that never part, and chance"),
    ("merging", "merging.study", "map merging on a bank of maps that robots made, beside the thesis and ROS map_merge"),
    ("parity", "parity", "random driving in the world of PyBullet beside the kinematic one, on 20 floors"),
    ("people", "people", "reference policies, SLAM and batches among people and doors, beside the same without"),
    ("prediction", "prediction", "predicted maps: how good they are, and what explorers win by them and by the truth"),
    ("printed", "printed", "policies under the rules of other projects, and the figures that those published"),
    ("realism", "realism", "how well robots know where they are with noise, wheels that slip, and SLAM"),
    ("slam", "slam.study", "SLAM on recorded laser logs and on a simulated robot: errors and times"),
    ("sparse", "sparse.study", "sparse 3D maps of furnished places: quantisation, paths beside grids, memory"),
    ("splines", "splines.study", "maps of walls as B-splines and localization on them, also in buildings"),
    ("srt", "srt.study", "the sensor-based random tree towards goals, full exploration, ablations of localization"),
    (
        "supervisor",
        "supervisor.study",
        "teams with unknown starts under the supervisor, beside bounds of merging",
    ),
    ("zoo", "zoo", "teams that learned by rewards, five trainings of each, beside classic teams on unseen floors"),
):
    STUDIES.register(_name, f"{_PACKAGE}.{_module}:STUDY", _summary)
