"""What the thesis printed of its experiments on merging maps."""

from typing import NamedTuple


class PrintedPair(NamedTuple):
    """A pair of the thesis's bank, as printed.

    It has names of the maps, matches, RANSAC inliers, agreement in discs [%], time [us], and whether it
    was accepted.
    """

    a: str
    b: str
    matches: int
    inliers: int
    agreement: float
    time_us: int
    is_accepted: bool


PAIRS = (
    PrintedPair("B1", "C1", 10, 0, 0.0, 27319, False),
    PrintedPair("B1", "C2", 21, 5, 90.161, 152583, True),
    PrintedPair("B1", "A1", 15, 3, 77.420, 94425, False),
    PrintedPair("B1", "A2", 49, 3, 84.519, 179721, False),
    PrintedPair("C1", "A1", 27, 7, 55.841, 21912, False),
    PrintedPair("C1", "A2", 38, 5, 90.314, 43468, True),
    PrintedPair("C1", "B2", 42, 4, 73.741, 33754, False),
    PrintedPair("A1", "B2", 27, 6, 91.054, 114585, True),
    PrintedPair("A1", "C2", 35, 5, 82.417, 125171, False),
    PrintedPair("B2", "C2", 58, 4, 68.106, 194303, False),
    PrintedPair("B2", "A2", 126, 6, 74.941, 193064, False),
    PrintedPair("C2", "A2", 52, 9, 90.170, 247168, True),
)
"""All of them; 10 overlap in truth, it does not say which."""

OVERLAPPING = 10

DETECTION_US = {"A1": 1731, "A2": 1523, "B1": 3101, "B2": 4852, "C1": 827, "C2": 2914}
DESCRIPTION_US = {"A1": 11171, "A2": 24335, "B1": 15320, "B2": 17891, "C1": 3004, "C2": 26048}
"""Times of each map [us]."""

DETECTORS_US = {"own": (384, 228, 2349), "Shi-Tomasi": (1095, 632, 9106), "SIFT": (11321, 6510, 75746)}
"""Times on three maps of 146 x 144, 113 x 113 and 398 x 402 cells [us].

The row of Shi-Tomasi may be that of Harris, copied.
"""

DESCRIPTORS_US = {
    "polar": (904, 425, 1808),
    "log-polar": (829, 605, 1050),
    "SIFT": (9176, 5407, 61673),
    "ORB": (1164, 315, 8704),
}
"""The same of descriptors [us]."""


def pair_ms(pair: PrintedPair) -> float:
    """Return the time of a pair [ms].

    Detection and description of both of its maps are included.
    """
    return (pair.time_us + sum(DETECTION_US[name] + DESCRIPTION_US[name] for name in (pair.a, pair.b))) / 1e3


def claimed_ms() -> float:
    """Return the sum claimed as the most that a pair takes [ms].

    It is the longest time of each stage, once.
    """
    return (
        max(DETECTION_US.values()) + max(DESCRIPTION_US.values()) + max(pair.time_us for pair in PAIRS)
    ) / 1e3
