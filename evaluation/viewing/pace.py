"""Keeps simulated time in step with the clock on the wall."""

import time
from collections.abc import Callable

LONGEST_WAIT_S = 0.05
"""Longest time between two looks at the controls [s]."""

MOST_BEHIND_S = 0.25
"""A run that is later than this does not hurry after the clock [s]."""


class Pace:
    """Waits until simulated time is due; it holds up a run and changes nothing of it.

    Parameters
    ----------
    clock, sleep : callable
        Wall time [s], and what waits for a time [s].
    """

    def __init__(
        self,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._clock, self._sleep = clock, sleep
        self._since = (0.0, 0.0, 0.0)

    def wait(
        self,
        time_s: float,
        speed: Callable[[], float],
        is_held: Callable[[], bool],
        meanwhile: Callable[[], bool],
    ) -> None:
        """Wait until a simulated time is due.

        Parameters
        ----------
        time_s : float
            Simulated time, later than at the last call [s].
        speed : callable
            Returns simulated seconds per second; inf waits for nothing.
        is_held : callable
            Returns whether time stands still.
        meanwhile : callable
            Called while there is nothing else to do; what it returns is whether to go on waiting.
        """
        while True:
            now, rate = self._clock(), speed()
            wall_s, simulated_s, before = self._since
            due = wall_s + (time_s - simulated_s) / rate
            is_other = rate != before or is_held() or now - due > MOST_BEHIND_S
            if is_other:
                self._since, due = (now, time_s, rate), now
            if not is_held() and now >= due:
                return
            self._sleep(LONGEST_WAIT_S if is_held() else min(due - now, LONGEST_WAIT_S))
            if not meanwhile():
                return
