"""Suites: policies x floors x robots x seeds x settings, read from TOML, and their single trials."""

import hashlib
import json
import tomllib
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

from lidarium.agents import Policy, make_policy
from lidarium.agents.catalogue import POLICIES
from lidarium.agents.policy import settings_for
from lidarium.envs.floors.catalogue.names import is_generated, load_floor
from lidarium.envs.floors.floor_choice import pixel_side, single_floors
from lidarium.envs.levels import LEVELS
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.stop_rules import stop_rule_of
from lidarium.evaluation.suites.trial import DEFAULT_VARIANT, Trial
from lidarium.mapping.files.guarded_reading import read_text, reading
from lidarium.mapping.files.named_files import hash_of, named_files
from lidarium.mapping.geometry.bounds import Rule, above, shown, within

MOST_SUITE_BYTES = 1 << 20
"""Longest file of a suite."""

MOST_EACH = 1_000_000
"""Maximum number of policies, floors, teams, seeds or variants."""

MOST_TRIALS = 10_000_000
"""Maximum number of episodes of a suite."""

RUN_OPTIONS = ("merging", "plans_sparsely", "level")
"""Options of ``run_episode`` that variants may set, besides settings."""

ROBOTS = Rule(int, bounds=within(1, 64))
SEED = Rule(int, bounds=within(0, 2**63 - 1))
SIDE = Rule(float, True, above(0.0, 1000.0))
_POSE = Rule(float, bounds=within(-1e8, 1e8))

Starts = tuple[tuple[float, float, float], ...]


def check_members(name: str, values: Sequence[Any]) -> None:
    """Check that there is something, with names, and nothing is there twice."""
    if not 1 <= len(values) <= MOST_EACH:
        some = "no" if not values else f"{len(values):,}"
        raise ValueError(f"the suite has {some} {name}; want at least one, at most {MOST_EACH:,}")
    seen: set[Any] = set()
    for value in values:
        if not isinstance(value, Hashable):
            raise ValueError(f"the suite has {shown(value)} among its {name}; want names or numbers")
        if value in seen:
            raise ValueError(f"the suite names {shown(value)} twice among its {name}")
        seen.add(value)


def check_numbers(name: str, values: Iterable[Any], rule: Rule) -> None:
    """Check all numbers of a list of the suite."""
    for value in values:
        if not rule.hold(value):
            raise ValueError(f"{name} of the suite has {shown(value)}; want {rule.wanted}")


def check_texts(name: str, values: Iterable[Any]) -> None:
    """Check that all members of a list of the suite are names."""
    for value in values:
        if not isinstance(value, str):
            raise ValueError(f"{name} of the suite has {shown(value)}; want names")


def check_trials(*lengths: int) -> None:
    """Check that a suite has not more episodes than can be counted one by one."""
    trials = 1
    for length in lengths:
        trials *= max(length, 1)
    if trials > MOST_TRIALS:
        raise ValueError(f"the suite has {trials:,} episodes; want at most {MOST_TRIALS:,}: part it")


def listed(content: Mapping[str, Any], name: str) -> tuple[Any, ...]:
    """Return a list of a suite; a single name or number counts as a list of one."""
    values = content[name]
    if isinstance(values, list | tuple):
        return tuple(values)
    if isinstance(values, str | int):
        return (values,)
    raise ValueError(f"{name} of the suite is {shown(values)}; want a list")


def seeds_of(seeds: Any, content: Mapping[str, Any]) -> tuple[Any, ...]:  # noqa: ANN401
    """Return the seeds of a suite: those of a list, or that many from 0 on."""
    if isinstance(seeds, int) and not isinstance(seeds, bool):
        if not 1 <= seeds <= MOST_EACH:
            raise ValueError(f"seeds of the suite is {shown(seeds)}; want a list, or how many, 1 to {MOST_EACH:,}")
        return tuple(range(seeds))
    return listed(content, "seeds")


def tables_of(content: Any, what: str) -> dict[str, dict[str, Any]]:  # noqa: ANN401
    """Return tables by name, as those of variants."""
    if not isinstance(content, Mapping) or not all(isinstance(table, Mapping) for table in content.values()):
        raise ValueError(f"{what} of the suite is {shown(content)}; want tables, as in [{what}.name]")
    return {name: dict(table) for name, table in content.items()}


def starts_of(content: Any) -> dict[str, tuple[Starts, ...]]:  # noqa: ANN401
    """Return teams of starts by floor."""
    if not isinstance(content, Mapping):
        raise ValueError(f"starts of the suite is {shown(content)}; want a table of teams by floor")
    return {floor: tuple(_team(floor, team) for team in _list(floor, teams)) for floor, teams in content.items()}


def _team(floor: str, team: Any) -> Starts:  # noqa: ANN401
    for start in _list(floor, team):
        if len(_list(floor, start)) != 3 or not all(_POSE.hold(value) for value in start):
            raise ValueError(f"a start on {floor!r} is {shown(start)}; want x, y [m] and theta [rad] of each robot")
    return tuple((start[0], start[1], start[2]) for start in team)


def _list(floor: str, value: Any) -> Sequence[Any]:  # noqa: ANN401
    if not isinstance(value, list | tuple):
        raise ValueError(
            f"starts on {shown(floor)} has {shown(value)}; want a list of teams, each a list of x, y, theta"
        )
    return value


@dataclass(frozen=True, slots=True, kw_only=True)
class Suite:
    """The request of an evaluation.

    Trials that differ in the policy alone are paired: same floor, same starts, same seed.

    Attributes
    ----------
    policies, floors : tuple of str
        Names of policies, or of ``policy_settings``; floors as for ``load_floor``, and ``set:NAME`` for all
        floors of a set.
    robots, seeds : tuple of int
        Sizes of teams; seeds.
    variants : dict
        Settings by name, as the options of ``lidarium.parallel_env``, and ``merging``, ``plans_sparsely`` and
        ``level`` as for ``lidarium.run_episode``.
    starts : dict
        By floor: teams of starts (x, y, theta) in the floor's frame [m, rad], tried one after the other in
        place of drawn ones; a team takes as many of them as it has robots.
    draws_starts : bool
        Whether the seed draws starts also on floors that have starts of their own; these would be the same
        for every seed.
    bounds : bool
        Whether each episode is compared with the time of a team that knows the floor. False by default.
    stop : dict or None
        Rule that ends episodes in addition to the settings, as ``StopRule``; ``decisions`` may be a table by the
        number of robots.
    image_resolution : float or None
        Metres per pixel of those floors that are plain images.
    policy_settings : dict
        By a name among the policies: options of the policy, and ``policy``, the policy itself,
        if the name is another.
    """

    policies: tuple[str, ...]
    floors: tuple[str, ...]
    robots: tuple[int, ...] = (1,)
    seeds: tuple[int, ...] = (0,)
    variants: Mapping[str, Mapping[str, Any]] = field(default_factory=lambda: {DEFAULT_VARIANT: {}})
    starts: Mapping[str, Sequence[Starts]] = field(default_factory=dict)
    draws_starts: bool = True
    bounds: bool = False
    stop: Mapping[str, Any] | None = None
    image_resolution: float | None = None
    policy_settings: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("policies", "floors", "robots", "seeds", "variants"):
            check_members(name, list(getattr(self, name)))
        for name in ("policies", "floors", "variants"):
            check_texts(name, getattr(self, name))
        check_numbers("robots", self.robots, ROBOTS)
        check_numbers("seeds", self.seeds, SEED)
        check_numbers("image_resolution", [self.image_resolution], SIDE)
        most = max((len(teams) for teams in self.starts.values()), default=1)
        check_trials(*map(len, (self.policies, self.floors, self.robots, self.seeds, self.variants)), most)
        for name in self.policy_settings:
            if name not in self.policies:
                raise ValueError(f"the suite has settings of a policy {name!r}, which is not among its policies")
        made = {name: self.make_policy(name) for name in self.policies}
        check_members("floors", self.single_floors)
        for floor in self.floors:
            if not (floor.startswith("set:") or is_generated(floor)):
                for single in map(str, single_floors(floor)):
                    load_floor(single, self.pixel_side(single))
        for variant in self.variants:
            options = self.run_options(variant)
            level = options.pop("level", None)
            for name, value in options.items():
                if not isinstance(value, bool):
                    raise ValueError(f"{name} of variant {variant!r} is {shown(value)}; want true or false")
            for name, policy in made.items():
                _check_level(name, policy, variant, level)
            for robots in self.robots:
                settings = self.settings(variant, robots)
                for name, policy in made.items():
                    _check_sensors(name, policy, variant, settings)
        for robots in self.robots:
            stop_rule_of(self.stop, robots)
        for floor, given in self.starts.items():
            if floor not in self.floors:
                raise ValueError(f"the suite has starts on {floor!r}, which is not among its floors")
            if single_floors(floor) != (floor,):
                raise ValueError(f"the suite has starts on {floor!r}, which are many; want them for each of its floors")
            if not given:
                raise ValueError(f"the suite has no starts on {floor!r}; want at least one team of them, or no entry")
            for team in given:
                if len(team) < max(self.robots) or any(len(start) != 3 for start in team):
                    raise ValueError(
                        f"a team of starts on {floor!r} is {team}; want x, y, theta of at least "
                        f"{max(self.robots)} robots"
                    )

    def settings(self, variant: str, robots: int) -> ExplorationSettings:
        """Return the settings of a variant for a team; each episode runs on one thread."""
        options = {name: value for name, value in self.variants[variant].items() if name not in RUN_OPTIONS}
        for name, why in (("robots", "the suite's robots"), ("threads", "one thread an episode")):
            if name in options:
                raise ValueError(f"variant {variant!r} sets {name}, which is fixed by {why}; leave it out")
        try:
            settings = make_settings(robots=robots, **options)
        except (ValueError, TypeError, AttributeError) as error:
            raise ValueError(f"variant {variant!r} with {robots} robots cannot be used: {error}") from error
        if settings.robots != robots:
            raise ValueError(
                f"variant {variant!r} has {settings.robots} robots, and the suite {robots}; want --robots alone"
            )
        return settings

    def run_options(self, variant: str) -> dict[str, Any]:
        """Return the options of ``run_episode`` that a variant sets."""
        return {name: value for name, value in self.variants[variant].items() if name in RUN_OPTIONS}

    def make_policy(self, name: str) -> Policy:
        """Return a new policy by its name among the policies."""
        options = dict(self.policy_settings.get(name, {}))
        try:
            return make_policy(options.pop("policy", name), **options)
        except (ValueError, TypeError, AttributeError, OverflowError) as error:
            if name not in self.policy_settings:
                raise
            raise ValueError(f"policy {name!r} of the suite cannot be made: {error}") from error

    @property
    def single_floors(self) -> tuple[str, ...]:
        """Names of the single floors."""
        return tuple(str(single) for floor in self.floors for single in single_floors(floor))

    def pixel_side(self, floor: str) -> float | None:
        """Return the side of a pixel to read one of the floors with [m]; None if it states its own."""
        if is_generated(floor):
            return None
        return pixel_side(floor, self.image_resolution, is_alone=self.floors == (floor,))

    def trials(self) -> Iterator[Trial]:
        """Yield all trials, paired ones one after the other.

        A suite that is cut short is therefore still paired.
        """
        for variant in self.variants:
            for floor in self.floors:
                teams = range(len(self.starts[floor])) if floor in self.starts else (-1,)
                for single in map(str, single_floors(floor)):
                    for robots in self.robots:
                        for start in teams:
                            for seed in self.seeds:
                                for policy in self.policies:
                                    yield Trial(variant, single, robots, start, seed, policy)

    def starts_of(self, trial: Trial) -> list[list[float]] | None:
        """Return the starts of a trial's robots, None if they are not given."""
        if trial.start < 0:
            return None
        return [list(start) for start in self.starts[trial.floor][trial.start][: trial.robots]]

    def setup_sha256(self, policy: str, variant: str) -> str:
        """Return a hash of what episodes of a policy depend on besides the settings of their world.

        Files that the policy's options name count by their content.
        """
        options = {
            name: hash_of(files) if (files := named_files(value)) else value
            for name, value in self.policy_settings.get(policy, {}).items()
        }
        told = {
            "draws_starts": self.draws_starts,
            "stop": self.stop,
            "run": {name: value for name, value in self.variants[variant].items() if name in RUN_OPTIONS},
            "policy": options,
        }
        return hashlib.sha256(json.dumps(told, sort_keys=True, default=str).encode()).hexdigest()

    def as_dict(self) -> dict[str, Any]:
        """Return it as types that JSON has."""
        content: dict[str, Any] = json.loads(json.dumps(asdict(self)))
        return content


def read_suite(path: Path, own_policies: bool = False) -> Suite:
    """Read a suite from a TOML file (docs/reference/files.md).

    It may name policies of modules, which are imported, only with ``own_policies``: suites are shared.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"no suite {path}; want a TOML file, as docs/reference/files.md shows one")
    text = read_text(path, MOST_SUITE_BYTES)
    with reading(path, "TOML"):
        content = tomllib.loads(text)
    if not own_policies:
        _refuse_modules(path, content)
    with reading(path, "a suite that can be used"):
        return suite_of(content)


def _refuse_modules(path: Path, content: Mapping[str, Any]) -> None:
    """Check that a file names registered policies alone."""
    settings = content.get("policy_settings")
    tables = settings.values() if isinstance(settings, Mapping) else ()
    policies = content.get("policies")
    named = [
        *(policies if isinstance(policies, list) else [policies]),
        *(table.get("policy") for table in tables if isinstance(table, Mapping)),
    ]
    # A name with a table that says which policy it is stands for that.
    aliases = {
        name
        for name, table in (settings.items() if isinstance(settings, Mapping) else ())
        if isinstance(table, Mapping) and "policy" in table
    }
    for name in named:
        if isinstance(name, str) and ":" in name and name not in POLICIES and name not in aliases:
            raise ValueError(
                f"{path} names the policy {shown(name)} of a module, which would be imported and run; want "
                "--own-policies if you trust the file"
            )


def suite_of(content: Mapping[str, Any]) -> Suite:
    """Make a suite of the content of a TOML file."""
    known = {each.name for each in fields(Suite)} | {"settings"}
    unknown = sorted(set(content) - known)
    if unknown:
        raise ValueError(f"a suite has no {shown(unknown[0])}; it has {', '.join(sorted(known))}")
    for name in ("policies", "floors"):
        if name not in content:
            raise ValueError(f"the suite has no {name}; want a list of names")
    common, draws = content.get("settings", {}), content.get("draws_starts", True)
    bounds = content.get("bounds", False)
    if not (isinstance(common, Mapping) and isinstance(draws, bool) and isinstance(bounds, bool)):
        raise ValueError(
            f"settings of the suite is {shown(common)}, draws_starts {shown(draws)} and bounds "
            f"{shown(bounds)}; want tables, as in [settings], and true or false"
        )
    variants = tables_of(content.get("variants", {DEFAULT_VARIANT: {}}), "variants")
    return Suite(
        policies=listed(content, "policies"),
        floors=listed(content, "floors"),
        robots=listed(content, "robots") if "robots" in content else (1,),
        seeds=seeds_of(content.get("seeds", 1), content),
        variants={name: {**common, **variant} for name, variant in variants.items()},
        starts=starts_of(content.get("starts", {})),
        draws_starts=draws,
        bounds=bounds,
        stop=content.get("stop"),
        image_resolution=content.get("image_resolution"),
        policy_settings=tables_of(content.get("policy_settings", {}), "policy_settings"),
    )


def _check_level(name: str, policy: Policy, variant: str, level: Any) -> None:  # noqa: ANN401
    """Check that the level of a variant carries out the actions of a policy."""
    wanted = policy.level if level is None else level
    if not isinstance(wanted, str):
        raise ValueError(f"level of variant {variant!r} is {shown(level)}; want one of {', '.join(LEVELS)}")
    if wanted != policy.level and policy.level not in LEVELS[wanted].carries:
        raise ValueError(
            f"policy {name!r} decides at the level {policy.level!r}, which level {wanted!r} of variant {variant!r} "
            "does not carry out"
        )


def _check_sensors(name: str, policy: Policy, variant: str, settings: ExplorationSettings) -> None:
    """Check that the robots of a variant have the sensors that a policy reads."""
    try:
        settings_for(policy, settings)
    except ValueError as error:
        raise ValueError(f"policy {name!r} cannot run with variant {variant!r}: {error}") from error
