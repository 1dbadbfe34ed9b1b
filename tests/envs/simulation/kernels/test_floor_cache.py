"""Tables of floors are the same from the cache, the store and made anew; the cache is bounded and never
makes twice."""

import copy
import gc
import math
import pickle
import subprocess
import sys

import numpy as np
import pytest

import lidarium
from lidarium.envs.floors import free_space
from lidarium.envs.floors.catalogue import names as catalogue
from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.floors.catalogue.store import FOLDER_VARIABLE, floor_store
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.floors.free_space import reachable_free_space
from lidarium.envs.floors.generation.buildings import generate_building
from lidarium.envs.simulation.kernels import floor_cache
from lidarium.envs.simulation.kernels.floor_cache import (
    REMEMBERED_SHARE,
    SIZE_VARIABLE,
    FloorTables,
    TablesCache,
    floor_tables,
    prepare_tables,
)

HEIGHTS = (0.05, 0.3, 0.52)


def forget():
    catalogue._load_named.cache_clear()
    floor_cache._cache.cache_clear()


@pytest.fixture
def own_store(tmp_path, monkeypatch):
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path / "own"))
    forget()
    yield floor_store()
    forget()


def box(side):
    """A room with a low table, which the body touches and the laser does not see."""
    wall, table = (
        np.array([(0, 0), (side, 0), (side, 0.2), (0, 0.2)]),
        np.array([(1, 1), (1.6, 1), (1.6, 1.5), (1, 1.5)]),
    )
    return Floor("box", (0.0, 0.0, side, side), (Solid(wall), Solid(table, 0.0, 0.2)))


def arrays_of(tables):
    raster = (
        tables.laser.solid,
        tables.body.solid,
        np.array([*tables.laser.origin, *tables.body.origin, tables.body.resolution]),
    )
    return (
        *raster,
        tables.frame,
        tables.rays.squares,
        tables.rays.faces,
        tables.rays.face_starts,
        tables.bound,
    )


def assert_same(one, other):
    for first, second in zip(arrays_of(one), arrays_of(other), strict=True):
        assert first.dtype == second.dtype
        assert np.array_equal(first, second)
    assert (one.laser is one.body) == (other.laser is other.body)


def cache_for(tables):
    """The size of a cache that has room for tables of so many bytes."""
    return math.ceil(tables / (1.0 - REMEMBERED_SHARE))


def refuse(*_):
    raise AssertionError("made anew")


@pytest.mark.parametrize(
    "make",
    [lambda: load_floor("apartment"), lambda: generate_building(5), lambda: box(4.0)],
    ids=["apartment", "generated", "box"],
)
def test_tables_from_the_cache_and_the_store_equal_new_ones_bit_for_bit(make, own_store, monkeypatch):
    floor = make()
    fresh = FloorTables.of_floor(floor, *HEIGHTS)
    made = floor_tables(floor, *HEIGHTS)
    monkeypatch.setattr(FloorTables, "of_floor", refuse)
    assert floor_tables(floor, *HEIGHTS) is made
    forget()
    stored = floor_tables(floor, *HEIGHTS)
    assert_same(made, fresh)
    assert_same(stored, fresh)
    assert stored.nbytes == fresh.nbytes


def test_laser_and_body_share_a_raster_only_where_they_see_the_same():
    tables = FloorTables.of_floor(box(4.0), *HEIGHTS)
    assert tables.laser is not tables.body
    assert tables.nbytes > 7 * tables.bound.size
    tables = FloorTables.of_floor(load_floor("scene_room"), *HEIGHTS)
    assert tables.laser is tables.body
    assert tables.nbytes == 6 * tables.bound.size + tables.rays.faces.nbytes + tables.rays.face_starts.nbytes


def test_what_determines_tables_tells_them_apart():
    tables = floor_tables(box(4.0), *HEIGHTS)
    assert floor_tables(box(4.0), *HEIGHTS) is tables
    others = [
        floor_tables(box(4.0 + 1e-9), *HEIGHTS),
        floor_tables(box(4.0), 0.1, 0.3, 0.52),
        floor_tables(box(4.0), 0.05, 0.1, 0.52),
        floor_tables(box(4.0), 0.05, 0.3, 0.6),
    ]
    assert len({id(one) for one in [tables, *others]}) == 5


def test_tables_cannot_be_written(own_store):
    floor = load_floor("building:5")
    made = floor_tables(floor, *HEIGHTS)
    forget()
    for tables in (made, floor_tables(floor, *HEIGHTS)):
        for array in (tables.laser.solid, tables.body.solid, tables.bound, *vars(tables.rays).values()):
            if isinstance(array, np.ndarray):
                with pytest.raises(ValueError, match="read-only"):
                    array[0] = 1


def test_the_cache_keeps_no_more_bytes_than_it_may():
    floors = [box(3.0 + 0.1 * k) for k in range(30)]
    sizes = [FloorTables.of_floor(floor, *HEIGHTS).nbytes for floor in floors]
    cache = TablesCache(cache_for(sum(sizes[-5:])))
    for k, floor in enumerate(floors):
        cache.get(str(k), lambda floor=floor: FloorTables.of_floor(floor, *HEIGHTS))
        assert cache.nbytes <= cache.max_bytes
    gc.collect()
    assert cache.nbytes == sum(sizes[-5:])
    for k in range(25, 30):
        cache.get(str(k), refuse)
    with pytest.raises(AssertionError, match="made anew"):
        cache.get("24", refuse)


def test_the_tables_used_last_stay_and_those_in_use_are_never_made_twice():
    def make():
        return FloorTables.of_floor(box(3.0), *HEIGHTS)

    first = make()
    cache = TablesCache(cache_for(2 * first.nbytes))
    cache.get("first", lambda: first)
    cache.get("second", make)
    cache.get("first", refuse)
    cache.get("third", make)
    gc.collect()
    assert cache.get("first", refuse) is first
    with pytest.raises(AssertionError, match="made anew"):
        cache.get("second", refuse)
    tiny = TablesCache(0)
    assert tiny.get("first", lambda: first) is first
    assert tiny.nbytes == 0
    assert tiny.get("first", refuse) is first


def test_what_episodes_add_to_tables_counts():
    tables = FloorTables.of_floor(box(3.0), *HEIGHTS)
    cache = TablesCache(cache_for(3 * tables.nbytes))
    cache.get("first", lambda: tables)
    bare = cache.nbytes
    reachable_free_space(tables.body, 0.1, np.array([[2.5, 2.5]]))
    assert cache.get("first", refuse) is tables
    assert cache.nbytes == tables.nbytes > bare
    cache.get("large", lambda: FloorTables.of_floor(box(6.0), *HEIGHTS))
    gc.collect()
    assert cache.nbytes == sum(runs.nbytes for runs in tables.body.kept.values())


def test_what_was_made_of_a_floor_stays_when_its_tables_go(monkeypatch):
    start = np.array([[2.5, 2.5]])
    cache = TablesCache(cache_for(1.5 * FloorTables.of_floor(box(3.0), *HEIGHTS).nbytes))
    tables = cache.get("first", lambda: FloorTables.of_floor(box(3.0), *HEIGHTS))
    free = reachable_free_space(tables.body, 0.1, start)
    del tables
    cache.get("second", lambda: FloorTables.of_floor(box(3.1), *HEIGHTS))
    gc.collect()
    again = cache.get("first", lambda: FloorTables.of_floor(box(3.0), *HEIGHTS))
    monkeypatch.setattr(free_space, "configuration_space", refuse)
    monkeypatch.setattr(free_space, "_dilated", refuse)
    np.testing.assert_array_equal(reachable_free_space(again.body, 0.1, start), free)
    with pytest.raises(AssertionError, match="made anew"):
        reachable_free_space(again.body, 0.2, start)
    assert cache.nbytes <= cache.max_bytes


def test_the_environment_bounds_the_cache(monkeypatch):
    monkeypatch.setenv(SIZE_VARIABLE, "0")
    forget()
    tables = floor_tables(box(4.0), *HEIGHTS)
    assert floor_tables(box(4.0), *HEIGHTS) is tables
    assert floor_cache._cache(0).nbytes == 0
    monkeypatch.setenv(SIZE_VARIABLE, "plenty")
    with pytest.raises(ValueError, match=SIZE_VARIABLE):
        floor_tables(box(4.0), *HEIGHTS)
    forget()


def test_damaged_tables_are_made_anew(own_store):
    fresh = floor_tables(box(4.0), *HEIGHTS)
    (path,) = (path for path in own_store.folder.rglob("*") if path.is_file())
    whole = path.read_bytes()
    for content in (whole[:-1], b"", b"anything", whole[:60] + b"\0" + whole[61:]):
        path.write_bytes(content)
        forget()
        assert_same(floor_tables(box(4.0), *HEIGHTS), fresh)
        assert path.read_bytes() == whole


def test_tables_prepared_ahead_are_found(own_store, monkeypatch):
    assert prepare_tables(own_store, box(4.0), *HEIGHTS)
    assert not prepare_tables(own_store, box(4.0), *HEIGHTS)
    monkeypatch.setattr(FloorTables, "of_floor", refuse)
    floor_tables(box(4.0), *HEIGHTS)


def episode(floor):
    env = lidarium.parallel_env(floor, robots=2, noise="datasheet", map_cells=64, starts="fixed")
    observations, _ = env.reset(seed=4)
    names = [env.floor.name]
    for _ in range(3):
        observations, *_ = env.step({agent: np.array([0.4, 0.2], np.float32) for agent in env.agents})
    env.reset()
    return env, [*names, env.floor.name], observations


def test_episodes_are_the_same_with_and_without_a_store(own_store, monkeypatch):
    filling, reading = episode("set:test"), (forget(), episode("set:test"))[1]
    monkeypatch.setenv(FOLDER_VARIABLE, "off")
    forget()
    for env, names, observations in (filling, reading):
        plain_env, plain_names, plain = episode("set:test")
        assert names == plain_names
        assert env.seed == plain_env.seed
        for agent, arrays in plain.items():
            assert all(np.array_equal(arrays[name], observations[agent][name]) for name in arrays)


@pytest.mark.parametrize(
    "copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["deepcopy", "pickle"]
)
def test_environments_on_stored_floors_can_be_copied(copied, own_store):
    floor_tables(load_floor("building:5"), 0.025, *HEIGHTS[1:])
    forget()
    env = episode("building:5")[0]
    other = copied(env)
    for one in (env, other):
        one.step({agent: np.array([0.5, -0.1], np.float32) for agent in one.agents})
    assert np.array_equal(env.simulation.ranges, other.simulation.ranges)
    assert np.array_equal(env.world.poses, other.world.poses)


def test_another_process_finds_what_this_one_made(own_store, tmp_path):
    fresh = floor_tables(load_floor("building:5"), *HEIGHTS)
    code = (
        "import sys, numpy as np\n"
        "from lidarium.envs.floors.catalogue import names as catalogue\n"
        "from lidarium.envs.simulation.kernels.floor_cache import floor_tables\n"
        "from lidarium.envs.simulation.kernels.floor_cache import FloorTables\n"
        "catalogue.generate_building = FloorTables.of_floor = None\n"
        f"tables = floor_tables(catalogue.load_floor('building:5'), *{HEIGHTS})\n"
        "np.savez(sys.argv[1], squares=tables.rays.squares, faces=tables.rays.faces, bound=tables.bound, "
        "solid=tables.laser.solid)\n"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "found.npz")], check=True)
    found = np.load(tmp_path / "found.npz")
    for name, array in (
        ("squares", fresh.rays.squares),
        ("faces", fresh.rays.faces),
        ("bound", fresh.bound),
        ("solid", fresh.laser.solid),
    ):
        assert np.array_equal(found[name], array)
