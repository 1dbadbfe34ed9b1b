"""Lloyd's steps of scikit-learn and faiss on one thread, as peers of ours."""

import importlib
import importlib.util
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float32]
Quantiser = Callable[[], NDArray[np.floating]]
"""Takes Lloyd's steps, labels every point, and returns the codes, shape (k, 3)."""


def scikit_learn_steps(points: Points, start: Points, steps: int) -> Quantiser | None:
    """Return the quantiser of scikit-learn; None where it is not installed."""
    if importlib.util.find_spec("sklearn") is None:
        return None
    cluster: Any = importlib.import_module("sklearn.cluster")
    limits: Any = importlib.import_module("threadpoolctl")

    def quantise() -> NDArray[np.floating]:
        with limits.threadpool_limits(1):
            model = cluster.KMeans(
                len(start), init=start, n_init=1, max_iter=steps, tol=0.0, algorithm="lloyd"
            )
            codes: NDArray[np.floating] = model.fit(points).cluster_centers_
        return codes

    return quantise


def faiss_steps(points: Points, start: Points, steps: int) -> Quantiser | None:
    """Return the quantiser of faiss; None where it is not installed."""
    if importlib.util.find_spec("faiss") is None:
        return None
    faiss: Any = importlib.import_module("faiss")

    def quantise() -> NDArray[np.floating]:
        faiss.omp_set_num_threads(1)
        model = faiss.Kmeans(3, len(start), niter=steps, max_points_per_centroid=len(points))
        model.train(points, init_centroids=start)
        model.index.search(points, 1)
        codes: NDArray[np.floating] = model.centroids
        return codes

    return quantise
