"""The decision tree, as data: questions about a robot, and consequences.

The rules are those of the thesis, reconstructed from its prose, as its figure is lost; they keep their
numbers:

1. A robot that has failed is left out: its map is not used, it gets no order.
2. The maps of all others are merged, but only robots that operate get orders: one that is paused or stopped
   may touch something that moves, and would draw that into its map and trap itself.
3. Of two robots with one goal the nearer one, by the length of its path, keeps it. The other one gets another
   goal on the merged map, or is stopped if there is none. (In the thesis's reported run the nearer robot
   was diverted; see the tests.)
4. A robot that knows much less of the map than the others is sent to unexplored space. One that is
   enclosed, having driven far for little, is stopped if there is no such way.
5. If the merged map has no frontier left the work is done, and all stop.

Beyond the thesis, each only if it is switched on: 6. all robots of a group get goals at once; 7. robots
that would meet are separated; 8. robots drive home when the work is done; 9. a robot turns back before its
battery is too low for that; 10. a robot that has paused by itself, and knows why, is ordered to go on; 11. a
robot without a goal of its own is paused, and ordered to resume when there is one.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from lidarium.agents.supervisor.settings import SupervisorSettings
from lidarium.envs.onboard.radio.messages import OperatingState, OrderKind


@dataclass(frozen=True, slots=True)
class RobotInputs:
    """Knowledge of the tree about a robot.

    Attributes
    ----------
    agent : str
        Its name.
    remaining_m : float
        Rest of its path, ``d_rest`` [m].
    state : OperatingState
        Its state, ``rob_sta``.
    map_known : float
        Share of its group's floor that its own map knows, ``map_kno``: 1 if all is explored and it knows it all.
    travelled_m : float
        How far it has come, ``d_trav`` [m].
    """

    agent: str
    remaining_m: float
    state: OperatingState
    map_known: float
    travelled_m: float


@dataclass(frozen=True, slots=True)
class Case:
    """A robot's inputs to the decision tree.

    They include what the station finds out from its group and from the merged map.

    Attributes
    ----------
    robot : RobotInputs
        The robot.
    rival : RobotInputs or None
        The nearest other operating robot of its group with the same goal.
    opponent : RobotInputs or None
        The one that it is about to meet, if such robots are separated.
    has_frontier : bool
        Whether any robot of its group can reach a frontier of the merged map.
    has_other_goal : bool
        Whether the merged map offers it a goal that no other robot has.
    has_richer_goal : bool
        Whether one of these has more to map than its present goal.
    is_behind : bool
        Whether its map is much smaller than those of its group.
    is_enclosed : bool
        Whether it has mapped little on a long way.
    is_battery_low : bool
        Whether its battery would soon not bring it home.
    is_pause_explained : bool
        Whether it has paused by itself, and reports a contact or an obstacle.
    is_held : bool
        Whether the supervisor has paused it by an order.
    """

    robot: RobotInputs
    rival: RobotInputs | None = None
    opponent: RobotInputs | None = None
    has_frontier: bool = True
    has_other_goal: bool = True
    has_richer_goal: bool = False
    is_behind: bool = False
    is_enclosed: bool = False
    is_battery_low: bool = False
    is_pause_explained: bool = False
    is_held: bool = False


@dataclass(frozen=True, slots=True)
class _Question:
    """A question that a case answers with yes or no."""

    name: str
    words: str
    holds: Callable[[Case], bool]


@dataclass(frozen=True, slots=True)
class Leaf:
    """A result: its rule, the order or None, and the reason.

    ``aim`` is the aim of an order to go.
    """

    rule: int
    order: OrderKind | None
    why: str
    aim: str = ""


@dataclass(frozen=True, slots=True)
class Node:
    """A question and the results of either answer."""

    question: _Question
    yes: "Node | Leaf"
    no: "Node | Leaf"


def _keeps_before(robot: RobotInputs, other: RobotInputs | None) -> bool:
    """Whether a robot is nearer than another.

    Of two equally near ones the first by name.
    """
    return other is None or (robot.remaining_m, robot.agent) <= (other.remaining_m, other.agent)


FAILED = _Question("failed", "has it failed?", lambda case: case.robot.state is OperatingState.FAILED)
OPERATING = _Question("operating", "does it operate?", lambda case: case.robot.state is OperatingState.OPERATING)
EXPLAINED = _Question(
    "explained",
    "has it paused for something that it touched or that blocks it?",
    lambda case: case.is_pause_explained,
)
HELD = _Question("held", "has the supervisor paused it?", lambda case: case.is_held)
FRONTIER = _Question("frontier", "does the merged map have a frontier left in reach?", lambda case: case.has_frontier)
SAME_GOAL = _Question("same_goal", "has another robot of its group the same goal?", lambda case: case.rival is not None)
NEARER = _Question("nearer", "is it nearer to the goal?", lambda case: _keeps_before(case.robot, case.rival))
OTHER_GOAL = _Question("other_goal", "does the merged map offer another goal?", lambda case: case.has_other_goal)
BEHIND = _Question("behind", "does it know much less of the map than its group?", lambda case: case.is_behind)
RICHER = _Question("richer", "is there a way with more to map?", lambda case: case.has_richer_goal)
ENCLOSED = _Question("enclosed", "has it driven far and mapped little?", lambda case: case.is_enclosed)
LOW_BATTERY = _Question("low_battery", "is its battery just enough to get home?", lambda case: case.is_battery_low)
MEETING = _Question(
    "meeting",
    "would it meet a nearer robot, and has another goal on offer?",
    lambda case: case.has_other_goal and not _keeps_before(case.robot, case.opponent),
)

OTHER, RICH, HOME = "other", "richer", "home"
"""Aims of orders to go.

It is a goal that no other robot has, one with more to map, or the start.
"""


LEFT = Leaf(2, None, "its map is merged, it gets no order")
RESUMED = Leaf(11, OrderKind.RESUME, "there is a goal for it again", OTHER)


def idle_leaf(rule: int, why: str, settings: SupervisorSettings) -> Leaf:
    """Return the result for a robot without a goal of its own: it stops, or is paused."""
    return Leaf(rule, OrderKind.PAUSE if settings.pauses_idle else OrderKind.STOP, why)


def decision_tree(settings: SupervisorSettings) -> Node:
    """Return the tree of the thesis, with the nodes that the settings add."""
    goes_on = Leaf(0, None, "goes on by itself")
    balance = Node(
        BEHIND,
        Node(
            RICHER,
            Leaf(4, OrderKind.GO_TO, "it knows less of the map, and there is more to map elsewhere", RICH),
            Node(ENCLOSED, Leaf(4, OrderKind.STOP, "it is enclosed"), goes_on),
        ),
        goes_on,
    )
    if settings.avoids_rendezvous:
        balance = Node(MEETING, Leaf(7, OrderKind.GO_TO, "it would meet a robot that is nearer", OTHER), balance)
    rivals = Node(
        NEARER,
        Leaf(3, None, "it is the nearer one and keeps the goal"),
        Node(
            OTHER_GOAL,
            Leaf(3, OrderKind.GO_TO, "another robot is nearer to the goal", OTHER),
            idle_leaf(3, "another robot is nearer to the only goal", settings),
        ),
    )
    done = Leaf(5, OrderKind.STOP, "no frontier is left, the work is done")
    if settings.returns_home:
        done = Leaf(8, OrderKind.GO_TO, "no frontier is left, it drives home", HOME)
    work = Node(FRONTIER, Node(SAME_GOAL, rivals, balance), done)
    if settings.battery_margin > 0.0:
        work = Node(LOW_BATTERY, Leaf(9, OrderKind.GO_TO, "its battery is just enough to get home", HOME), work)
    idle: Node | Leaf = LEFT
    if settings.resumes_paused:
        idle = Node(EXPLAINED, Leaf(10, OrderKind.RESUME, "it backs out of what stopped it and goes on"), idle)
    if settings.pauses_idle:
        waits = Node(OTHER_GOAL, RESUMED, LEFT)
        over = replace(done, order=OrderKind.RESUME) if settings.returns_home else done
        idle = Node(HELD, Node(FRONTIER, waits, over), idle)
    operating = Node(OPERATING, work, idle)
    return Node(FAILED, Leaf(1, None, "it has failed and is left out"), operating)


def decide(tree: Node, case: Case) -> tuple[Leaf, list[tuple[str, bool]]]:
    """Return the leaf of a case, and the answers that lead to it.

    Answers are names of questions with yes or no.
    """
    answers: list[tuple[str, bool]] = []
    node: Node | Leaf = tree
    while isinstance(node, Node):
        # What arrays answered is no bool that JSON can hold.
        is_so = bool(node.question.holds(case))
        answers.append((node.question.name, is_so))
        node = node.yes if is_so else node.no
    return node, answers


def leaves(tree: Node | Leaf) -> Iterator[Leaf]:
    """Yield all leaves, that of yes before that of no."""
    if isinstance(tree, Leaf):
        yield tree
    else:
        yield from leaves(tree.yes)
        yield from leaves(tree.no)


def words_of(leaf: Leaf) -> str:
    """Return a leaf in one line."""
    rule = f"rule {leaf.rule}: " if leaf.rule else ""
    aims = {OTHER: "another goal", RICH: "where there is more to map", HOME: "home"}
    words = [] if leaf.order is None else [leaf.order.value.replace("_", " ")]
    if leaf.aim:
        words += ["and go to"] * (leaf.order is OrderKind.RESUME) + [aims[leaf.aim]]
    order = " ".join(words or ["no order"])
    return f"{rule}{order} ({leaf.why})"


def tree_text(tree: Node | Leaf, indent: str = "") -> str:
    """Return the tree as indented lines, as `lidarium show supervisor` prints it."""
    if isinstance(tree, Leaf):
        return indent + words_of(tree)
    branches = [
        (answer, tree_text(branch, indent + "    ").lstrip()) for answer, branch in (("yes", tree.yes), ("no", tree.no))
    ]
    return "\n".join([indent + tree.question.words, *(f"{indent}  {answer}: {text}" for answer, text in branches)])


def tree_data(tree: Node | Leaf) -> dict[str, object]:
    """Return the tree as a dictionary for JSON."""
    if isinstance(tree, Leaf):
        return {"rule": tree.rule, "order": None if tree.order is None else tree.order.value, "why": tree.why}
    return {
        "test": tree.question.name,
        "question": tree.question.words,
        "yes": tree_data(tree.yes),
        "no": tree_data(tree.no),
    }
