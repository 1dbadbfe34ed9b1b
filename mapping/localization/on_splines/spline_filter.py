"""The particle filter on a map of curves.

Each particle is a pose, weighted by how well features and rays fit the map from there.

A particle also has scale errors of the wheels: by how much they measure paths and turns too long or too
short. What fits the walls survives, and carries the robot past where walls show nothing, as along a corridor.

References
----------
Motion by turn, way and turn, and resampling by one comb: Thrun, Burgard, Fox, "Probabilistic robotics", 2005,
chapters 4 and 5. Particles are drawn by motion and matches together: Montemerlo, Thrun, Koller, Wegbreit,
"FastSLAM 2.0", IJCAI 2003. Printed forms that divide the prior by the proposal leave the likelihood out; here
it is in the weight.
"""

import math
from dataclasses import dataclass, field
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.bounds import Distance, FromZero, Turn, check_settings, share, within
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.localization.on_splines.spline_matches import (
    Matches,
    TrackingSettings,
    joined,
    measured_lines,
    measured_points,
    measured_rays,
)
from lidarium.mapping.localization.on_splines.spline_tracking import SplineTracker, driven, steps_of
from lidarium.mapping.splines.features import Observation

_HIT_SHARE = 0.95
_ENTRIES_PER_METRE, _FARTHEST = 2000.0, 0.5


def _ray_likelihoods(sigma: float) -> NDArray[np.float64]:
    """Return log-likelihood and likelihood of a ray, shape (entries, 2).

    By the distance of the ray's end from a curve.
    """
    gaps = (np.arange(round(_FARTHEST * _ENTRIES_PER_METRE)) + 0.5) / _ENTRIES_PER_METRE
    likelihoods = _HIT_SHARE * np.exp(-0.5 * (gaps / sigma) ** 2) + 1.0 - _HIT_SHARE
    likelihoods[-1] = 1.0 - _HIT_SHARE
    return np.stack([np.log(likelihoods), likelihoods], axis=1)


class _MatchedFeatures(NamedTuple):
    """Features as seen and in the map, and their deviations; see ``Matches``."""

    seen: Array
    known: Array
    sigmas: Array


@kernel
def _weigh_features(
    particles: Array,
    matched_points: _MatchedFeatures,
    matched_lines: _MatchedFeatures,
    angle_sigma: float,
    logarithms: Array,
) -> None:
    """Add to each particle's log-likelihood (particles,) how well features fit."""
    points, known_points, point_sigmas = matched_points
    lines, known_lines, line_sigmas = matched_lines
    cosines, sines = np.cos(particles[:, 2]), np.sin(particles[:, 2])
    for k in range(points.shape[0]):
        for i in range(particles.shape[0]):
            dx = particles[i, 0] + cosines[i] * points[k, 0] - sines[i] * points[k, 1] - known_points[k, 0]
            dy = particles[i, 1] + sines[i] * points[k, 0] + cosines[i] * points[k, 1] - known_points[k, 1]
            logarithms[i] -= 0.5 * (dx * dx + dy * dy) / (point_sigmas[k] * point_sigmas[k])
    for k in range(lines.shape[0]):
        along_x, along_y = math.cos(known_lines[k, 2]), math.sin(known_lines[k, 2])
        for i in range(particles.shape[0]):
            dx = particles[i, 0] + cosines[i] * lines[k, 0] - sines[i] * lines[k, 1] - known_lines[k, 0]
            dy = particles[i, 1] + sines[i] * lines[k, 0] + cosines[i] * lines[k, 1] - known_lines[k, 1]
            aside = dy * along_x - dx * along_y
            turns = (particles[i, 2] + lines[k, 2] - known_lines[k, 2]) / (2.0 * math.pi)
            turn = (turns - math.floor(turns + 0.5)) * (2.0 * math.pi)
            logarithms[i] -= 0.5 * ((aside / line_sigmas[k]) ** 2 + (turn / angle_sigma) ** 2)


@kernel
def _weigh_rays(
    particles: Array,
    rays: Array,
    pieces: Array,
    ray_table: Array,
    share: float,
    logarithms: Array,
    fits: Array,
) -> None:
    """Weigh particles by the distances of ray ends from their matched pieces.

    Rays are (k, 2), pieces (k, 5). Writes how well the rays fit, from 0.05 to 1.
    """
    last_entry = ray_table.shape[0] - 1
    cosines, sines = np.cos(particles[:, 2]), np.sin(particles[:, 2])
    for k in range(rays.shape[0]):
        ray_x, ray_y = rays[k]
        middle_x, middle_y, along_x, along_y, _ = pieces[k]
        for i in range(particles.shape[0]):
            dx = particles[i, 0] + cosines[i] * ray_x - sines[i] * ray_y - middle_x
            dy = particles[i, 1] + sines[i] * ray_x + cosines[i] * ray_y - middle_y
            entry = min(int(abs(dy * along_x - dx * along_y) * _ENTRIES_PER_METRE), last_entry)
            logarithms[i] += share * ray_table[entry, 0]
            fits[i] += ray_table[entry, 1] / rays.shape[0]


_GATE_SIGMAS = 3.0
_MIN_MOTION = np.array([1e-4, 1e-4, 1e-4])
_RECOVERY_STEPS = 10
_MIN_BOX = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class SplineFilterSettings:
    """Settings of the particle filter.

    Attributes
    ----------
    tracking : TrackingSettings
        Settings of matching and of the map.
    particles : int, default 400
        Number of particles.
    start_distance, start_turn : float, default 0.0
        Standard deviations of the particles around the first pose [m, rad]; with ``start_map``
        0.0 means 0.05 m and 1 degree.
    distance_bias, turn_bias : float, default 0.05
        Constant scale errors of odometry's paths and turns, as a standard
        deviation: particles try how much, and those that fit the walls teach it.
    bias_wander : float, default 0.005
        Standard deviation by which that share is changed whenever particles are drawn again, so that they go
        on trying; at most the share itself. Without evidence it comes back to none.
    lost_likelihood : float, default 0.3
        If rays fit worse than this in the mean for ten corrections, some particles are drawn again; 0 for
        never.
    recovered_share, recovery_distance, recovery_turn : float
        Share of particles, and half of the box around the pose from which they are drawn [m, rad]; then
        from boxes of half the size each, down to a sixteenth.
    """

    tracking: TrackingSettings = field(default_factory=TrackingSettings)
    particles: Annotated[int, within(1, 100_000)] = 400
    start_distance: Distance = 0.0
    start_turn: Turn = 0.0
    distance_bias: FromZero = 0.05
    turn_bias: FromZero = 0.05
    bias_wander: FromZero = 0.005
    lost_likelihood: FromZero = 0.3
    recovered_share: Annotated[float, share()] = 0.1
    recovery_distance: Distance = 0.25
    recovery_turn: Turn = math.radians(10.0)

    def __post_init__(self) -> None:
        check_settings(self, "the filter")


class SplineFilter(SplineTracker):
    """Localizes by particles on the map of curves that it makes.

    Parameters
    ----------
    settings : SplineFilterSettings or None
        The defaults if None.
    geometry : ScanGeometry or None
        The laser; the URG-04LX of the theses if None.

    Attributes
    ----------
    particles : (n, 3) float64
        Poses x, y, theta in the frame of the local map [m, rad].
    scales : (n, 2) float64
        Each particle's scale factors of paths and turns against odometry.
    weights : (n,) float64
        Their weights, which sum to one.
    resamplings : int
        How often particles were drawn again by their weights.
    """

    Settings = SplineFilterSettings

    def __init__(self, settings: SplineFilterSettings | None = None, geometry: ScanGeometry | None = None) -> None:
        self.settings = settings or SplineFilterSettings()
        super().__init__(self.settings.tracking, geometry or ScanGeometry())

    @property
    def local_covariance(self) -> NDArray[np.float64]:
        """Covariance of the particles, shape (3, 3) [m^2, m rad, rad^2]."""
        offsets = self.particles - self.local
        offsets[:, 2] = np.arctan2(np.sin(offsets[:, 2]), np.cos(offsets[:, 2]))
        return np.asarray((offsets * self.weights[:, None]).T @ offsets)

    def _begin(self, pose: NDArray[np.float64], seed: int) -> None:
        settings = self.settings
        self._generator = np.random.default_rng(seed)
        spread = self._start_spread(settings.start_distance, settings.start_turn)
        self.particles = pose + spread * self._generator.standard_normal((settings.particles, 3))
        self.weights = np.full(settings.particles, 1.0 / settings.particles)
        self.scales = 1.0 + np.array([settings.distance_bias, settings.turn_bias]) * self._generator.standard_normal(
            (settings.particles, 2)
        )
        self.resamplings, self._lost_steps, self._box = 0, 0, 0.0
        self._ray_table = _ray_likelihoods(self.tracking.curve_sigma)
        # Where odometry alone leads each particle from its last place, and the covariance of that motion.
        self._expected, self._motion_covariance = self.particles.copy(), np.diag(_MIN_MOTION**2)

    def _change_frame(self, change: Transform, reach: float) -> None:
        self.particles = np.column_stack([change.apply(self.particles[:, :2]), self.particles[:, 2] + change.theta])

    def _predict(self, motion: Transform) -> NDArray[np.float64]:
        first, distance, second = steps_of(motion)
        noise, tracking = self._generator.standard_normal((3, len(self.particles))), self.tracking
        if first == 0.0 and distance == 0.0 and second == 0.0:
            self._expected, self._motion_covariance = self.particles.copy(), np.diag(_MIN_MOTION**2)
            return self.local
        turns = abs(first), abs(second)
        sway = tracking.turn_per_metre * abs(distance)
        of_way, of_turn = self.scales.T
        firsts = first * of_turn + noise[0] * (tracking.turn_per_turn * turns[0] + sway)
        ways = distance * of_way + noise[1] * (
            tracking.slip_per_metre * abs(distance) + tracking.slip_per_turn * sum(turns)
        )
        seconds = second * of_turn + noise[2] * (tracking.turn_per_turn * turns[1] + sway)
        plain = np.stack([first * of_turn, distance * of_way, second * of_turn], axis=1)
        self._expected = driven(self.particles, plain)
        self.particles = driven(self.particles, np.stack([firsts, ways, seconds], axis=1))
        pose = self._mean()
        spread = np.array(
            [
                tracking.turn_per_turn * turns[0] + sway,
                tracking.slip_per_metre * abs(distance) + tracking.slip_per_turn * sum(turns),
                tracking.turn_per_turn * turns[1] + sway,
            ]
        )
        heading = float(pose[2]) - second
        cosine, sine = math.cos(heading), math.sin(heading)
        by_steps = np.array([[-distance * sine, cosine, 0.0], [distance * cosine, sine, 0.0], [1.0, 0.0, 1.0]])
        self._motion_covariance = (by_steps * spread**2) @ by_steps.T + np.diag(_MIN_MOTION**2)
        return pose

    def _correct(self, matches: Matches, observation: Observation) -> NDArray[np.float64]:
        tracking = self.tracking
        logarithms, fits = np.zeros(len(self.particles)), np.zeros(len(self.particles))
        _weigh_features(
            self.particles,
            _MatchedFeatures(
                matches.points,
                matches.known_points,
                np.maximum(matches.point_sigmas, tracking.feature_sigma),
            ),
            _MatchedFeatures(
                matches.lines, matches.known_lines, np.maximum(matches.line_sigmas, tracking.feature_sigma)
            ),
            tracking.line_angle_sigma,
            logarithms,
        )
        _weigh_rays(
            self.particles,
            matches.rays,
            matches.pieces,
            self._ray_table,
            tracking.ray_share,
            logarithms,
            fits,
        )
        if self._box <= _MIN_BOX and float(self.weights @ fits) >= self.settings.lost_likelihood:
            logarithms = self._move_to_matches(matches)
        weights = self.weights * np.exp(logarithms - logarithms.max())
        self.weights = weights / weights.sum()
        pose = self._mean()
        likelihood = float(self.weights @ fits)
        if float((self.weights**2).sum()) * len(self.particles) > 2.0:
            self._resample()
        self._recover(likelihood if len(matches.rays) else 1.0, pose)
        return pose

    def _move_to_matches(self, matches: Matches) -> NDArray[np.float64]:
        """Draw each particle anew from the estimate by its motion and the matches together.

        Return the logarithms of the weights (particles,) by which matches fit the motions. Drawn by the
        motion alone, few particles would fit, and those that live on by chance would lose along a corridor
        what they spread over.
        """
        here, tracking = self._mean(), self.tracking
        measured = joined(
            [
                part.within(_GATE_SIGMAS)
                for part in (
                    measured_points(matches, here, tracking),
                    measured_lines(matches, here, tracking),
                    measured_rays(matches, here, tracking),
                )
            ]
        )
        information, pull = measured.information()
        spread = np.linalg.inv(np.linalg.inv(self._motion_covariance) + information)
        offsets = self._expected - here
        offsets[:, 2] = np.arctan2(np.sin(offsets[:, 2]), np.cos(offsets[:, 2]))
        rest = pull - offsets @ information
        drawn = self._generator.standard_normal(offsets.shape) @ np.linalg.cholesky(spread).T
        self.particles = here + offsets + rest @ spread + drawn
        return np.asarray(
            offsets @ pull
            - 0.5 * ((offsets @ information) * offsets).sum(axis=1)
            + 0.5 * ((rest @ spread) * rest).sum(axis=1)
        )

    def _mean(self) -> NDArray[np.float64]:
        x, y = self.weights @ self.particles[:, :2]
        headings = self.particles[:, 2]
        return np.array(
            [x, y, math.atan2(float(self.weights @ np.sin(headings)), float(self.weights @ np.cos(headings)))]
        )

    def _resample(self) -> None:
        """Draw particles by their weights with one comb of evenly spaced teeth."""
        count = len(self.particles)
        teeth = (self._generator.random() + np.arange(count)) / count
        chosen = np.searchsorted(np.cumsum(self.weights), teeth).clip(max=count - 1)
        self.particles, self.weights = self.particles[chosen], np.full(count, 1.0 / count)
        self.scales = self._wandered(self.scales[chosen])
        self.resamplings += 1

    def _wandered(self, scales: NDArray[np.float64]) -> NDArray[np.float64]:
        """Change scales (n, 2) a little, so that without evidence they spread as at first, and no wider."""
        biases = np.array([self.settings.distance_bias, self.settings.turn_bias])
        wander = np.minimum(self.settings.bias_wander, biases)
        kept = np.sqrt(1.0 - (wander / np.maximum(biases, np.finfo(np.float64).tiny)) ** 2)
        drawn = self._generator.standard_normal(scales.shape)
        return np.asarray(1.0 + kept * (scales - 1.0) + wander * drawn)

    def _recover(self, likelihood: float, pose: NDArray[np.float64]) -> None:
        """Draw some particles around the pose if rays have not fitted for a while.

        Afterwards they are drawn in ever smaller boxes.

        The nearest of those that were drawn fits well enough to take all, and a robot that stands spreads
        them no more.
        """
        settings = self.settings
        is_lost = likelihood < settings.lost_likelihood
        self._lost_steps = self._lost_steps + 1 if is_lost or self._box > _MIN_BOX else 0
        drawn = round(settings.recovered_share * len(self.particles))
        if self._lost_steps >= _RECOVERY_STEPS and drawn > 0:
            self._box = 1.0 if is_lost else 0.5 * self._box
            box = self._box * np.array([settings.recovery_distance, settings.recovery_distance, settings.recovery_turn])
            which = self._generator.permutation(len(self.particles))[:drawn]
            self.particles[which] = pose + box * self._generator.uniform(-1.0, 1.0, (drawn, 3))
            self._lost_steps = 0
