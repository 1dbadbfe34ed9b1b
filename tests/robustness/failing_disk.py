"""A disk on which the n-th operation below a folder fails: write, fsync, rename or mkdir.

The functions of ``os`` and the files of ``open`` are replaced, in this process and for a while. What
libraries write in C past ``open`` is not seen.
"""

import builtins
import errno
import io
import os
from contextlib import contextmanager
from pathlib import Path

OPERATIONS = ("write", "fsync", "rename", "mkdir")


class FailingDisk:
    """Counts operations below a folder, and lets one of them fail.

    Parameters
    ----------
    folder : Path
        Operations elsewhere are neither counted nor failed.
    failing : int or None
        Number of the operation that fails, from 1 on; none where None.
    number : int
        Error that it fails with.
    """

    def __init__(self, folder, failing=None, number=errno.ENOSPC):
        self.folder, self.failing, self.number = f"{os.path.realpath(folder)}{os.sep}", failing, number
        self.operations = []
        self.real = {name: getattr(os, name) for name in (*OPERATIONS, "replace", "open")}
        self.real_open = io.open

    @property
    def count(self):
        return len(self.operations)

    def is_below(self, place):
        if isinstance(place, int):
            try:
                place = os.readlink(f"/proc/self/fd/{place}")
            except OSError:
                return False
        return f"{os.path.abspath(os.fspath(place))}{os.sep}".startswith(self.folder)

    def happen(self, operation, place):
        """Count an operation; fail where it is the one."""
        if self.is_below(place):
            self.operations.append(operation)
            if self.count == self.failing:
                raise OSError(self.number, os.strerror(self.number), str(place))

    def write(self, handle, content):
        self.happen("write", handle)
        return self.real["write"](handle, content)

    def fsync(self, handle):
        self.happen("fsync", handle)
        return self.real["fsync"](handle)

    def rename(self, before, after, **more):
        self.happen("rename", after)
        return self.real["rename"](before, after, **more)

    def replace(self, before, after, **more):
        self.happen("rename", after)
        return self.real["replace"](before, after, **more)

    def mkdir(self, path, *more, **named):
        self.happen("mkdir", path)
        return self.real["mkdir"](path, *more, **named)

    def open(self, file, mode="r", buffering=-1, encoding=None, errors=None, newline=None, *more, **named):
        """Open as ``open`` does; files below the folder that are written count what they write."""
        if not set(mode) & set("wax+") or not self.is_below(file):
            return self.real_open(file, mode, buffering, encoding, errors, newline, *more, **named)
        raw = _File(self, file, mode.replace("b", "").replace("t", ""), *more, **named)
        buffered = io.BufferedRandom(raw) if "+" in mode else io.BufferedWriter(raw)
        return buffered if "b" in mode else io.TextIOWrapper(buffered, encoding, errors, newline)


class _File(io.FileIO):
    """A file that asks a disk before it writes."""

    def __init__(self, disk, *place, **named):
        self._disk, self._place = disk, place[0]
        super().__init__(*place, **named)

    def write(self, content):
        self._disk.happen("write", self._place)
        return super().write(content)


@contextmanager
def failing_disk(folder, failing=None, number=errno.ENOSPC):
    """Lend a disk whose ``failing``-th operation below a folder fails."""
    disk = FailingDisk(Path(folder), failing, number)
    replaced = [(os, name, getattr(disk, name)) for name in (*OPERATIONS, "replace")]
    replaced += [(module, "open", disk.open) for module in (io, builtins)]
    before = [(module, name, getattr(module, name)) for module, name, _ in replaced]
    for module, name, function in replaced:
        setattr(module, name, function)
    try:
        yield disk
    finally:
        for module, name, function in before:
            setattr(module, name, function)
