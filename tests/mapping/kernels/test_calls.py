"""Calls between kernels: in parallel loops, and with the caller or the callee loaded from the cache."""

import os
import subprocess
import sys
import textwrap

import numba
import numpy as np
import pytest

from lidarium.mapping.kernels.compilation import IS_INTERPRETED, Array, kernel
from lidarium.mapping.kernels.work_queue import Work, new_work, share_of, take_next


@kernel
def _square(values: Array, out: Array, work: Work) -> None:
    """Square the items of the work, and note the thread that did."""
    for thread in range(work.first, work.first + work.threads):
        k = take_next(work.taken)
        while k < len(work.items):
            item = work.items[k]
            out[item, 0], out[item, 1] = values[item] ** 2, thread
            k = take_next(work.taken)


@kernel(parallel=True)
def _square_on_threads(values: Array, out: Array, work: Work) -> None:
    for thread in numba.prange(work.threads):
        _square(values, out, share_of(work, thread))


@pytest.mark.parametrize("is_writeable", [True, False])
def test_a_parallel_loop_works_off_all_items_whatever_the_types_of_arguments(is_writeable):
    values, out = np.arange(50.0), np.full((50, 2), -1.0)
    values.flags.writeable = is_writeable  # another type to numba, and so other code
    _square_on_threads(values, out, new_work(np.arange(50), 3))
    assert np.array_equal(out[:, 0], values**2)
    assert set(out[:, 1]) <= {0.0, 1.0, 2.0}
    serial = np.empty_like(out)
    _square(values, serial, new_work(np.arange(50), 1))
    assert np.array_equal(serial[:, 0], out[:, 0])
    assert not serial[:, 1].any()


SOURCE = """
    from lidarium.mapping.kernels.compilation import kernel

    @kernel
    def inner(value): return 2.0 * value

    @kernel
    def middle(value): return inner(value) + 1.0

    @kernel
    def outer(value): return middle(value) + 1.0
"""

PROGRAM = """
    import sys
    from lidarium.mapping.kernels import compilation

    compilation.LONGEST_LINKED = int(sys.argv[2])
    import sources

    called = getattr(sources, sys.argv[1])
    print(called(20.0), len(called.stats.cache_hits))
"""


@pytest.fixture
def run(tmp_path):
    """Call a kernel in a new process; return its result, and whether it was loaded from the cache."""
    (tmp_path / "sources.py").write_text(textwrap.dedent(SOURCE))
    (tmp_path / "program.py").write_text(textwrap.dedent(PROGRAM))

    def call(name, longest_linked):
        done = subprocess.run(
            [sys.executable, str(tmp_path / "program.py"), name, str(longest_linked)],
            env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")},
            capture_output=True,
            text=True,
            check=True,
        )
        result, hits = done.stdout.split()
        return float(result), bool(int(hits))

    return call


@pytest.mark.skipif(IS_INTERPRETED, reason="Python runs the kernels")
@pytest.mark.parametrize("longest_linked", [0, 10**9])
def test_a_cached_caller_finds_a_kernel_whose_own_code_was_lost(run, tmp_path, longest_linked):
    assert run("outer", longest_linked) == (42.0, False)
    assert run("outer", longest_linked) == (42.0, True)
    lost = [path for path in (tmp_path / "cache").rglob("*") if path.is_file() and "inner" in path.name]
    assert lost
    for path in lost:
        path.unlink()
    assert run("outer", longest_linked) == (42.0, True)


@pytest.mark.skipif(IS_INTERPRETED, reason="Python runs the kernels")
@pytest.mark.parametrize("of_middle", [0, 10**9])
@pytest.mark.parametrize("of_outer", [0, 10**9])
def test_a_cached_caller_finds_what_a_kernel_calls_that_was_in_the_cache_before(run, of_middle, of_outer):
    assert run("middle", of_middle) == (41.0, False)
    assert run("outer", of_outer) == (42.0, False)
    assert run("outer", of_outer) == (42.0, True)


@pytest.mark.skipif(IS_INTERPRETED, reason="Python runs the kernels")
def test_damaged_bitcode_of_a_cached_kernel_is_told_to_whoever_links_it(run, tmp_path):
    assert run("inner", 10**9) == (40.0, False)
    (code,) = (path for path in (tmp_path / "cache").rglob("*.nbc") if "inner" in path.name)
    magic = b"BC\xc0\xde"  # LLVM, "LLVM Bitcode File Format": the first four bytes
    assert magic in code.read_bytes()
    code.write_bytes(code.read_bytes().replace(magic, bytes(4)))
    assert run("inner", 10**9) == (40.0, True)
    with pytest.raises(subprocess.CalledProcessError) as ended:
        run("middle", 10**9)
    assert "is damaged" in ended.value.stderr
    assert f"{tmp_path / 'cache'}" in ended.value.stderr
    assert "delete the folder" in ended.value.stderr
