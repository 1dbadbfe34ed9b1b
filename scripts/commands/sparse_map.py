"""`lidarium sparse-map`: make a sparse map of point clouds or depth images."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from tyro.conf import Positional

from lidarium.scripts.common import DONE, DOUBTFUL, Answer, Command, check_output, counted, notify, table

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from lidarium.mapping.point_clouds.agreement import FrameAgreement
    from lidarium.mapping.point_clouds.cameras import Intrinsics
    from lidarium.mapping.point_clouds.sequences import Sequence
    from lidarium.mapping.sparse.settings import FloorSettings, MapperSettings
    from lidarium.mapping.sparse.sparse_map import SparseMap

DEFAULT_MAP = Path("sparse_map") / "map.smap"
SUFFIXES, DEPTH_IMAGES = (".smap", ".txt"), (".png", ".pgm")


@dataclass(frozen=True, kw_only=True)
class _SparseMapping(Command):
    """Make a sparse map of a cloud, or of frames with their poses.

    Writes the map and pictures of it, from above in the plane and in space.
    """

    compiles: ClassVar[bool] = True

    clouds: Positional[tuple[Path, ...]]
    """files of clouds, or depth images (PNG, PGM); several are frames. Or a folder as of TUM RGB-D or KITTI"""
    poses: tuple[Path, ...] = ()
    """text files of 4 x 4 numbers, the pose of each cloud in the map or in its camera's first frame"""
    world_to_camera: bool = False
    """the poses move points of the map into the frames, as those of COLMAP do"""
    least_motion: float | None = None
    """frames nearer to the one before, and turned by less than 25 degrees, are left out [m]; 0.3 of a folder, else 0"""
    intrinsics: str | None = None
    """fx,fy,cx,cy of the camera of depth images [pixels]"""
    scale: float | None = None
    """metres of a unit; 1 by default, 0.001 of depth images"""
    codes: int = 0
    """codes of a cloud; 0 for 1024 of one cloud and 256 of each frame"""
    range: float | None = None
    """points farther from the sensor are left out [m], as depth cameras are noisy far off; none by default"""
    floor_share: float = 0.03
    """share of the points that the floor has at least; smaller for clouds with little floor"""
    floor_gap: float = 0.1
    """how far from points of the floor it counts as seen between them [m]; more for clouds of few points"""
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
    from lidarium.evaluation.drawing.sparse_picture import picture_paths, save_sparse_pictures
    from lidarium.mapping.sparse.map_files import write_sparse_map

    if not command.clouds:
        raise ValueError("no cloud is named; want at least one file")
    _refuse_idle_options(command)
    path, clouds = command.map_path, command.clouds[0]
    files = [each.name for each in (path, *picture_paths(path))]
    beside = clouds.iterdir() if clouds.is_dir() else ()  # poses, times
    check_output(path.parent, files, (*command.clouds, *command.poses, *beside))
    began = perf_counter()
    told = _Told()
    sparse_map, points = _mapped(command, _frames_of(command, told), told)
    seconds = perf_counter() - began
    path.parent.mkdir(parents=True, exist_ok=True)
    write_sparse_map(path, sparse_map)
    pictures = save_sparse_pictures(path, sparse_map.boxes, sparse_map.free)
    seen = sparse_map.seen_floor
    result = {
        "map": str(path),
        "clouds": [str(cloud) for cloud in command.clouds],
        "points": points,
        "frames": told.frames,
        "agreement": told.agreement,
        "occupied": len(sparse_map.boxes),
        "free": len(sparse_map.free),
        "unlike_points": told.unlike,
        "bytes": path.stat().st_size,
        "seconds": round(seconds, 3),
        "pictures": pictures,
        "floor": told.floor | {"seen_m2": None if seen is None else round(seen.area_m2, 2)},
        "offset": told.offset,
        "remarks": told.remarks,
        "probably_wrong": told.is_doubtful,
    }
    for remark in told.remarks:
        notify(remark)
    agreement = "" if told.agreement is None else f", {told.agreement:.1%} of what they see twice agrees"
    floor = "{area_m2} m2 with {share:.0%} of the points, up is {up}".format(**told.floor)
    facts = [
        ("map", f"{len(sparse_map.boxes)} boxes, {len(sparse_map.free)} free codes of {points:,} points"),
        *([("frames", f"{told.frames['used']} of {told.frames['all']} used{agreement}")] * (told.frames["all"] > 1)),
        ("floor", floor),
        ("size", f"{result['bytes']:,} bytes"),
        ("time", f"{seconds:.2f} s"),
        ("files", ", ".join([str(path), *pictures])),
    ]
    return Answer(result, table(facts), DOUBTFUL if told.is_doubtful else DONE)


def _refuse_idle_options(command: _SparseMapping) -> None:
    """Refuse options that the files have no use for, and a text that would not hold the map."""
    if command.map_path.suffix == ".txt" and command.mode != "thesis":
        raise ValueError(
            f"{command.map_path} is a text, which keeps the centres of boxes alone; want a name that ends in .smap, "
            "or --mode thesis"
        )
    least = command.least_motion
    if least is not None and not 0.0 <= least < float("inf"):
        raise ValueError(f"least-motion is {least}; want zero or more metres")
    is_folder = command.clouds[0].is_dir()
    if len(command.clouds) == 1 and not is_folder:
        command.refuse("a single cloud has no frame before it", "least_motion")
    if not is_folder and not command.poses:
        command.refuse("there are no poses", "world_to_camera")
    if not is_folder and all(path.suffix.lower() not in DEPTH_IMAGES for path in command.clouds):
        command.refuse("there are no depth images", "intrinsics")


@dataclass
class _Told:
    """What is told of clouds beside their map.

    Remarks, offset of the map, its floor, whether it is doubtful, numbers of frames, the share of what frames see twice
    that agrees, and how many points are in no box and boxes far from points.
    """

    remarks: list[str] = field(default_factory=list)
    offset: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    floor: dict[str, Any] = field(default_factory=dict)
    is_doubtful: bool = False
    frames: dict[str, int] = field(default_factory=dict)
    agreement: float | None = None
    unlike: dict[str, int] = field(default_factory=dict)


def _frames_of(command: _SparseMapping, told: _Told) -> "Sequence":
    """Return the files of a command and their poses."""
    import numpy as np

    from lidarium.mapping.geometry.rigid_motions import inverse_of
    from lidarium.mapping.point_clouds.cameras import read_pose
    from lidarium.mapping.point_clouds.sequences import Sequence, read_sequence

    if command.clouds[0].is_dir():
        if len(command.clouds) > 1 or command.poses:
            raise ValueError(f"{command.clouds[0]} is a folder with poses; want it alone, without --poses")
        found = read_sequence(command.clouds[0])
        told.remarks += found.remarks
    else:
        if command.poses and len(command.poses) != len(command.clouds):
            raise ValueError(
                f"--poses names {len(command.poses)} files for {len(command.clouds)} clouds; want one for each"
            )
        poses = np.array([read_pose(path) for path in command.poses] or [np.eye(4)] * len(command.clouds))
        found = Sequence(command.clouds, poses, None)
    return replace(found, poses=inverse_of(found.poses)) if command.world_to_camera else found


def _mapped(command: _SparseMapping, frames: "Sequence", told: _Told) -> "tuple[SparseMap, int]":
    """Return the map of a command's clouds, and how many points they have."""
    from lidarium.mapping.geometry.rigid_motions import moved_points
    from lidarium.mapping.sparse.mapper.fitting import SeenPoints, unlike_points
    from lidarium.mapping.sparse.mapper.frame_coding import usable_points
    from lidarium.mapping.sparse.mapper.full import map_cloud
    from lidarium.mapping.sparse.mapper.incremental import IncrementalMapper

    settings, total, used = _settings(command), 0, 0
    cells = SeenPoints()
    clouds = _clouds(command, frames, told)
    if len(frames.files) == 1:
        points, pose = next(clouds)
        cells.add(moved_points(usable_points(points, settings.range_m), pose))
        found, total, used = map_cloud(points, command.codes or 1024, settings, pose=pose), len(points), 1
    else:
        mapper = IncrementalMapper(command.codes or 256, settings)
        for points, pose in counted(clouds, len(frames.files), "clouds", command.json):
            total, used = total + len(points), used + 1
            mapper.add(points, pose)
            cells.add(moved_points(usable_points(points, settings.range_m), pose))
        found = mapper.map
    told.frames = {"all": len(frames.files), "used": used}
    if settings.mode != "thesis":
        told.unlike = unlike_points(found, cells.middles)
        if any(told.unlike.values()):
            told.remarks.append(
                "the map is probably wrong: {points} cells of points are in no box, and {boxes} boxes are mostly far "
                "from points".format(**told.unlike)
            )
            told.is_doubtful = True
    return found, total


def _settings(command: _SparseMapping) -> "MapperSettings":
    from lidarium.mapping.sparse.settings import FloorSettings, MapperSettings

    x, y, z = numbers_of("--up", command.up, (3,))
    share = command.floor_share
    floor = FloorSettings(least_share=share) if command.levels else _given_floor((x, y, z), share)
    return MapperSettings(
        mode=command.mode,
        range_m=command.range,
        floor_gap_m=command.floor_gap,
        least_motion_m=0.0,
        robot_height_m=command.robot_height,
        seed=command.seed,
        floor=floor,
    )


def _given_floor(up: tuple[float, float, float], share: float) -> "FloorSettings":
    from lidarium.mapping.sparse.settings import FloorSettings

    return FloorSettings(up_x=up[0], up_y=up[1], up_z=up[2], least_share=share)


def _clouds(
    command: _SparseMapping, frames: "Sequence", told: _Told
) -> "Iterator[tuple[NDArray[np.floating], NDArray[np.float64]]]":
    """Yield the points of each cloud and its pose in the map, whose origin is near the first cloud."""
    import numpy as np

    from lidarium.mapping.geometry.rigid_motions import inverse_of
    from lidarium.mapping.point_clouds.agreement import FrameAgreement
    from lidarium.mapping.point_clouds.cloud_files import FAR, read_cloud
    from lidarium.mapping.sparse.floor_plane import find_floor

    x, y, z = numbers_of("--up", command.up, (3,))
    levelling: NDArray[np.float64] | None = None
    own, inverse = FrameAgreement(), FrameAgreement()
    focal = {factor: FrameAgreement(1.0 / factor) for factor in FOCAL_FACTORS if command.intrinsics}
    least = command.least_motion if command.least_motion is not None else 0.3 * command.clouds[0].is_dir()
    last: NDArray[np.float64] | None = None
    for place, (path, given) in enumerate(zip(frames.files, frames.poses, strict=True)):
        if last is not None and _is_near(last, given, least):
            continue
        last, pose = given, given.copy()
        scale = command.scale if command.scale is not None else frames.scale
        cloud = read_cloud(path, scale, _intrinsics(command))
        points = cloud.points
        told.remarks += [f"{path}: {remark}" for remark in cloud.remarks]
        if len(frames.files) > 1:
            own.add(points, given)
            inverse.add(points, inverse_of(given))
            for agreement in focal.values():
                agreement.add(points, given)
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
            floor = find_floor(in_first, _given_floor((x, y, z), command.floor_share), command.seed)
            levelling = floor.levelling()
        yield points, pose if levelling is None else levelling @ pose
    if len(frames.files) > 1:
        _check_agreement(own, inverse, told)
        _check_focal_length(own, focal, told)


LEAST_TURN = 0.436
"""A frame that is turned by more is taken wherever it is [rad]."""

LEAST_AGREEMENT, DOUBTFUL_AGREEMENT = 0.90, 0.98
"""Shares of what frames see twice that have to agree: frames below the first are refused, below the second doubted."""


FOCAL_FACTORS = (0.75, 0.85, 0.92, 1.08, 1.18, 1.33)
"""Factors of the focal length that are tried beside the given one."""

CLEARLY_NEARER = 0.8
"""Share of the mean distance of frames below which another focal length is clearly better."""


def _is_near(last: "NDArray[np.float64]", pose: "NDArray[np.float64]", least: float) -> bool:
    """Whether a frame has hardly moved since the last one."""
    import numpy as np

    turn = np.arccos(np.clip(0.5 * (np.trace(last[:3, :3].T @ pose[:3, :3]) - 1.0), -1.0, 1.0))
    return bool(np.linalg.norm(pose[:3, 3] - last[:3, 3]) < least and turn < LEAST_TURN)


def _check_agreement(own: "FrameAgreement", inverse: "FrameAgreement", told: _Told) -> None:
    """Refuse frames that contradict each other; tell how well they agree."""
    told.agreement = own.share
    if own.share is None:
        told.remarks.append("the frames see too little twice: whether their poses fit is not known")
    elif own.share < DOUBTFUL_AGREEMENT:
        is_inverse = inverse.share is not None and inverse.share > max(own.share, LEAST_AGREEMENT)
        cure = (
            f"by the inverses of their poses {inverse.share:.0%} does: --world-to-camera, or without it?"
            if is_inverse
            else "are poses, --intrinsics and --scale theirs?"
        )
        message = f"frames contradict each other: of what they see twice, {own.share:.0%} agrees; {cure}"
        if own.share < LEAST_AGREEMENT:
            raise ValueError(message)
        told.remarks.append(f"the map is probably wrong: {message}")
        told.is_doubtful = True


def _check_focal_length(own: "FrameAgreement", focal: "dict[float, FrameAgreement]", told: _Told) -> None:
    """Tell if the frames would agree clearly better with another focal length."""
    distances = {factor: agreement.mean_distance for factor, agreement in focal.items()}
    known = {factor: distance for factor, distance in distances.items() if distance is not None}
    given = own.mean_distance
    if given is None or not known:
        return
    best = min(known, key=lambda factor: known[factor])
    if known[best] < CLEARLY_NEARER * given:
        change = f"{abs(best - 1.0):.0%} {'longer' if best > 1.0 else 'shorter'}"
        told.remarks.append(
            f"the map is probably wrong: the frames differ by {1000 * given:.0f} mm where they see the same, and by "
            f"{1000 * known[best]:.0f} mm with a focal length {change}; are --intrinsics theirs?"
        )
        told.is_doubtful = True


def _check_floor(
    command: _SparseMapping, points: "NDArray[np.floating]", up: tuple[float, float, float], told: _Told
) -> None:
    """Tell which floor the first cloud has; of one of several frames it may be small."""
    from lidarium.mapping.sparse.up_axis import check_up

    found = check_up(points, up, command.seed, command.floor_share)
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
