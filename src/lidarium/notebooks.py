"""Pictures of environments, floors, maps and results in notebooks.

A notebook shows them for the last expression of a cell. IPython is told at ``import lidarium``, if it runs, by names of
classes, so that nothing more is imported until a picture is asked for.
"""

import tempfile
from collections.abc import Callable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

MOST_SIDE, LEAST_SIDE = 800, 300
"""Greatest and least of the longer side of a map's picture [pixels]."""


def _saved(draw: Callable[[Path], Any]) -> bytes:
    """Return the content of a picture that is drawn to a file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.png"
        draw(path)
        return path.read_bytes()


def _png(picture: NDArray[np.uint8]) -> bytes:
    import imageio.v3 as imageio

    return bytes(imageio.imwrite("<bytes>", picture, extension=".png"))


def _cells(levels: NDArray[np.uint8]) -> bytes:
    """Return a picture of a map's levels, row 0 at the bottom."""
    longest = max(levels.shape)
    step, times = -(-longest // MOST_SIDE), max(LEAST_SIDE // longest, 1)
    shown = levels[::step, ::step][::-1]
    return _png(np.ascontiguousarray(shown.repeat(times, axis=0).repeat(times, axis=1)))


def _env(env: Any) -> bytes | None:  # noqa: ANN401
    """Return a frame of an environment of ours, in any form and in wrappers; nothing of others, or before a reset."""
    from lidarium.envs.drawing.rendering import draw_frame
    from lidarium.envs.faces.parallel import ExplorationEnv

    inner = getattr(env.unwrapped, "parallel", env).unwrapped
    return _png(draw_frame(inner.scene())) if isinstance(inner, ExplorationEnv) and inner.floor is not None else None


def _floor(floor: Any) -> bytes:  # noqa: ANN401
    from lidarium.envs.settings.lidar import Lidar
    from lidarium.evaluation.drawing.run_picture import save_floor_picture

    return _saved(lambda path: save_floor_picture(path, floor, Lidar().height))


def _batch(batch: Any) -> bytes | None:  # noqa: ANN401
    """Return a frame of each episode of a batch of ours, tiled; nothing of others, or before its first reset."""
    from lidarium.envs.drawing.batch_frames import batch_frames, tiled
    from lidarium.envs.faces.vector_env import BatchFace

    if not isinstance(batch.unwrapped, BatchFace):
        return None
    scenes = batch.unwrapped.batch.scenes()
    return None if any(scene.name == "" for scene in scenes) else _png(tiled(batch_frames(scenes)))


def _merged(merged: Any) -> bytes:  # noqa: ANN401
    from lidarium.evaluation.drawing.merge_picture import save_merge_picture
    from lidarium.mapping.geometry.rigid import Transform

    origins = {name: merged.origins.get(name, (0.0, 0.0)) for name in merged.levels}
    corners = {name: Transform(x, y) for name, (x, y) in origins.items()}
    return _saved(lambda path: save_merge_picture(path, merged, corners))


def _sparse_map(sparse_map: Any) -> bytes:  # noqa: ANN401
    from lidarium.evaluation.drawing.sparse_picture import save_sparse_pictures

    return _saved(lambda path: save_sparse_pictures(path, sparse_map.boxes, sparse_map.free))


def _record(record: Any) -> bytes:  # noqa: ANN401
    from lidarium.evaluation.drawing.record_frames import save_track_picture

    return _saved(lambda path: save_track_picture(path, record))


def _episode(episode: Any) -> bytes:  # noqa: ANN401
    from lidarium.evaluation.drawing.run_picture import save_run_picture

    return _saved(lambda path: save_run_picture(path, episode, type(episode.policy).__name__))


def _suite(suite: Any) -> str:  # noqa: ANN401
    """Return a table of what a suite runs."""
    rows = [
        ("policies", suite.policies),
        ("floors", suite.floors),
        ("robots", suite.robots),
        ("seeds", suite.seeds),
        ("variants", tuple(suite.variants)),
    ]
    lines = "".join(f"<tr><th>{name}</th><td>{_listed(values)}</td></tr>" for name, values in rows)
    return f"<table>{lines}<tr><th>episodes</th><td>{sum(1 for _ in suite.trials()):,}</td></tr></table>"


MOST_LISTED = 12


def _listed(values: Sequence[Any]) -> str:
    shown = ", ".join(escape(str(value)) for value in values[:MOST_LISTED])
    return shown if len(values) <= MOST_LISTED else f"{shown}, ... ({len(values):,} in all)"


PICTURES: dict[str, Callable[[Any], bytes | None]] = {
    "gymnasium.core.Env": _env,
    "pettingzoo.utils.env.AECEnv": _env,
    "pettingzoo.utils.env.ParallelEnv": _env,
    "gymnasium.vector.vector_env.VectorEnv": _batch,
    "lidarium.envs.faces.vector_env.BatchFace": _batch,
    "lidarium.envs.floors.floor.Floor": _floor,
    "lidarium.mapping.files.map_files.MapImage": lambda image: _cells(image.levels),
    "lidarium.mapping.grids.occupancy.OccupancyGrid": lambda grid: _cells(grid.levels()),
    "lidarium.mapping.merging.joining.Merged": _merged,
    "lidarium.mapping.sparse.sparse_map.SparseMap": _sparse_map,
    "lidarium.mapping.localization.slam.following.Followed": lambda followed: _cells(followed.slam.map.levels()),
    "lidarium.evaluation.record.episode_record.EpisodeRecord": _record,
    "lidarium.evaluation.episodes.runner.Episode": _episode,
}
"""Pictures (PNG) by class."""


def _rows(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return a table of the policies of an evaluation: how much they saw, and how soon."""
    lines = []
    for policy in dict.fromkeys(row["policy"] for row in rows):
        of_policy = [row for row in rows if row["policy"] == policy]
        reached = [np.inf if row["t99_s"] is None else row["t99_s"] for row in of_policy]
        median = float(np.median(reached))
        seen = 100.0 * float(np.mean([row["coverage_final"] for row in of_policy]))
        cells = (escape(policy), len(of_policy), f"{seen:.1f} %", f"{median:.1f} s" if np.isfinite(median) else "not")
        lines.append(f"<tr>{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>")
    head = "".join(f"<th>{name}</th>" for name in ("policy", "episodes", "explored, mean", "99 % at, median"))
    return f"<table><tr>{head}</tr>{''.join(lines)}</table>"


TABLES: dict[str, Callable[[Any], str]] = {
    "lidarium.evaluation.suites.campaign.Rows": _rows,
    "lidarium.evaluation.suites.suite.Suite": _suite,
}
"""Tables (HTML) by class."""


def show_pictures(shell: Any) -> None:  # noqa: ANN401
    """Tell a shell of IPython how objects look."""
    for kind, functions in (("image/png", PICTURES), ("text/html", TABLES)):
        for name, function in functions.items():
            module, _, of = name.rpartition(".")
            shell.display_formatter.formatters[kind].for_type_by_name(module, of, function)
