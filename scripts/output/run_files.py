"""The files of a run."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lidarium.scripts.output.team_files import write_team

if TYPE_CHECKING:
    from lidarium.evaluation.episodes.runner import Episode
    from lidarium.evaluation.record import Recorder

VIEW_SIZE = 900, 1200
"""Rows and columns of the picture from above [pixels]."""


def write_run(
    folder: Path,
    episode: "Episode",
    result: dict[str, Any],
    recorder: "Recorder | None",
    policy: str,
    films: Sequence[str],
) -> list[str]:
    """Write the figures of a run first, then the record, the maps and the pictures.

    Parameters
    ----------
    folder : Path
        Where to.
    episode : Episode
        The run.
    result : dict
        Its figures.
    recorder : Recorder or None
        What recorded it; None where nothing did.
    policy : str
        Name of the policy.
    films : sequence of str
        Names of the films that were written there before.

    Returns
    -------
    list of str
        The files' names.
    """
    from lidarium.evaluation.drawing.run_picture import save_run_picture
    from lidarium.evaluation.episodes.output import check_written, write_json, write_text
    from lidarium.evaluation.episodes.supervision import decision_lines
    from lidarium.evaluation.truth.beliefs import team_log_odds
    from lidarium.mapping.files.map_files import write_ros_map
    from lidarium.mapping.grids.occupancy import three_levels

    env = episode.env
    write_json(folder / "result.json", result)
    if recorder is not None:
        from lidarium.evaluation.record import write_record

        write_record(folder / "episode.npz", recorder.finish(is_interrupted=episode.is_interrupted))
    log_odds, (x, y) = team_log_odds(env)
    write_ros_map(folder, "map", three_levels(log_odds), (x, y, 0.0), env.settings.occupancy.resolution)
    save_run_picture(folder / "run.png", episode, policy)
    files = ["result.json", "map.yaml", "map.pgm", "run.png", *write_team(folder, episode)]
    if env.settings.camera is not None:
        _save_view(folder / "view.png", episode)
        files += ["view.png", *_write_sparse_maps(folder, episode)]
    report = episode.policy.report()
    if report.supervision is not None:
        write_text(folder / "decisions.jsonl", decision_lines(report))
        files.append("decisions.jsonl")
    files += [*(["episode.npz"] if recorder is not None else []), *films]
    check_written(folder, files)
    return files


def _save_view(path: Path, episode: "Episode") -> None:
    """Draw the floor from above, with the robots where they ended."""
    import imageio.v3 as imageio

    from lidarium.envs.drawing.views import views_of
    from lidarium.evaluation.episodes.output import whole_file

    env = episode.env
    assert env.floor is not None
    views = views_of(env.floor, env.settings.robot, env.settings.robots)
    with whole_file(path) as beside:
        imageio.imwrite(beside, views.from_above(env.world.poses, VIEW_SIZE), extension=".png")


def _write_sparse_maps(folder: Path, episode: "Episode") -> list[str]:
    """Write the sparse maps that robots have made, each with a picture of it and of the robot's trail."""
    from lidarium.evaluation.drawing.maps.sparse_picture import save_sparse_pictures
    from lidarium.mapping.sparse.map_files import write_sparse_map

    files = []
    for row, mapper in sorted(episode.env.perception.sparse_maps.made.items()):
        if mapper.map is not None:
            path = folder / f"{episode.env.possible_agents[row]}.smap"
            write_sparse_map(path, mapper.map)
            pictures = save_sparse_pictures(path, mapper.map.boxes, mapper.map.free, way=mapper.trail)
            files += [path.name, *(Path(picture).name for picture in pictures)]
    return files
