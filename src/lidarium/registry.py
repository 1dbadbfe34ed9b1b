"""Registries: what can be chosen by name, each with a summary.

A registry is a mapping from names to items. An item may be registered as ``"module:attribute"``; its module
is imported when the item is first asked for, so a name costs nothing until it is used.
"""

import difflib
import os
import reprlib
import sys
import warnings
from collections.abc import Iterable, Iterator, Mapping
from importlib import import_module
from typing import Any, Generic, TypeVar, cast

T = TypeVar("T")

REGISTRIES: dict[str, str] = {
    "policy": "lidarium.agents.catalogue:POLICIES",
    "robot": "lidarium.envs.settings.robots:ROBOTS",
    "lidar": "lidarium.envs.settings.lidar:LIDARS",
    "camera": "lidarium.envs.settings.cameras:CAMERAS",
    "observable": "lidarium.envs.settings.observables:SENSED",
    "noise": "lidarium.envs.settings.lidar:NOISE",
    "odometry": "lidarium.envs.settings.odometry:ODOMETRY",
    "radio": "lidarium.envs.settings.radio:RADIO",
    "battery": "lidarium.envs.settings.battery:BATTERIES",
    "realism": "lidarium.envs.settings.making:REALISM",
    "level": "lidarium.envs.levels:LEVELS",
    "localizer": "lidarium.mapping.localization.registry:LOCALIZERS",
    "predictor": "lidarium.mapping.prediction.predictors:PREDICTORS",
    "floor_format": "lidarium.envs.floors.importers:FORMATS",
    "study": "lidarium.benchmarks.studies:STUDIES",
    "reward_term": "lidarium.envs.engine.reward_terms:REWARD_TERMS",
    "backend": "lidarium.envs.simulation.backends:BACKENDS",
    "metric": "lidarium.evaluation.episodes.result:METRICS",
    "film": "lidarium.evaluation.drawing.films:FILMS",
    "command": "lidarium.scripts.commands:COMMANDS",
}
"""All registries by kind, and where each is."""


class Registry(Mapping[str, T], Generic[T]):
    """Items of one kind by name.

    Parameters
    ----------
    kind : str
        What the items are, for messages: ``policy``.
    """

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self._items: dict[str, T | str] = {}
        self._summaries: dict[str, str] = {}
        self._own: set[str] = set()

    def register(self, name: str, item: T | str, summary: str) -> None:
        """Add an item.

        Parameters
        ----------
        name : str
            Name of the item.
        item : T or str
            The item, or ``"module:attribute"`` that is imported when it is first asked for.
        summary : str
            One line that describes it.

        Warns
        -----
        UserWarning
            If a user's item of this name is replaced, as by a cell of a notebook that is run again.

        Raises
        ------
        ValueError
            If the package has an item of this name.
        """
        is_own = not _is_package_loading()
        if name in self._items:
            if not (is_own and name in self._own):
                raise ValueError(f"{self.kind} {name!r} is registered already; choose another name")
            warnings.warn(f"{self.kind} {name!r} was registered before and is replaced", UserWarning, stacklevel=3)
        if is_own:
            self._own.add(name)
        self._items[name] = item
        self._summaries[name] = summary

    def unregister(self, name: str) -> None:
        """Remove an item; its name is free again.

        Raises
        ------
        ValueError
            If the name is unknown.
        """
        self._check(name)
        del self._items[name], self._summaries[name]
        self._own.discard(name)

    def __getitem__(self, name: str) -> T:
        """Return an item.

        Raises
        ------
        UnknownNameError
            If the name is unknown; the message suggests the nearest one.
        """
        self._check(name)
        item = self._items[name]
        if isinstance(item, str):
            module, _, attribute = item.partition(":")
            item = cast(T, getattr(import_module(module), attribute))
            self._items[name] = item
        return item

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self._items

    def __iter__(self) -> Iterator[str]:
        return iter(self._items)

    def __len__(self) -> int:
        return len(self._items)

    @property
    def summaries(self) -> dict[str, str]:
        """What each name stands for, in one line."""
        return dict(self._summaries)

    def _check(self, name: str) -> None:
        if not isinstance(name, str) or name not in self._items:
            raise UnknownNameError(unknown(self.kind, name, self._items))


def _is_package_loading() -> bool:
    """Whether a module of the package that is being imported calls, not a user through a function of the package."""
    frame = sys._getframe(2)
    while frame is not None and str(frame.f_globals.get("__name__", "")).partition(".")[0] == "lidarium":
        if frame.f_code.co_name == "<module>":
            return True
        frame = frame.f_back  # type: ignore[assignment]
    return False


class UnknownNameError(KeyError, ValueError):
    """A name that a registry does not have."""

    def __str__(self) -> str:
        return str(self.args[0])


def unknown(kind: str, name: object, known: Iterable[str], most: int | None = None) -> str:
    """Return the message for an unknown name: the nearest known one, and all of them.

    With ``most`` as many as fit into that many characters.
    """
    names = list(known)
    listed = names
    while most is not None and len(", ".join(listed)) > most:
        listed = listed[:-1]
    left = f" and {len(names) - len(listed)} more" if len(listed) < len(names) else ""
    near = difflib.get_close_matches(_shown(name)[:100], names, n=1, cutoff=0.3)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    return f"unknown {kind} {_shown(name)}{hint} (known: {', '.join(listed) or 'none'}{left})"


def _shown(name: object) -> str:
    """Return a name as it was given, never longer than a line."""
    text = repr(name) if isinstance(name, str) else reprlib.repr(name)
    return text if len(text) <= 100 else f"{text[:100]}..."


def registry(kind: str) -> Registry[Any]:
    """Return the registry of a kind, such as ``policy`` or ``robot``: a mapping from names to items.

    Use ``register(name, item, summary)`` of the registry to add an item.

    Parameters
    ----------
    kind : str
        Kind of the items; docs/architecture.md lists them.

    Raises
    ------
    ValueError
        If the kind is unknown.

    Examples
    --------
    >>> import lidarium
    >>> "kobuki" in lidarium.registry("robot")
    True
    """
    if kind not in REGISTRIES:
        raise ValueError(unknown("registry", kind, REGISTRIES))
    module, _, attribute = REGISTRIES[kind].partition(":")
    return cast("Registry[Any]", getattr(import_module(module), attribute))


IMPORTS_VARIABLE = "LIDARIUM_IMPORT"
"""Environment variable that names modules of the user's, separated by commas; workers import them, too."""


def import_own(names: Iterable[str] = ()) -> None:
    """Import modules that register parts of the user's: those named here, and those in ``LIDARIUM_IMPORT``.

    They are installed, or in the current folder. Processes started from here import them, too. A ValueError
    if one cannot be imported.
    """
    named = [name for name in os.environ.get(IMPORTS_VARIABLE, "").split(",") if name]
    wanted = list(dict.fromkeys([*named, *names]))
    here = os.getcwd() if wanted else ""
    if wanted and here not in sys.path and "" not in sys.path:
        sys.path.append(here)
    for name in wanted:
        try:
            import_module(name)
        except ImportError as error:
            raise ValueError(
                f"module {name!r} cannot be imported ({error}); want a module that is installed or in {here}"
            ) from error
    if wanted:
        os.environ[IMPORTS_VARIABLE] = ",".join(wanted)
