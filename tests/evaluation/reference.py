"""A second scorer, slow and plain, that shares nothing with the package but the arrays of the world.

It notes what a watcher sees of every step (true poses, scans as told) and works out anew from the rasters of
the floor: rays by all crossings with the lattice, the seen area cell by cell (which fan holds a cell's
centre, and does it lie before the fan's far edge), F by flood fill, log-odds cell by cell. Only what is
exactly on an edge could be told differently, and nothing that is drawn at random is."""

import itertools
import math

import numpy as np

from lidarium.evaluation.episodes.watching import Watcher

GRAZING = 8.0
TEAMMATE_MARGIN = 1.5
JUST_INSIDE = 1.0 + 1.2e-7
HIT, MISS, LEAST, MOST = 17, 8, -40, 70
ENDED = 4


class Notes(Watcher):
    """What a step leaves: poses, scans as told, and who still senses. A watcher."""

    def begin(self, env):
        self.poses, self.ranges, self.senses = [], [], []
        self._note(env)

    def step(self, env, commands):
        self._note(env)

    def outcome(self, env):
        pass

    def _note(self, env):
        self.poses.append(env.world.poses.copy())
        self.ranges.append(env.simulation.ranges.astype(float))
        self.senses.append(env.world.flags & ENDED == 0)


def reached(is_free, cell):
    """Cells that a flood from a cell reaches through free ones, 4-connected."""
    found, edge = np.zeros(is_free.shape, bool), [cell]
    found[cell] = True
    free = is_free.tolist()
    while edge:
        row, column = edge.pop()
        for i, j in ((row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)):
            if free[i][j] and not found[i, j]:
                found[i, j] = True
                edge.append((i, j))
    return found


def grown(cells, offsets):
    """Cells at any of some offsets from given ones."""
    result, (rows, columns) = np.zeros_like(cells), cells.shape
    for i, j in offsets:
        source = cells[max(-i, 0) : rows - max(i, 0), max(-j, 0) : columns - max(j, 0)]
        result[max(i, 0) : rows + min(i, 0), max(j, 0) : columns + min(j, 0)] |= source
    return result


def around(reach):
    return itertools.product(range(-math.ceil(reach) - 1, math.ceil(reach) + 2), repeat=2)


EIGHT = list(itertools.product((-1, 0, 1), repeat=2))


def pooled(cells, multiple, combine):
    """Cells of the maps, of those of the world that they hold; what lies beyond the raster is False."""
    rows, columns = (-(-size // multiple) for size in cells.shape)
    whole = np.zeros((rows * multiple, columns * multiple), bool)
    whole[: cells.shape[0], : cells.shape[1]] = cells
    return combine(whole.reshape(rows, multiple, columns, multiple), axis=(1, 3))


class Reference:
    """The figures of an episode, worked out again from its notes."""

    def __init__(self, env, notes):
        self.env, self.notes = env, notes
        tables, settings = env.world.floors[0], env.settings
        self.laser, self.body = tables.laser.solid != 0, tables.body.solid != 0
        self.cell, self.origin = tables.laser.resolution, np.array(tables.laser.origin)
        self.resolution = settings.occupancy.resolution
        self.multiple = round(self.resolution / self.cell)
        lidar = settings.lidar
        self.is_round = lidar.field_of_view > 2.0 * math.pi - 1e-9
        self.increment = lidar.field_of_view / (lidar.beams if self.is_round else lidar.beams - 1)
        self.angles = -lidar.field_of_view / 2 + self.increment * np.arange(lidar.beams)
        self.reach, self.radius = lidar.range_max, settings.robot.radius
        self.counted = self.cells_of_f()
        self.occupied = pooled(self.laser, self.multiple, np.any)
        self.look()

    def start_cells(self, side):
        return [
            tuple(int(value) for value in ((start[:2] - self.origin) / side)[::-1]) for start in self.env.world.starts
        ]

    def cells_of_f(self):
        """F: what the disc sweeps from the starts and the laser can look into."""
        reach = self.radius / self.cell
        near = [
            (i, j)
            for i, j in around(reach)
            if math.hypot(max(abs(i) - 0.5, 0), max(abs(j) - 0.5, 0)) ** 2 < reach**2 - 1e-9
        ]
        space = ~grown(self.body, near)
        centres = np.zeros_like(space)
        for cell in self.start_cells(self.cell):
            assert space[cell], "a start is too near to a wall for this reference"
            if not centres[cell]:
                centres |= reached(space, cell)
        # Centres before a straight wall are rounded away from it; the disc still reaches the wall.
        reach = max(reach, math.ceil(reach + 0.5 - 1e-9) - 1.0)
        disc = [(i, j) for i, j in around(reach) if i * i + j * j <= reach**2 + 1e-9]
        return pooled(grown(centres, disc) & ~self.body & ~self.laser, self.multiple, np.all)

    def true_scan(self, pose, others):
        """Ranges [m], inf for no return, by all crossings of each beam with the lines of the lattice."""
        directions = pose[2] + self.angles
        slopes = np.stack([np.cos(directions), np.sin(directions)], axis=1)
        place = (pose[:2] - self.origin) / self.cell
        longest = self.reach / self.cell
        ranges = np.full(len(directions), np.inf)
        for beam, slope in enumerate(slopes):
            crossings = [np.zeros(1)]
            for axis in range(2):
                lines = np.arange(math.floor(place[axis] - longest), math.ceil(place[axis] + longest) + 1)
                with np.errstate(divide="ignore"):
                    crossings.append((lines - place[axis]) / slope[axis])
            at = np.sort(np.concatenate(crossings))
            at = at[(at >= 0.0) & (at < longest)]
            middles = np.append((at[1:] + at[:-1]) / 2, (at[-1] + longest) / 2)
            # The outermost cells of a raster are solid: what lies beyond is never asked for.
            rows, columns = (
                np.clip(
                    np.floor(place[axis] + middles * slope[axis]).astype(int),
                    0,
                    self.laser.shape[1 - axis] - 1,
                )
                for axis in (1, 0)
            )
            met = np.flatnonzero(self.laser[rows, columns])
            length = at[met[0]] * self.cell if met.size else np.inf
            for other in others:
                gap = other[:2] - pose[:2]
                along = float(gap @ slope)
                beside = float(gap @ gap) - along**2
                if along > 0.0 and beside < self.radius**2:
                    length = min(length, along - math.sqrt(self.radius**2 - beside))
            ranges[beam] = np.float32(length * JUST_INSIDE) if length < self.reach else np.inf
        return ranges

    def area(self, pose, ranges):
        """Cells whose centre the scan has seen: each lies in one fan, and is seen if it lies before the
        fan's far edge."""
        rows, columns = self.counted.shape
        lengths = np.minimum(ranges, self.reach)
        low_x, low_y = (np.floor((pose[:2] - self.reach - self.origin) / self.resolution).astype(int)).clip(0)
        high_x, high_y = np.ceil((pose[:2] + self.reach - self.origin) / self.resolution).astype(int) + 1
        x = self.origin[0] + (np.arange(low_x, min(high_x, columns)) + 0.5) * self.resolution - pose[0]
        y = self.origin[1] + (np.arange(low_y, min(high_y, rows)) + 0.5) * self.resolution - pose[1]
        x, y = np.meshgrid(x, y)
        turn = np.mod(np.arctan2(y, x) - pose[2] - self.angles[0], 2.0 * math.pi) / self.increment
        fan = np.floor(turn).astype(int)
        beams = len(lengths)
        is_within = fan < (beams if self.is_round else beams - 1)
        first = np.where(is_within, fan, 0)
        last = (first + 1) % beams
        from_length, to_length = lengths[first], lengths[last]
        nearer = np.minimum(from_length, to_length)
        is_edge = np.abs(from_length - to_length) > self.resolution + GRAZING * self.increment * nearer
        from_length, to_length = np.where(is_edge, nearer, from_length), np.where(is_edge, nearer, to_length)
        heading = pose[2] + self.angles
        from_x, from_y = from_length * np.cos(heading[first]), from_length * np.sin(heading[first])
        to_x, to_y = to_length * np.cos(heading[last]), to_length * np.sin(heading[last])
        is_before = (to_x - from_x) * (y - from_y) - (to_y - from_y) * (x - from_x) > 0.0
        seen = np.zeros((rows, columns), bool)
        seen[low_y : low_y + x.shape[0], low_x : low_x + x.shape[1]] = is_within & is_before
        return seen

    def hits(self, robot, poses, ranges):
        """Cells in which beams of a scan ended, those on teammates left out."""
        pose, cells = poses[robot], set()
        for angle, length in zip(self.angles, ranges, strict=True):
            if length > self.reach:
                continue
            end = pose[:2] + length * np.array([math.cos(pose[2] + angle), math.sin(pose[2] + angle)])
            teammates = [other for k, other in enumerate(poses) if k != robot]
            if any(
                math.dist(end, teammate[:2]) <= self.radius + TEAMMATE_MARGIN * self.resolution
                for teammate in teammates
            ):
                continue
            column, row = np.floor((end - self.origin) / self.resolution).astype(int)
            cells.add((int(row), int(column)))
        return cells

    def settled(self, believed, pose, ranges):
        """Ranges of beams that end at most three deviations and a cell behind an occupied cell, and beside
        no free one, end in it."""
        lidar, known = (
            self.env.settings.lidar,
            {tuple(cell): believed[tuple(cell)] for cell in np.argwhere(believed).tolist()},
        )
        start, settled = (pose[:2] - self.origin) / self.resolution, ranges.astype(float)
        for beam, angle in enumerate(self.angles):
            if ranges[beam] > self.reach:
                continue
            length = float(ranges[beam]) / self.resolution
            deviation = max(lidar.noise_floor, lidar.noise_share * ranges[beam]) / self.resolution
            direction = np.array([math.cos(pose[2] + angle), math.sin(pose[2] + angle)])
            column, row = (int(value) for value in np.floor(start + length * direction))
            if any(known.get((row + i, column + j), 0) < 0 for i, j in ((1, 0), (-1, 0), (0, 1), (0, -1))):
                continue
            for back in np.arange(0.0, 3.0 * deviation + 1.0 + 1e-12, 0.5):
                if back <= length:
                    column, row = (int(value) for value in np.floor(start + (length - back) * direction))
                    if known.get((row, column), 0) >= HIT:
                        settled[beam] = (length - back) * self.resolution
                        break
        return settled

    def look(self):
        """Go through the steps: masks of what each robot saw, maps, coverage over time, and what is seen
        at once."""
        robots, is_noisy = self.env.settings.robots, self.env.settings.lidar.is_noisy
        self.seen = np.zeros((robots, *self.counted.shape), bool)
        self.maps = np.zeros((robots, *self.counted.shape), int)
        self.coverage, self.at_once = [], []
        for poses, told, senses in zip(self.notes.poses, self.notes.ranges, self.notes.senses, strict=True):
            now = np.zeros_like(self.seen)
            for robot in np.flatnonzero(senses):
                others = [pose for k, pose in enumerate(poses) if k != robot]
                true = self.true_scan(poses[robot], others)
                if not is_noisy:
                    np.testing.assert_allclose(told[robot], true, rtol=1e-6)
                area = self.area(poses[robot], true)
                now[robot] = area & self.counted
                believed = self.maps[robot]
                ranges = self.settled(believed, poses[robot], told[robot]) if is_noisy else told[robot]
                lowered = self.area(poses[robot], ranges) if is_noisy else area
                raised = np.zeros_like(lowered)
                for cell in self.hits(robot, poses, ranges):
                    if cell[0] < raised.shape[0] and cell[1] < raised.shape[1] and min(cell) >= 0:
                        raised[cell] = True
                believed[raised] = np.minimum(believed[raised] + HIT, MOST)
                believed[lowered & ~raised] = np.maximum(believed[lowered & ~raised] - MISS, LEAST)
            self.seen |= now
            self.coverage.append(self.seen.any(axis=0).sum() / self.counted.sum())
            by_one, by_two = now.any(axis=0).sum(), (now.sum(axis=0) >= 2).sum()
            self.at_once.append(by_two / by_one if by_one else 0.0)

    @property
    def overlap(self):
        times = self.seen.sum(axis=0)
        return (times >= 2).sum() / (times >= 1).sum() if times.any() else 0.0

    @property
    def instant_overlap(self):
        return np.mean(self.at_once[:: self.env.settings.decision_steps])

    @property
    def path(self):
        ways = np.zeros(self.env.settings.robots)
        for before, after in itertools.pairwise(self.notes.poses):
            ways += [math.dist(a[:2], b[:2]) for a, b in zip(before, after, strict=True)]
        return ways

    def time_to(self, share):
        return next(
            (round(k * self.env.settings.time_step, 6) for k, value in enumerate(self.coverage) if value >= share),
            None,
        )

    @property
    def auc(self):
        """Each value holds for a step; the last one up to the horizon."""
        steps = self.env.settings.horizon_steps
        values = self.coverage[:steps]
        return (sum(values) + (steps - len(values)) * self.coverage[-1]) / steps

    @property
    def iou(self):
        believed = {tuple(cell) for cell in np.argwhere(self.maps.sum(axis=0) > 0).tolist()}
        sensed = self.seen.any(axis=0)
        surface = {tuple(cell) for cell in np.argwhere(self.occupied & grown(sensed, EIGHT)).tolist()}
        hits = sum(
            any((i + k, j + m) in other for k, m in EIGHT)
            for one, other in ((believed, surface), (surface, believed))
            for i, j in one
        )
        size = len(believed) + len(surface)
        return hits / size if size else 1.0

    @property
    def knowable(self):
        free = np.zeros_like(self.occupied)
        for cell in self.start_cells(self.resolution):
            free |= reached(~self.occupied, cell)
        return free | (self.occupied & grown(free, EIGHT))

    @property
    def known_shares(self):
        """C_known of the team's map and of each robot's, and C_valid."""
        knowable, valid = self.knowable, self.counted | (self.occupied & grown(self.counted, EIGHT))
        known = self.maps != 0
        team = known.any(axis=0)
        own = [(map_ & knowable).sum() / knowable.sum() for map_ in known]
        return (team & knowable).sum() / knowable.sum(), own, (team & valid).sum() / valid.sum()
