"""Old names of modules and of what is in them, kept for one release.

A module that has moved can still be imported by its old name, with a ``DeprecationWarning`` that names the
new one. The aliases go with release 0.3.
"""

import warnings
from importlib import import_module
from importlib.abc import Loader
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

from lidarium.moved_places import MOVED, MOVED_NAMES, RENAMED

_ROOT = "lidarium."


class MovedModule(ModuleType):
    """A module by its old name: its attributes are those of the modules that took its place."""

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401
        if name.startswith("__"):
            raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")
        return _found(self.__name__, MOVED[self.__name__.removeprefix(_ROOT)], name)


class MovedModules(Loader):
    """Finds modules by their old names, after all other finders have failed."""

    def find_spec(self, name: str, _path: object = None, _target: object = None) -> ModuleSpec | None:
        """Return the spec of a module that has moved, None for any other."""
        if not name.startswith(_ROOT) or name.removeprefix(_ROOT) not in MOVED:
            return None
        return ModuleSpec(name, self, is_package=True)

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """Return the module by its old name, and warn."""
        places = " and ".join(_ROOT + place for place in MOVED[spec.name.removeprefix(_ROOT)])
        warnings.warn(
            f"{spec.name} has moved to {places}; the old name goes with release 0.3",
            DeprecationWarning,
            stacklevel=2,
        )
        return MovedModule(spec.name)

    def exec_module(self, module: ModuleType) -> None:
        """Do nothing: attributes are looked up when they are asked for."""


def moved_name(module: str, name: str) -> Any:  # noqa: ANN401
    """Return a name that a module had, from where it has gone, and warn; the module's ``__getattr__``.

    Raises
    ------
    AttributeError
        Where the name is nowhere.
    """
    places = MOVED_NAMES[module.removeprefix(_ROOT)]
    renamed = RENAMED.get(module.removeprefix(_ROOT), {}).get(name)
    if name.startswith("_"):
        raise AttributeError(f"module {module!r} has no attribute {name!r}")
    found = _found(module, places, name)
    place = getattr(found, "__module__", None) or " or ".join(_ROOT + place for place in places)
    change = f"has moved to {place}" if renamed is None else f"is now called {renamed}"
    warnings.warn(
        f"{module}.{name} {change}; the old name goes with release 0.3",
        DeprecationWarning,
        stacklevel=3,
    )
    return found


def renamed_method(old: str, new: str) -> Any:  # noqa: ANN401
    """Return a method for the old name of one that is called ``new`` now."""

    def method(self: Any, *arguments: Any, **options: Any) -> Any:  # noqa: ANN401
        warnings.warn(
            f"{type(self).__name__}.{old} is now called {new}; the old name goes with release 0.3",
            DeprecationWarning,
            stacklevel=2,
        )
        return getattr(self, new)(*arguments, **options)

    method.__name__, method.__doc__ = old, f"Call ``{new}``, as this method is called now; it warns."
    return method


def _found(module: str, places: tuple[str, ...], name: str) -> Any:  # noqa: ANN401
    name = RENAMED.get(module.removeprefix(_ROOT), {}).get(name, name)
    for place in places:
        # Not by getattr: a place may itself search a name that it lacks where names have moved.
        found = vars(import_module(_ROOT + place))
        if name in found:
            return found[name]
    raise AttributeError(f"module {module!r} has no attribute {name!r}")
