"""What an evaluation asks for, and the single trials that this makes.

It asks for policies x floors x robots x seeds x settings.
"""

import json
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

from lidarium.agents import Policy, make_policy
from lidarium.agents.policy import settings_for
from lidarium.envs.floors.catalogue.names import is_generated, load_floor, set_floors
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.stop_rules import stop_rule_of
from lidarium.evaluation.suites.content import (
    MOST_SUITE_BYTES,
    ROBOTS,
    SEED,
    SIDE,
    Starts,
    check_members,
    check_numbers,
    check_texts,
    check_trials,
    listed,
    seeds_of,
    starts_of,
    tables_of,
)
from lidarium.evaluation.suites.trial import DEFAULT_VARIANT, Trial
from lidarium.mapping.files.guarded_reading import read_text, reading
from lidarium.mapping.geometry.bounds import shown


@dataclass(frozen=True, slots=True, kw_only=True)
class Suite:
    """What an evaluation asks for.

    Trials that differ in the policy alone are paired: same floor, same starts, same seed.

    Attributes
    ----------
    policies, floors : tuple of str
        Names of policies, or of ``policy_settings``; floors as for ``load_floor``, and ``set:NAME`` for all
        floors of a set.
    robots, seeds : tuple of int
        Sizes of teams; seeds.
    variants : dict
        Settings by name, as the options of ``lidarium.parallel_env``.
    starts : dict
        By floor: teams of starts (x, y, theta) in the floor's frame [m, rad], tried one after the other in
        place of drawn ones; a team takes as many of them as it has robots.
    draws_starts : bool
        Whether the seed draws starts also on floors that have starts of their own; these would be the same
        for every seed.
    bounds : bool
        Whether each episode is set beside how soon a team that knew the floor could have seen it.
    stop : dict or None
        When episodes end beside what the settings say, as ``StopRule``.
    image_resolution : float or None
        Metres per pixel, where floors are plain images.
    policy_settings : dict
        By a name among the policies: options that the policy is made with, and ``policy``, which one it is,
        where the name is another.

    Raises
    ------
    ValueError
        Where there is nothing to try, something is named twice, or a policy, floor, number or setting cannot
        be used.
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
                raise ValueError(
                    f"the suite has settings of a policy {name!r}, which is not among its policies"
                )
        made = {name: self.make_policy(name) for name in self.policies}
        for floor in self.floors:
            _check_floor(floor, self.image_resolution)
        for variant in self.variants:
            for robots in self.robots:
                settings = self.settings(variant, robots)
                for name, policy in made.items():
                    _check_sensors(name, policy, variant, settings)
        stop_rule_of(self.stop)
        for floor, given in self.starts.items():
            if floor not in self.floors:
                raise ValueError(f"the suite has starts on {floor!r}, which is not among its floors")
            for team in given:
                if len(team) < max(self.robots) or any(len(start) != 3 for start in team):
                    raise ValueError(
                        f"a team of starts on {floor!r} is {team}; want x, y, theta of at least "
                        f"{max(self.robots)} robots"
                    )

    def settings(self, variant: str, robots: int) -> ExplorationSettings:
        """Return the settings of a variant for a team; each episode runs on one thread.

        Raises
        ------
        ValueError
            Where a setting cannot be used; the variant is named.
        """
        options = dict(self.variants[variant])
        for name, why in (("robots", "the suite's robots"), ("threads", "one thread an episode")):
            if name in options:
                raise ValueError(f"variant {variant!r} sets {name}, which is fixed by {why}; leave it out")
        try:
            return make_settings(robots=robots, **options)
        except (ValueError, TypeError, AttributeError) as error:
            raise ValueError(f"variant {variant!r} with {robots} robots cannot be used: {error}") from error

    def make_policy(self, name: str) -> Policy:
        """Return a new policy by its name among the policies.

        Raises
        ------
        ValueError
            Where there is no such policy, or its settings cannot be used; the message names it.
        """
        options = dict(self.policy_settings.get(name, {}))
        try:
            return make_policy(options.pop("policy", name), **options)
        except (ValueError, TypeError, AttributeError, OverflowError) as error:
            if name not in self.policy_settings:
                raise
            raise ValueError(f"policy {name!r} of the suite cannot be made: {error}") from error

    def trials(self) -> Iterator[Trial]:
        """Yield all trials, paired ones one after the other.

        A suite that is cut short is therefore still paired.
        """
        for variant in self.variants:
            for floor in self.floors:
                teams = range(len(self.starts[floor])) if floor in self.starts else (-1,)
                for single in set_floors(floor) if floor.startswith("set:") else (floor,):
                    for robots in self.robots:
                        for start in teams:
                            for seed in self.seeds:
                                for policy in self.policies:
                                    yield Trial(variant, single, robots, start, seed, policy)

    def starts_of(self, trial: Trial) -> list[list[float]] | None:
        """Return the starts of a trial's robots, None where they are not given."""
        if trial.start < 0:
            return None
        return [list(start) for start in self.starts[trial.floor][trial.start][: trial.robots]]

    def as_dict(self) -> dict[str, Any]:
        """Return what JSON can hold of it."""
        content: dict[str, Any] = json.loads(json.dumps(asdict(self)))
        return content


def read_suite(path: Path) -> Suite:
    """Read a suite from a TOML file (docs/reference/files.md).

    Raises
    ------
    FileNotFoundError, ValueError
        Where there is no such file, or what it holds cannot be used; the message names the file.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"no suite {path}; want a TOML file, as docs/reference/files.md shows one")
    text = read_text(path, MOST_SUITE_BYTES)
    with reading(path, "TOML"):
        content = tomllib.loads(text)
    with reading(path, "a suite that can be used"):
        return suite_of(content)


def suite_of(content: Mapping[str, Any]) -> Suite:
    """Make a suite of what a TOML file holds.

    Parameters
    ----------
    content : mapping
        ``policies``, ``floors``, ``robots``, ``seeds`` (a list, or how many from 0 on), ``settings`` (for all
        variants), ``variants``, ``starts``, ``draws_starts``, ``bounds``, ``stop``, ``image_resolution``,
        ``policy_settings``.

    Raises
    ------
    ValueError
        Where something is missing, unknown or cannot be used.
    """
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


def _check_sensors(name: str, policy: Policy, variant: str, settings: ExplorationSettings) -> None:
    """Check that the robots of a variant have the sensors that a policy reads."""
    try:
        settings_for(policy, settings)
    except ValueError as error:
        raise ValueError(f"policy {name!r} cannot run with variant {variant!r}: {error}") from error


def _check_floor(floor: str, image_resolution: float | None) -> None:
    """Check that there is such a floor, without generating any."""
    if floor.startswith("set:"):
        set_floors(floor)
    elif not is_generated(floor):
        load_floor(floor, image_resolution)
