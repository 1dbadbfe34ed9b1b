"""Sparse maps edited by hand: boxes added or removed, two maps joined.

Removing cuts space out of boxes, so that neighbouring obstacles stay.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid_motions import checked_poses
from lidarium.mapping.sparse.mapper.merging import are_near, merged_codes
from lidarium.mapping.sparse.seen_floor import SeenFloor
from lidarium.mapping.sparse.sparse_map import FreeCodes, OccupiedCodes, SparseMap, occupied_codes


def edited(
    sparse_map: SparseMap,
    add_boxes: NDArray[np.float64] | None = None,
    remove_boxes: NDArray[np.float64] | None = None,
) -> SparseMap:
    """Return a map with boxes added, after the space of others was cleared.

    Parameters
    ----------
    add_boxes : (A, 2, 3) float64 or None
        Low and high corners of further obstacles [m].
    remove_boxes : (R, 2, 3) float64 or None
        Low and high corners of the space that is free [m]; unseen floor within one that reaches below the floor
        counts as seen, too.
    """
    codes, seen = sparse_map.current, sparse_map.seen_floor
    for box in _checked_boxes(remove_boxes, "remove_boxes"):
        codes = _without(codes, box)
        if seen is not None and sparse_map.floor.heights(np.append(box.mean(axis=0)[:2], box[0, 2])) <= 0.0:
            seen = seen.cleared(box)
    frame = max(len(sparse_map.poses) - 1, 0)
    codes = codes.joined(occupied_codes(_checked_boxes(add_boxes, "add_boxes"), frame))
    ground = replace(sparse_map.ground, centres=sparse_map.free)
    return replace(sparse_map, occupied=codes, ground=ground, recorded=sparse_map.poses, seen_floor=seen)


def join_maps(first: SparseMap, second: SparseMap, transform: NDArray[np.float64]) -> SparseMap:
    """Return both maps as one, in the frame of the first.

    Parameters
    ----------
    transform : (4, 4) float64
        Maps points of the second into the first.
    """
    motion = checked_poses(transform)
    seen: SeenFloor | None = None
    if first.seen_floor is not None and second.seen_floor is not None:
        seen = first.seen_floor.joined(second.seen_floor, motion)
    second = second.moved(motion @ second.poses)
    shift = len(first.poses)
    added = second.current
    codes = first.current.joined(replace(added, frames=added.frames + shift))
    is_new = ~are_near(second.free, first.free, first.settings.merge_radius_m)
    ground = replace(first.ground, centres=first.free).joined(
        FreeCodes(centres=second.free[is_new], frames=second.ground.frames[is_new] + shift)
    )
    if first.settings.mode != "thesis":
        codes, _ = merged_codes(codes, ground.centres, first.settings)
    poses = np.concatenate([first.poses, second.poses])
    return replace(first, occupied=codes, ground=ground, poses=poses, recorded=poses, seen_floor=seen)


def _checked_boxes(boxes: NDArray[np.float64] | None, whose: str) -> NDArray[np.float64]:
    found = np.empty((0, 2, 3)) if boxes is None else np.asarray(boxes, np.float64)
    if found.ndim != 3 or found.shape[1:] != (2, 3):
        raise ValueError(f"{whose} have shape {found.shape}; want (N, 2, 3)")
    if not (np.isfinite(found).all() and (found[:, 0] <= found[:, 1]).all()):
        raise ValueError(f"{whose} are not finite low and high corners; want low before high, in metres")
    return found


def _without(codes: OccupiedCodes, box: NDArray[np.float64]) -> OccupiedCodes:
    """Cut a box (2, 3) out of codes; one that reaches out of it becomes up to six."""
    inside = ((codes.boxes[:, 0] < box[1]) & (codes.boxes[:, 1] > box[0])).all(axis=1)
    # A box of no size lies inside where it is not outside.
    flat = (codes.boxes[:, 0] >= box[0]).all(axis=1) & (codes.boxes[:, 1] <= box[1]).all(axis=1)
    cut = np.flatnonzero(inside | flat)
    rest, kept = codes.boxes[cut].copy(), codes.taken(~(inside | flat))
    for axis in range(3):
        for side in range(2):
            reaches = (rest[:, 0, axis] < box[0, axis]) if side == 0 else (rest[:, 1, axis] > box[1, axis])
            beyond = rest[reaches].copy()
            beyond[:, 1 - side, axis] = box[side, axis]
            rest[reaches, side, axis] = box[side, axis]
            pieces = codes.taken(cut[reaches])
            kept = kept.joined(replace(pieces, boxes=beyond, centres=beyond.mean(axis=1)))
    return kept
