"""`lidarium sparse-map`: make a sparse map of point clouds or depth images."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from tyro.conf import Positional

from lidarium.scripts.common import DONE, DOUBTFUL, Answer, Command, counted, notify, table

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from lidarium.mapping.point_clouds.cameras import Intrinsics
    from lidarium.mapping.sparse.settings import MapperSettings
    from lidarium.mapping.sparse.sparse_map import SparseMap

DEFAULT_MAP = Path("sparse_map") / "map.smap"
SUFFIXES = (".smap", ".txt")


@dataclass(frozen=True, kw_only=True)
class _SparseMapping(Command):
    """Make a sparse map of a cloud, or of frames with their poses.

    Writes the map and pictures of it, from above in the plane and in space.
    """

    compiles: ClassVar[bool] = True

    clouds: Positional[tuple[Path, ...]]
    """PCD, PLY, OBJ, XYZ or NPZ files, or depth images (PNG, PGM); several are frames"""
    poses: tuple[Path, ...] = ()
    """text files of 4 x 4 numbers, the pose of each cloud in the map or in its camera's first frame"""
    intrinsics: str | None = None
    """fx,fy,cx,cy of the camera of depth images [pixels]"""
    scale: float | None = None
    """metres of a unit; 1 by default, 0.001 of depth images"""
    codes: int = 0
    """codes of a cloud; 0 for 1024 of one cloud and 256 of each frame"""
    range: float | None = None
    """points farther from the sensor are left out [m], as depth cameras are noisy far off; none by default"""
    robot_height: float = 1.2
    """points more than 0.3 m higher are left out [m]"""
    levels: bool = False
    """turn the clouds so that their floor is level, for clouds that lean or have another axis upwards"""
    up: str = "0,0,1"
    """direction that is about upwards in the clouds, such as 0,-1,0 in a camera's frame"""
    mode: Literal["default", "thesis"] = "default"
    """boxes of codes, or points split by their heights as in the thesis"""

    @property
    def map_path(self) -> Path:
        """The file of the map."""
        if self.out is None:
            return DEFAULT_MAP
        return self.out if self.out.suffix in SUFFIXES else self.out / "map.smap"


def execute(command: _SparseMapping) -> Answer:
    """Make a map and write it."""
    from lidarium.evaluation.drawing.sparse_picture import save_sparse_pictures
    from lidarium.mapping.files.output import check_writable
    from lidarium.mapping.sparse.map_files import write_sparse_map

    if not command.clouds:
        raise ValueError("no cloud is named; want at least one file")
    if command.poses and len(command.poses) != len(command.clouds):
        raise ValueError(
            f"--poses names {len(command.poses)} files for {len(command.clouds)} clouds; want one for each"
        )
    path = command.map_path
    check_writable(path.parent)
    began = perf_counter()
    told = _Told()
    sparse_map, points = _mapped(command, told)
    seconds = perf_counter() - began
    path.parent.mkdir(parents=True, exist_ok=True)
    write_sparse_map(path, sparse_map)
    pictures = save_sparse_pictures(path, sparse_map.boxes, sparse_map.free)
    result = {
        "map": str(path),
        "clouds": [str(cloud) for cloud in command.clouds],
        "points": points,
        "occupied": len(sparse_map.boxes),
        "free": len(sparse_map.free),
        "bytes": path.stat().st_size,
        "seconds": round(seconds, 3),
        "pictures": pictures,
        "floor": told.floor,
        "offset": told.offset,
        "remarks": told.remarks,
        "probably_wrong": told.is_doubtful,
    }
    for remark in told.remarks:
        notify(remark)
    floor = "{area_m2} m2 with {share:.0%} of the points, up is {up}".format(**told.floor)
    facts = [
        ("map", f"{len(sparse_map.boxes)} boxes, {len(sparse_map.free)} free codes of {points:,} points"),
        ("floor", floor),
        ("size", f"{result['bytes']:,} bytes"),
        ("time", f"{seconds:.2f} s"),
        ("files", ", ".join([str(path), *pictures])),
    ]
    return Answer(result, table(facts), DOUBTFUL if told.is_doubtful else DONE)


@dataclass
class _Told:
    """What is told of clouds beside their map: remarks, offset of the map, its floor, and whether it is doubtful."""

    remarks: list[str] = field(default_factory=list)
    offset: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    floor: dict[str, Any] = field(default_factory=dict)
    is_doubtful: bool = False


def _mapped(command: _SparseMapping, told: _Told) -> "tuple[SparseMap, int]":
    """Return the map of a command's clouds, and how many points they have."""
    from lidarium.mapping.sparse.mapper.full import map_cloud
    from lidarium.mapping.sparse.mapper.incremental import IncrementalMapper

    settings, total = _settings(command), 0
    clouds = _clouds(command, told)
    if len(command.clouds) == 1:
        points, pose = next(clouds)
        return map_cloud(points, command.codes or 1024, settings, pose=pose), len(points)
    mapper = IncrementalMapper(command.codes or 256, settings)
    for points, pose in counted(clouds, len(command.clouds), "clouds", command.json):
        total += len(points)
        mapper.add(points, pose)
    return mapper.map, total


def _settings(command: _SparseMapping) -> "MapperSettings":
    from lidarium.mapping.sparse.settings import FloorSettings, MapperSettings

    x, y, z = numbers_of("--up", command.up, (3,))
    floor = FloorSettings(up_x=x, up_y=y, up_z=z) if not command.levels else FloorSettings()
    return MapperSettings(
        mode=command.mode,
        range_m=command.range,
        robot_height_m=command.robot_height,
        seed=command.seed,
        floor=floor,
    )


def _clouds(command: _SparseMapping, told: _Told) -> "Iterator[tuple[NDArray[np.floating], NDArray[np.float64]]]":
    """Yield the points of each cloud and its pose in the map, whose origin is near the first cloud."""
    import numpy as np

    from lidarium.mapping.point_clouds.cameras import read_pose
    from lidarium.mapping.point_clouds.cloud_files import FAR, read_cloud
    from lidarium.mapping.sparse.floor_plane import find_floor
    from lidarium.mapping.sparse.settings import FloorSettings

    x, y, z = numbers_of("--up", command.up, (3,))
    levelling: NDArray[np.float64] | None = None
    for place, path in enumerate(command.clouds):
        cloud = read_cloud(path, command.scale, _intrinsics(command))
        points = cloud.points
        told.remarks += [f"{path}: {remark}" for remark in cloud.remarks]
        pose = read_pose(command.poses[place]) if command.poses else np.eye(4)
        pose[:3, 3] += pose[:3, :3] @ cloud.offset
        if place == 0 and np.abs(pose[:3, 3]).max() > FAR:
            told.offset = (np.rint(pose[:3, 3] / 100.0) * 100.0).tolist()
            if command.poses:
                told.remarks.append(f"the map's origin is at {', '.join(f'{value:,.0f}' for value in told.offset)}")
        pose[:3, 3] -= told.offset
        if place == 0:
            _check_floor(command, points @ pose[:3, :3].T + pose[:3, 3], (x, y, z), told)
        if command.levels and levelling is None:
            in_first = points @ pose[:3, :3].T + pose[:3, 3]
            floor = find_floor(in_first, FloorSettings(up_x=x, up_y=y, up_z=z), command.seed)
            levelling = floor.levelling()
        yield points, pose if levelling is None else levelling @ pose


def _check_floor(
    command: _SparseMapping, points: "NDArray[np.floating]", up: tuple[float, float, float], told: _Told
) -> None:
    """Tell which floor the first cloud has; of one of several frames it may be small."""
    from lidarium.mapping.sparse.up_axis import check_up

    found = check_up(points, up, command.seed)
    told.floor = {
        "up": command.up,
        "area_m2": round(found.area_m2, 1),
        "share": round(found.share, 3),
        "normal": None if found.plane is None else found.plane.normal.round(4).tolist(),
        "offset": None if found.plane is None else round(found.plane.offset, 3),
    }
    if found.doubt and not (command.levels and len(command.clouds) > 1):
        told.remarks.append(f"{command.clouds[0]}: the map is probably wrong: {found.doubt}")
        told.is_doubtful = True


def _intrinsics(command: _SparseMapping) -> "Intrinsics | None":
    from lidarium.mapping.point_clouds.cameras import Intrinsics

    return None if command.intrinsics is None else Intrinsics(*numbers_of("--intrinsics", command.intrinsics, (4,)))


def numbers_of(name: str, text: str, counts: tuple[int, ...]) -> list[float]:
    """Return the numbers of an option, separated by commas."""
    import math

    try:
        numbers: list[Any] = [float(number) for number in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in counts or not all(map(math.isfinite, numbers)):
        wanted = " or ".join(map(str, counts))
        raise ValueError(f"{name} is {text!r}; want {wanted} finite numbers separated by commas")
    return numbers
