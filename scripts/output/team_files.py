"""The maps that a run leaves: each robot's own, those that were merged, and how they lie."""

from pathlib import Path
from typing import TYPE_CHECKING

from lidarium.scripts.output.transforms import PlacedMaps, transforms

if TYPE_CHECKING:
    from lidarium.agents.report import TeamMaps
    from lidarium.envs.faces.parallel import ExplorationEnv
    from lidarium.evaluation.episodes.runner import Episode


def write_team(folder: Path, episode: "Episode") -> list[str]:
    """Write each robot's map and, of a team, each group's merged map and ``transforms.json``.

    All are in the robots' own map frames. What is merged is as the station last knew it; without a station
    nothing is.

    Parameters
    ----------
    folder : Path
        Where to.
    episode : Episode
        The run.

    Returns
    -------
    list of str
        The files' names.
    """
    from lidarium.evaluation.episodes.output import write_json
    from lidarium.mapping.files.map_files import write_ros_map

    env, known = episode.env, _team_maps(episode)
    names = []
    for robot, agent in enumerate(env.possible_agents):
        _write_own_map(folder, env, robot)
        names.append(agent)
    for group in known.groups:
        if group.fused is not None:
            joined = sum(name.startswith("merged") for name in names)
            names.append("merged" if joined == 0 else f"merged-{joined + 1}")
            fused = group.fused
            write_ros_map(folder, names[-1], fused.levels, (*fused.origin, 0.0), fused.resolution)
    files = [f"{name}.{kind}" for name in names for kind in ("yaml", "pgm")]
    if env.settings.robots == 1:
        return files
    placed = PlacedMaps(
        [group.frames for group in known.groups], known.pairs, known.corners, known.used, known.dropped
    )
    write_json(folder / "transforms.json", transforms(placed))
    return [*files, "transforms.json"]


def _write_own_map(folder: Path, env: "ExplorationEnv", robot: int) -> None:
    """Write what a robot's own map knows, in that robot's map frame."""
    import numpy as np

    from lidarium.envs.onboard.station.reports import known_map
    from lidarium.mapping.files.map_files import write_ros_map
    from lidarium.mapping.grids.occupancy import UNKNOWN

    one = known_map(env.perception, robot)
    # A robot that has seen nothing leaves one cell, as a map has to have some.
    levels = one.levels if one.levels.size else np.full((1, 1), UNKNOWN, np.uint8)
    write_ros_map(
        folder, env.possible_agents[robot], levels, (*one.origin, 0.0), env.settings.occupancy.resolution
    )


def _team_maps(episode: "Episode") -> "TeamMaps":
    """Return how the robots' maps lie: as a station knows, else as the robots do."""
    from lidarium.agents.report import JoinedGroup, TeamMaps
    from lidarium.envs.faces.merged_maps import true_frames
    from lidarium.mapping.geometry.rigid import Transform

    known, env = episode.policy.team_maps(), episode.env
    if known is not None:
        return known
    first, *others = env.possible_agents
    if not env.settings.known_starts:
        return TeamMaps([JoinedGroup({agent: Transform()}) for agent in env.possible_agents])
    frames = true_frames(env)
    return TeamMaps([JoinedGroup({first: Transform(), **{name: frames[first, name] for name in others}})])
