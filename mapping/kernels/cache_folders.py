"""Private folders for caches.

Cached files are loaded as code (numba's index files are pickles) or trusted. A folder is therefore used only
if nobody else could have put anything into it: a directory and no link, of this user, that no other user may
write to. The same holds for each folder above that was made for the cache, and the folder that contains them
must keep other users from renaming them.
"""

import os
import stat
import tempfile
from collections.abc import Collection, Iterator
from pathlib import Path

PRIVATE = 0o700
"""Mode of the folders that are made for caches."""

_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH
_HAS_OWNERS = hasattr(os, "geteuid")
_ROOT = 0


def user_cache_folder() -> Path | None:
    """Return the folder for the user's caches, or None if the user has no home."""
    chosen = os.environ.get("XDG_CACHE_HOME", "")
    # The specification of these folders has a relative one ignored: it would be another in every folder.
    if os.path.isabs(chosen):
        return Path(chosen)
    try:
        return Path.home() / ".cache"
    except (RuntimeError, KeyError):  # neither HOME nor an entry of the user in the system's list
        return None


def cache_folder(*names: str, beside: Path | None = None) -> Path | None:
    """Return a private folder for a cache, made if absent, or None.

    It is the first safe and writable one of: next to the source, in the user's cache folder, in the temporary
    folder.
    """
    return next(
        (
            folder
            for base, inner, owners in _candidates(names, beside)
            if (folder := trusted_folder(base, inner, owners)) is not None and is_writable(folder)
        ),
        None,
    )


def trusted_folder(base: Path, names: Collection[str], owners: Collection[int] = ()) -> Path | None:
    """Return a private folder below ``base``, made if absent, or None.

    None if it cannot be made, or if it, or one above it that was made for it, is a link, belongs to another user,
    or is writable for others.
    """
    trusted = {*owners, os.geteuid()} if _HAS_OWNERS else set()
    try:
        base.mkdir(parents=True, exist_ok=True)
        base = base.resolve(strict=True)
        if not _keeps_names(base, trusted):
            return None
        folder = base
        for place, name in enumerate(names, 1):
            folder = folder / name
            if not _is_made_ours(folder, trusted, is_inner=place == len(names)):
                return None
    except (OSError, RuntimeError):  # RuntimeError: links that lead in a circle
        return None
    return folder


def _is_private(status: os.stat_result, trusted: Collection[int]) -> bool:
    """Whether a status is of a directory that only trusted users can write to.

    It was read without following links.
    """
    if not stat.S_ISDIR(status.st_mode):
        return False
    return not _HAS_OWNERS or (status.st_uid in trusted and not status.st_mode & _BY_OTHERS)


def is_writable(folder: Path | None) -> bool:
    """Return whether files can be written to a folder, which is made if absent."""
    if folder is None:
        return False
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _candidates(names: tuple[str, ...], beside: Path | None) -> Iterator[tuple[Path, tuple[str, ...], tuple[int, ...]]]:
    """Yield candidates for the cache: base, folders below, trusted owners."""
    if beside is not None:
        owners = (beside.stat().st_uid,) if _HAS_OWNERS else ()
        yield beside.parent / "__pycache__", names, owners
    if (cache := user_cache_folder()) is not None:
        yield cache, ("lidarium", *names), ()
    try:
        temporary = Path(tempfile.gettempdir())
    except OSError:  # there is none that can be written to
        return
    user = os.geteuid() if _HAS_OWNERS else "user"
    yield temporary, (f"lidarium-{user}", *names), ()


def _keeps_names(base: Path, trusted: Collection[int]) -> bool:
    """Whether nobody else can rename this user's folders in it, nor it or one above it.

    Users who may write to a folder may rename its entries, unless it is sticky, as ``/tmp`` is: there only the
    owners of the folder and of the entry may.
    """
    if not _HAS_OWNERS:
        return True
    modes = [folder.stat().st_mode for folder in (base, *base.parents)]
    is_closed = all(not mode & _BY_OTHERS or mode & stat.S_ISVTX for mode in modes)
    return is_closed and base.stat().st_uid in {*trusted, _ROOT}


def _is_made_ours(folder: Path, trusted: Collection[int], *, is_inner: bool) -> bool:
    """Make a folder if absent, and return whether it is private.

    An outer folder of this user to which others can write, as some masks leave them, is closed to them: they could
    have put only other folders there, and these are checked themselves. The inner one may hold their files, and is
    not used.
    """
    try:
        os.mkdir(folder, PRIVATE)
    except FileExistsError:
        status = os.lstat(folder)
        is_mine = stat.S_ISDIR(status.st_mode) and _HAS_OWNERS and status.st_uid == os.geteuid()
        if is_mine and status.st_mode & _BY_OTHERS and not is_inner:
            os.chmod(folder, stat.S_IMODE(status.st_mode) & ~_BY_OTHERS)
    return _is_private(os.lstat(folder), trusted)
