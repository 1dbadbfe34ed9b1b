"""`lidarium replay`: run a recorded episode again, or draw it."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import Positional, arg

from lidarium.scripts.common import DONE, NO, Answer, Command, notify, table
from lidarium.scripts.options import FilmFiles

if TYPE_CHECKING:
    from lidarium.envs.faces.parallel import ExplorationEnv
    from lidarium.envs.floors.floor import Floor
    from lidarium.evaluation.record import EpisodeRecord


_FIGURES = (
    *("coverage_final", "time_s", "t85_s", "t90_s", "t95_s", "t99_s"),
    *("path_m", "overlap", "collisions", "ended_because"),
    *("c_known_final", "c_valid_final", "c_own_min_final", "c_own_mean_final", "c_others_final", "balance"),
    *("iou_occupied", "f1_occupied", "free_error_rate"),
)
"""Metrics of an episode that was run again."""


@dataclass(frozen=True, kw_only=True)
class _Replay(FilmFiles, Command):
    """Run a recorded episode again and compare its end, or draw its record.

    It reports whether the episode ends in the same state to the bit. Pictures, films and pages show records
    of other versions too.
    """

    file: Annotated[Positional[Path], arg(metavar="FILE")]
    """episode.npz of `lidarium run --record`"""
    floor: str | None = None
    """the floor that was recorded, if the one that the record names is not found"""
    picture: Path | None = None
    """draw the record as a PNG file instead of running it again.

    Works for records of other versions too
    """
    html: Path | None = None
    """write a page that replays the record in a browser, as one HTML file without network.

    Works for records of other versions too, with less to be seen
    """
    prediction: bool = False
    """show what a network predicts beyond the map, in all of these, also if robots did not predict"""
    mcap: Path | None = None
    """run the record again and write the sensor data as a bag of ROS 2 (extra bags)"""
    demonstrations: Path | None = None
    """run the record again and write observations and actions of each robot (.npz), to imitate"""


def execute(command: _Replay) -> Answer:
    """Run a record again, or draw it."""
    from lidarium.evaluation.record import read_record
    from lidarium.mapping.files.output import check_not_read, check_writable, write_json

    asked = {".png": command.picture, ".html": command.html, ".mcap": command.mcap, ".npz": command.demonstrations}
    files = [path for path in asked.values() if path is not None]
    for folder in (command.out, *(path.parent for path in files)):
        if folder is not None:
            check_writable(folder)
    for suffix, path in asked.items():
        if path is not None and path.suffix.lower() != suffix:
            raise ValueError(f"{path} does not fit as a name; want one that ends in {suffix}")
    check_not_read(command.file, (*files, *command.films))
    if not command.films:
        command.refuse("no film is asked for", "film_speed", "film_width", "film_fps")
        if command.picture is None and command.html is None:
            command.refuse("neither picture, page nor film is asked for", "prediction")
    command.check_films()
    record = read_record(command.file)
    answer = _drawn(command, record) if files or command.films else _run_again(command, record)
    if command.out is not None:
        write_json(command.out / "replay.json", answer.result)
    return answer


def _about(command: _Replay, record: "EpisodeRecord") -> dict[str, Any]:
    header = record.header
    names = ("version", "floor", "robots", "policy", "seed", "interrupted")
    return {"record": str(command.file), **{name: header[name] for name in names}}


def _drawn(command: _Replay, record: "EpisodeRecord") -> Answer:
    from lidarium.evaluation.drawing.record_frames import save_track_picture
    from lidarium.evaluation.drawing.track_film import save_track_film

    files = []
    if command.picture is not None:
        save_track_picture(command.picture, record, command.prediction)
        files.append(str(command.picture))
    floor = _floor_of_camera(command, record) if command.films else None
    for path in command.films:
        notify(f"filming {record.display.times[-1]:.0f} s")
        save_track_film(path, record, command.film_settings, floor, command.prediction)
        files.append(str(path))
    if command.html is not None:
        _write_page(command.html, command, record)
        files.append(str(command.html))
    if command.mcap is not None:
        from lidarium.evaluation.record.bag import write_bag

        write_bag(command.mcap, record, command.floor)
        files.append(str(command.mcap))
    if command.demonstrations is not None:
        from lidarium.evaluation.record.demonstrations import write_demonstrations

        write_demonstrations(command.demonstrations, record, command.floor)
        files.append(str(command.demonstrations))
    display = record.display
    result = {
        **_about(command, record),
        "time_s": round(float(display.times[-1]), 6),
        "coverage_final": round(float(display.coverage[-1, 1]), 9),
        "files": files,
    }
    facts = [
        (
            "explored",
            f"{100.0 * result['coverage_final']:.2f} % in {result['time_s']:.1f} s of simulated time",
        ),
        ("files", ", ".join(files)),
    ]
    return Answer(result, "\n".join([_title(result), table(facts)]))


def _write_page(path: Path, command: _Replay, record: "EpisodeRecord") -> None:
    from lidarium.evaluation.report.page import write_replay_page
    from lidarium.evaluation.report.replay_page import replay_of

    replay = replay_of(record, command.floor, command.prediction)
    if replay.lacks:
        notify(f"the page is without scans, true walls and the robots' own maps: {replay.lacks}")
    write_replay_page(path, replay)


def _floor_of_camera(command: _Replay, record: "EpisodeRecord") -> "Floor | None":
    """Return the floor that the cameras of a record see.

    It is None if robots had no cameras, or if the floor is not found.
    """
    from lidarium.evaluation.record.replay import find_floor

    if not record.header["settings"].get("camera"):
        return None
    try:
        return find_floor(record.header, command.floor)
    except ValueError as error:
        if command.floor is not None:
            raise
        notify(f"the film is without cameras: {error}")
        return None


def _run_again(command: _Replay, record: "EpisodeRecord") -> Answer:
    from lidarium.evaluation.record.replay import drive_again, first_difference, is_same, state_sha256

    env = drive_again(record, command.floor)
    same = is_same(record, env)
    result = {
        **_about(command, record),
        "same": same,
        "final_sha256": state_sha256(env),
        "recorded_sha256": record.header["final_sha256"],
        **_figures(env),
    }
    verdict = "the same as recorded, to the bit" if same else f"not as recorded: {first_difference(record, env)}"
    ended = [
        (agent, reason or "still at work", f"{length:.1f} m")
        for (agent, reason), length in zip(result["ended_because"].items(), result["path_m"], strict=True)
    ]
    facts = [
        ("final state", verdict),
        (
            "explored",
            f"{100.0 * result['coverage_final']:.2f} % in {result['time_s']:.1f} s of simulated time",
        ),
        (
            "together",
            f"{sum(result['path_m']):.1f} m driven, overlap {result['overlap']:.2f}, {result['collisions']} collisions",
        ),
        ("map", f"IoU of occupied cells {result['iou_occupied']:.3f}"),
    ]
    text = "\n".join([_title(result), table(facts), "", table(ended, ("robot", "ended because", "drove"))])
    return Answer(result, text, DONE if same else NO)


def _figures(env: "ExplorationEnv") -> dict[str, Any]:
    """Return the main figures of an episode, as ``result.json`` has them."""
    from lidarium.evaluation.episodes.result import EpisodeData, figures_of

    return figures_of(EpisodeData(env), _FIGURES)


def _title(result: dict[str, Any]) -> str:
    who = result["policy"] or "an unnamed policy"
    seed = "" if result["seed"] is None else f", seed {result['seed']}"
    how = " (interrupted)" if result["interrupted"] else ""
    return f"{result['floor']}: {who}{seed}, recorded by lidarium {result['version']}{how}"
