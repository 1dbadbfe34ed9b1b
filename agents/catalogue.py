"""The policies by name."""

import importlib
import inspect
import os
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from lidarium.agents.policy import Policy
from lidarium.mapping.geometry.bounds import shown
from lidarium.registry import Registry, unknown

POLICIES: Registry[Callable[..., Policy]] = Registry("policy")
"""Factories of policies by name; keyword arguments are the settings.

A module is imported when it is first needed.
"""

_FRONTIER = "lidarium.agents.frontier.policies"
POLICIES.register(
    "random_walk",
    "lidarium.agents.random_walk:RandomWalk",
    "drives straight on and turns by a random angle where something is near",
)
POLICIES.register(
    "nearest_frontier",
    f"{_FRONTIER}:NearestFrontier",
    "each robot drives to its nearest frontier of the team's map (Yamauchi)",
)
POLICIES.register(
    "nearest_frontier_own_map",
    f"{_FRONTIER}:nearest_frontier_own_map",
    "each robot drives to the nearest frontier of its own map",
)
POLICIES.register(
    "utility_frontier",
    f"{_FRONTIER}:UtilityFrontier",
    "the team shares frontiers out by utility less cost (Burgard)",
)
POLICIES.register(
    "explore_lite",
    f"{_FRONTIER}:ExploreLite",
    "least cost of distance less size of the frontier, both in metres (explore_lite)",
)
POLICIES.register(
    "nearest_node",
    "lidarium.agents.frontier.nodes:NearestNode",
    "at the level of nodes: to the nearest node with utility (as in DARE)",
)
POLICIES.register(
    "utility_node",
    "lidarium.agents.frontier.nodes:UtilityNode",
    "at the level of nodes: to the node of most utility, discounted by its distance (as in DARE)",
)
POLICIES.register(
    "tour_frontier",
    "lidarium.agents.tours.policy:TourFrontier",
    "the team shares out all frontiers as tours past places from which much is seen",
)
POLICIES.register(
    "oblivious",
    "lidarium.agents.tours.policy:TourFrontier",
    "tour_frontier, whose robots exchange maps when they are in reach by chance; a baseline of meeting_tours",
)
POLICIES.register(
    "tethered",
    "lidarium.agents.meetings.tethered:Tethered",
    "as tour_frontier, with robots that never leave each other's radio; a baseline of meeting_tours",
)
POLICIES.register(
    "meeting_tours",
    "lidarium.agents.meetings.policy:MeetingTours",
    "as tour_frontier, with robots that meet again when their radio does not reach",
)
POLICIES.register(
    "meeting_frontier",
    "lidarium.agents.meetings.policy:MeetingFrontier",
    "each robot drives to the nearest frontier of its map, and meets the others again",
)
POLICIES.register(
    "predicted_tours",
    "lidarium.agents.predicted.policy:PredictedTours",
    "tours of the team on a map whose unknown part a network predicts",
)
POLICIES.register(
    "learned",
    "lidarium.agents.learned.policy:Learned",
    "tours of the team, of which a trained network chooses where each robot sets out",
)
POLICIES.register(
    "zoo:ppo-2",
    "lidarium.agents.zoo.policy:ppo_2",
    "at the level of frontiers: two robots that share a network trained by PPO",
)
POLICIES.register(
    "zoo:ppo-4",
    "lidarium.agents.zoo.policy:ppo_4",
    "at the level of frontiers: four robots that share a network trained by PPO",
)
POLICIES.register(
    "zoo:mappo-2",
    "lidarium.agents.zoo.policy:mappo_2",
    "at the level of frontiers: two robots that share a network trained by MAPPO",
)
POLICIES.register(
    "zoo:mappo-4",
    "lidarium.agents.zoo.policy:mappo_4",
    "at the level of frontiers: four robots that share a network trained by MAPPO",
)
POLICIES.register(
    "zoo:signal-2",
    "lidarium.agents.zoo.policy:signal_2",
    "as zoo:ppo-2, trained with radio links that break behind walls",
)
POLICIES.register(
    "zoo:tours-2",
    "lidarium.agents.zoo.policy:tours_2",
    "at the level of tours: two robots that share a network trained by PPO, which begins as tour_frontier",
)
POLICIES.register(
    "sparse_frontier",
    "lidarium.agents.sparse.frontier:SparseFrontier",
    "robots see all ground with depth cameras, and plan on sparse maps of boxes",
)
POLICIES.register(
    "srt",
    "lidarium.agents.srt.policy:SensorBasedRandomTree",
    "grows a tree of safe regions towards openings and the goal (sensor-based random tree)",
)
POLICIES.register(
    "srt:thesis",
    "lidarium.agents.srt.policy:srt_thesis",
    "srt with the settings of its thesis as printed",
)
POLICIES.register(
    "supervised",
    "lidarium.agents.supervisor.factories:supervised",
    "robots explore alone; a station merges their maps, and redirects and stops them by a tree of rules",
)
POLICIES.register(
    "supervised:thesis",
    "lidarium.agents.supervisor.factories:supervised_thesis",
    "as supervised, with merging, periods and final stops of its thesis as printed",
)
POLICIES.register(
    "supervised_tours",
    "lidarium.agents.supervisor.factories:supervised_tours",
    "as supervised, with robots that explore by tours",
)
POLICIES.register(
    "supervised_predicted",
    "lidarium.agents.supervisor.factories:supervised_predicted",
    "as supervised, with robots that explore by tours on predicted maps",
)
POLICIES.register(
    "supervised_learned",
    "lidarium.agents.supervisor.factories:supervised_learned",
    "as supervised, with robots that were trained",
)
POLICIES.register(
    "independent",
    "lidarium.agents.supervisor.factories:independent",
    "each robot explores the whole floor alone; a bound for teams that merge their maps",
)
POLICIES.register(
    "oracle_starts",
    "lidarium.agents.supervisor.factories:oracle_starts",
    "supervised robots that are given how they stand to each other; a bound for teams that merge",
)


def register_policy(name: str, make: Callable[..., Policy] | str, summary: str) -> None:
    """Register a policy, so that `policy`, `evaluate` and commands find it by name.

    Parameters
    ----------
    name : str
        Name of the policy.
    make : callable or str
        Function or class that returns a new policy; keyword arguments are its settings. A string
        ``"module:attribute"`` is imported when it is first used.
    summary : str
        One line that describes it.

    Raises
    ------
    ValueError
        If the name is taken.

    Examples
    --------
    >>> import lidarium
    >>> class Idle(lidarium.Policy):
    ...     level = "velocity"
    ...     def act(self, observations):
    ...         return {agent: lidarium.Stop("idle") for agent in observations}
    >>> lidarium.register_policy("idle", Idle, "stops at once")
    """
    POLICIES.register(name, make, summary)


def policy_names() -> dict[str, str]:
    """Return the names of all policies with their summaries."""
    return dict(sorted(POLICIES.summaries.items()))


def make_policy(name: str, **settings: Any) -> Policy:  # noqa: ANN401
    """Return a new policy by name, or one of your own by ``module:Class``.

    Parameters
    ----------
    name : str
        Name of a policy, see ``lidarium show policies``.
    **settings
        Settings of the policy; defaults if left out.

    Raises
    ------
    ValueError
        If the name or a setting is unknown, the module or class does not exist, or it is not a policy.

    Examples
    --------
    >>> import lidarium
    >>> lidarium.policy("nearest_frontier").level
    'waypoint'
    """
    maker = _maker_of(name)
    _check_named(name, maker, settings)
    try:
        policy = maker(**settings)
    except TypeError as error:
        if "unexpected keyword argument" not in str(error):
            raise
        raise ValueError(f"policy {name!r}: {_unknown_setting(maker, error)}") from error
    if not isinstance(policy, Policy):
        raise ValueError(f"policy {name!r} makes {type(policy).__name__}; want a subclass of Policy")
    return policy


def _check_named(name: str, maker: Callable[..., Any], settings: Mapping[str, Any]) -> None:
    """Check that the factory of a policy has the parameters that settings name, and needs no others."""
    try:
        parameters = inspect.signature(maker).parameters
    except (TypeError, ValueError):  # a factory that does not tell
        return
    takes_any = any(each.kind is each.VAR_KEYWORD for each in parameters.values())
    for setting in settings:
        if not takes_any and setting not in parameters:
            raise ValueError(f"policy {name!r}: {unknown('setting', setting, parameters)}")
    named = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    needed = [each.name for each in parameters.values() if each.default is each.empty and each.kind in named]
    lacking = [each for each in needed if each not in settings]
    if lacking:
        raise ValueError(f"policy {name!r} needs the setting {lacking[0]!r}; want --policy-set {lacking[0]}=VALUE")


def source_of(name: str) -> Path | None:
    """Return the file of a policy that is not of the package, None of one that is."""
    maker = _maker_of(name)
    module = sys.modules.get(getattr(maker, "__module__", ""))
    file = getattr(module, "__file__", None)
    return None if file is None or str(getattr(module, "__name__", "")).startswith("lidarium.") else Path(file)


def _unknown_setting(maker: Callable[..., Any], error: TypeError) -> str:
    """Return the message for a setting that the policy's factory does not have."""
    wrong = str(error).partition("argument ")[2].split("'")[1]
    parameters = inspect.signature(maker).parameters
    if any(each.kind == each.VAR_KEYWORD for each in parameters.values()):
        return f"there is no setting {wrong!r}; leave it out"
    return unknown("setting", wrong, parameters)


def _maker_of(name: str) -> Callable[..., Any]:
    """Return the factory of a policy; a name such as ``zoo:ppo-2`` is never that of a module, ``zoo``."""
    families = {known.partition(":")[0] for known in POLICIES.summaries if ":" in known}
    is_own = isinstance(name, str) and ":" in name and name.partition(":")[0] not in families
    return _maker_at(name) if is_own else POLICIES[name]


def _maker_at(name: str) -> Callable[..., Any]:
    """Return the factory of a user's own policy."""
    module_name, _, attribute = name.partition(":")
    here = os.getcwd()
    try:
        if here not in sys.path and "" not in sys.path:
            sys.path.append(here)
        module = importlib.import_module(module_name)
    except (ImportError, ValueError) as error:
        raise ValueError(
            f"policy {name!r}: module {module_name!r} cannot be imported ({error}); want module:Class of a "
            f"module that is installed or in {here}"
        ) from error
    if not attribute or not callable(getattr(module, attribute, None)):
        own = sorted(key for key, value in vars(module).items() if isinstance(value, type))
        raise ValueError(f"policy {name!r}: {unknown(f'class of {module_name}', attribute, own)}")
    made = getattr(module, attribute)
    # Checked before it is called: the name may come from a file.
    if not (isinstance(made, type) and issubclass(made, Policy)):
        raise ValueError(f"policy {name!r} is {shown(made)}; want a subclass of lidarium.Policy")
    found: Callable[..., Any] = made
    return found
