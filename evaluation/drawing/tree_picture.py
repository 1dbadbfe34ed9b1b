"""The supervisor's decision tree as a picture."""

import textwrap
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lidarium.agents.supervisor.settings import SupervisorSettings
from lidarium.agents.supervisor.tree import Leaf, Node, decision_tree, leaves, words_of
from lidarium.evaluation.drawing.picture_parts import FAINT, INK, save_titled_figure

_LINE_CHARACTERS = 22
_ORDER_COLOUR, _NO_ORDER_COLOUR, _QUESTION_COLOUR = "#fde68a", "#e5e7eb", "#dbeafe"


def save_tree_picture(path: Path, settings: SupervisorSettings | None = None) -> None:
    """Draw the tree that settings make.

    It has questions with their answers, and rule and order at the leaves.
    """
    tree = decision_tree(settings or SupervisorSettings())
    count, depth = len(list(leaves(tree))), _depth(tree)
    figure = Figure(figsize=(1.9 * count, 1.35 * depth + 0.8), layout="constrained")
    axes = figure.add_subplot()
    axes.set_axis_off()
    axes.set_xlim(-0.6, count - 0.4)
    axes.set_ylim(depth - 0.4, -0.6)
    _draw(axes, tree, 0, 0)
    save_titled_figure(path, figure, "supervisor", "what is asked of each robot, and what follows")


def _depth(tree: Node | Leaf) -> int:
    return 1 if isinstance(tree, Leaf) else 1 + max(_depth(tree.yes), _depth(tree.no))


def _draw(axes: Axes, tree: Node | Leaf, level: int, first: int) -> float:
    """Draw a part of the tree with leaves from position ``first``.

    Return the place of its head.
    """
    if isinstance(tree, Leaf):
        _box(axes, first, level, words_of(tree), _NO_ORDER_COLOUR if tree.order is None else _ORDER_COLOUR)
        return float(first)
    middle = first + len(list(leaves(tree.yes)))
    places = (_draw(axes, tree.yes, level + 1, first), _draw(axes, tree.no, level + 1, middle))
    head = 0.5 * (places[0] + places[1])
    for place, answer in zip(places, ("yes", "no"), strict=True):
        axes.plot([head, place], [level, level + 1], color=FAINT, linewidth=1.0, zorder=1)
        axes.text(
            0.5 * (head + place),
            level + 0.5,
            answer,
            ha="center",
            va="center",
            fontsize=8,
            color=INK,
            backgroundcolor="white",
        )
    _box(axes, head, level, tree.question.words, _QUESTION_COLOUR)
    return head


def _box(axes: Axes, x: float, level: int, words: str, colour: str) -> None:
    text = "\n".join(textwrap.wrap(words, _LINE_CHARACTERS))
    box = {"boxstyle": "round,pad=0.4", "facecolor": colour, "edgecolor": FAINT}
    axes.text(x, level, text, ha="center", va="center", fontsize=8, color=INK, bbox=box, zorder=3)
