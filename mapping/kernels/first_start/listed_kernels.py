"""Kernels as lists name them: by their place, and the types of their arguments."""

import importlib
from typing import Any

Entry = dict[str, Any]
"""A kernel: ``name`` as ``module:name``, and ``signature``, a list of encoded types."""


def compile_kernel(entry: Entry) -> None:
    """Compile a kernel for the types of its arguments; keep it in the cache.

    Raises
    ------
    ValueError, AttributeError, ImportError
        Where there is no such kernel or type.
    """
    module, name = entry["name"].split(":")
    compiled = getattr(importlib.import_module(module), name)
    compiled.compile(tuple(decode_type(each) for each in entry["signature"]))


def _numba_types() -> Any:  # noqa: ANN401
    """Return numba's module of types, which has no hints."""
    from numba.core import types

    return types


def encode_type(kind: Any) -> Any:  # noqa: ANN401
    """Return the type of a kernel's argument as strings, lists and dicts.

    Scalars are their names; arrays ``dtype:dimensions+layout``, with ``:readonly`` where they are; tuples
    lists; named tuples ``{"class": "module:name", "of": list}``.

    Raises
    ------
    ValueError
        Where the type is none of these.
    """
    types = _numba_types()
    if isinstance(kind, types.Array):
        return f"{kind.dtype}:{kind.ndim}{kind.layout}" + ("" if kind.mutable else ":readonly")
    if isinstance(kind, types.BaseNamedTuple):
        made = kind.instance_class
        return {
            "class": f"{made.__module__}:{made.__qualname__}",
            "of": [encode_type(each) for each in kind.types],
        }
    if isinstance(kind, types.BaseTuple):
        return [encode_type(each) for each in kind.types]
    if isinstance(kind, types.Number | types.Boolean):
        return str(kind)
    raise ValueError(f"the type {kind!r} of a kernel's argument cannot be written; want numbers or arrays")


def decode_type(text: Any) -> Any:  # noqa: ANN401
    """Return the type that ``encode_type`` wrote."""
    types = _numba_types()
    if isinstance(text, dict):
        module, name = text["class"].split(":")
        made = getattr(importlib.import_module(module), name)
        return types.BaseTuple.from_types([decode_type(each) for each in text["of"]], made)
    if isinstance(text, list):
        return types.BaseTuple.from_types([decode_type(each) for each in text])
    dtype, *shape = text.split(":")
    scalar = {"bool": types.boolean}.get(dtype) or getattr(types, dtype)
    if not shape:
        return scalar
    return types.Array(scalar, int(shape[0][:-1]), shape[0][-1], readonly=shape[1:] == ["readonly"])
