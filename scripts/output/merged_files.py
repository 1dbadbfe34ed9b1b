"""Files that a merge leaves: fused maps, transforms and pictures."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lidarium.mapping.files.map_files import MapImage
    from lidarium.mapping.geometry.rigid import Transform
    from lidarium.mapping.merging.bend.deforming import Deformed
    from lidarium.mapping.merging.joining.merged_maps import Merged
    from lidarium.mapping.merging.regions.settings import RegionSettings


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

    In the ROS frame of the group's first map; bent where the groups were.
    """
    from lidarium.evaluation.drawing.merge_picture import save_merge_picture
    from lidarium.evaluation.episodes.output import check_written, write_json
    from lidarium.mapping.files.map_files import write_ros_map
    from lidarium.mapping.geometry.rigid import Transform

    files = []
    joined = [group for group in merged.groups() if len(group) > 1]
    fused_maps = [bent.fused for bent in deformed] or [merged.fused(group) for group in joined]
    for number, (group, fused) in enumerate(zip(joined, fused_maps, strict=True)):
        name = "map" if number == 0 else f"map-{number + 1}"
        origin = corner_of(images[group[0]]) @ Transform(*fused.origin)
        write_ros_map(out, name, fused.levels, (origin.x, origin.y, origin.theta), fused.resolution)
        files += [f"{name}.yaml", f"{name}.pgm"]
    corners = {name: corner_of(image) for name, image in images.items()}
    save_merge_picture(out / "merge.png", merged, corners, deformed)
    write_json(out / "transforms.json", result)
    files += ["transforms.json", "merge.png"]
    check_written(out, files)
    return files


def draw_regions(
    merged: "Merged", images: "dict[str, MapImage]", settings: "RegionSettings", out: Path
) -> str:
    """Draw the regions of each map as it was compared; returns the file's name."""
    from lidarium.evaluation.drawing.maps.region_picture import RegionMap, save_region_picture
    from lidarium.mapping.merging.regions.graph import find_regions

    maps = {}
    for name, levels in merged.levels.items():
        graph = find_regions(levels, merged.resolution, settings)
        maps[name] = RegionMap(levels, merged.resolution, graph, corner_of(images[name]))
    save_region_picture(out / "regions.png", maps)
    return "regions.png"
