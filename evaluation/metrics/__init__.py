"""The figures of a run, each a pure function on arrays.

Each has its formula and its source; docs/reference/metrics.md lists them.
"""

from lidarium.evaluation.metrics.communication import (
    bytes_per_robot_second,
    connected_share,
    largest_cluster_share,
    largest_clusters,
    sharing_lag,
)
from lidarium.evaluation.metrics.coverage import free_coverage, known_coverage, own_coverage, valid_coverage
from lidarium.evaluation.metrics.curves import (
    WallError,
    curve_precision,
    distances_to_walls,
    end_point_bytes,
    grid_bytes,
    hits_of_beams,
    seen_walls,
    wall_error,
    wall_recall,
)
from lidarium.evaluation.metrics.effort import decision_percentiles, peak_megabytes
from lidarium.evaluation.metrics.evenness import balance, jain_index, path_balance
from lidarium.evaluation.metrics.maps import free_error_rate, occupied_f1, occupied_iou, surface, widened
from lidarium.evaluation.metrics.overlaps import instant_overlap, overlap, overlap_of_maps
from lidarium.evaluation.metrics.poses import absolute_error, best_transform, moved, relative_error
from lidarium.evaluation.metrics.progress import (
    area_under_curve,
    decisions_to,
    distance_sum_to,
    distance_to,
    first_reached,
    is_success,
    path_lengths,
    restricted_time,
    time_to,
)
from lidarium.evaluation.metrics.safety import collisions_per_episode, collisions_per_km

__all__ = [
    "WallError",
    "absolute_error",
    "area_under_curve",
    "balance",
    "best_transform",
    "bytes_per_robot_second",
    "collisions_per_episode",
    "collisions_per_km",
    "connected_share",
    "curve_precision",
    "decision_percentiles",
    "decisions_to",
    "distance_sum_to",
    "distance_to",
    "distances_to_walls",
    "end_point_bytes",
    "first_reached",
    "free_coverage",
    "free_error_rate",
    "grid_bytes",
    "hits_of_beams",
    "instant_overlap",
    "is_success",
    "jain_index",
    "known_coverage",
    "largest_cluster_share",
    "largest_clusters",
    "moved",
    "occupied_f1",
    "occupied_iou",
    "overlap",
    "overlap_of_maps",
    "own_coverage",
    "path_balance",
    "path_lengths",
    "peak_megabytes",
    "relative_error",
    "restricted_time",
    "seen_walls",
    "sharing_lag",
    "surface",
    "time_to",
    "valid_coverage",
    "wall_error",
    "wall_recall",
    "widened",
]
