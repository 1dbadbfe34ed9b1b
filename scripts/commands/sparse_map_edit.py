"""`lidarium sparse-map edit`: add and remove boxes of a sparse map, or join maps."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from tyro.conf import Positional, UseAppendAction

from lidarium.scripts.commands.sparse_map import SUFFIXES, numbers_of
from lidarium.scripts.common import Answer, Command, check_output, table

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from lidarium.mapping.sparse.sparse_map import SparseMap

DEFAULT_MAP = Path("sparse_map") / "edited.smap"


@dataclass(frozen=True, kw_only=True)
class _EditSparseMap(Command):
    """Edit a sparse map: clear boxes, add boxes, join another map.

    Boxes are cleared first, then others added, then the other map is joined. Writes the map and its pictures.
    """

    compiles: ClassVar[bool] = True

    map: Positional[Path]
    """the map, as `lidarium sparse-map` writes it; it is not changed"""
    remove: UseAppendAction[tuple[str, ...]] = ()
    """x,y,z,x,y,z: low and high corner of a space to clear [m]; may be given again"""
    add: UseAppendAction[tuple[str, ...]] = ()
    """x,y,z,x,y,z: low and high corner of another obstacle [m]; may be given again"""
    join: Path | None = None
    """another map, which is joined to this one"""
    at: str = "0,0,0"
    """x,y,yaw or x,y,z,yaw: origin of the other map in this one [m, rad]"""

    @property
    def map_path(self) -> Path:
        """The file of the edited map."""
        if self.out is None:
            return DEFAULT_MAP
        return self.out if self.out.suffix in SUFFIXES else self.out / "edited.smap"


def execute(command: _EditSparseMap) -> Answer:
    """Edit a map and write the new one."""
    from lidarium.evaluation.drawing.sparse_picture import picture_paths, save_sparse_pictures
    from lidarium.mapping.sparse.editing import edited, join_maps
    from lidarium.mapping.sparse.map_files import read_sparse_map, write_sparse_map

    if not (command.remove or command.add or command.join):
        raise ValueError("nothing is to be edited; want --add, --remove or --join")
    if command.join is None:
        command.refuse("no map is joined", "at")
    path = command.map_path
    files = [each.name for each in (path, *picture_paths(path))]
    check_output(path.parent, files, (command.map, command.join))
    remove, add, motion = (
        _boxes("--remove", command.remove),
        _boxes("--add", command.add),
        _motion(command.at),
    )
    before, _ = read_sparse_map(command.map)
    found: SparseMap = edited(before, add, remove)
    if command.join is not None:
        other, _ = read_sparse_map(command.join)
        found = join_maps(found, other, motion)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_sparse_map(path, found)
    pictures = save_sparse_pictures(path, found.boxes, found.free)
    result = {
        "map": str(path),
        "occupied": len(found.boxes),
        "free": len(found.free),
        "before": {"occupied": len(before.boxes), "free": len(before.free)},
        "bytes": path.stat().st_size,
        "pictures": pictures,
    }
    facts = [
        ("map", f"{len(found.boxes)} boxes, {len(found.free)} free codes"),
        ("before", f"{len(before.boxes)} boxes, {len(before.free)} free codes"),
        ("files", ", ".join([str(path), *pictures])),
    ]
    return Answer(result, table(facts))


def _boxes(name: str, texts: tuple[str, ...]) -> "NDArray[np.float64]":
    import numpy as np

    return np.array([numbers_of(name, text, (6,)) for text in texts], np.float64).reshape(-1, 2, 3)


def _motion(text: str) -> "NDArray[np.float64]":
    """Return the rigid motion of x, y, yaw or x, y, z, yaw, (4, 4)."""
    from lidarium.mapping.geometry.rigid import Transform
    from lidarium.mapping.point_clouds.cameras import map_from_base

    numbers = numbers_of("--at", text, (3, 4))
    height = numbers[2] if len(numbers) == 4 else 0.0
    return map_from_base(Transform(numbers[0], numbers[1], numbers[-1]), height)
