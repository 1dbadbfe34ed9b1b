"""How much of a box is in no other box: what one leaves of it goes to the next."""

from lidarium.mapping.kernels.compilation import Array, kernel

MOST_PIECES = 512
"""Pieces that wait to be looked at, at most."""


@kernel(nrt=False)
def uncovered_volume(
    around: Array, slack: float, boxes: Array, limit: float, pieces: Array, nexts: Array
) -> float:
    """Return how much of a box is in none of others, all made wider by a slack.

    Parameters
    ----------
    around : (6,) float64
        Low and high corner of the box [m].
    slack : float
        By how much all boxes are wider, to each side [m].
    boxes : (N, 6) float64
        The others [m].
    limit : float
        Where more is found than this, or the pieces are too many, the search ends [m3].
    pieces : (MOST_PIECES, 6) float64
        Room for pieces.
    nexts : (MOST_PIECES,) int64
        Room for the boxes that each piece is compared with next.

    Returns
    -------
    float
        The volume [m3]; inf where the pieces are too many.
    """
    for axis in range(3):
        pieces[0, axis], pieces[0, axis + 3] = around[axis] - slack, around[axis + 3] + slack
    nexts[0] = 0
    waiting, uncovered = 1, 0.0
    while waiting > 0 and uncovered <= limit:
        waiting -= 1
        piece, place = pieces[waiting], nexts[waiting]
        while place < boxes.shape[0] and not _share_space(piece, boxes[place], slack):
            place += 1
        if place == boxes.shape[0]:
            uncovered += (piece[3] - piece[0]) * (piece[4] - piece[1]) * (piece[5] - piece[2])
            continue
        if waiting + 6 > MOST_PIECES:
            return float("inf")
        waiting = _cut(pieces, nexts, waiting, boxes[place], slack, place + 1)
    return uncovered


@kernel(nrt=False)
def _share_space(piece: Array, box: Array, slack: float) -> bool:
    for axis in range(3):
        if piece[axis] >= box[axis + 3] + slack or piece[axis + 3] <= box[axis] - slack:
            return False
    return True


@kernel(nrt=False)
def _cut(pieces: Array, nexts: Array, place: int, box: Array, slack: float, following: int) -> int:
    """Put what a box leaves of a piece in its place and behind; return the next place."""
    low_x, low_y, low_z = pieces[place, 0], pieces[place, 1], pieces[place, 2]
    high_x, high_y, high_z = pieces[place, 3], pieces[place, 4], pieces[place, 5]
    for axis in range(3):
        for side in range(2):
            low, high = box[axis] - slack, box[axis + 3] + slack
            start = low_x if axis == 0 else (low_y if axis == 1 else low_z)
            end = high_x if axis == 0 else (high_y if axis == 1 else high_z)
            if (side == 0 and start >= low) or (side == 1 and end <= high):
                continue
            kept = pieces[place]
            kept[0], kept[1], kept[2], kept[3], kept[4], kept[5] = low_x, low_y, low_z, high_x, high_y, high_z
            # What lies beyond this side of the box is a piece; the rest is cut at it.
            rest = low if side == 0 else high
            kept[axis + 3 if side == 0 else axis] = rest
            nexts[place] = following
            place += 1
            if axis == 0:
                low_x, high_x = (rest, high_x) if side == 0 else (low_x, rest)
            elif axis == 1:
                low_y, high_y = (rest, high_y) if side == 0 else (low_y, rest)
            else:
                low_z, high_z = (rest, high_z) if side == 0 else (low_z, rest)
    return place
