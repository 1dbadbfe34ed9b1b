"""Logs of laser scans in any of the formats that can be read."""

from pathlib import Path

from lidarium.mapping.files.bags.reading import is_bag, read_bag_log
from lidarium.mapping.files.carmen_logs import read_carmen_log
from lidarium.mapping.files.laser_logs import LaserLog
from lidarium.mapping.files.mines_logs import read_mines_log
from lidarium.mapping.files.npz_logs import read_npz_log


def read_log(path: Path | str, topic: str | None = None, field_of_view: float | None = None) -> LaserLog:
    """Read a log of laser scans: a CARMEN log, an npz file, a bag of ROS 1 or 2, or a log of Mines ParisTech.

    Use it with `run_slam`. Scans without a usable stamp and odometry without information are left out;
    ``skipped`` of the log counts what was left out, by reason.

    Parameters
    ----------
    path : Path or str
        A CARMEN log (``.log``, ``.clf``, also ``.gz``), an ``.npz`` file, or a bag (``.bag``, ``.mcap``,
        ``.db3``, or a folder of these), or a log of Mines ParisTech (``.dat``, also ``.gz``). Bags need the extra
        ``bags``.
    topic : str, optional
        Topic of the scans if a bag has several.
    field_of_view : float, optional
        Angle between the first and the last beam of FLASER lines [rad]. By default, the parameters of the
        log count, or 180 degrees.

    Returns
    -------
    LaserLog
        ``stamps`` (scans,) [s], ``ranges`` (scans, beams) [m] with inf for no return and nan for an invalid
        beam, ``odometry`` (scans, 3) [m, rad] or None.

    Raises
    ------
    FileNotFoundError
        If the file does not exist.
    ValueError
        If the file is not a log or holds no usable scan, or an option is given for which the format has no use.

    Examples
    --------
    >>> import lidarium, numpy as np, tempfile
    >>> folder = tempfile.mkdtemp()
    >>> np.savez(f"{folder}/log.npz", ranges=np.full((9, 360), 3.0), angle_min=-np.pi,
    ...          angle_increment=np.pi / 180, max_range=10.0)
    >>> lidarium.read_log(f"{folder}/log.npz").ranges.shape
    (9, 360)
    """
    path = Path(path)
    if is_bag(path):
        _refuse(path, "field_of_view", field_of_view, "bags state the directions of beams")
        return read_bag_log(path, topic)
    _refuse(path, "topic", topic, "only bags have topics")
    if path.suffix.lower() == ".npz" or path.name.lower().endswith((".dat", ".dat.gz")):
        _refuse(path, "field_of_view", field_of_view, "its format states the directions of beams")
    if path.suffix.lower() == ".npz":
        return read_npz_log(path)
    if path.name.lower().endswith((".dat", ".dat.gz")):
        return read_mines_log(path)
    return read_carmen_log(path, field_of_view)


def _refuse(path: Path, name: str, value: object, why: str) -> None:
    """Refuse an option that a format has no use for."""
    if value is not None:
        raise ValueError(f"{name} is {value!r} for {path}, but {why}; leave it out")
