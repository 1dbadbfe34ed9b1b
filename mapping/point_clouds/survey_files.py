"""Clouds of surveys by outside packages: LAS and LAZ by laspy, E57 by pye57."""

from pathlib import Path

import numpy as np

from lidarium.extras import install_command
from lidarium.mapping.files.guarded_reading import open_guarded, reading
from lidarium.mapping.point_clouds.columns import Content


def read_las(path: Path) -> Content:
    """Return the points of a LAS or LAZ file, without those that are withheld."""
    try:
        import laspy
    except ImportError as error:
        raise _missing("LAS files", "laspy") from error
    with open_guarded(path), reading(path, "a whole LAS or LAZ file"):
        try:
            found = laspy.read(path)
        except laspy.errors.LaspyException as error:
            raise ValueError(str(error)) from error
        points = np.asarray(found.xyz, np.float64)
        # Class 7 is noise of the sensor.
        is_noise = np.asarray(found.classification) == 7
        if "withheld" in found.point_format.dimension_names:
            is_noise |= np.asarray(found.withheld) == 1
        remarks = (f"{np.count_nonzero(is_noise):,} points of noise are left out",) if is_noise.any() else ()
        return Content(points[~is_noise], remarks=remarks)


def read_e57(path: Path) -> Content:
    """Return the points of all scans of an E57 file, moved by their poses."""
    try:
        import pye57
    except ImportError as error:
        raise _missing("E57 files", "pye57") from error
    with open_guarded(path), reading(path, "a whole E57 file"):
        try:
            file = pye57.E57(str(path))
            scans = [file.read_scan(number, ignore_missing_fields=True) for number in range(file.scan_count)]
        except pye57.libe57.E57Exception as error:
            raise ValueError(str(error)) from error
        parts = [np.stack([scan[f"cartesian{axis}"] for axis in "XYZ"], axis=1) for scan in scans]
        return Content(np.concatenate([np.empty((0, 3)), *parts]))


def _missing(what: str, package: str) -> ValueError:
    return ValueError(f"{what} need the package {package}: {install_command('clouds')}")
