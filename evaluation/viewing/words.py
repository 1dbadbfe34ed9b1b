"""What a page says of a run, as HTML."""

from collections.abc import Sequence
from html import escape

from lidarium.agents.report import PolicyReport
from lidarium.envs.drawing.frame_parts import team_colours
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.mapping.files.guarded_reading import printable

MOST_EVENTS = 6
"""Most events that are listed, the latest first."""


def status_text(env: WatchedExploration, policy: str, report: PolicyReport, decisions: int) -> str:
    """Return where a run is: time, coverage, decisions, and what each robot does."""
    name = "" if env.floor is None else env.floor.name
    joins = [] if report.supervision is None else [join for join in report.supervision.joins if join.is_used]
    rows = [
        ("Time", f"{env.scorer.time:.1f} s"),
        ("Explored", f"{100.0 * env.scorer.coverage:.1f} %"),
        ("Decisions", f"{decisions:,}"),
    ]
    if report.supervision is not None:
        rows.append(("Maps joined", f"{len(joins):,}"))
        rows.append(("Orders", f"{len(report.supervision.orders):,}"))
    title = f"<b>{_safe(name)}</b><br>{_safe(policy)}"
    return _BOX.format("".join([title, _table(rows), _robots(env)]))


def events_text(env: WatchedExploration, report: PolicyReport) -> str:
    """Return the latest joins, orders and changes of state, the last one first."""
    events = [
        (event.time_s, f"{event.agent}: {event.what}{f' ({event.reason})' if event.reason else ''}")
        for event in env.operating.events[0]
    ]
    if report.supervision is not None:
        joins = report.supervision.joins
        events += [(join.time_s, f"{join.a} and {join.b} joined") for join in joins if join.is_used]
    if not events:
        return _BOX.format("nothing yet")
    latest = sorted(events, key=lambda event: event[0])[: -MOST_EVENTS - 1 : -1]
    return _BOX.format(_table([(_safe(words), f"{time_s:.1f} s") for time_s, words in latest]))


_BOX = '<div style="padding:4px 14px 2px;font-size:0.875em;line-height:1.5">{}</div>'
_TABLE = '<table style="width:100%;margin-top:4px;border-collapse:collapse">{}</table>'


def _safe(text: str) -> str:
    """Return text that HTML shows as it is."""
    return escape(printable(text))


def _table(rows: Sequence[tuple[str, str]]) -> str:
    return _TABLE.format(
        "".join(
            f'<tr><td>{name}</td><td style="text-align:right;white-space:nowrap">{value}</td></tr>'
            for name, value in rows
        )
    )


def _robots(env: WatchedExploration) -> str:
    """Return a line for each robot: its colour, what it does, and how far it has driven."""
    lines = []
    colours = team_colours(env.settings.robots)
    for row, (agent, (red, green, blue)) in enumerate(zip(env.possible_agents, colours, strict=True)):
        dot = f'<span style="color:rgb({red},{green},{blue})">&#9679;</span>'
        lines.append((f"{dot} {agent}", f"{_doing(env, row)}, {env.world.travelled[row]:.1f} m"))
    return _table(lines)


def _doing(env: WatchedExploration, row: int) -> str:
    if env.possible_agents[row] not in env.agents:
        return "ended"
    if env.driver is None:
        return "driving"
    return env.driver.state(row).value.replace("_", " ")
