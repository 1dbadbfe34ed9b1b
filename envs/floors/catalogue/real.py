"""Real floors that ship with the package, by collection and name: ``home:17``, ``robot_map:willow_garage_2010``.

Sources and licences are in data/real/LICENSES.txt.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.importers import load_file

DATA = Path(__file__).parent / "data" / "real"


@dataclass(frozen=True, slots=True)
class Collection:
    """Floors of one source, files of one format in a folder of its name.

    `suffix`: that of its files; `resolution`: metres per pixel if files do not state it; `about`: one line for people.
    """

    suffix: str
    resolution: float | None
    about: str


COLLECTIONS = {
    "dungeon": Collection(".png", 0.1, "dungeons of rooms and tunnels, 50 x 50 m (test maps of DARE, MIT)"),
    "home": Collection(".txt", None, "apartments by vector annotation (LIFULL, by FloorplanTransformation, MIT)"),
    "robot_map": Collection(".yaml", None, "maps that robots made of buildings (BSD, MIT, Apache-2.0)"),
}


@lru_cache(maxsize=len(COLLECTIONS))
def real_floors(collection: str) -> tuple[str, ...]:
    """Return the names of the floors of a collection, for ``load_floor``."""
    suffix = COLLECTIONS[collection].suffix
    return tuple(f"{collection}:{path.stem}" for path in sorted((DATA / collection).glob(f"*{suffix}")))


def load_real(name: str) -> Floor:
    """Read a floor of a collection."""
    collection, _, stem = name.partition(":")
    if name not in real_floors(collection):
        some = real_floors(collection)
        raise ValueError(f"no floor {name!r}; there are {len(some)}, such as {some[0]!r} and {some[-1]!r}")
    source = COLLECTIONS[collection]
    return replace(load_file(DATA / collection / f"{stem}{source.suffix}", source.resolution), name=name)
