"""`lidarium floors`: list, show, generate, import and prepare floors."""

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from tyro.conf import Positional, subcommand

from lidarium.scripts.common import (
    DONE,
    DOUBTFUL,
    INTERRUPTED,
    Answer,
    Command,
    Outputs,
    counted,
    file_name,
    table,
)

if TYPE_CHECKING:
    from lidarium.envs.floors.floor import Floor


@dataclass(frozen=True, kw_only=True)
class _List(Command):
    """List the floors of the catalogue, the generators and the sets."""


@dataclass(frozen=True, kw_only=True)
class _Show(Command):
    """Tell a floor's figures; with --out draw it, too."""

    name: Positional[str]
    """name in the catalogue, building:SEED, or a file"""
    resolution: float | None = None
    """metres per pixel, if the floor is a plain image"""
    skip_meshes: bool = False
    """leave out collisions of a Gazebo world that are meshes, instead of taking their bounding boxes"""
    layers: tuple[str, ...] = ()
    """layers of a DXF drawing that are walls; by default all that are not off or frozen"""


@dataclass(frozen=True, kw_only=True)
class _Generate(Command):
    """Generate a building; writes it as a ROS map (yaml and pgm) and as a picture."""

    kind: str = "any"
    """apartment, office, corridors, or any, which the seed draws"""
    area: float | None = None
    """floor area between the walls, 30 to 1500 [m2]; drawn by default"""
    loops: float | None = None
    """share of the possible openings beyond those that join all rooms, 0 to 1.

    Drawn by default
    """
    clutter: float | None = None
    """share of the area under furniture, 0 to 0.3; drawn by default"""
    map_resolution: float = 0.025
    """side of a cell of the ROS map [m]"""


@dataclass(frozen=True, kw_only=True)
class _Import(Command):
    """Read a floor of any known format.

    Writes it as a ROS map (yaml and pgm) and as a picture.
    """

    file: Positional[Path]
    """ROS map (yaml), plain image or other floor file.

    Formats: `lidarium show formats`.
    """
    resolution: float | None = None
    """metres per pixel, if the file is a plain image; the length of a unit of a drawing, whatever its header says"""
    skip_meshes: bool = False
    """leave out collisions of a Gazebo world that are meshes, instead of taking their bounding boxes"""
    layers: tuple[str, ...] = ()
    """layers of a DXF drawing that are walls; by default all that are not off or frozen"""
    map_resolution: float = 0.025
    """side of a cell of the ROS map [m]"""


@dataclass(frozen=True, kw_only=True)
class _Prepare(Command):
    """Make floors and their tables ahead and keep them on disk for all processes.

    Existing ones are skipped.
    """

    name: Positional[str]
    """set:NAME, or any floor"""
    robot: str = "kobuki"
    """body of the robots, which determines the height of obstacles.

    `lidarium show robots` lists them
    """
    lidar: str = "urg"
    """laser of the robots, which determines the height of the scan; `lidarium show lidars` lists them"""
    raster_resolution: float = 0.025
    """side of a cell of the world [m]"""
    workers: int = 1
    """processes at work"""

    compiles: ClassVar[bool] = True

    def __post_init__(self) -> None:
        Command.__post_init__(self)
        if self.workers < 1:
            raise ValueError(f"workers is {self.workers}; want at least 1")


@dataclass(frozen=True)
class _Floors:
    """List, show, generate, import and prepare floors."""

    command: (
        Annotated[_List, subcommand("list")]
        | Annotated[_Show, subcommand("show")]
        | Annotated[_Generate, subcommand("generate")]
        | Annotated[_Import, subcommand("import")]
        | Annotated[_Prepare, subcommand("prepare")]
    )

    @property
    def json(self) -> bool:
        """Whether the result is printed as JSON."""
        return self.command.json

    @property
    def compiles(self) -> bool:
        """Whether kernels are called."""
        return self.command.compiles


def execute(command: _Floors) -> Answer:
    """Run the command about floors that was chosen."""
    chosen = command.command
    if isinstance(chosen, _List):
        return _list_floors(chosen)
    if isinstance(chosen, _Show):
        return _show_floor(chosen)
    if isinstance(chosen, _Generate):
        return _generate_floor(chosen)
    return _import_floor(chosen) if isinstance(chosen, _Import) else _prepare_floors(chosen)


def _list_floors(command: _List) -> Answer:
    """List all floors."""
    from lidarium.envs.floors.catalogue.names import SETS, about_floor, floor_names
    from lidarium.envs.floors.catalogue.real import COLLECTIONS, real_floors
    from lidarium.envs.floors.generation.buildings import KINDS

    check_out(command)
    result: dict[str, Any] = {
        "floors": {name: about_floor(name) for name in floor_names()},
        "generators": ["building", *KINDS],
        "real": {name: list(real_floors(name)) for name in COLLECTIONS},
        "sets": {name: {"first_seed": first, "floors": count} for name, (first, count) in SETS.items()},
    }
    generators = [
        ("building:SEED", "a building of any kind"),
        *((f"{kind}:SEED", f"a building of kind {kind}") for kind in KINDS),
    ]
    sets = [
        (f"set:{name}", f"{count:,} generated floors, building:{first} and on") for name, (first, count) in SETS.items()
    ] + [
        (f"set:{name}", f"{len(real_floors(name))} real floors, {real_floors(name)[0]} and on") for name in COLLECTIONS
    ]
    real = [(f"{name}:NAME", each.about) for name, each in COLLECTIONS.items()]
    sections = (
        ("drawn floors", list(result["floors"].items())),
        ("generated by seed", generators),
        ("real", real),
        ("sets", sets),
    )
    text = "\n\n".join(f"{title}\n{table(rows)}" for title, rows in sections)
    write_result(command, "floors.json", result)
    return Answer(result, text + "\n\nand any file that the importers know: lidarium floors import --help")


def _show_floor(command: _Show) -> Answer:
    """Describe a floor."""
    from lidarium.envs.floors.catalogue.names import about_floor, describe_floor, floor_names, load_floor
    from lidarium.envs.floors.importers import load_file

    check_out(command)
    options = _import_options(command)
    floor = (
        load_file(Path(command.name), command.resolution, **options)
        if options
        else load_floor(command.name, command.resolution)
    )
    if command.out is not None:
        stem = file_name(floor.name)
        _outputs((f"{stem}.json", f"{stem}.png")).check(command.out, (command.name,))
    result = describe_floor(floor)
    about = about_floor(command.name) if command.name in floor_names() else ""
    files = []
    if command.out is not None:
        write_result(command, f"{stem}.json", result)
        _save_picture(command.out / f"{stem}.png", floor)
        files = [f"{stem}.json", f"{stem}.png"]
    return Answer(result, floor_description(result, command.out, files, about), verdict_of_reach(result))


def _generate_floor(command: _Generate) -> Answer:
    """Generate a building and write it."""
    from lidarium.envs.floors.generation.buildings import BuildingSettings, generate_building

    check_out(command)
    settings = BuildingSettings(kind=command.kind, area_m2=command.area, loops=command.loops, clutter=command.clutter)
    return write_floor(command, generate_building(command.seed, settings), command.map_resolution)


def _import_floor(command: _Import) -> Answer:
    """Read a floor and write it."""
    from lidarium.envs.floors.importers import load_file

    check_out(command)
    floor = load_file(command.file, command.resolution, **_import_options(command))
    return write_floor(command, floor, command.map_resolution, command.file)


def _import_options(command: _Show | _Import) -> dict[str, Any]:
    """Return the options of formats that are given."""
    given = {"skip_meshes": command.skip_meshes, "layers": command.layers}
    return {name: value for name, value in given.items() if value}


def _prepare_floors(command: _Prepare) -> Answer:
    """Fill the store of floors.

    A call that is interrupted or loses a worker keeps the finished floors.
    """
    from lidarium.envs.floors.catalogue.names import set_floors
    from lidarium.envs.floors.catalogue.store import FOLDER_VARIABLE, SIZE_VARIABLE, floor_store
    from lidarium.envs.settings.making import make_settings
    from lidarium.mapping.kernels.cache_folders import is_writable

    check_out(command)
    store = floor_store()
    if store.folder is None or not is_writable(store.folder):
        raise ValueError(
            "no folder to keep floors in; name one that can be written to in the environment variable "
            f"{FOLDER_VARIABLE}"
        )
    specs = set_floors(command.name) if command.name.startswith("set:") else (command.name,)
    settings = make_settings(robot=command.robot, lidar=command.lidar)
    prepare = partial(
        _prepared,
        resolution=command.raster_resolution,
        laser_height=settings.lidar.height,
        body_height=settings.robot.height,
    )
    prepared, made, is_interrupted = _prepare(prepare, specs, command)
    result = {
        "name": command.name,
        "floors": len(specs),
        "prepared": prepared,
        "made": made,
        "is_interrupted": is_interrupted,
        "folder": str(store.folder),
        "size_mib": round(store.size() / 2**20, 1),
        "max_mib": round(store.max_bytes / 2**20, 1),
    }
    write_result(command, "prepared.json", result)
    facts = [
        ("prepared", f"{prepared:,} of {len(specs):,} floors, {made:,} of them made now"),
        ("folder", f"{store.folder}"),
        ("size", f"{result['size_mib']:,} MiB of at most {result['max_mib']:,}, which {SIZE_VARIABLE} sets"),
    ]
    how = " (interrupted; call again to go on)" if is_interrupted else ""
    return Answer(result, f"{command.name}{how}\n{table(facts)}", INTERRUPTED if is_interrupted else 0)


def _prepared(spec: str, resolution: float, laser_height: float, body_height: float) -> bool:
    """Keep a floor and its tables; False if they were there."""
    from lidarium.envs.floors.catalogue.names import load_floor
    from lidarium.envs.floors.catalogue.store import floor_store
    from lidarium.envs.simulation.kernels.floor_cache import prepare_tables

    return prepare_tables(floor_store(), load_floor(spec), resolution, laser_height, body_height)


def _prepare(prepare: Callable[[str], bool], specs: Sequence[str], command: _Prepare) -> tuple[int, int, bool]:
    """Prepare floors.

    Return how many are ready, how many were made, and whether it was broken off.
    """
    from lidarium.evaluation.processes import WorkerDiedError, shared_out

    prepared, made = 0, 0
    with closing(shared_out(prepare, specs, command.workers)) as work:
        try:
            for _, result in counted(work, len(specs), "floors prepared", command.json):
                if isinstance(result, WorkerDiedError):
                    raise ChildProcessError(
                        f"a worker was killed, most often for want of memory; at least {prepared:,} of "
                        f"{len(specs):,} floors are ready and kept: "
                        f"call again to go on, with fewer --workers than {command.workers}"
                    ) from result
                if isinstance(result, Exception):
                    raise result
                prepared, made = prepared + 1, made + result
        except KeyboardInterrupt:
            return prepared, made, True
    return prepared, made, False


LASER_HEIGHT = 0.3
"""Height of the plane in which maps and pictures show a floor [m].

It is that of the robots' lasers.
"""


FINE_M, LEAST_KEPT = 0.025, 0.9
"""Side of cells with which a map is compared [m], and the share of the free floor that it has at least."""


def write_floor(command: Command, floor: "Floor", resolution: float, source: Path | None = None) -> Answer:
    """Write a floor as a ROS map and a picture, with its figures; it was read from ``source``."""
    from lidarium.envs.floors.catalogue.names import describe_floor
    from lidarium.mapping.files.map_files import write_ros_map
    from lidarium.mapping.files.output import check_written

    stem = file_name(floor.name)
    folder = command.out or Path("floors") / stem
    files = [f"{stem}.{kind}" for kind in ("json", "yaml", "pgm", "png")]
    _outputs(files).check(folder, (source,))
    raster = floor.raster(resolution, LASER_HEIGHT, LASER_HEIGHT)
    result = describe_floor(floor)
    free, whole = (
        float((each.solid == 0).sum()) * each.resolution**2
        for each in (raster, floor.raster(min(FINE_M, resolution), LASER_HEIGHT, LASER_HEIGHT))
    )
    if free == 0.0:
        raise ValueError(f"map-resolution is {resolution} m, by which no cell is free; want a smaller one")
    if is_coarse := not LEAST_KEPT * whole <= free <= whole / LEAST_KEPT:
        coarse = f"in cells of {resolution:g} m the map has {free:.1f} m2 of free floor, instead of {whole:.1f} m2"
        result["remark"] = "; ".join(filter(None, (result["remark"], coarse)))
    write_result(command, f"{stem}.json", result, folder)
    write_ros_map(folder, stem, _levels(raster.solid, resolution), (*raster.origin, 0.0), resolution)
    _save_picture(folder / f"{stem}.png", floor)
    check_written(folder, files)
    text = floor_description(result, folder, files)
    return Answer(result, text, DOUBTFUL if is_coarse else verdict_of_reach(result))


def _outputs(files: Sequence[str]) -> Outputs:
    """Return the files that are written of a floor; the first is the one with its figures."""
    return Outputs(tuple(files), files[0], "sha256")


def verdict_of_reach(result: dict[str, Any]) -> int:
    """Return the exit code: a floor of which robots reach the smaller part is hardly what was meant."""
    return DOUBTFUL if result["reachable_m2"] < 0.5 * result["whole_m2"] else DONE


def _levels(solid: Any, resolution: float) -> Any:  # noqa: ANN401
    """Return free and occupied cells.

    Cells deeper in solids than a wall are unknown: no laser sees them.
    """
    import cv2
    import numpy as np

    from lidarium.mapping.files.map_files import FREE, OCCUPIED, UNKNOWN

    side = 2 * max(round(0.1 / resolution), 1) + 1
    near_free = cv2.dilate((solid == 0).astype(np.uint8), np.ones((side, side), np.uint8))
    return np.where(solid == 0, np.uint8(FREE), np.where(near_free != 0, np.uint8(OCCUPIED), np.uint8(UNKNOWN)))


def _save_picture(path: Path, floor: "Floor") -> None:
    """Write a picture of a floor."""
    from lidarium.evaluation.drawing.run_picture import save_floor_picture

    save_floor_picture(path, floor, LASER_HEIGHT)


def check_out(command: Command) -> None:
    """Check that ``--out`` can be written to, if it is given."""
    from lidarium.mapping.files.output import check_writable

    if command.out is not None:
        check_writable(command.out)


def write_result(command: Command, name: str, result: dict[str, Any], folder: Path | None = None) -> None:
    """Write a result into a folder, or into ``--out`` if it is given."""
    from lidarium.mapping.files.output import write_json

    place = folder or command.out
    if place is not None:
        write_json(place / name, result)


def floor_description(result: dict[str, Any], folder: Path | None, files: list[str], about: str = "") -> str:
    """Return the figures of a floor as text."""
    width, height = result["size_m"]
    facts = [
        ("size", f"{width:g} x {height:g} m"),
        ("free area", f"{result['area_m2']:.1f} m2"),
        ("reachable", f"{result['reachable_m2']:.1f} m2 of {result['whole_m2']:.1f} m2"),
        ("rooms", f"{result['rooms']}"),
        ("loops", f"{result['loops']}"),
        ("clutter", f"{100.0 * result['clutter']:.1f} % of the area under furniture"),
        ("solids", f"{result['solids'] or 'none, cells of an image'}"),
        ("sha256", result["sha256"]),
    ]
    if result["remark"]:
        facts.append(("note", result["remark"]))
    if folder is not None:
        facts.append(("files", f"{folder}: {', '.join(files)}"))
    return f"{result['name']}{f': {about}' if about else ''}\n{table(facts)}"
