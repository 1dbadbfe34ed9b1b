"""The page of a report: its content, and the built front end with the content in it.

The front end is ``evaluation/report/data/page.html``, built by npm from ``evaluation/report/web``.
"""

import html
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.floor import Floor
from lidarium.evaluation.analysis.episodes import Row, pair_key_of, variant_of
from lidarium.evaluation.analysis.figures import TIMES, Value
from lidarium.evaluation.analysis.groups import Group
from lidarium.evaluation.analysis.records import Entry, Key, record_key
from lidarium.evaluation.drawing.films import FilmSettings
from lidarium.evaluation.drawing.style import colours
from lidarium.evaluation.drawing.track_film import save_track_film
from lidarium.evaluation.episodes.result import METRICS
from lidarium.evaluation.record import EpisodeRecord, read_record, rerun
from lidarium.evaluation.report.replay_page import Replay, replay_of
from lidarium.evaluation.report.sections import Section
from lidarium.evaluation.report.tables import as_text
from lidarium.evaluation.suites.trial import DEFAULT_VARIANT
from lidarium.mapping.files.guarded_reading import printable
from lidarium.mapping.files.output import check_not_read, write_text

_DIGITS = 4
_OF_GROUP = ("times", "over_bound", "values", "comparisons", "coverage_over_time", "profiles", "by_floor")


def page_content(report: dict[str, Any], sections: Sequence[Section], replays: Sequence[Row]) -> dict[str, Any]:
    """Return the content of a page."""
    policies = sorted({policy for section in sections for policy in section.group.runs})
    values = sections[0].values
    place = {id(row): index for index, row in enumerate(replays)}
    return {
        "kind": "report",
        "title": "Report",
        **{name: report[name] for name in ("episodes_version", "baseline", "seed", "records")},
        "warnings": [as_text(warning) for warning in report["warnings"]],
        "policies": dict(zip(policies, colours(len(policies)), strict=True)),
        "times": TIMES,
        "values": {value.column.key: _described(value) for value in values},
        "groups": [_group(section) for section in sections],
        "episodes": _columns([section.group for section in sections], policies, values, place),
    }


def _described(value: Value) -> dict[str, Any]:
    """Return the description of a column for tables of the page."""
    column = value.column
    return {
        "title": printable(column.title),
        "unit": printable(column.unit),
        "digits": column.digits,
        "direction": column.direction,
        "summary": printable(METRICS[value.metric].summary.replace("`", "")),
        "by_mean": column.by_mean,
        "is_main": column.is_main,
    }


def _group(section: Section) -> dict[str, Any]:
    group = section.group
    first = next(iter(group.runs.values()))[0]
    return {
        "title": group.title,
        "settings": _settings_of(first),
        "robots": group.robots,
        "floor_set": group.floor_set,
        "floors": group.floors,
        "horizon_s": group.horizon_s,
        **{name: section.numbers[name] for name in _OF_GROUP},
    }


def _settings_of(row: Row) -> str:
    """Name the settings of an episode: how real its world is, and their own name if they have one."""
    realism, variant = printable(str(row.get("realism") or "unknown")), variant_of(row)
    return realism if variant in ("", DEFAULT_VARIANT) else f"{variant} ({realism})"


def rounded(content: Any) -> Any:  # noqa: ANN401
    """Return content of JSON with numbers of as many digits as a page shows."""
    if isinstance(content, dict):
        return {key: rounded(value) for key, value in content.items()}
    if isinstance(content, list):
        return [rounded(value) for value in content]
    return round(content, _DIGITS) if isinstance(content, float) else content


def _columns(
    groups: Sequence[Group], policies: Sequence[str], values: Sequence[Value], replays: dict[int, int]
) -> dict[str, list[Any]]:
    """Return all episodes as columns, names as their places in lists: thousands of lines stay small."""
    floors = {floor: k for k, floor in enumerate(dict.fromkeys(name for each in groups for name in each.floors))}
    of_policy = {policy: k for k, policy in enumerate(policies)}
    lines = [
        (
            k,
            of_policy[policy],
            floors[str(row["floor"])],
            row["seed"],
            replays.get(id(row), -1),
            *_figures(row, values),
        )
        for k, group in enumerate(groups)
        for policy, rows in group.runs.items()
        for row in rows
    ]
    names = ("group", "policy", "floor", "seed", "replay", *TIMES, *(value.column.key for value in values))
    return {"floors": list(floors), **dict(zip(names, map(list, zip(*lines, strict=True)), strict=True))}


def _figures(row: Row, values: Sequence[Value]) -> list[float | None]:
    times = [None if row[key] is None else round(float(row[key]), 2) for key in TIMES]
    return [*times, *(round(value.of(row), value.column.digits) for value in values)]


def chosen_replays(groups: Iterable[Group], records: dict[Key, Entry], most: int) -> list[Row]:
    """Return the recorded episodes of which a page has replays.

    All policies on one floor with one seed are together, so that they can be compared; the groups, then the floors,
    then the seeds take turns.
    """
    turns: list[tuple[int, int, list[Row]]] = []
    for place, group in enumerate(groups):
        pairs: dict[Any, list[Row]] = {}
        for rows in group.runs.values():
            for row in rows:
                if record_key(row) in records:
                    pairs.setdefault(pair_key_of(row), []).append(row)
        on_floor: dict[str, int] = {}
        ordered = []
        for partners in sorted(
            pairs.values(), key=lambda rows: (group.floors.index(rows[0]["floor"]), rows[0]["seed"])
        ):
            floor = partners[0]["floor"]
            on_floor[floor] = on_floor.get(floor, 0) + 1
            ordered.append((on_floor[floor], partners))
        ordered.sort(key=lambda each: each[0])
        turns += [(turn, place, partners) for turn, (_, partners) in enumerate(ordered)]
    turns.sort(key=lambda each: each[:2])
    return [row for _, _, partners in turns for row in partners][:most]


FRONT_END = Path(__file__).parent / "data" / "page.html"
"""The page without data."""

_TITLE, _DATA = "<!--title-->", "<!--data-->"


def write_page(path: Path, content: Mapping[str, Any], replays: Sequence[Replay]) -> None:
    """Write a page with data and replays, whole or not at all."""
    listed = [{"title": replay.title, "lacks": replay.lacks} for replay in replays]
    data = [_script("application/json", "page-data", _json({**content, "replays": listed}))]
    data += [_script("text/plain", f"replay-{place}", replay.text) for place, replay in enumerate(replays)]
    before, after = FRONT_END.read_text(encoding="utf-8").split(_DATA)
    head = before.replace(_TITLE, html.escape(printable(str(content["title"]))))
    write_text(path, head + "\n".join(data) + after)


def write_replay_page(path: Path, replay: Replay) -> None:
    """Write the page of one episode; raises as `write_page`."""
    write_page(path, {"kind": "replay", "title": replay.title}, [replay])


def replay(
    record: EpisodeRecord | Path | str,
    floor: str | Path | Floor | None = None,
    *,
    html: Path | str | None = None,
    film: Path | str | None = None,
    speed: float = 10.0,
    predicts: bool = False,
) -> ExplorationEnv:
    """Run a recorded episode again, and write a page or a film of it if asked to.

    The version of lidarium that made a record runs it again to the bit.

    Parameters
    ----------
    record : EpisodeRecord, Path or str
        The record, or its file.
    floor : str, Path or Floor, optional
        The floor of the episode; by default the one that the record names.
    html : Path or str, optional
        File of a page that replays the episode in a browser.
    film : Path or str, optional
        File of a film: ``.gif``, ``.webp`` or ``.mp4``.
    speed : float, optional
        Simulated seconds per second of the film, 10 by default.
    predicts : bool, optional
        Whether page and film show what a network predicts beyond the maps; if robots predicted, they do in any case.

    Returns
    -------
    ExplorationEnv
        The environment at the end of the episode.

    Raises
    ------
    ValueError
        If the record is of another version, the floor is not found, the end is not the recorded one, or a file to be
        written is the record.

    Examples
    --------
    >>> import lidarium
    >>> recorded = lidarium.record("nearest_frontier", settings=lidarium.make_settings(horizon_s=5.0))
    >>> lidarium.replay(recorded).scorer.time
    5.0
    """
    if not isinstance(record, EpisodeRecord):
        check_not_read(record, (html, film))
    found = record if isinstance(record, EpisodeRecord) else read_record(Path(record))
    env = rerun(found, floor)
    if html is not None:
        write_replay_page(Path(html), replay_of(found, None if floor is None else env.floor, predicts))
    if film is not None:
        save_track_film(Path(film), found, FilmSettings(speed=speed), env.floor, predicts)
    return env


def _json(content: Mapping[str, Any]) -> str:
    """Return JSON that cannot end the script that contains it."""
    text = json.dumps(content, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").encode("utf-8", "backslashreplace").decode()


def _script(kind: str, name: str, text: str) -> str:
    return f'<script type="{kind}" id="{name}">{text}</script>'
