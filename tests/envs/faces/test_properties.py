"""Whatever the floors, the team and the settings: rows are the robots of parallel environments."""

from compared_faces import compare_rows
from hypothesis import given, settings
from hypothesis import strategies as st

FLOORS = (
    "apartment",
    "clinic",
    "scene_room",
    "scene_corridor",
    "building:3",
    "building:5",
    "building:8",
    "apartment:2",
    "office:6",
)


@settings(max_examples=12, derandomize=True, database=None)
@given(
    floors=st.lists(st.sampled_from(FLOORS), min_size=1, max_size=6),
    robots=st.integers(1, 4),
    seed=st.integers(0, 2**31),
    noise=st.sampled_from(["none", "datasheet", "thesis"]),
    known_starts=st.booleans(),
    threads=st.integers(1, 2),
    horizon_s=st.sampled_from([0.4, 600.0]),
    stop_on_contact=st.booleans(),
    observe=st.lists(
        st.sampled_from(["scan", "pose", "velocity", "bumper", "map", "egocentric_map"]),
        min_size=1,
        unique=True,
    ),
)
def test_rows_are_the_robots_of_parallel_environments(floors, robots, seed, threads, **options):
    compare_rows("velocity", threads, 8, floors, robots, seed, **options)
