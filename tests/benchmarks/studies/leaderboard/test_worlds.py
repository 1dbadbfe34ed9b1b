from lidarium.agents.catalogue import POLICIES
from lidarium.benchmarks.studies.leaderboard import worlds


def test_floors_run_in_all_worlds_and_fewer_of_them_in_slow_ones():
    suites = worlds.suites(None, 20)
    assert set(suites) == {"test_ideal", "test_lab", "test_unknown", "test_camera"}
    ideal, lab, unknown = (suites[f"test_{name}"] for name in ("ideal", "lab", "unknown"))
    assert len(ideal.floors) == 10
    assert set(lab.floors) < set(ideal.floors)
    assert (ideal.robots, unknown.robots) == ((1, 2, 3), (2, 3))
    assert lab.settings("default", 2).localization == "slam"
    assert ideal.settings("default", 2).localization == "truth"
    assert unknown.settings("default", 2).known_starts is False


def test_all_policies_that_need_no_goal_are_in_it():
    asked = {policy for world in worlds.WORLDS.values() for policy in world.policies}
    # A bound of supervised teams, the systems as they were printed and meetings are compared in their own studies,
    # teams of the zoo on their own page; two policies move between the nodes of a graph.
    own = {"oracle_starts", "supervised:thesis", "srt:thesis", "nearest_node", "utility_node"}
    own |= {name for name in POLICIES if name.startswith("zoo:")}
    own |= {"meeting_frontier", "meeting_tours", "oblivious", "tethered"}
    assert set(POLICIES) - asked == own


def test_large_floors_are_left_out_of_slow_worlds():
    assert {name for kind, name, _ in worlds.parts() if kind in ("slam", "kth")} == {"ideal"}
    assert {name for kind, name, _ in worlds.parts() if kind == "lifull"} == set(worlds.WORLDS)
