"""The one decorator of kernels: exact, cached by all sources, and with views on arrays by their address."""

import ast
import math
import os
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest

from lidarium.benchmarks.speed.cases.cached_start import read_only_environment
from lidarium.mapping.kernels import cache_folders, compilation
from lidarium.mapping.kernels.compilation import kernel, use_threads
from lidarium.mapping.kernels.views import scratch_grid, scratch_vector

ROOT = Path(compilation.__file__).resolve().parents[2]
SOURCES = {
    path: path.read_text() for folder in compilation.PACKAGE_FOLDERS for path in sorted((ROOT / folder).rglob("*.py"))
}


@kernel
def odd_sums(values):
    total = 0.0
    for value in values:
        total += value
    return total, math.isnan(values[0] / values[0])


@kernel(nrt=False)
def sum_by_scratch(values):
    twice, rows = scratch_vector(values.shape[0], np.float64), scratch_grid(3, values.shape[0], np.int32)
    for k in range(values.shape[0]):
        twice[k], rows[1, k], rows[2, k] = 2.0 * values[k], 3, k
    total = 0.0
    for k in range(values.shape[0]):
        total += twice[k] * rows[1, k] + rows[2, k]
    return total


@kernel
def sum_often(values, times):
    total = 0.0
    for k in range(times):
        total += sum_by_scratch(values[k % 2 :])
    return total


@kernel(parallel=True)
def doubled(values):
    return values * 2.0


def test_parallel_kernels_run_on_as_many_threads_as_wanted():
    before = numba.get_num_threads()
    use_threads(before)
    assert use_threads(1) == 1
    assert numba.get_num_threads() == 1
    assert use_threads(before) == before
    assert numba.get_num_threads() == before


def test_arithmetic_is_exact_and_in_order():
    values = np.array([1e16, 1.0, -1e16, 1.0, 0.1, 0.2])
    total, is_nan = odd_sums(values)
    expected = 0.0
    for value in values:
        expected += value
    assert total == expected
    assert not is_nan
    assert odd_sums(np.array([np.nan]))[1]


def test_parallel_kernels_compute_the_same():
    assert np.array_equal(doubled(np.arange(100.0)), 2.0 * np.arange(100.0))


def test_the_cache_key_changes_with_kernels_and_what_they_import_and_only_then(tmp_path):
    for folder in compilation.PACKAGE_FOLDERS:
        (tmp_path / folder).mkdir()
    source, constants = tmp_path / "mapping" / "one.py", tmp_path / "envs" / "constants.py"
    source.write_text("from lidarium.envs.constants import A\n\n@kernel\ndef f(x): return x + A\n")
    constants.write_text("A = 1\n")
    (tmp_path / "envs" / "plain.py").write_text("x = 1\n")
    first = compilation._sources_hash(tmp_path)
    (tmp_path / "envs" / "plain.py").write_text("x = 2\n")
    assert compilation._sources_hash(tmp_path) == first
    constants.write_text("A = 2\n")
    second = compilation._sources_hash(tmp_path)
    assert second != first
    source.write_text("@kernel\ndef f(x): return x + 1\n")
    assert compilation._sources_hash(tmp_path) not in (first, second)


def test_a_start_tells_a_first_one_from_later_ones_by_the_cache(tmp_path, monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(compilation, "_CHOSEN_BY_USER", False)
    monkeypatch.setattr(compilation, "_FOLDER", tmp_path)
    assert compilation.is_cache_empty()
    (tmp_path / "parallel" / "mapping").mkdir(parents=True)
    (tmp_path / "parallel" / "mapping" / "one.nbi").touch()
    assert not compilation.is_cache_empty()
    monkeypatch.setattr(compilation, "_FOLDER", None)
    assert not compilation.is_cache_empty()


def test_every_file_whose_constants_or_kernels_a_kernel_uses_is_in_the_cache_key():
    """Numba bakes globals into compiled code: a constant of a file without kernels could change unseen."""
    with_kernels = {path for path, text in SOURCES.items() if "@kernel" in text}
    keyed = set(compilation.key_sources())
    assert len(with_kernels) > 5
    for path in with_kernels:
        tree = ast.parse(SOURCES[path])
        imported = {
            alias.asname or alias.name: ROOT / (node.module.removeprefix("lidarium.").replace(".", "/") + ".py")
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("lidarium.")
            for alias in node.names
        }
        decorated = [
            node
            for node in ast.walk(tree)
            if isinstance(node, ast.FunctionDef)
            and any("kernel" in ast.unparse(decorator) for decorator in node.decorator_list)
        ]
        used = {
            name.id
            for function in decorated
            for part in function.body
            for name in ast.walk(part)
            if isinstance(name, ast.Name)
        }
        for name in used & imported.keys():
            assert imported[name] in keyed, f"{path.name} uses {name} of {imported[name].name} in a kernel"


def test_kernels_are_made_by_the_one_decorator_only():
    for path, text in SOURCES.items():
        if path.name != "compilation.py":
            assert "njit" not in text, path
            assert "@numba" not in text, path
            assert "fastmath" not in text, path


@pytest.mark.parametrize("name", compilation.NUMBA_SETTINGS)
def test_settings_of_numba_that_change_the_code_have_a_cache_of_their_own(monkeypatch, name):
    before = compilation._sources_hash()
    monkeypatch.setattr(numba.core.config, name, 1 - int(getattr(numba.core.config, name) or 0))
    assert compilation._sources_hash() != before


def test_indices_are_checked_where_that_is_asked_for(tmp_path):
    script = tmp_path / "beyond.py"
    script.write_text(
        "import numpy as np\n"
        "from lidarium.mapping.kernels.compilation import kernel\n"
        "from lidarium.mapping.kernels.views import scratch_vector, vector_at\n"
        "@kernel(nrt=False)\n"
        "def beyond(address, place):\n"
        "    scratch = scratch_vector(4, np.float64)\n"
        "    scratch[place % 4] = 1.0\n"
        "    return vector_at(address, 3, np.float64)[place] + scratch[place % 4]\n"
        "values = np.ones(4)\n"
        "print(beyond(values.ctypes.data, 3))\n"
    )
    for asked, ends in (("0", "2.0"), ("1", "IndexError")):
        cache = str(tmp_path / asked)
        environment = {**os.environ, "NUMBA_BOUNDSCHECK": asked, "NUMBA_CACHE_DIR": cache}
        result = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, env=environment)
        assert ends in result.stdout + result.stderr


def test_the_cache_lies_beside_the_sources_and_nowhere_where_nothing_can_be_written(monkeypatch):
    folder = compilation._cache_folder()
    assert folder is not None
    assert folder.name == compilation._sources_hash()
    assert folder.parent.parent == Path(compilation.__file__).resolve().parent / "__pycache__"
    monkeypatch.setattr(cache_folders, "is_writable", lambda folder: False)
    assert compilation._cache_folder() is None


def test_a_cache_folder_that_the_user_chose_is_used(tmp_path):
    script = tmp_path / "one_kernel.py"
    script.write_text(
        "from lidarium.mapping.kernels import compilation\n"
        "@compilation.kernel\n"
        "def one_more(x):\n"
        "    return x + 1\n"
        "print(one_more(1), compilation._CHOSEN_BY_USER)\n"
    )
    chosen = tmp_path / "cache"
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(chosen)}
    result = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, env=environment, check=True)
    assert result.stdout.split() == ["2", "True"]
    assert list(chosen.rglob("*.nbi"))


def test_the_serial_and_the_parallel_form_of_a_function_keep_their_code_apart(tmp_path):
    script = tmp_path / "two_forms.py"
    script.write_text(
        "import numba, numpy as np\n"
        "from lidarium.mapping.kernels import compilation\n"
        "def count(values):\n"
        "    for k in numba.prange(values.size):\n"
        "        values[k] += 1\n"
        "serial, parallel = compilation.kernel(count), compilation.kernel(parallel=True)(count)\n"
        "values = np.zeros(64, np.int64)\n"
        "serial(values)\n"
        "parallel(values)\n"
        "print(values.sum(), sum(serial.stats.cache_hits.values()), "
        "sum(parallel.stats.cache_hits.values()))\n"
    )
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    # The parallel form finds nothing that the serial one has left, and the next program finds both.
    for hits in ("0", "1"):
        result = subprocess.run(
            [sys.executable, str(script)], capture_output=True, text=True, env=environment, check=True
        )
        assert result.stdout.split() == ["128", hits, hits]


def test_kernels_are_compiled_anew_where_nothing_can_be_written(tmp_path):
    script = tmp_path / "one_kernel.py"
    script.write_text(
        "import tempfile\n"
        "def refuse(*args, **kwargs):\n"
        "    raise PermissionError('read-only')\n"
        "tempfile.TemporaryFile = refuse\n"
        "from lidarium.mapping.kernels import compilation\n"
        "@compilation.kernel\n"
        "def one_more(x):\n"
        "    return x + 1\n"
        "print(one_more(1), compilation._CAN_CACHE)\n"
    )
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    result = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, env=environment, check=True)
    assert result.stdout.split() == ["2", "False"]


PLANTED = """
import os
from lidarium.mapping.kernels import compilation
@compilation.kernel
def one_more(x):
    return x + 1
print(one_more(1), compilation._FOLDER, compilation._CAN_CACHE)
"""


@pytest.mark.skipif(
    getattr(os, "geteuid", lambda: 1)() != 0, reason="only the administrator can make folders of other users"
)
def test_nothing_is_loaded_from_a_folder_that_another_user_made_before(tmp_path):
    """Where only the temporary folder is left, and someone else was there first."""
    environment = read_only_environment(tmp_path / "place")
    temporary = Path(environment["TMPDIR"])
    temporary.chmod(0o1777)
    planted = temporary / f"lidarium-{os.geteuid()}"
    planted.mkdir()
    planted.chmod(0o777)
    os.chown(planted, 65534, 65534)
    script = tmp_path / "planted.py"
    script.write_text(PLANTED)
    result = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, env=environment, check=True)
    assert result.stdout.split() == ["2", "None", "False"]
    assert not list(planted.iterdir())
    planted.rmdir()
    result = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, env=environment, check=True)
    assert result.stdout.split()[1].startswith(str(planted / "kernels"))
    assert planted.stat().st_mode & 0o777 == 0o700
    for folder in (each for each in (tmp_path / "place").rglob("*") if each.is_dir()):
        folder.chmod(0o755)


def test_kernels_that_borrow_arrays_leave_their_count_as_it_was():
    values = np.arange(100.0)
    before = sys.getrefcount(values)
    sum_often(values, 100)
    sum_by_scratch(values)
    assert sys.getrefcount(values) == before


@pytest.mark.parametrize(("given", "wanted", "spins"), [(None, "passive", "2000"), ("active", "active", None)])
def test_threads_hardly_spin_where_nobody_has_said_otherwise(given, wanted, spins):
    """OpenMP says what it was given when it is loaded, with the first threads."""
    code = "\n".join(
        [
            "import numba, numpy as np",
            "numba.config.THREADING_LAYER = 'omp'",
            "from lidarium.envs.observing.kernels import write_parallel",
            "from lidarium.mapping.kernels.compilation import use_threads",
            "use_threads(2)",
            "from numba.np.ufunc import omppool",
            "numba.np.ufunc.parallel._launch_threads()",
            "assert numba.threading_layer() == 'omp'",
            f"import os; assert os.environ.get('GOMP_SPINCOUNT') == {spins!r}",
        ]
    )
    ours = ("OMP_WAIT_POLICY", "GOMP_SPINCOUNT")
    environment = {name: value for name, value in os.environ.items() if name not in ours}
    if given is not None:
        environment["OMP_WAIT_POLICY"] = given
    environment["OMP_DISPLAY_ENV"] = "true"
    result = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    if "No module named" in result.stderr or "omppool" in result.stderr:
        pytest.skip("numba has no OpenMP here")
    assert result.returncode == 0, result.stderr
    assert f"OMP_WAIT_POLICY = '{wanted.upper()}'" in result.stderr


def test_threads_that_start_leave_pytorch_as_many_as_it_had():
    pytest.importorskip("torch", reason="PyTorch is not installed")
    program = (
        "import torch; torch.set_num_threads(1); import lidarium\n"
        "from lidarium.mapping.kernels.compilation import use_threads\n"
        "use_threads(2); print(torch.get_num_threads())"
    )
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert found.stdout.split() == ["1"]
