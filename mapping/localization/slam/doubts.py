"""Stretches of a run in which odometry alone says where the robot went, or lies."""

from dataclasses import dataclass, replace

ODOMETRY_ALONE = "odometry alone: the scans show what the map does not hold"
NO_MATCH = "no match: the scans contradict the map where odometry leads, and no other place is sure"

ELSEWHERE = "odometry contradicted: the scans agree with the map in another direction or place alone"

LITTLE = "little explained: hardly any of the scans agrees with the map, and no other place is sure"


@dataclass(frozen=True, slots=True)
class Doubt:
    """A stretch that is doubtful.

    Attributes
    ----------
    start_s, end_s : float
        Times of the last scan before it that was matched, and of the last scan in it [s].
    scans : int
        Scans in it.
    reason : str
        Why.
    """

    start_s: float
    end_s: float
    scans: int
    reason: str


class Doubts:
    """Doubtful stretches so far, in the order of time."""

    def __init__(self) -> None:
        self.stretches: list[Doubt] = []
        self._sure_s: float | None = None
        self._is_open = False

    def note(self, time_s: float, reason: str | None) -> None:
        """Take in that a scan was matched (None), or why it is not sure where it was taken."""
        if reason is None:
            self._sure_s, self._is_open = time_s, False
            return
        if self._is_open and self.stretches[-1].reason == reason:
            last = self.stretches[-1]
            self.stretches[-1] = replace(last, end_s=time_s, scans=last.scans + 1)
        else:
            start_s = time_s if self._sure_s is None else self._sure_s
            self.stretches.append(Doubt(start_s, time_s, 1, reason))
        self._is_open = True
