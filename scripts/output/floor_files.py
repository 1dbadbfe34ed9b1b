"""Files and text that ``lidarium floors`` makes of a floor."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from lidarium.scripts.common import Answer, Command, file_name, table

if TYPE_CHECKING:
    from lidarium.envs.floors.floor import Floor

LASER_HEIGHT = 0.3
"""Height of the plane in which maps and pictures show a floor [m].

It is that of the robots' lasers.
"""


def write_floor(command: Command, floor: "Floor", resolution: float) -> Answer:
    """Write a floor as a ROS map and a picture, with its figures."""
    from lidarium.envs.floors.catalogue.names import describe_floor
    from lidarium.evaluation.episodes.output import check_writable, check_written
    from lidarium.mapping.files.map_files import write_ros_map

    stem = file_name(floor.name)
    folder = command.out or Path("floors") / stem
    check_writable(folder)
    raster = floor.raster(resolution, LASER_HEIGHT, LASER_HEIGHT)
    result = describe_floor(floor)
    write_ros_map(folder, stem, _levels(raster.solid, resolution), (*raster.origin, 0.0), resolution)
    save_picture(folder / f"{stem}.png", floor)
    write_result(command, f"{stem}.json", result, folder)
    files = [f"{stem}.{kind}" for kind in ("yaml", "pgm", "png", "json")]
    check_written(folder, files)
    return Answer(result, floor_description(result, folder, files))


def _levels(solid: Any, resolution: float) -> Any:  # noqa: ANN401
    """Return free and occupied cells.

    What is deeper in solids than a wall, no laser sees: unknown.
    """
    import cv2
    import numpy as np

    from lidarium.mapping.files.map_files import FREE, OCCUPIED, UNKNOWN

    side = 2 * max(round(0.1 / resolution), 1) + 1
    near_free = cv2.dilate((solid == 0).astype(np.uint8), np.ones((side, side), np.uint8))
    return np.where(
        solid == 0, np.uint8(FREE), np.where(near_free != 0, np.uint8(OCCUPIED), np.uint8(UNKNOWN))
    )


def save_picture(path: Path, floor: "Floor") -> None:
    """Write a picture of a floor."""
    from lidarium.evaluation.drawing.run_picture import save_floor_picture

    save_floor_picture(path, floor, LASER_HEIGHT)


def check_out(command: Command) -> None:
    """Check that ``--out`` can be written to, where it is given."""
    from lidarium.evaluation.episodes.output import check_writable

    if command.out is not None:
        check_writable(command.out)


def write_result(command: Command, name: str, result: dict[str, Any], folder: Path | None = None) -> None:
    """Write a result into a folder, or into ``--out`` where it is given."""
    from lidarium.evaluation.episodes.output import write_json

    place = folder or command.out
    if place is not None:
        write_json(place / name, result)


def floor_description(result: dict[str, Any], folder: Path | None, files: list[str], about: str = "") -> str:
    """Return the figures of a floor as text."""
    width, height = result["size_m"]
    facts = [
        ("size", f"{width:g} x {height:g} m"),
        ("free area", f"{result['area_m2']:.1f} m2"),
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
