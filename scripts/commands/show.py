"""`lidarium show`: list the choices: policies, robots, metrics, settings and more."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any, Literal

from tyro.conf import Positional

from lidarium.registry import registry
from lidarium.scripts.common import Answer, Command, table


@dataclass(frozen=True, kw_only=True)
class Show(Command):
    """Show the choices, the settings or the supervisor's decision tree.

    All settings are shown with their defaults, the tree with --out as a picture too.
    """

    what: Positional[
        Literal[
            "policies",
            "robots",
            "lidars",
            "cameras",
            "realism",
            "odometry",
            "localizers",
            "radios",
            "batteries",
            "formats",
            "studies",
            "rewards",
            "observables",
            "backends",
            "metrics",
            "films",
            "commands",
            "settings",
            "supervisor",
        ]
    ]
    """kind of the list"""


def execute(command: Show) -> Answer:
    """List the choices of a kind."""
    from lidarium.mapping.files.output import check_writable, write_json, write_text

    if command.out is not None:
        check_writable(command.out)
    result, text = _LISTS[command.what]()
    if command.out is not None:
        write_json(command.out / f"{command.what}.json", result)
        if command.what == "settings":
            from lidarium.envs.settings.table import markdown_table

            write_text(command.out / "settings.md", markdown_table())
        if command.what == "metrics":
            from lidarium.evaluation.metrics import metrics_table

            write_text(command.out / "metrics.md", metrics_table())
        if command.what == "supervisor":
            from lidarium.evaluation.drawing.tree_picture import save_tree_picture

            save_tree_picture(command.out / "supervisor.png")
    return Answer(result, text)


def _summaries(kind: str, key: str) -> tuple[dict[str, Any], str]:
    """Return the summaries of a registry."""
    summaries = registry(kind).summaries
    return {key: summaries}, table(summaries.items(), indent="")


def _metrics() -> tuple[dict[str, Any], str]:
    from lidarium.evaluation.episodes.result import METRICS

    fields = ("unit", "direction", "summary")
    values = {name: {field: getattr(each, field) for field in fields} for name, each in METRICS.items()}
    rows = [(name, each.unit, each.direction or "", each.summary) for name, each in METRICS.items()]
    return {"metrics": values}, table(rows, ("metric", "unit", "better", "meaning"), indent="")


def _policies() -> tuple[dict[str, Any], str]:
    from lidarium.agents import policy_names

    names = policy_names()
    return {"policies": names}, table(names.items(), indent="")


def _robots() -> tuple[dict[str, Any], str]:
    from lidarium.envs.settings.robots import ROBOTS

    header = ("robot", "radius [m]", "height [m]", "cruise [m/s]", "max [m/s]", "turn [rad/s]")
    rows = [
        (name, robot.radius, robot.height, robot.cruise_speed, robot.max_speed, robot.max_turn_rate)
        for name, robot in ROBOTS.items()
    ]
    return {"robots": {name: asdict(robot) for name, robot in ROBOTS.items()}}, table(rows, header, indent="")


def _cameras() -> tuple[dict[str, Any], str]:
    import math

    from lidarium.envs.settings.cameras import CAMERAS

    header = ("camera", "pixels", "view [deg]", "from [m]", "to [m]", "height [m]", "noisy")
    rows = [
        (
            name,
            f"{camera.columns} x {camera.rows}",
            round(math.degrees(camera.field_of_view), 1),
            camera.depth_min,
            camera.depth_max,
            camera.height,
            "yes" if camera.is_noisy else "no",
        )
        for name, camera in CAMERAS.items()
    ]
    result = {"cameras": {name: asdict(camera) for name, camera in CAMERAS.items()}}
    return result, table(rows, header, indent="")


def _lidars() -> tuple[dict[str, Any], str]:
    import math

    from lidarium.envs.settings.lidar import LIDARS, NOISE

    header = ("lidar", "beams", "view [deg]", "from [m]", "to [m]", "height [m]")
    rows = [
        (
            name,
            lidar.beams,
            round(math.degrees(lidar.field_of_view), 1),
            lidar.range_min,
            lidar.range_max,
            lidar.height,
        )
        for name, lidar in LIDARS.items()
    ]
    noises = [(name, f"{least:g} m or {share:g} of the range, the larger") for name, (least, share) in NOISE.items()]
    result = {
        "lidars": {name: asdict(lidar) for name, lidar in LIDARS.items()},
        "noise": {name: {"noise_floor": least, "noise_share": share} for name, (least, share) in NOISE.items()},
    }
    return result, table(rows, header, indent="") + "\n\nnoise, standard deviation\n" + table(noises)


def _settings() -> tuple[dict[str, Any], str]:
    from lidarium.envs.settings.exploration import ExplorationSettings
    from lidarium.envs.settings.table import settings_table

    rows = [(row.name, "none" if row.default is None else row.default, row.summary) for row in settings_table()]
    text = "\n".join(f"{name:<36}{default!s:<24} {summary}" for name, default, summary in rows)
    return {"settings": asdict(ExplorationSettings())}, text


def _formats() -> tuple[dict[str, Any], str]:
    from lidarium.envs.floors.importers import FORMATS

    rows = [(name, " ".join(FORMATS[name].suffixes), summary) for name, summary in FORMATS.summaries.items()]
    return {"formats": FORMATS.summaries}, table(rows, ("format", "files", "what it is"), indent="")


def _realism() -> tuple[dict[str, Any], str]:
    from lidarium.envs.settings.faults import KINDS
    from lidarium.envs.settings.making import REALISM, make_settings

    header = ("realism", "noise", "odometry", "localization", "radio", "faults [1/h]", "scan [s]", "beams", "maps [m]")
    rows, values = [], {}
    for name, preset in REALISM.items():
        settings = make_settings(realism=name)
        rates = {kind: rate for kind in KINDS[1:] if (rate := getattr(settings.faults, kind)) > 0.0}
        faults = ", ".join(f"{kind} {rate:g}" for kind, rate in rates.items()) or "none"
        detail = (settings.scan_period_s or settings.time_step, settings.lidar.beams, settings.occupancy.resolution)
        row = (name, preset["noise"], preset["odometry"], settings.localization, settings.radio.kind, faults)
        rows.append((*row, *(f"{number:g}" for number in detail)))
        parts = ("lidar", "occupancy", "odometry", "localization", "radio", "faults", "scan_period_s")
        values[name] = {part: asdict(settings)[part] for part in parts}
    return {"realism": values}, table(rows, header, indent="")


def _odometry() -> tuple[dict[str, Any], str]:
    from lidarium.envs.settings.odometry import ODOMETRY

    values = {name: asdict(odometry) for name, odometry in ODOMETRY.items()}
    return {"odometry": values}, _side_by_side(values)


def _radios() -> tuple[dict[str, Any], str]:
    from lidarium.envs.settings.radio import RADIO

    values = {name: asdict(radio) for name, radio in RADIO.items()}
    return {"radios": values}, _side_by_side(values)


def _batteries() -> tuple[dict[str, Any], str]:
    from lidarium.envs.settings.battery import BATTERIES

    values = {name: asdict(battery) for name, battery in BATTERIES.items()}
    return {"batteries": values}, _side_by_side(values)


def _localizers() -> tuple[dict[str, Any], str]:
    from lidarium.mapping.localization.registry import LOCALIZERS

    lines = {"truth": "the true pose", **LOCALIZERS.summaries}
    return {"localizers": lines}, table(lines.items(), indent="")


def _observables() -> tuple[dict[str, Any], str]:
    from lidarium.envs.observing.spaces import KERNEL_SUMMARIES
    from lidarium.envs.settings.observables import SENSED

    summaries = {**KERNEL_SUMMARIES, **SENSED.summaries}
    return {"observables": summaries}, table(summaries.items(), indent="")


def _supervisor() -> tuple[dict[str, Any], str]:
    from lidarium.agents.supervisor.settings import SupervisorSettings
    from lidarium.agents.supervisor.tree import decision_tree, tree_data, tree_text

    settings = SupervisorSettings()
    tree = decision_tree(settings)
    defaults = asdict(settings)
    text = [tree_text(tree), "", "settings", table([(name, str(value)) for name, value in defaults.items()])]
    return {"tree": tree_data(tree), "settings": defaults}, "\n".join(text)


def _side_by_side(values: dict[str, dict[str, Any]]) -> str:
    """Return a table of settings, a column for each name."""
    fields = next(iter(values.values()))
    return table(
        [(field, *(str(named[field]) for named in values.values())) for field in fields],
        ("", *values),
        indent="",
    )


_LISTS: dict[str, Callable[[], tuple[dict[str, Any], str]]] = {
    "policies": _policies,
    "robots": _robots,
    "lidars": _lidars,
    "cameras": _cameras,
    "realism": _realism,
    "odometry": _odometry,
    "localizers": _localizers,
    "radios": _radios,
    "batteries": _batteries,
    "formats": _formats,
    "studies": partial(_summaries, "study", "studies"),
    "rewards": partial(_summaries, "reward_term", "rewards"),
    "observables": _observables,
    "backends": partial(_summaries, "backend", "backends"),
    "metrics": _metrics,
    "films": partial(_summaries, "film", "films"),
    "commands": partial(_summaries, "command", "commands"),
    "settings": _settings,
    "supervisor": _supervisor,
}
