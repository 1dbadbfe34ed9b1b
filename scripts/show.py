"""`lidarium show`: what can be chosen: policies, robots, lasers, settings."""

from dataclasses import asdict, dataclass
from typing import Any, Literal

from tyro.conf import Positional

from lidarium.scripts.common import Answer, Command, table


@dataclass(frozen=True, kw_only=True)
class Show(Command):
    """Tell what can be chosen: policies, robots, lidars, or all settings with their defaults."""

    what: Positional[Literal["policies", "robots", "lidars", "settings"]]
    """what to list"""


def execute(command: Show) -> Answer:
    """List what there is of a kind."""
    from lidarium.evaluation.output import check_writable, write_json

    if command.out is not None:
        check_writable(command.out)
    result, text = {"policies": _policies, "robots": _robots, "lidars": _lidars, "settings": _settings}[command.what]()
    if command.out is not None:
        write_json(command.out / f"{command.what}.json", result)
    return Answer(result, text)


def _policies() -> tuple[dict[str, Any], str]:
    from lidarium.agents import policy_names

    names = policy_names()
    return {"policies": names}, table(names.items(), indent="")


def _robots() -> tuple[dict[str, Any], str]:
    from lidarium.envs.simulation.robots import ROBOTS

    header = ("robot", "radius [m]", "height [m]", "cruise [m/s]", "max [m/s]", "turn [rad/s]")
    rows = [(name, robot.radius, robot.height, robot.cruise_speed, robot.max_speed, robot.max_turn_rate) for name, robot in ROBOTS.items()]
    return {"robots": {name: asdict(robot) for name, robot in ROBOTS.items()}}, table(rows, header, indent="")


def _lidars() -> tuple[dict[str, Any], str]:
    import math

    from lidarium.envs.settings import LIDARS, NOISE

    header = ("lidar", "beams", "view [deg]", "from [m]", "to [m]", "height [m]")
    rows = [
        (name, lidar.beams, round(math.degrees(lidar.field_of_view), 1), lidar.range_min, lidar.range_max, lidar.height)
        for name, lidar in LIDARS.items()
    ]
    noises = [(name, f"{least:g} m or {share:g} of the range, the larger") for name, (least, share) in NOISE.items()]
    result = {
        "lidars": {name: asdict(lidar) for name, lidar in LIDARS.items()},
        "noise": {name: {"noise_floor": least, "noise_share": share} for name, (least, share) in NOISE.items()},
    }
    return result, table(rows, header, indent="") + "\n\nnoise, standard deviation\n" + table(noises)


def _settings() -> tuple[dict[str, Any], str]:
    from lidarium.envs.settings import ExplorationSettings

    values = asdict(ExplorationSettings())
    rows = []
    for name, value in values.items():
        entries = {f"{name}.{part}": part_value for part, part_value in value.items()} if isinstance(value, dict) else {name: value}
        rows += [(entry, "none" if part_value is None else str(part_value)) for entry, part_value in entries.items()]
    return {"settings": values}, "\n".join(f"{entry:<32}{value}" for entry, value in rows)
