"""Time to predict a window of a map with the shipped network, compared with PyTorch."""

import importlib.util
import statistics
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.benchmarks.speed.harness.lines import Line, faster
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Effort, interleaved, repeated
from lidarium.mapping.prediction.levels import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.prediction.network import WINDOW, MapNetwork, load_weights

CORES = 1
MOST_MS = 15.0
OWN, TORCH = "lidarium", "PyTorch"

NOTES = (
    f"*Window of a predicted map*: probabilities of {WINDOW} x {WINDOW} squares from a room that is half seen, by the "
    "shipped network on one thread. *PyTorch*: the same network and weights, on one thread.",
)


def half_seen_room() -> NDArray[np.int8]:
    """Return a window with a part of a room."""
    levels = np.full((WINDOW, WINDOW), UNKNOWN, np.int8)
    levels[30:90, 30:100] = FREE
    levels[30, 30:100] = levels[30:90, 30] = levels[60, 40:80] = OCCUPIED
    return levels


def by_torch(levels: NDArray[np.int8]) -> Callable[[], object] | None:
    """Return what predicts the window with PyTorch; None if it is not installed."""
    if importlib.util.find_spec("torch") is None:
        return None
    import torch

    from lidarium.training.prediction.torch_map_network import TorchMapNetwork

    network: Any = TorchMapNetwork().eval()
    network.set_weights(load_weights())
    batch = torch.from_numpy(levels)[None]

    def predict() -> object:
        threads = torch.get_num_threads()
        torch.set_num_threads(1)
        try:
            with torch.no_grad():
                return network(batch)[0].sigmoid().numpy()
        finally:
            torch.set_num_threads(threads)

    return predict


def measure(effort: Effort) -> list[Line]:
    """Measure a window, by the package and by PyTorch in turn."""
    levels, model = half_seen_room(), MapNetwork(load_weights())
    model(levels)  # compiles
    contenders = {OWN: repeated(lambda: model(levels))}
    peer = by_torch(levels)
    if peer is not None:
        contenders[TORCH] = repeated(peer)
    seconds = interleaved(contenders, effort)
    own = 1e3 * statistics.median(seconds[OWN])
    name = "window of a predicted map"
    return [
        Line(f"{name}, time", f"{own:.1f} ms", "-", None, MOST_MS, own, is_upper_bound=True, unit="ms"),
        faster(name, seconds[OWN], TORCH, seconds.get(TORCH), None, "windows/s"),
    ]


if __name__ == "__main__":
    run_alone(measure, "Time to predict a window of a map, compared with PyTorch.", CORES)
