"""Episodes distributed to the machines of a Ray cluster, with results as they become ready.

A task with a lost worker or machine is repeated elsewhere; its result arrives once.
"""

import atexit
import logging
import os
import signal
import socket
import tempfile
import threading
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing, contextmanager
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

import lidarium
from lidarium.evaluation.processes import CLEANUP_IS_UNSAFE
from lidarium.evaluation.suites.suite import Suite
from lidarium.evaluation.suites.trial import Trial
from lidarium.evaluation.suites.trial_run import run_trial, write_record_bytes
from lidarium.extras import install_command
from lidarium.registry import IMPORTS_VARIABLE, import_own

Task = TypeVar("Task")
Result = TypeVar("Result")

ANSWERS_S = 10.0
"""A cluster answers within this [s]."""

WAITING_PER_CORE = 2
"""Tasks that are handed over for each core, so that none waits."""

POLL_S = 0.5
"""Wall time after which an interrupt is acted on at the latest [s]."""

LOST_S = 20.0
"""A cluster whose head has not answered for this long is lost [s]. Ray itself ends the process after 60 s."""


class ClusterLostError(ConnectionError):
    """Raised if the head of a Ray cluster no longer answers."""


def on_ray(
    work: Callable[[Task], Result], tasks: Iterable[Task], address: str
) -> Generator[tuple[Task, Result | Exception], None, None]:
    """Do tasks on a Ray cluster; yield each with its result when ready."""
    ray = _connected(address)
    head = _Head(ray.get_runtime_context().gcs_address)
    try:
        # Lost workers and machines are no fault of a task: it is tried until it has an end.
        remote = ray.remote(max_retries=-1, num_cpus=1)(_done)
        window = WAITING_PER_CORE * max(int(ray.cluster_resources().get("CPU", 1)), 1)
        pending = iter(tasks)
        version, imports = lidarium.__version__, os.environ.get(IMPORTS_VARIABLE, "")
        running = {remote.remote(work, task, version, imports): task for task in islice(pending, window)}
        while running:
            head.check()
            for ready in ray.wait(list(running), num_returns=1, timeout=POLL_S)[0]:
                task = running.pop(ready)
                result = _result(ray, ready)
                if isinstance(result, OtherVersionError):
                    raise ValueError(str(result))
                yield task, result
                for following in islice(pending, 1):
                    running[remote.remote(work, following, version, imports)] = following
    finally:
        if head.is_lost:
            # Ray's own way out waits for the head, and crashes.
            atexit.unregister(ray.shutdown)
            CLEANUP_IS_UNSAFE.set()
        else:
            ray.shutdown()


class _Head:
    """The head of a cluster, and since when it does not answer."""

    def __init__(self, address: str) -> None:
        self._address = address
        self._answered_s = self._asked_s = time.monotonic()
        self.is_lost = False

    def check(self) -> None:
        """Ask the head, every few seconds, whether it is there."""
        now = time.monotonic()
        if now - self._asked_s < LOST_S / 5.0:
            return
        host, _, port = self._address.rpartition(":")
        try:
            socket.create_connection((host.strip("[]"), int(port)), LOST_S / 5.0).close()
            self._answered_s = now
        except OSError as error:
            self.is_lost = now - self._answered_s >= LOST_S
            if self.is_lost:
                raise ClusterLostError(
                    f"the head of the Ray cluster at {self._address} has not answered for {LOST_S:g} s ({error}); "
                    "finished episodes are kept: start the cluster again, and the same command goes on after them"
                ) from error
        self._asked_s = time.monotonic()


class OtherVersionError(RuntimeError):
    """Raised if a machine of a cluster has another version."""


def _connected(address: str) -> Any:  # noqa: ANN401
    """Return the module ``ray``, connected to a cluster."""
    try:
        import ray
    except ModuleNotFoundError as error:
        raise ValueError(f"a Ray cluster needs Ray: {install_command('ray')}") from error
    if address != "auto":
        host, colon, port = address.rpartition(":")
        if not (colon and host and port.isascii() and port.isdigit() and 0 < int(port) < 65536):
            raise ValueError(f"the Ray cluster is {address!r}; want auto or HOST:PORT, such as 10.0.0.1:6379")
        try:
            socket.create_connection((host.strip("[]"), int(port)), ANSWERS_S).close()
        except OSError as error:
            raise ValueError(
                f"no Ray cluster answers at {address} within {ANSWERS_S:g} s ({error}); start one there with "
                "`ray start --head`"
            ) from error
    try:
        with _handlers_kept():
            ray.init(address=address, logging_level=logging.ERROR, log_to_driver=False)
    except (ConnectionError, RuntimeError, ValueError) as error:
        raise ValueError(
            f"there is no Ray cluster at {address} ({str(error).splitlines()[0]}); start one with `ray start --head`"
        ) from error
    return ray


@contextmanager
def _handlers_kept() -> Iterator[None]:
    """Keep the handler of SIGTERM, which Ray replaces."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    kept = signal.getsignal(signal.SIGTERM)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, kept)


def _done(work: Callable[[Task], Result], task: Task, version: str, imports: str) -> Result:
    """Do a task on a machine of the cluster, if it has the same version."""
    if lidarium.__version__ != version:
        raise OtherVersionError(
            f"machine {socket.gethostname()} of the cluster has lidarium {lidarium.__version__}, this is "
            f"{version}; install the same on all"
        )
    import_own(name for name in imports.split(",") if name)
    return work(task)


def _result(ray: Any, ready: Any) -> Any:  # noqa: ANN401
    """Return the result of a task, or its exception."""
    try:
        return ray.get(ready)
    except ray.exceptions.RayTaskError as error:
        return error.cause if isinstance(error.cause, Exception) else error
    except ray.exceptions.RayError as error:
        return error


class _Recorded:
    """A trial's line, and its record as bytes."""

    def __init__(self, suite: Suite, keeps_records: bool) -> None:
        self._suite, self._keeps_records = suite, keeps_records

    def __call__(self, trial: Trial) -> tuple[dict[str, Any], bytes | None]:
        """Run a trial; its record is made in a temporary folder of this machine."""
        if not self._keeps_records:
            return run_trial(self._suite, trial), None
        with tempfile.TemporaryDirectory() as folder:
            line = run_trial(self._suite, trial, Path(folder))
            record = Path(folder) / f"{trial.file_name}.npz"
            return line, record.read_bytes() if line["record"] else None


def trials_on_ray(
    suite: Suite, trials: Iterable[Trial], records: Path | None, address: str
) -> Generator[tuple[Trial, dict[str, Any] | Exception], None, None]:
    """Run trials on a Ray cluster; yield each with its line when its record is written here."""
    with closing(on_ray(_Recorded(suite, records is not None), trials, address)) as work:
        for trial, result in work:
            if isinstance(result, Exception):
                yield trial, result
                continue
            line, record = result
            if records is not None and record is not None:
                try:
                    write_record_bytes(records / f"{trial.file_name}.npz", record)
                except OSError as error:
                    yield trial, error
                    continue
            yield trial, line
