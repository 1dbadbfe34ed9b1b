"""Wheel odometry: encoder counts with bias, noise and whole ticks.

The module also has the noise of the drives.

Biases belong to a robot and an episode: their signs are drawn at its beginning. Noise follows the odometry
motion model (turn and distance, each from turn and distance) and the velocity motion model of Thrun, Burgard
and Fox, "Probabilistic Robotics", chapter 5, with variances that grow with the path driven, so that a model
has the same effect for any time step.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.settings.odometry import OdometrySettings
from lidarium.envs.simulation.disturbances.noise import gaussian_at, mix, stream_key
from lidarium.mapping.kernels.compilation import Array, kernel

ENCODER_STREAM, DRIVE_STREAM = 0x6F646F6D, 0x64726976
"""Set the draws of encoders and drives apart from those of the laser."""

DISTANCE_SCALE, TURN_SCALE, DRIFT, LEFT_TRAVEL, RIGHT_TRAVEL, LEFT_TICKS, RIGHT_TICKS = range(7)
"""Places in a robot's row of wheel numbers.

They are its biases, the false travel of its wheels [m], and the ticks read from it.
"""

(
    RADIUS,
    MAX_SPEED,
    MAX_TURN_RATE,
    MAX_ACCELERATION,
    MAX_TURN_ACCELERATION,
    HEIGHT,
    WHEEL_BASE,
    TICKS_PER_METRE,
) = range(8)
"""Columns of bodies, as ``Robot.numbers`` has them."""

WHEEL_NUMBERS = 7


@kernel(forceinline=True)
def within_half_turns(angle: float) -> float:
    """Return an angle in (-pi, pi] (kernel)."""
    return angle - 2.0 * math.pi * math.ceil((angle - math.pi) / (2.0 * math.pi))


def begin_wheels(settings: OdometrySettings, robots: int, seed: int) -> NDArray[np.float64]:
    """Return the wheel numbers of a team at the beginning of an episode.

    The signs of the biases are drawn from ``seed``.
    """
    signs = np.random.default_rng([seed, ENCODER_STREAM]).choice([-1.0, 1.0], (robots, 3))
    wheels = np.zeros((robots, WHEEL_NUMBERS))
    wheels[:, DISTANCE_SCALE] = 1.0 + settings.distance_bias * signs[:, 0]
    wheels[:, TURN_SCALE] = 1.0 + settings.turn_bias * signs[:, 1]
    wheels[:, DRIFT] = settings.drift * signs[:, 2]
    return wheels


@kernel(nrt=False)
def disturb_commands(numbers: Array, noise_table: Array, seed: np.uint64, step: int, commands: Array) -> None:
    """Disturb a team's speeds and turn rates (robots, 2) as its drives do."""
    for robot in range(commands.shape[0]):
        key = mix(stream_key(seed, robot, step) ^ np.uint32(DRIVE_STREAM))
        commands[robot, 0] *= 1.0 + numbers[5] * gaussian_at(key, noise_table, 0)
        commands[robot, 1] *= 1.0 + numbers[6] * gaussian_at(key, noise_table, 1)


class Encoders(NamedTuple):
    """Wheels of one robot, and their measured motion.

    Attributes
    ----------
    wheels : (7,) float64
        The robot's row of wheel numbers.
    measured : (2,) float64
        Speed and turn rate as the encoders measure them [m/s, rad/s].
    odometry : (3,) float64
        x, y, theta by dead reckoning [m, rad].
    """

    wheels: Array
    measured: Array
    odometry: Array


@kernel(nrt=False)
def read_encoders(
    numbers: Array,
    noise_table: Array,
    key: np.uint32,
    body: Array,
    encoders: Encoders,
    velocity: Array,
    duration: float,
) -> None:
    """Count the wheels of one robot after a step, and update its dead reckoning.

    Parameters
    ----------
    numbers : (7,) float64
        ``OdometrySettings.numbers``.
    noise_table : (4096,) float32
        ``GAUSSIAN_TABLE``.
    body : (8,) float64
        ``Robot.numbers``, the distance between the wheels and their ticks per metre among them.
    velocity : (2,) float64
        Speed and turn rate that the wheels drove at [m/s, rad/s].
    duration : float
        Length of the step [s].
    """
    wheels, measured, odometry = encoders.wheels, encoders.measured, encoders.odometry
    wheel_base, ticks_per_metre = body[WHEEL_BASE], body[TICKS_PER_METRE]
    key = mix(key ^ np.uint32(ENCODER_STREAM))
    distance, turn = velocity[0] * duration, velocity[1] * duration
    path, angle = abs(distance), abs(turn)
    turn_deviation = math.sqrt(numbers[0] * numbers[0] * angle + numbers[1] * numbers[1] * path)
    distance_deviation = math.sqrt(numbers[2] * numbers[2] * path + numbers[3] * numbers[3] * angle)
    turn = turn * wheels[TURN_SCALE] + distance * wheels[DRIFT] + turn_deviation * gaussian_at(key, noise_table, 0)
    distance = distance * wheels[DISTANCE_SCALE] + distance_deviation * gaussian_at(key, noise_table, 1)
    if numbers[4] != 0.0:
        wheels[LEFT_TRAVEL] += distance - 0.5 * turn * wheel_base
        wheels[RIGHT_TRAVEL] += distance + 0.5 * turn * wheel_base
        left, right = (
            math.floor(wheels[LEFT_TRAVEL] * ticks_per_metre),
            math.floor(wheels[RIGHT_TRAVEL] * ticks_per_metre),
        )
        left_path, right_path = (
            (left - wheels[LEFT_TICKS]) / ticks_per_metre,
            (right - wheels[RIGHT_TICKS]) / ticks_per_metre,
        )
        wheels[LEFT_TICKS], wheels[RIGHT_TICKS] = left, right
        distance, turn = 0.5 * (left_path + right_path), (right_path - left_path) / wheel_base
    measured[0], measured[1] = distance / duration, turn / duration
    middle = odometry[2] + 0.5 * turn
    chord = distance if abs(turn) < 1e-9 else distance * math.sin(0.5 * turn) / (0.5 * turn)
    odometry[0] += chord * math.cos(middle)
    odometry[1] += chord * math.sin(middle)
    odometry[2] = within_half_turns(odometry[2] + turn)
