"""`lidarium merge`: merge occupancy maps of several robots."""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from tyro.conf import Positional

from lidarium.scripts.common import DONE, DOUBTFUL, NO, Answer, Command, Outputs, file_name, table
from lidarium.scripts.transforms import PlacedMaps, transforms

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from lidarium.mapping.files.map_files import MapImage
    from lidarium.mapping.geometry.rigid import Transform
    from lidarium.mapping.merging.bend.deforming import Deformation, Deformed
    from lidarium.mapping.merging.joining import Merged
    from lidarium.mapping.merging.regions.segmentation import RegionSettings
    from lidarium.mapping.merging.settings import MergeSettings

DEFAULT_FOLDER = Path("merged")
RESULT, REGIONS = "transforms.json", "regions.png"
MAPS = tuple(f"map{number}.{kind}" for number in ("", "-[0-9]", "-[0-9][0-9]") for kind in ("yaml", "pgm"))
OUTPUTS = Outputs((RESULT, *MAPS, "merge.png", REGIONS), RESULT, "remarks")  # which that of a run lacks

ROS_MAPS = (".yaml", ".yml")

LEAST_SCALE = 0.01
"""Minimum scale that can be given, and one over the maximum."""


@dataclass(frozen=True, kw_only=True)
class _Merge(Command):
    """Merge maps into one; writes the fused map, transforms.json and a picture.

    If maps do not join, the reason for each pair is printed; transforms.json and the picture say more.
    """

    compiles: ClassVar[bool] = True

    maps: Positional[tuple[Path, ...]]
    """two maps or more: ROS maps (yaml with its image), or images with --resolution"""
    resolution: float | None = None
    """metres per pixel of maps that are plain images.

    Dark is occupied, light is free, values between are unknown
    """
    mode: str = "default"
    """rules of merging: default, or thesis for those of the thesis as printed."""
    tolerance: Literal["strict", "normal", "drift"] = "normal"
    """how far maps may be bent against each other: strict for not at all, drift for maps that have drifted"""
    structure: Literal["corners", "regions", "all"] = "all"
    """method that proposes transforms before everything is tried.

    Corners; regions of free space and the doors between them; or both. Mode thesis knows corners alone
    """
    regions: bool = False
    """also draw the regions of each map and their doors, as regions.png"""
    guess: str | None = None
    """X,Y,THETA of the second map's ROS frame in that of the first [m, rad].

    For two maps; right to 2 m and 20 degrees
    """
    force: bool = False
    """join two maps by the best transform, even if the maps contradict it"""
    scale: str = "fixed"
    """fixed, auto, or a number by which the second of two maps has to grow.

    auto seeks it, as for a drawn plan
    """
    deform: bool = False
    """bend the maps of each group until they agree; the first of each is unchanged"""

    def __post_init__(self) -> None:
        Command.__post_init__(self)
        if len(self.maps) < 2:
            raise ValueError(f"{len(self.maps)} map is given; want two or more")
        from lidarium.mapping.merging.fusion import MAX_MAPS

        if len(self.maps) > MAX_MAPS:
            raise ValueError(f"{len(self.maps)} maps are given; want at most {MAX_MAPS}: merge them in parts")
        if self.resolution is not None and not 0.0 < self.resolution < float("inf"):
            raise ValueError(f"resolution is {self.resolution} m; want a positive number of metres per pixel")
        factor = self.factor
        if self.scale != "fixed" and len(self.maps) != 2:
            raise ValueError(f"a scale is of two maps; {len(self.maps)} are given")
        ignored = self.given & ({"tolerance"} if self.structure == "corners" else {"tolerance", "structure"})
        if ignored and self.mode != "default":
            raise ValueError(f"--{min(ignored)} is set and the mode {self.mode}; want --mode default")
        if factor is None and (self.guess is not None or self.force or self.mode != "default"):
            raise ValueError("--scale auto goes without --guess, --force and --mode; give the scale as a number")

    @property
    def factor(self) -> float | None:
        """Scale of the second map; None to search for it."""
        if self.scale in ("fixed", "auto"):
            return 1.0 if self.scale == "fixed" else None
        try:
            factor = float(self.scale)
        except ValueError:
            factor = math.nan
        if not LEAST_SCALE <= factor <= 1.0 / LEAST_SCALE:
            raise ValueError(
                f"scale is {self.scale!r}; want fixed, auto, or a number from {LEAST_SCALE:g} to {1.0 / LEAST_SCALE:g}"
            )
        return factor


def execute(command: _Merge) -> Answer:
    """Merge maps and write the results."""
    from lidarium.mapping.merging.settings import TOLERANCES, merge_settings

    out = command.out or DEFAULT_FOLDER
    OUTPUTS.check(out, command.maps)
    if all(path.suffix.lower() in ROS_MAPS for path in command.maps):
        command.refuse("ROS maps state theirs", "resolution")
    images = _read(command)
    settings = merge_settings(command.mode, max(image.resolution for image in images.values()))
    if command.mode == "default":
        confidence = TOLERANCES[command.tolerance]
        settings = replace(settings, confidence=confidence, structure=command.structure)
    given = images
    merged, images, scale = _merged(command, images, settings)
    result = transforms(_placed(merged, images))
    remarks = _remarks(merged) or _unlike_scale(command, merged, given, settings)
    result["remarks"] = remarks
    second = result["maps"][list(images)[1]]
    if command.scale != "fixed" and second is not None:
        second["scale"] = round(scale, 5)
    joined = [group for group in merged.groups() if len(group) > 1]
    deformed = [merged.deformed(group, settings.bend) for group in joined] if command.deform else []
    for group, bent in zip(joined, deformed, strict=False):
        for name, deformation in zip(group, bent.deformations, strict=True):
            result["maps"][name]["deformation"] = _deformation(deformation)
    files = write_merged(merged, deformed, images, result, out)
    if command.regions:
        files.append(draw_regions(merged, images, settings.regions, out))
    is_whole = len(merged.groups()) == 1
    summary = _summary(merged, files, out, None if command.scale == "fixed" else scale)
    code = NO if not is_whole else DOUBTFUL if remarks else DONE
    return Answer(result, "\n".join([summary, *remarks]), code)


def _remarks(merged: "Merged") -> list[str]:
    """Return what makes the pairs doubtful that join the maps."""
    pairs = [(edge.a, edge.b) for edge in merged.tree.edges]
    found = {pair: merged.pairs[pair].doubt for pair in pairs if pair in merged.pairs}
    return [f"doubtful: {a} and {b}: {doubt}" for (a, b), doubt in found.items() if doubt]


def _unlike_scale(
    command: _Merge, merged: "Merged", images: "dict[str, MapImage]", settings: "MergeSettings"
) -> list[str]:
    """Return at which scale two refused maps would be joined, if there is one."""
    from lidarium.mapping.merging.bend.hypotheses import MAX_GROWTH
    from lidarium.mapping.merging.scaling import ScaleSettings, merge_scaled

    is_asked = command.scale == "fixed" and command.guess is None and command.mode == "default"
    if not is_asked or len(images) != 2 or len(merged.groups()) == 1:
        return []
    found = merge_scaled(_grids(images), settings, ScaleSettings(least=0.8, most=1.25))
    if len(found.merged.groups()) > 1 or abs(found.scale - 1.0) <= MAX_GROWTH:
        return []
    return [f"the scales are unlike: {list(images)[1]} would be joined if grown {found.scale:.3f} times (--scale auto)"]


def _merged(
    command: _Merge, images: "dict[str, MapImage]", settings: "MergeSettings"
) -> "tuple[Merged, dict[str, MapImage], float]":
    """Merge maps; return also the maps with the second one grown, and by how much it has."""
    from lidarium.mapping.merging.merger import Question, merge_maps
    from lidarium.mapping.merging.scaling import merge_scaled

    factor = command.factor
    if factor is None:
        scaled = merge_scaled(_grids(images), settings)
        return scaled.merged, _grown(images, scaled.scale), scaled.scale
    images = _grown(images, factor)
    question = Question(guess=_guess(command, list(images.values())), is_forced=command.force)
    return merge_maps(_grids(images), settings, question), images, factor


def _grids(images: "dict[str, MapImage]") -> "dict[str, tuple[NDArray[np.uint8], float]]":
    return {name: (image.levels, image.resolution) for name, image in images.items()}


def _grown(images: "dict[str, MapImage]", factor: float) -> "dict[str, MapImage]":
    """Return maps of which the second has grown about its ROS frame's origin."""
    if factor == 1.0:
        return images
    (first, kept), (second, image) = images.items()
    x, y, yaw = image.origin
    grown = replace(image, resolution=image.resolution * factor, origin=(x * factor, y * factor, yaw))
    return {first: kept, second: grown}


def _guess(command: _Merge, images: "list[MapImage]") -> "Transform | None":
    """Return the guess between the maps' lower left corners; None if there is none."""
    if command.guess is None:
        return None
    from lidarium.mapping.geometry.rigid import Transform

    try:
        x, y, theta = (float(word) for word in command.guess.split(","))
    except ValueError:
        x = y = theta = float("nan")
    if not all(abs(value) < float("inf") for value in (x, y, theta)):
        raise ValueError(f"guess is {command.guess!r}; want X,Y,THETA in metres and radians")
    if len(images) != 2:
        raise ValueError(f"a guess is of two maps; {len(images)} are given")
    first, second = (corner_of(image) for image in images)
    return first.inverse() @ Transform(x, y, theta) @ second


def _read(command: _Merge) -> "dict[str, MapImage]":
    """Return the maps by their files' stems, numbered if these are the same."""
    from lidarium.mapping.files.map_files import read_grey_map, read_ros_map

    images: dict[str, MapImage] = {}
    for path in command.maps:
        if path.suffix.lower() in ROS_MAPS:
            image = read_ros_map(path)
        elif command.resolution is None:
            raise ValueError(f"{path} is an image without a scale; pass --resolution with its metres per pixel")
        else:
            image = read_grey_map(path, command.resolution)
        stem, name, number = file_name(path.stem), file_name(path.stem), 1
        while name in images:
            number += 1
            name = f"{stem}-{number}"
        images[name] = image
    return images


def _placed(merged: "Merged", images: "dict[str, MapImage]") -> PlacedMaps:
    """Return how the maps lie, between their ROS frames."""
    corners = {name: corner_of(image) for name, image in images.items()}
    groups = []
    for group in merged.groups():
        frames = {}
        for name in group:
            transform = merged.tree.lookup(group[0], name)
            assert transform is not None
            frames[name] = corners[group[0]] @ transform @ corners[name].inverse()
        groups.append(frames)
    return PlacedMaps(
        groups,
        merged.pairs,
        corners,
        {(edge.a, edge.b) for edge in merged.tree.edges},
        {(edge.a, edge.b) for edge in merged.tree.dropped},
    )


def _deformation(found: "Deformation | None") -> dict[str, float] | None:
    """Return how much a map is bent, and its agreement with earlier maps."""
    if found is None:
        return None
    return {
        "mean_m": round(found.mean_m, 4),
        "most_m": round(found.most_m, 4),
        "strain": round(found.bend.strain, 5),
        "agreeing_m": round(found.agreement.agreeing_m, 3),
        "contradiction_m": round(found.agreement.contradicting_m, 3),
    }


def _summary(merged: "Merged", files: list[str], out: Path, scale: float | None) -> str:
    """Return the printed text; ``scale`` is by how much the second map has grown, None if it may not."""
    from lidarium.mapping.merging.bend.hypotheses import MAX_GROWTH

    lines = [f"joined: {', '.join(group)}" if len(group) > 1 else f"alone:  {group[0]}" for group in merged.groups()]
    dropped = {(edge.a, edge.b) for edge in merged.tree.dropped}
    rows = []
    for (a, b), found in merged.pairs.items():
        if (a, b) in dropped:
            reason = "refused: contradicts stronger pairs of the group"
        elif found.is_accepted:
            agreement = found.agreement
            reason = (
                f"{found.reason}: {agreement.agreeing_m:.1f} m of walls agree, {agreement.overlap_m2:.0f} m2 "
                "known in both"
            )
            if scale is not None:
                reason += f", {b} grown {scale:.3f} times"
            if found.found_by == "bend":
                bend = found.ranked[0].bend
                reason += f", bent by {bend.bend_m:.2f} m"
                if abs(bend.scale - 1.0) > MAX_GROWTH:
                    reason += f", of which the scale {bend.scale:.3f} explains {100.0 * bend.growth_share:.0f} %"
        else:
            reason = f"refused: {found.reason}"
        rows.append((a, b, reason))
    return "\n".join([*lines, "", table(rows), "", f"written to {out}: {', '.join(files)}"])


def corner_of(image: "MapImage") -> "Transform":
    """Return the transform from cells' metres into the map's ROS frame."""
    from lidarium.mapping.geometry.rigid import Transform

    return Transform(*image.origin)


def write_merged(
    merged: "Merged",
    deformed: "list[Deformed]",
    images: "dict[str, MapImage]",
    result: dict[str, Any],
    out: Path,
) -> list[str]:
    """Write transforms, the picture and the fused map of each group of two maps or more.

    In the ROS frame of the group's first map; bent if the groups were.
    """
    from lidarium.evaluation.drawing.merge_picture import save_merge_picture
    from lidarium.mapping.files.map_files import write_ros_map
    from lidarium.mapping.files.output import check_written, write_json
    from lidarium.mapping.geometry.rigid import Transform

    files = []
    joined = [group for group in merged.groups() if len(group) > 1]
    fused_maps = [bent.fused for bent in deformed] or [merged.fused(group) for group in joined]
    OUTPUTS.clear(out)
    write_json(out / RESULT, result)
    for number, (group, fused) in enumerate(zip(joined, fused_maps, strict=True)):
        name = "map" if number == 0 else f"map-{number + 1}"
        origin = corner_of(images[group[0]]) @ Transform(*fused.origin)
        write_ros_map(out, name, fused.levels, (origin.x, origin.y, origin.theta), fused.resolution)
        files += [f"{name}.yaml", f"{name}.pgm"]
    corners = {name: corner_of(image) for name, image in images.items()}
    save_merge_picture(out / "merge.png", merged, corners, deformed)
    files += [RESULT, "merge.png"]
    check_written(out, files)
    return files


def draw_regions(merged: "Merged", images: "dict[str, MapImage]", settings: "RegionSettings", out: Path) -> str:
    """Draw the regions of each map as it was compared; returns the file's name."""
    from lidarium.evaluation.drawing.region_picture import RegionMap, save_region_picture
    from lidarium.mapping.merging.regions.graph import find_regions

    maps = {}
    for name, levels in merged.levels.items():
        graph = find_regions(levels, merged.resolution, settings)
        maps[name] = RegionMap(levels, merged.resolution, graph, corner_of(images[name]))
    save_region_picture(out / REGIONS, maps)
    return REGIONS
