"""Sparse maps as files, in the form that the file's name or its first bytes say."""

from pathlib import Path

from lidarium.mapping.files.guarded_reading import open_guarded
from lidarium.mapping.sparse.files.binary_form import MAGIC, GraphEdges, read_binary, write_binary
from lidarium.mapping.sparse.files.text_form import read_text_map, write_text
from lidarium.mapping.sparse.sparse_map import SparseMap

TEXT_SUFFIX, BINARY_SUFFIX = ".txt", ".smap"


def write_sparse_map(path: Path, sparse_map: SparseMap, graph: GraphEdges | None = None) -> None:
    """Write a map, whole or not at all.

    The thesis's text where the name ends in ``.txt``, the binary form where it ends in ``.smap``.

    Raises
    ------
    ValueError
        Where the name ends otherwise, or a graph is to be kept as text.
    OSError
        Where nothing can be written there.
    """
    if path.suffix == BINARY_SUFFIX:
        write_binary(path, sparse_map, graph)
    elif path.suffix != TEXT_SUFFIX:
        raise ValueError(
            f"{path} is no name for a sparse map; want one that ends in {BINARY_SUFFIX} or {TEXT_SUFFIX}"
        )
    elif graph is not None:
        raise ValueError(f"{path} is a text, which keeps no graph; want a name that ends in {BINARY_SUFFIX}")
    else:
        write_text(path, sparse_map)


def read_sparse_map(path: Path) -> tuple[SparseMap, GraphEdges | None]:
    """Read a map, with the graph where the file has one.

    Raises
    ------
    FileNotFoundError
        Where there is none.
    ValueError
        Where it is no sparse map; the message names the file and says why.
    """
    with open_guarded(path) as file:
        is_binary = file.read(len(MAGIC)) == MAGIC
    return read_binary(path) if is_binary or path.suffix == BINARY_SUFFIX else (read_text_map(path), None)
