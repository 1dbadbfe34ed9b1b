"""The supervisor's decision tree as a picture."""

import cv2
from matplotlib.figure import Figure

from lidarium.agents.supervisor.settings import SupervisorSettings
from lidarium.agents.supervisor.tree import Leaf, decision_tree, leaves
from lidarium.evaluation.drawing.tree_picture import _depth, _draw, save_tree_picture


def questions(tree):
    return 0 if isinstance(tree, Leaf) else 1 + questions(tree.yes) + questions(tree.no)


def test_all_questions_and_leaves_are_drawn_at_places_of_their_own():
    tree, axes = decision_tree(SupervisorSettings()), Figure().subplots()
    count = len(list(leaves(tree)))
    assert 0.0 < _draw(axes, tree, 0, 0) < count - 1
    places = [text.get_position() for text in axes.texts if text.get_text() not in ("yes", "no")]
    assert len(places) == len(set(places)) == questions(tree) + count
    assert max(level for _, level in places) == _depth(tree) - 1
    assert max(x for x, _ in places) == count - 1


def test_the_picture_is_written(tmp_path):
    save_tree_picture(tmp_path / "tree.png")
    assert cv2.imread(str(tmp_path / "tree.png")).shape[1] > 1000
