"""`lidarium merge`: merging of occupancy maps of several robots.

The robots know nothing of each other's start.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tyro.conf import Positional

from lidarium.scripts.common import DONE, NO, Answer, Command, file_name, table

if TYPE_CHECKING:
    from lidarium.mapping.files.map_files import MapImage
    from lidarium.mapping.geometry.rigid import Transform
    from lidarium.mapping.merging.merger import Merged

DEFAULT_FOLDER = Path("merged")


@dataclass(frozen=True, kw_only=True)
class Merge(Command):
    """Merge maps into one; writes the fused map, transforms.json and a picture.

    Where maps do not join, it says why of each pair.
    """

    maps: Positional[tuple[Path, ...]]
    """two maps or more: ROS maps (yaml with its image), or images with --resolution"""
    resolution: float | None = None
    """metres per pixel of maps that are plain images.

    Dark is occupied, light is free, what lies between unknown
    """
    mode: str = "default"
    """rules of merging: default, or thesis for those of the thesis as printed."""

    def __post_init__(self) -> None:
        Command.__post_init__(self)
        if len(self.maps) < 2:
            raise ValueError(f"{len(self.maps)} map is given; want two or more")
        if self.resolution is not None and not 0.0 < self.resolution < float("inf"):
            raise ValueError(f"resolution is {self.resolution} m; want a positive number of metres per pixel")


def execute(command: Merge) -> Answer:
    """Merge maps and write what came of it.

    Raises
    ------
    ValueError, FileNotFoundError, OSError
        Where a map or ``--out`` is no good; nothing is written then.
    """
    from lidarium.evaluation.episodes.output import check_writable
    from lidarium.mapping.merging.merger import merge_maps
    from lidarium.mapping.merging.settings import merge_settings

    out = command.out or DEFAULT_FOLDER
    check_writable(out)
    images = _read(command)
    settings = merge_settings(command.mode, max(image.resolution for image in images.values()))
    merged = merge_maps({name: (image.levels, image.resolution) for name, image in images.items()}, settings)
    result = _result(merged, images)
    files = _write(merged, images, result, out) if any(len(group) > 1 for group in merged.groups()) else []
    is_whole = len(merged.groups()) == 1
    return Answer(result, _summary(merged, files, out), DONE if is_whole else NO)


def _read(command: Merge) -> "dict[str, MapImage]":
    """Return the maps by their files' stems, numbered where these are the same."""
    from lidarium.mapping.files.map_files import read_grey_map, read_ros_map

    images: dict[str, MapImage] = {}
    for path in command.maps:
        if path.suffix.lower() in (".yaml", ".yml"):
            image = read_ros_map(path)
        elif command.resolution is None:
            raise ValueError(
                f"{path} is an image without a scale; pass --resolution with its metres per pixel"
            )
        else:
            image = read_grey_map(path, command.resolution)
        stem, name, number = file_name(path.stem), file_name(path.stem), 1
        while name in images:
            number += 1
            name = f"{stem}-{number}"
        images[name] = image
    return images


def _corner(image: "MapImage") -> "Transform":
    """Return the transform from cells' metres into the map's ROS frame."""
    from lidarium.mapping.geometry.rigid import Transform

    return Transform(*image.origin)


def _result(merged: "Merged", images: "dict[str, MapImage]") -> dict[str, Any]:
    """Return what transforms.json holds: transforms between the maps' ROS frames."""
    groups = merged.groups()
    world = groups[0][0]
    maps: dict[str, dict[str, Any] | None] = dict.fromkeys(images)
    for number, group in enumerate(groups):
        if len(group) > 1:
            root = _corner(images[group[0]])
            for name in group:
                transform = merged.tree.lookup(group[0], name)
                assert transform is not None
                maps[name] = {**_numbers(root @ transform @ _corner(images[name]).inverse()), "group": number}
    pairs = []
    used = {(edge.a, edge.b) for edge in merged.tree.edges}
    for (a, b), found in merged.pairs.items():
        is_used = (a, b) in used
        between = (
            None
            if found.a_from_b is None
            else _corner(images[a]) @ found.a_from_b @ _corner(images[b]).inverse()
        )
        reason = (
            "contradicts stronger pairs of the group" if found.is_accepted and not is_used else found.reason
        )
        pairs.append(
            {
                "a": a,
                "b": b,
                "accepted": is_used,
                "reason": reason,
                **_numbers(between),
                "inliers": found.inliers,
                "score": round(found.score, 6),
                "overlap_m2": round(found.agreement.overlap_m2, 3),
                "time_ms": round(found.time_ms, 3),
            }
        )
    return {"world": world, "maps": maps, "pairs": pairs}


def _numbers(transform: "Transform | None") -> dict[str, float | None]:
    if transform is None:
        return {"x": None, "y": None, "theta": None}
    return {"x": round(transform.x, 6), "y": round(transform.y, 6), "theta": round(transform.theta, 8)}


def _write(merged: "Merged", images: "dict[str, MapImage]", result: dict[str, Any], out: Path) -> list[str]:
    """Write transforms, the picture and the fused map of each group.

    In the ROS frame of the group's first map.
    """
    from lidarium.evaluation.drawing.merge_picture import save_merge_picture
    from lidarium.evaluation.episodes.output import check_written, write_json
    from lidarium.mapping.files.map_files import write_ros_map
    from lidarium.mapping.geometry.rigid import Transform

    files = []
    joined = [group for group in merged.groups() if len(group) > 1]
    for number, group in enumerate(joined):
        fused = merged.fused(group)
        name = "map" if number == 0 else f"map-{number + 1}"
        origin = _corner(images[group[0]]) @ Transform(*fused.origin)
        write_ros_map(out, name, fused.levels, (origin.x, origin.y, origin.theta), fused.resolution)
        files += [f"{name}.yaml", f"{name}.pgm"]
    save_merge_picture(out / "merge.png", merged)
    write_json(out / "transforms.json", result)
    files += ["transforms.json", "merge.png"]
    check_written(out, files)
    return files


def _summary(merged: "Merged", files: list[str], out: Path) -> str:
    lines = [
        f"joined: {', '.join(group)}" if len(group) > 1 else f"alone:  {group[0]}"
        for group in merged.groups()
    ]
    dropped = {(edge.a, edge.b) for edge in merged.tree.dropped}
    rows = []
    for (a, b), found in merged.pairs.items():
        if (a, b) in dropped:
            reason = "refused: contradicts stronger pairs of the group"
        elif found.is_accepted:
            agreement = found.agreement
            reason = (
                f"accepted: {agreement.agreeing_m:.1f} m of walls agree, {agreement.overlap_m2:.0f} m2 known "
                "in both"
            )
        else:
            reason = f"refused: {found.reason}"
        rows.append((a, b, reason))
    return "\n".join(
        [
            *lines,
            "",
            table(rows),
            "",
            f"written to {out}: {', '.join(files)}" if files else "nothing was written",
        ]
    )
