"""What all tests share."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import hypothesis
import pytest

# The first example may have to wait until kernels are compiled. The same tests draw the same examples, so
# that a run of the suite can be repeated; `pytest --hypothesis-profile=search` draws others each time.
hypothesis.settings.register_profile("lidarium", deadline=None, derandomize=True)
hypothesis.settings.register_profile("search", deadline=None)
hypothesis.settings.load_profile("lidarium")

# Tests neither read nor fill the user's store of floors; those of the store name one of their own.
os.environ["LIDARIUM_FLOOR_STORE"] = "off"

# Each process of the suite would begin others that compile kernels.
os.environ["LIDARIUM_FIRST_START"] = "off"

# Processes of the suite share the cores: threads of PyTorch, which wait busily, would take them from each other.
os.environ.setdefault("OMP_NUM_THREADS", "1")


def _data_folder() -> Path:
    return Path(os.environ.get("LIDARIUM_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real maps and floors; the test is skipped where it is absent."""
    folder = _data_folder()
    if not folder.is_dir():
        pytest.skip(f"no real data at {folder}; set LIDARIUM_DATA")
    return folder


@pytest.fixture(scope="session")
def shared_cases() -> Path:
    """Folder of small files of other programs; the test is skipped where it is absent."""
    folder = _data_folder().parent / "cases"
    if not folder.is_dir():
        pytest.skip(f"no files of other programs at {folder}; set LIDARIUM_DATA to a folder beside it")
    return folder


@pytest.fixture(autouse=True)
def handlers_of_signals() -> Iterator[None]:
    """Put back the handlers of Ctrl-C and SIGTERM: a command that was interrupted leaves one that ends the process."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        if signal.getsignal(number) is not handler:
            signal.signal(number, handler)


_FIRST = (
    "test_golden_episodes.py",
    "test_slam.py",
    "test_conformance.py",
    "test_sparse_page.py",
    "test_gallery.py",
    "test_plain_loop.py",
    "test_heavy.py",
    "test_kills.py",
    "test_fuzz.py",
    "test_failing_disk.py",
    "test_determinism.py",
    "test_equality.py",
    "test_frontier.py",
    "test_browser.py",
    "test_study.py",
    "test_policy.py",
    "test_signals.py",
    "test_wrappers.py",
    "test_notebooks.py",
    "test_learning_run.py",
    "test_results.py",
    "test_calls.py",
)
"""Long files. While the first compiles the kernels of environments, other processes run those that need few."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the longest files: each runs in one process, which the others shall not have to wait for."""
    place = {name: k for k, name in enumerate(_FIRST)}
    items.sort(key=lambda item: place.get(item.path.name, len(place)))
