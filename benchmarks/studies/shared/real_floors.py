"""The files of real floors below a folder, by kind."""

import json
from pathlib import Path


def real_floors(data: Path) -> dict[str, list[Path]]:
    """Return the files of real floors below a folder, by kind.

    Raises
    ------
    FileNotFoundError
        Where the folder holds none of them.
    """
    plans = Path(data) / "floorplans"
    meta = plans / "kth" / "meta.json"
    connected = (
        {name for name, entry in json.loads(meta.read_text()).items() if entry["conn"] >= 0.8}
        if meta.is_file()
        else set()
    )
    found = {
        "kth": [
            path
            for path in sorted((plans / "kth" / "xml").glob("*.xml.gz"))
            if path.name.removesuffix(".xml.gz") in connected
        ],
        "lifull": sorted((plans / "lifull" / "txt").glob("*.txt")),
        "slam": sorted((Path(data) / "slam_maps").glob("*.yaml")),
        "dungeon": sorted((plans / "synthetic_dungeon").glob("*.png")),
    }
    if not any(found.values()):
        raise FileNotFoundError(
            f"no real floors below {data}; want the folders floorplans and slam_maps there"
        )
    return found
