"""The settings of a planar laser range finder."""

from dataclasses import dataclass

from lidarium.mapping.grids.scan_geometry import ScanGeometry


@dataclass(frozen=True, slots=True, kw_only=True)
class Lidar(ScanGeometry):
    """A planar laser range finder at the centre of the robot.

    Attributes
    ----------
    noise_floor, noise_share : float
        Standard deviation of the range noise: max(noise_floor, noise_share * range) [m, 1].
    height : float
        Height of the laser's plane above the floor [m].
    """

    noise_floor: float = 0.0
    noise_share: float = 0.0
    height: float = 0.3

    def __post_init__(self) -> None:
        ScanGeometry.__post_init__(self)
        if not (self.noise_floor >= 0.0 and self.noise_share >= 0.0):
            raise ValueError(
                f"noise_floor is {self.noise_floor} and noise_share is {self.noise_share}; want 0 or more"
            )
        if not self.height > 0.0:
            raise ValueError(f"height of the laser's plane is {self.height} m; want more than 0")

    @property
    def is_noisy(self) -> bool:
        """Whether ranges carry noise."""
        return self.noise_floor > 0.0 or self.noise_share > 0.0
