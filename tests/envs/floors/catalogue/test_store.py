"""The store: arrays by key that are whole or not there, bounded on disk, shared by processes, never
needed."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from lidarium.envs.floors.catalogue import names as catalogue
from lidarium.envs.floors.catalogue import store
from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.floors.catalogue.store import PARTS, Store, floor_store, hash_of_code
from lidarium.envs.floors.generation.buildings import generate_building
from lidarium.envs.simulation.kernels import floor_cache
from lidarium.mapping.kernels import cache_folders

ROOT = Path(store.__file__).resolve().parents[3]
ARRAYS = {
    "bytes": np.arange(12, dtype=np.uint8).reshape(3, 4),
    "numbers": np.array([[0.1, np.inf], [-0.0, np.pi]]),
    "none": np.zeros((0, 3)),
}


@pytest.fixture
def kept(tmp_path):
    return Store(tmp_path / "store", 2**24)


@pytest.fixture
def own_store(tmp_path, monkeypatch):
    monkeypatch.setenv(store.FOLDER_VARIABLE, str(tmp_path / "own"))
    catalogue._load_named.cache_clear()
    yield floor_store()
    catalogue._load_named.cache_clear()


def entries(folder):
    return sorted(path for path in folder.rglob("*") if path.is_file())


def assert_same(found, arrays):
    assert found is not None
    assert list(found) == list(arrays)
    for name, array in arrays.items():
        assert found[name].dtype == array.dtype
        assert found[name].tobytes() == array.tobytes()
        assert found[name].shape == array.shape


def test_arrays_come_back_to_the_bit_and_read_only(kept):
    assert kept.load("a") is None
    kept.save("a", ARRAYS)
    found = kept.load("a")
    assert_same(found, ARRAYS)
    with pytest.raises(ValueError, match="read-only"):
        found["bytes"][0, 0] = 1
    assert kept.load("b") is None
    assert kept.size() == 4096


def damaged(content):
    for cut in (0, 1, 30, 41, len(content) - 1):
        yield content[:cut]
    for place in (0, 20, 50, len(content) - 1):
        yield content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :]
    yield bytes(len(content))
    yield content + b"more"


def test_a_damaged_or_cut_file_is_not_taken_and_is_replaced(kept):
    kept.save("a", ARRAYS)
    (path,) = entries(kept.folder)
    whole = path.read_bytes()
    for content in damaged(whole):
        path.write_bytes(content)
        assert kept.load("a") is None
    kept.save("a", ARRAYS)
    assert path.read_bytes() == whole


def test_the_whole_file_of_another_key_is_not_taken(kept):
    kept.save("a", ARRAYS)
    kept.save("b", {"other": np.ones(3)})
    kept._path("a").write_bytes(kept._path("b").read_bytes())
    assert kept.load("a") is None
    assert kept.load("b") is not None


def test_the_bound_holds_and_what_was_used_longest_ago_goes_first(tmp_path):
    kept = Store(tmp_path, PARTS * 3 * 4096)
    keys = [key for key in map(str, range(400)) if kept._path(key).parent.name == "7"][:6]
    for age, key in enumerate(keys[:3]):
        kept.save(key, ARRAYS)
        os.utime(kept._path(key), (1000 + age, 1000 + age))
    assert kept.load(keys[0]) is not None
    kept.save(keys[3], ARRAYS)
    assert [kept.load(key) is not None for key in keys[:4]] == [True, False, True, True]
    for key in map(str, range(400)):
        kept.save(key, ARRAYS)
    assert 0.8 * kept.max_bytes < kept.size() <= kept.max_bytes


def test_a_full_folder_is_not_listed_for_each_entry(tmp_path, monkeypatch):
    """The fault that was found: a full store took 50 ms for each new floor."""
    kept, looks = Store(tmp_path, PARTS * 256 * 4096), []
    files = store._files
    monkeypatch.setattr(store, "_files", lambda folder: looks.append(folder) or files(folder))
    keys = [key for key in map(str, range(7_000)) if kept._path(key).parent.name == "7"][:400]
    for key in keys:
        kept.save(key, ARRAYS)
    assert len(looks) < len(keys) // 3
    assert 240 * 4096 <= kept.size() <= 256 * 4096
    assert kept.load(keys[-1]) is not None


def test_what_other_processes_write_is_seen_before_a_folder_is_too_large(tmp_path):
    stores = [Store(tmp_path, PARTS * 32 * 4096) for _ in range(store.SHARERS)]
    for number in range(1200):
        stores[number % len(stores)].save(str(number), ARRAYS)
    assert all(sum(size for _, size, _ in store._files(part)) <= 32 * 4096 for part in tmp_path.glob("?"))


def test_what_is_larger_than_its_part_is_not_kept(tmp_path):
    kept = Store(tmp_path, PARTS * 4096)
    kept.save("large", {"noise": np.random.default_rng(0).integers(0, 255, 5000, np.uint8)})
    assert kept.load("large") is None
    assert kept.size() == 0


def test_leftovers_of_broken_writers_are_removed_in_their_turn(tmp_path):
    kept = Store(tmp_path, PARTS * 2 * 4096)
    folder = kept._path("a").parent
    folder.mkdir(parents=True)
    for name in (f".{32 * 'a'}.left_x", f".{32 * 'b'}.left_y"):
        (folder / name).write_bytes(b"half")
        os.utime(folder / name, (1000, 1000))
    kept.save("a", ARRAYS)
    assert kept.load("a") is not None
    assert len(entries(folder)) == 2


def test_a_folder_that_cannot_be_written_to_is_read(kept, monkeypatch):
    kept.save("a", ARRAYS)

    def refuse(*_, **__):
        raise PermissionError("read-only")

    monkeypatch.setattr(store, "write_whole", refuse)
    monkeypatch.setattr(store.os, "utime", refuse)
    kept.save("b", ARRAYS)
    assert_same(kept.load("a"), ARRAYS)
    assert kept.load("b") is None


def test_without_a_folder_nothing_is_kept(tmp_path):
    (tmp_path / "file").write_bytes(b"")
    for nowhere in (Store(None, 2**20), Store(tmp_path / "file" / "below", 2**20)):
        nowhere.save("a", ARRAYS)
        assert nowhere.load("a") is None
        assert nowhere.size() == 0


def test_the_environment_chooses_folder_and_size(tmp_path, monkeypatch):
    monkeypatch.setenv(store.FOLDER_VARIABLE, "off")
    assert floor_store().folder is None
    monkeypatch.setenv(store.FOLDER_VARIABLE, str(tmp_path))
    monkeypatch.setenv(store.SIZE_VARIABLE, "2.5")
    assert (floor_store().folder, floor_store().max_bytes) == (tmp_path, 5 * 2**19)
    for wrong in ("-1", "much", "nan", "inf"):
        monkeypatch.setenv(store.SIZE_VARIABLE, wrong)
        with pytest.raises(ValueError, match=store.SIZE_VARIABLE):
            floor_store()


def test_without_a_wish_the_store_is_in_the_users_cache_or_nowhere(tmp_path, monkeypatch):
    monkeypatch.delenv(store.FOLDER_VARIABLE)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(cache_folders.tempfile, "gettempdir", lambda: str(tmp_path / "file"))
    (tmp_path / "file").write_bytes(b"")
    store._store.cache_clear()
    assert floor_store().folder == tmp_path / "cache" / "lidarium" / "floors"
    floor_store().save("a", ARRAYS)
    assert floor_store().load("a") is not None
    floor_store().folder.chmod(0o777)
    store._store.cache_clear()
    assert floor_store().folder is None
    store._store.cache_clear()


def test_a_home_that_is_not_there_is_told(monkeypatch):
    monkeypatch.setenv(store.FOLDER_VARIABLE, "~nobody-of-that-name/floors")
    with pytest.raises(ValueError, match=r"~nobody-of-that-name/floors.*no home"):
        floor_store()


def test_only_what_the_store_made_is_removed(tmp_path):
    """The fault that was found: files of others went, through a link in place of a part."""
    kept = Store(tmp_path / "store", PARTS * 4096)
    part = kept._path("a").parent
    part.mkdir(parents=True)
    foreign = [part / name for name in ("thesis.tex", ".git", "a" * 31, "A" * 32, ".left.x")]
    for path in foreign:
        path.write_bytes(bytes(3 * 4096))
    aim = tmp_path / "aim"
    aim.write_bytes(bytes(3 * 4096))
    (part / ("f" * 32)).symlink_to(aim)
    kept.save("a", ARRAYS)
    assert kept.load("a") is not None
    assert all(path.exists() for path in (*foreign, aim, part / ("f" * 32)))
    assert kept.size() == 4096


def test_nothing_is_read_written_or_removed_through_links(tmp_path):
    kept, theirs = Store(tmp_path / "store", PARTS * 4096), tmp_path / "theirs"
    theirs.mkdir()
    (theirs / ("e" * 32)).write_bytes(bytes(3 * 4096))
    kept.folder.mkdir()
    kept._path("a").parent.symlink_to(theirs)
    kept.save("a", ARRAYS)
    assert [path.name for path in theirs.iterdir()] == ["e" * 32]
    other = Store(tmp_path / "other", 2**24)
    other.save("a", ARRAYS)
    other._path("a").rename(theirs / kept._path("a").name)
    assert kept.load("a") is None
    other._path("a").symlink_to(theirs / kept._path("a").name)
    assert other.load("a") is None


def test_generated_floors_are_kept_and_come_back_the_same(own_store, monkeypatch):
    first = load_floor("building:7")
    assert len(entries(own_store.folder)) == 1
    catalogue._load_named.cache_clear()
    monkeypatch.setattr(catalogue, "generate_building", None)
    second = load_floor("building:7")
    assert second is not first
    assert second.name == first.name
    assert second.sha256 == first.sha256 == generate_building(7).sha256
    assert second.geometry_sha256 == first.geometry_sha256


def test_a_floor_is_made_anew_where_its_file_is_damaged_or_the_generator_is_another(own_store, monkeypatch):
    wanted = load_floor("office:7").sha256
    (path,) = entries(own_store.folder)
    path.write_bytes(path.read_bytes()[:100])
    catalogue._load_named.cache_clear()
    assert load_floor("office:7").sha256 == wanted
    catalogue._load_named.cache_clear()
    monkeypatch.setattr(catalogue, "hash_of_code", lambda *sources: "another")
    monkeypatch.setattr(catalogue, "generate_building", lambda seed, settings: generate_building(8, settings))
    assert load_floor("office:7").sha256 != wanted


def test_the_hash_of_code_changes_with_every_source_and_library(tmp_path, monkeypatch):
    monkeypatch.setattr(store, "_PACKAGE", tmp_path)
    hashes = set()

    def note():
        hash_of_code.cache_clear()
        hashes.add(hash_of_code("folder", "one.py"))

    (tmp_path / "folder" / "deep").mkdir(parents=True)
    for place, path in enumerate(("one.py", "folder/two.py", "folder/deep/three.py")):
        (tmp_path / "one.py").touch()
        (tmp_path / path).write_text(f"x = {place}\n")
        note()
    (tmp_path / "two.py").write_text("x = 1\n")
    note()
    assert len(hashes) == 3
    monkeypatch.setattr(store.np, "__version__", "0")
    note()
    assert len(hashes) == 4
    hash_of_code.cache_clear()


def imported(path):
    """Files of the package that a file needs, those which they need, and so on."""
    found, left = set(), [path]
    while left:
        path = left.pop()
        if path in found:
            continue
        found.add(path)
        froms = [
            node
            for node in ast.walk(ast.parse((ROOT / path).read_text()))
            if isinstance(node, ast.ImportFrom)
            and (node.module or "").startswith("lidarium.")
            and node.module != "lidarium.registry"
        ]
        for node in froms:
            name = node.module.removeprefix("lidarium.").replace(".", "/")
            # Of a package its modules are imported.
            is_package = (ROOT / name).is_dir()
            left += [f"{name}/{part.name}.py" for part in node.names] if is_package else [f"{name}.py"]
    return found


@pytest.mark.parametrize(
    ("made_by", "makers"),
    [
        (
            catalogue.MADE_BY,
            ("envs/floors/generation/buildings.py", "envs/floors/catalogue/store.py"),
        ),
        (
            floor_cache.MADE_BY,
            ("envs/simulation/kernels/floor_cache.py", "envs/floors/catalogue/store.py"),
        ),
    ],
)
def test_every_source_that_makes_an_entry_counts_in_its_key(made_by, makers):
    for path in set().union(*map(imported, makers)):
        assert any(path == source or path.startswith(f"{source}/") for source in made_by), path


def test_processes_share_and_of_two_writers_both_succeed(tmp_path):
    code = (
        "import sys, numpy as np\n"
        "from pathlib import Path\n"
        "from lidarium.envs.floors.catalogue.store import Store\n"
        "store = Store(Path(sys.argv[1]), 2**24)\n"
        "arrays = {'large': np.arange(200_000) % 1009}\n"
        "for _ in range(30):\n"
        "    found = store.load('key')\n"
        "    assert found is None or np.array_equal(found['large'], arrays['large'])\n"
        "    store.save('key', arrays)\n"
        "    assert store.load('key') is not None\n"
    )
    started = [subprocess.Popen([sys.executable, "-c", code, str(tmp_path)]) for _ in range(2)]
    assert [process.wait() for process in started] == [0, 0]
    assert np.array_equal(Store(tmp_path, 2**24).load("key")["large"], np.arange(200_000) % 1009)
    assert len(entries(tmp_path)) == 1
