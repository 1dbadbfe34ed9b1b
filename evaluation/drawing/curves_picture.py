"""The picture of learning curves: mean and band of each kind, and its trainings as thin lines."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from lidarium.evaluation.analysis.learning_curves import LearningCurve
from lidarium.evaluation.drawing.style import band, colours, dash, dress, legend, save


def save_learning_curves(path: Path, curves: Sequence[LearningCurve], x: str, y: str) -> None:
    """Draw learning curves as a PNG file.

    Parameters
    ----------
    path : Path
        The file.
    curves : sequence of LearningCurve
        What is drawn.
    x, y : str
        Labels of the axes.
    """
    figure = Figure(figsize=(8.0, 4.8), layout="constrained")
    axes = figure.add_subplot()
    chosen = colours(len(curves))
    for index, curve in enumerate(curves):
        axes.plot(curve.x, curve.seeds.T, color=chosen[index], alpha=0.3, linewidth=0.7)
        axes.plot(curve.x, curve.mean, color=chosen[index], linestyle=dash(index), linewidth=1.9, zorder=3)
    # Wide bands of few trainings must not hide the curves.
    axes.set_ylim(*axes.get_ylim())
    for index, curve in enumerate(curves):
        if curve.has_band:
            band(axes, curve.x, curve.low, curve.high, chosen[index])
    dress(axes, "", x, y)
    handles = [Line2D([], [], color=chosen[k], linestyle=dash(k), linewidth=1.9) for k in range(len(curves))]
    counts = [len(curve.seeds) for curve in curves]
    names = [f"{curve.name} ({n} training{'s' * (n > 1)})" for curve, n in zip(curves, counts, strict=True)]
    legend(figure, names, handles)
    has_bands = any(curve.has_band for curve in curves)
    shaded = "shaded: 95 % band that holds the whole mean curve" if has_bands else "too few for a band"
    save(path, figure, f"{y} over {x}", f"mean of trainings; {shaded}; thin: each training")
