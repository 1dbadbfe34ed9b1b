"""A world in plain numpy, without kernels: slow, obvious, the oracle of the fast one.

Wheels measure exactly, lasers have no noise, nothing fails.
"""

import math

import numpy as np

from lidarium.envs.simulation.kernels.arrays import ENDED
from lidarium.envs.simulation.kernels.contact import (
    CENTRE_BUMPER,
    CONTACT_TOLERANCE,
    PRESSED,
    SIDE_BUMPER,
)
from lidarium.envs.simulation.kernels.motion import PIECE


class PlainWorld:
    """Robots on floors; a ``World``."""

    def __init__(self, team, lidar, time_step=0.1, episodes=1):
        self.team, self.lidar, self.time_step = team, lidar, time_step
        self.robots, self.episodes, rows = len(team), episodes, len(team) * episodes
        self.bodies = np.stack([robot.numbers for robot in team])
        self.floors = [None] * episodes
        self.seeds, self.steps = np.zeros(episodes, np.uint64), np.zeros(episodes, np.int64)
        self.starts, self.poses, self.velocities = (np.zeros((rows, n)) for n in (3, 3, 2))
        self.attitudes = np.zeros((rows, 3))
        self.moves, self.flags = np.ones(rows, np.uint8), np.zeros(rows, np.int64)
        self.failed, self.contacts = np.zeros(rows, np.uint8), np.zeros(rows, np.uint8)
        self.travelled, self.collisions = np.zeros(rows), np.zeros(rows, np.int64)
        self.faults, self.true_ranges = np.zeros((rows, 0)), np.full((rows, lidar.beams), np.inf, np.float32)
        self.sensors = {
            "scan": self.true_ranges.copy(),
            "odometry": np.zeros((rows, 3)),
            "velocity": self.velocities,
            "bumper": np.zeros((rows, 3), np.int8),
        }

    def place(self, episode, floor, starts, free, seed):
        rows = slice(episode * self.robots, (episode + 1) * self.robots)
        self.floors[episode], self.seeds[episode], self.steps[episode] = floor, seed, -1
        self.starts[rows] = self.poses[rows] = starts
        self.true_ranges[rows] = self.sensors["scan"][rows] = np.inf
        self.moves[rows] = 1
        arrays = (self.velocities, self.contacts, self.failed, self.travelled, self.collisions)
        for array in (*arrays, self.sensors["odometry"], self.sensors["bumper"]):
            array[rows] = 0

    def move_and_sense(self, commands, *, moves_bodies=True, runs=None):
        for episode in range(self.episodes):
            if runs is not None and not runs[episode]:
                continue
            rows = range(episode * self.robots, (episode + 1) * self.robots)
            if moves_bodies:
                for row in rows:
                    self._move(row, commands[row])
            for row in rows:
                if not self.flags[row] & ENDED:
                    self.true_ranges[row] = self._scan(row)
                    self.sensors["scan"][row] = self.true_ranges[row]

    def show(self):
        return False

    def close(self):
        pass

    def _move(self, row, command):
        robot = self.team[row % self.robots]
        was_in_contact, self.contacts[row] = bool(self.contacts[row]), 0
        self.sensors["bumper"][row] = 0
        if not self.moves[row]:
            self.velocities[row] = 0.0
            return
        limits = np.array([robot.max_speed, robot.max_turn_rate])
        gains = np.array([robot.max_acceleration, robot.max_turn_acceleration]) * self.time_step
        change = np.clip(np.clip(command, -limits, limits) - self.velocities[row], -gains, gains)
        speed, turn_rate = self.velocities[row] + change
        start = self.poses[row, :2].copy()
        cell = self.floors[row // self.robots].body.resolution
        pieces = max(math.ceil(abs(speed) * self.time_step / (PIECE * cell)), 1)
        for _ in range(pieces):
            self._drive_piece(row, speed, turn_rate, self.time_step / pieces)
        if self.contacts[row]:
            # What the body could not do, the wheels did not do either.
            advance = (self.poses[row, :2] - start) @ _direction(self.poses[row, 2]) / self.time_step
            speed = np.clip(advance, -abs(speed), abs(speed))
            self.collisions[row] += not was_in_contact
        self.travelled[row] += math.hypot(*(self.poses[row, :2] - start))
        self.velocities[row] = speed, turn_rate
        self.poses[row, 2] = math.pi - (math.pi - self.poses[row, 2]) % (2.0 * math.pi)

    def _drive_piece(self, row, speed, turn_rate, duration):
        heading = self.poses[row, 2] + turn_rate * duration
        # The chord of an arc points halfway between its headings.
        half = 0.5 * turn_rate * duration
        chord = speed * duration * np.sinc(half / math.pi)
        place, is_free = self._pushed_out(row, self.poses[row, :2] + chord * _direction(heading - half), heading)
        self.poses[row, 2] = heading
        if is_free:
            self.poses[row, :2] = place

    def _pushed_out(self, row, place, heading):
        for _ in range(8):
            depth, normal = max((self._wall(row, place), self._other(row, place)), key=lambda found: found[0])
            if depth <= 0.0:
                return place, True
            if depth > PRESSED:
                self.contacts[row] = 1
                side = (math.atan2(-normal[1], -normal[0]) - heading + math.pi) % (2.0 * math.pi) - math.pi
                if abs(side) <= SIDE_BUMPER:
                    pressed = 1 if abs(side) <= CENTRE_BUMPER else (0 if side > 0.0 else 2)
                    self.sensors["bumper"][row, pressed] = 1
            if not normal.any():
                return place, False
            place = place + normal * (depth + CONTACT_TOLERANCE)
        return place, False

    def _wall(self, row, place):
        """How deep the disc is in the nearest solid cell, and the way out."""
        low, high = _cells(self.floors[row // self.robots].body)
        return _out_of(place - np.clip(place, low, high), self.team[row % self.robots].radius)

    def _other(self, row, place):
        """How deep the disc is in the nearest other robot, and the way out."""
        first = row // self.robots * self.robots
        others = [other for other in range(first, first + self.robots) if other != row]
        found = [
            _out_of(
                (place - self.poses[other, :2])[None],
                self.team[row - first].radius + self.team[other - first].radius,
            )
            for other in others
        ]
        return max(found, key=lambda out: out[0], default=(0.0, np.zeros(2)))

    def _scan(self, row):
        """Distances to the first solid cell or body along each beam, by all cells and bodies."""
        lidar, first = self.lidar, row // self.robots * self.robots
        x, y, heading = self.poses[row]
        beams = _direction(heading + lidar.angles).T
        low, high = _cells(self.floors[row // self.robots].laser)
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.stack([low - (x, y), high - (x, y)])[:, None] / beams[None, :, None]
        enters, leaves = ends.min(axis=0).max(axis=2), ends.max(axis=0).min(axis=2)
        lengths = np.where((enters <= leaves) & (leaves > 0.0), np.maximum(enters, 0.0), np.inf).min(axis=1)
        for other in range(first, first + self.robots):
            body = self.team[other - first]
            if other != row and body.height > lidar.height:
                gap = self.poses[other, :2] - (x, y)
                along = beams @ gap
                inside = along**2 - (gap @ gap - body.radius**2)
                meets = (inside >= 0.0) & (along > 0.0)
                lengths[meets] = np.minimum(lengths[meets], along[meets] - np.sqrt(inside[meets]))
        return np.where(lengths < lidar.range_max, lengths, np.inf).astype(np.float32)


def _direction(angle):
    return np.array([np.cos(angle), np.sin(angle)])


def _cells(raster):
    """Lower left and upper right corners of the solid cells [m]."""
    rows, columns = np.nonzero(raster.solid)
    low = np.stack([columns, rows], axis=1) * raster.resolution + raster.origin
    return low, low + raster.resolution


def _out_of(gaps, radius):
    """Depth of a disc in the nearest thing at gaps (n, 2), and the unit vector away from it."""
    distances = np.hypot(*gaps.T)
    nearest = int(distances.argmin()) if len(distances) else 0
    if not len(distances) or distances[nearest] >= radius:
        return 0.0, np.zeros(2)
    normal = gaps[nearest] / distances[nearest] if distances[nearest] > 0.0 else np.zeros(2)
    return radius - distances[nearest], normal
