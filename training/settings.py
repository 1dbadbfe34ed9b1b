"""Settings of a training, and how they are read from a TOML file."""

import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, TypeVar, get_args, get_origin, get_type_hints

from lidarium.agents.learned.network import NO_PREDICTOR
from lidarium.agents.supervisor.settings import SupervisorSettings
from lidarium.agents.zoo.network import OBSERVED, TOURS
from lidarium.envs.floors.generation.buildings import KINDS
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.making import make_settings
from lidarium.mapping.files.guarded_reading import read_text, reading
from lidarium.mapping.geometry.bounds import above, check_settings, share, shown, within
from lidarium.mapping.prediction.predictors import make_predictor
from lidarium.training.prediction.settings import DUNGEON, SHIPPED, PredictionSettings

MOST_BYTES = 1 << 20
"""Files of settings are no larger."""

FLOOR_KINDS = ("building", *KINDS, DUNGEON)
"""Kinds of generated floors to train on."""

FROM_TOURS = "tours"
"""Network to begin with that corrects nothing."""

Part = TypeVar("Part")


def _check_sizes(robots: tuple[int, ...], whose: str) -> None:
    """Check that sizes of teams are some."""
    if not robots or not all(type(size) is int and 1 <= size <= 100 for size in robots):
        raise ValueError(f"robots of {whose} is {shown(robots)}; want sizes of teams, as in [1, 1, 2, 3]")


@dataclass(frozen=True, slots=True, kw_only=True)
class Round:
    """Floors on which robots are taught, after which the network is fitted.

    A curriculum has several rounds.

    Attributes
    ----------
    floors : int
        Number of these.
    kinds : dict of float
        How often each kind of floor comes, besides the others.
    bare_share : float
        So many of the floors have no furniture, as plans of real buildings.
    robots : tuple of int
        Sizes of teams; each comes as often as it stands here.
    teaching_share : float
        So often the teacher chooses, in place of classic tours or of the network of the round before.
    """

    floors: Annotated[int, within(2, 10_000)] = 400
    kinds: Mapping[str, float] = field(default_factory=lambda: {"building": 1.0})
    bare_share: Annotated[float, share()] = 0.0
    robots: tuple[int, ...] = (1, 1, 2, 3)
    teaching_share: Annotated[float, share()] = 0.3

    def __post_init__(self) -> None:
        check_settings(self, "a round")
        for kind, often in self.kinds.items():
            if kind not in FLOOR_KINDS:
                raise ValueError(f"kinds has {shown(kind)}; want some of {', '.join(FLOOR_KINDS)}")
            if isinstance(often, bool) or not isinstance(often, int | float) or not 0.0 <= often <= 1e6:
                raise ValueError(f"kinds.{kind} is {shown(often)}; want a number of 0 or more")
        if not sum(self.kinds.values()) > 0.0:
            raise ValueError(f"kinds is {shown(dict(self.kinds))}; want at least one above 0")
        _check_sizes(self.robots, "a round")


@dataclass(frozen=True, slots=True, kw_only=True)
class FitSettings:
    """How a network is fitted to lessons.

    Attributes
    ----------
    epochs : int, default 30
        How often it sees all samples.
    batch : int, default 256
        Samples of an update.
    learning_rate, weight_decay : float, default 0.0003, 0.01
        Of AdamW.
    most_regret : float, default 10.0
        Greater regrets count as this one [m].
    held_out : float, default 0.1
        Share of the floors that are not fitted, at least one; the epoch that is best on them is kept.
    correction_cost : float, default 0.001
        Cost of the square of a correction [1/m2]: without evidence tours remain as they are.
    """

    epochs: Annotated[int, within(1, 10_000)] = 30
    batch: Annotated[int, within(1, 100_000)] = 256
    learning_rate: Annotated[float, above(0.0, 1.0)] = 3e-4
    weight_decay: Annotated[float, within(0.0, 10.0)] = 0.01
    most_regret: Annotated[float, above(0.0, 1000.0)] = 10.0
    held_out: Annotated[float, share(has_minimum=False, has_maximum=False)] = 0.1
    correction_cost: Annotated[float, within(0.0, 10.0)] = 0.001

    def __post_init__(self) -> None:
        check_settings(self, "fit")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Budget:
    """How long a network learns by rewards.

    Attributes
    ----------
    decisions : int
        How many; 0 for none.
    checkpoint : int
        Decisions from one checkpoint to the next; new episodes begin after each.
    environments : int
        Episodes side by side, each in a process of its own; for teams robots side by side.
    """

    decisions: Annotated[int, within(0, 100_000_000)] = 0
    checkpoint: Annotated[int, within(1, 10_000_000)] = 8192
    environments: Annotated[int, within(1, 256)] = 4

    @property
    def whole_decisions(self) -> int:
        """Decisions up to the end of the last checkpoint."""
        return -(-self.decisions // self.checkpoint) * self.checkpoint


@dataclass(frozen=True, slots=True, kw_only=True)
class PpoSettings(_Budget):
    """How a network goes on by proximal policy optimization with masks.

    See sb3-contrib's MaskablePPO.

    Attributes
    ----------
    steps : int, default 512
        Decisions of each environment between two updates.
    batch, epochs : int, default 256, 4
        Decisions of a step of gradients, and how often an update sees all.
    learning_rate, clip, entropy, discount, trace : float, default 0.0001, 0.1, 0.001, 1.0, 0.95
        Rate of Adam, greatest change of a ratio, weight of the entropy, gamma and lambda.
    """

    steps: Annotated[int, within(2, 100_000)] = 512
    batch: Annotated[int, within(2, 100_000)] = 256
    epochs: Annotated[int, within(1, 100)] = 4
    learning_rate: Annotated[float, above(0.0, 1.0)] = 1e-4
    clip: Annotated[float, above(0.0, 1.0)] = 0.1
    entropy: Annotated[float, within(0.0, 1.0)] = 0.001
    discount: Annotated[float, above(0.0, 1.0)] = 1.0
    trace: Annotated[float, share()] = 0.95

    def __post_init__(self) -> None:
        check_settings(self, "ppo")
        update = self.environments * self.steps
        if self.checkpoint % update:
            raise ValueError(
                f"checkpoint of ppo is {self.checkpoint}; want a whole multiple of environments times steps, "
                f"{update}: so many decisions are made between two updates"
            )
        if update % self.batch == 1:
            raise ValueError(
                f"batch of ppo is {self.batch}; {update} decisions (environments times steps) leave a batch of one, "
                "which has no spread to normalize by; want another batch"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class ValueSettings(_Budget):
    """How a team learns the value of each robot's choices, by QMIX or VDN.

    See TorchRL's QMixerLoss. A step of gradients follows each decision of the teams.

    Attributes
    ----------
    batch : int, default 64
        Decisions of teams in a step of gradients.
    kept : int, default 20000
        Decisions of teams that are kept to learn from, the latest; none from before the last checkpoint.
    learning_rate, discount : float, default 0.0003, 0.98
        Rate of Adam, and gamma.
    tracking : float, default 0.01
        Share of the way that target networks go towards the learned ones in each step.
    first_chance, last_chance : float, default 0.3, 0.05
        Share of choices that are drawn evenly: at the beginning, and from the middle of the training on.
    mixing : int, default 32
        Width of the network of QMIX that mixes values.
    """

    environments: Annotated[int, within(1, 256)] = 32
    batch: Annotated[int, within(2, 100_000)] = 64
    kept: Annotated[int, within(2, 10_000_000)] = 20_000
    learning_rate: Annotated[float, above(0.0, 1.0)] = 3e-4
    discount: Annotated[float, above(0.0, 1.0)] = 0.98
    tracking: Annotated[float, above(0.0, 1.0)] = 0.01
    first_chance: Annotated[float, share()] = 0.3
    last_chance: Annotated[float, share()] = 0.05
    mixing: Annotated[int, within(1, 1024)] = 32

    def __post_init__(self) -> None:
        check_settings(self, "value")
        if self.checkpoint % self.environments:
            raise ValueError(
                f"checkpoint of value is {self.checkpoint}; want a whole multiple of environments, "
                f"{self.environments}: all robots decide together"
            )
        if self.kept < self.batch:
            raise ValueError(f"kept of value is {self.kept}; want at least the batch, {self.batch}")

    def chance(self, decisions: int) -> float:
        """Return the probability of a random choice after a number of decisions."""
        progress = min(2.0 * decisions / self.whole_decisions, 1.0)
        return self.first_chance + (self.last_chance - self.first_chance) * progress


TEAM_PPO: Mapping[str, Any] = {
    "environments": 32,
    "steps": 64,
    "batch": 512,
    "epochs": 3,
    "learning_rate": 5e-4,
    "clip": 0.2,
    "entropy": 0.005,
    "discount": 0.98,
}
"""Defaults of ``[ppo]`` for teams, where they are not those of explorers."""

POLICY_GRADIENT, VALUES = ("ppo", "mappo"), ("qmix", "vdn")
"""Algorithms that train teams: those that learn a policy, and those that learn the value of choices."""

ALGORITHMS, LEVELS = (*POLICY_GRADIENT, *VALUES), tuple(OBSERVED)
"""All algorithms that train teams, and levels at which these decide."""

STATE_CELLS = 8
"""Side of the pictures in the true state of a team, which critics and QMIX see."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TeamSettings:
    """How a team of the zoo is trained, by rewards alone.

    Attributes
    ----------
    seed : int, default 0
        Seed of all draws.
    algorithm : str, default "ppo"
        All robots share a network that attends to frontiers and teammates. ``ppo``: MaskablePPO, whose critic sees
        what the robot sees (independent PPO, IPPO); ``mappo``: the same, its critic sees the true state of the team as
        well; ``qmix``, ``vdn``: the network gives the value of each choice, and that of the team is a mixture that
        depends on the true state, or their sum.
    level : str
        ``frontier``, where the network begins with the ranking of explore_lite, or ``tour``, where it begins with what
        `tour_frontier` does.
    robots : int, default 2
        Size of the team.
    floors : str, default "set:train:1000"
        Floors to learn on, as for ``--floor``.
    horizon_s : float, default 120.0
        Episodes end after so long, or when 0.99 of the floor is seen [s].
    realism : str, default "fast"
        World of the episodes to learn in; validation is in that of ``lidarium evaluate``.
    validation : str, default "set:validation:16"
        Set of floors on which checkpoints are compared; the best one is kept.
    supervisor : dict, optional
        Settings of a supervisor by name: starts are then unknown, the station merges the maps, and robots follow its
        orders. With ``ppo`` alone; by default there is no supervisor.
    settings : dict
        More options of the environment, for learning and validation.
    ppo, value : PpoSettings, ValueSettings
        How it learns by ``ppo`` and ``mappo``, and by ``qmix`` and ``vdn``; ``environments`` are robots side by side, a
        whole number of teams.
    """

    seed: Annotated[int, within(0, 2**31 - 1)] = 0
    algorithm: str = "ppo"
    level: str = "frontier"
    robots: Annotated[int, within(2, 100)] = 2
    floors: str = "set:train:1000"
    horizon_s: Annotated[float, above(0.0, 1e6)] = 120.0
    realism: str = "fast"
    validation: str = "set:validation:16"
    supervisor: Mapping[str, Any] | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    ppo: PpoSettings = field(default_factory=lambda: PpoSettings(**{**TEAM_PPO, "decisions": 65536}))
    value: ValueSettings = field(default_factory=lambda: ValueSettings(decisions=65536))

    def __post_init__(self) -> None:
        check_settings(self, "team")
        for name, known in (("algorithm", ALGORITHMS), ("level", LEVELS)):
            if getattr(self, name) not in known:
                raise ValueError(f"{name} of team is {shown(getattr(self, name))}; want {' or '.join(known)}")
        name, learning = self.table, self.learning
        if learning.environments % self.robots:
            raise ValueError(
                f"environments of {name} is {learning.environments}; want a whole multiple of the {self.robots} robots "
                "of the team: they are robots side by side"
            )
        if not learning.decisions:
            raise ValueError(f"decisions of {name} is 0; want how many the team makes while it learns")
        if self.algorithm in VALUES and learning.checkpoint < 2 * learning.batch * self.robots:
            raise ValueError(
                f"checkpoint of {name} is {learning.checkpoint}; want at least twice batch times robots, "
                f"{2 * learning.batch * self.robots}: each checkpoint begins with an empty memory, and up to half of "
                "the decisions begin episodes only"
            )
        if self.supervisor is not None and self.algorithm != "ppo":
            raise ValueError(f"algorithm of a team under a supervisor is {self.algorithm!r}; want ppo")
        _made(SupervisorSettings, self.supervisor or {}, "supervisor of team")
        taken = sorted({"robots", "horizon_s", "realism", "observe"} & set(self.settings))
        if taken:
            raise ValueError(f"settings of team has {shown(taken[0])}; the table [team] sets it, observe is fixed")
        for realism in dict.fromkeys(("ideal", self.realism)):
            self.options(realism)

    @property
    def table(self) -> str:
        """Name of the table that says how it learns."""
        return "value" if self.algorithm in VALUES else "ppo"

    @property
    def learning(self) -> PpoSettings | ValueSettings:
        """How it learns."""
        return self.value if self.algorithm in VALUES else self.ppo

    def as_dict(self) -> dict[str, Any]:
        """Return it as types that JSON has, without the table of other algorithms."""
        return {name: each for name, each in asdict(self).items() if name not in {"ppo", "value"} - {self.table}}

    def options(self, realism: str) -> dict[str, Any]:
        """Return the options of the environment, checked."""
        options = {
            "stop_coverage": 0.99,
            "state_cells": STATE_CELLS,
            "known_starts": self.supervisor is None,
            **self.settings,
            "robots": self.robots,
            "horizon_s": self.horizon_s,
        }
        observe = [name for name in OBSERVED[self.level] if name != TOURS]  # the level itself shows its tours
        options |= {"observe": observe, "realism": realism}
        try:
            make_settings(**options)
        except (TypeError, AttributeError) as error:
            raise ValueError(f"settings of the training cannot be used: {error}") from error
        return options


@dataclass(frozen=True, slots=True, kw_only=True)
class _ValidationSettings:
    """Floors and teams of the comparison with classic tours.

    Attributes
    ----------
    floors : tuple of str
        Floors as for `lidarium evaluate`.
    robots : tuple of int
        Sizes of teams.
    """

    floors: tuple[str, ...] = ("set:validation:40",)
    robots: tuple[int, ...] = (1, 2, 3)

    def __post_init__(self) -> None:
        check_settings(self, "validation")
        if not self.floors or not all(isinstance(floor, str) for floor in self.floors):
            raise ValueError(
                f'floors of validation is {shown(self.floors)}; want names of floors, as in ["set:validation:16"]'
            )
        _check_sizes(self.robots, "validation")


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingSettings:
    """Settings of a training.

    Attributes
    ----------
    seed : int, default 0
        Seed of all draws.
    predictor : str, default "nothing"
        Predictor of maps whose tours the network corrects, such as "network"; "nothing" for tours past known frontiers.
    begin : str, default "tours"
        Network to begin with: "tours" for one that corrects nothing, "shipped" for that of the package, or a file
        of weights.
    settings : dict
        Options of the environment, as in a suite.
    rounds : tuple of Round
        Floors and teams of lessons; the network is fitted after each round, and decides in the next.
    fit, ppo, validation
        Settings of fitting, of reinforcement learning, and of validation.
    """

    seed: Annotated[int, within(0, 2**31 - 1)] = 0
    predictor: str = NO_PREDICTOR
    begin: str = FROM_TOURS
    settings: Mapping[str, Any] = field(default_factory=dict)
    rounds: tuple[Round, ...] = (Round(),)
    fit: FitSettings = field(default_factory=FitSettings)
    ppo: PpoSettings = field(default_factory=PpoSettings)
    validation: _ValidationSettings = field(default_factory=_ValidationSettings)

    def __post_init__(self) -> None:
        check_settings(self, "training")
        make_predictor(self.predictor)
        if self.begin not in (FROM_TOURS, SHIPPED) and not Path(self.begin).is_file():
            raise ValueError(f"begin is {shown(self.begin)}; want {FROM_TOURS!r}, {SHIPPED!r} or a file of weights")
        if "robots" in self.settings:
            raise ValueError("settings has 'robots'; want them in [[rounds]] and [validation]")
        for size in sorted({*self.validation.robots, *(size for each in self.rounds for size in each.robots)}):
            self.team(size)

    @property
    def options(self) -> dict[str, Any]:
        """Options of the environment, but for the size of the team."""
        return {"stop_coverage": 0.99, "horizon_s": 1800.0, **self.settings}

    def team(self, robots: int) -> ExplorationSettings:
        """Return the settings of a team.

        It ends where 0.99 of the floor is seen, or as ``settings`` says.
        """
        try:
            return make_settings(**self.options, robots=robots)
        except (TypeError, AttributeError) as error:
            raise ValueError(f"settings of the training cannot be used: {error}") from error

    def as_dict(self) -> dict[str, Any]:
        """Return it as types that JSON has."""
        return asdict(self)


def read_training(path: Path) -> TrainingSettings:
    """Read the settings of a training of explorers from a TOML file."""
    settings = read_any_training(path)
    if not isinstance(settings, TrainingSettings):
        raise ValueError(f"{path} has a table [prediction] or [team], and is no training of explorers")
    return settings


def read_any_training(path: Path) -> TrainingSettings | PredictionSettings | TeamSettings:
    """Read the settings of a training from a TOML file.

    With a table ``[prediction]`` it is that of a map predictor, with ``[team]`` that of a team of the zoo.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"no training {path}; want a TOML file, such as `lidarium examples copy` gives")
    text = read_text(path, MOST_BYTES)
    with reading(path, "TOML"):
        content = tomllib.loads(text)
    with reading(path, "a training that can be used"):
        if "prediction" in content:
            return _prediction_of(content)
        if "team" in content:
            return _team_of(content)
        return training_of(content)


def _prediction_of(content: Mapping[str, Any]) -> PredictionSettings:
    """Make settings of a file with a table ``[prediction]``."""
    others = sorted(set(content) - {"prediction", "seed"})
    if others:
        raise ValueError(f"a training of predictions has no {shown(others[0])}; it has seed and [prediction]")
    return _made(PredictionSettings, _with_seed(content, "prediction"), "prediction")


def _with_seed(content: Mapping[str, Any], name: str) -> Any:  # noqa: ANN401
    """Return a table of a file, with the seed at the file's top."""
    table = content[name]
    if not isinstance(table, Mapping) or "seed" not in content:
        return table
    if "seed" in table:
        raise ValueError(
            f"seed is {shown(content['seed'])} at the top and {shown(table['seed'])} in [{name}]; want one"
        )
    return {"seed": content["seed"], **table}


def _team_of(content: Mapping[str, Any]) -> TeamSettings:
    """Make settings of a file with a table ``[team]``, and ``[ppo]`` or ``[value]`` by its algorithm."""
    table = content["team"]
    if not isinstance(table, Mapping):
        return _made(TeamSettings, table, "team")
    algorithm = table.get("algorithm", "ppo")
    is_value = algorithm in VALUES
    name = "value" if is_value else "ppo"
    others = sorted(set(content) - {"team", name, "seed"})
    if others:
        raise ValueError(f"a training of teams by {algorithm} has no {shown(others[0])}; it has seed, [team], [{name}]")
    given = content.get(name, {})
    if is_value:
        learning: PpoSettings | ValueSettings = _made(ValueSettings, given, name)
    else:
        learning = _made(PpoSettings, {**TEAM_PPO, **given} if isinstance(given, Mapping) else given, name)
    inner = sorted({"ppo", "value"} & set(table))
    if inner:
        raise ValueError(f"team has the table {shown(inner[0])}; want [{inner[0]}], beside [team]")
    return _made(TeamSettings, {**_with_seed(content, "team"), name: learning}, "team")


def training_of(content: Mapping[str, Any]) -> TrainingSettings:
    """Make settings of the content of a TOML file."""
    parts: dict[str, Any] = dict(content)
    rounds = parts.get("rounds", [{}])
    if not isinstance(rounds, list) or not rounds:
        raise ValueError(f"rounds is {shown(rounds)}; want one or more tables [[rounds]]")
    parts["rounds"] = tuple(_made(Round, each, "a round") for each in rounds)
    for name, kind in (("fit", FitSettings), ("ppo", PpoSettings), ("validation", _ValidationSettings)):
        parts[name] = _made(kind, parts.get(name, {}), name)
    if not isinstance(parts.get("settings", {}), dict):
        raise ValueError(f"settings is {shown(parts['settings'])}; want a table [settings]")
    return _made(TrainingSettings, parts, "a training")


def _made(kind: type[Part], content: Any, name: str) -> Part:  # noqa: ANN401
    """Return a part made of a table; lists become tuples."""
    if not isinstance(content, Mapping):
        raise ValueError(f"{name} is {shown(content)}; want a table")
    known = [each.name for each in fields(kind)]  # type: ignore[arg-type]
    unknown = sorted(set(content) - set(known))
    if unknown:
        raise ValueError(f"{name} has no {shown(unknown[0])}; it has {', '.join(known)}")
    hints = get_type_hints(kind)
    for key, value in content.items():
        allowed = _plain_types(hints[key])
        for plain, taken, wanted in ((tuple, (list, *allowed), "a list"), (Mapping, allowed, "a table")):
            if plain in allowed and not isinstance(value, taken):
                raise ValueError(f"{key} of {name} is {shown(value)}; want {wanted}")
    values = {key: tuple(value) if isinstance(value, list) else value for key, value in content.items()}
    try:
        return kind(**values)
    except TypeError as error:
        raise ValueError(f"{name} cannot be used: {error}") from error


def _plain_types(hint: Any) -> tuple[type, ...]:  # noqa: ANN401
    """Return the classes that a hint allows, without their parameters."""
    if get_origin(hint) is UnionType:
        return tuple(each for part in get_args(hint) for each in _plain_types(part))
    plain = get_origin(hint) or hint
    return (plain,) if isinstance(plain, type) else ()
