"""Costs between cells that are kept while a map changes."""

import numpy as np
import pytest

from lidarium.mapping.planning import path_costs
from lidarium.mapping.planning.clearance import ClearanceField
from lidarium.mapping.planning.footprint import Footprint
from lidarium.mapping.planning.grid_planning import search
from lidarium.mapping.planning.path_costs import PathCosts
from lidarium.mapping.planning.search.path_search import SearchSpace

FOOTPRINT = Footprint()


class World:
    """A map of rooms whose cells change."""

    def __init__(self):
        self.log_odds = np.full((90, 140), -1, np.int8)
        self.log_odds[:, 20::24] = 1
        for column in range(20, 140, 24):
            self.log_odds[30:42, column] = -1
        self.log_odds[60:, :] = 0
        self.clearance = ClearanceField(self.log_odds.shape, 0.05, 0.6)
        self.space = SearchSpace(self.log_odds.shape, 0.05)
        self.kept = self.fresh()
        self.change((0, 90, 0, 140), None)

    def fresh(self):
        return PathCosts(self.space, self.log_odds, self.clearance, FOOTPRINT)

    def change(self, window, value):
        top, bottom, left, right = window
        if value is not None:
            self.log_odds[top:bottom, left:right] = value
        self.clearance.update(self.log_odds, window)

    def reachable(self, generator, count):
        found = search(self.space, self.log_odds, self.clearance, (36, 60), FOOTPRINT)
        cells, costs = found.reached(), found.costs()
        chosen = [tuple(map(int, cell)) for cell in cells[generator.integers(len(cells), size=count)]]
        return chosen, np.array([costs[cell] for cell in chosen])

    def plain(self, cells, bounds):
        """The definition: one search from every cell."""
        table = np.minimum(
            [[search(self.space, self.log_odds, self.clearance, a, FOOTPRINT).cost(b) for b in cells] for a in cells],
            bounds[:, None] + bounds[None],
        )
        np.fill_diagonal(table, 0.0)
        return table


@pytest.mark.parametrize("seed", range(4))
def test_kept_costs_are_those_of_new_searches_whatever_changes(seed):
    generator, world = np.random.default_rng(seed), World()
    asked = []
    for _ in range(25):
        top, left = int(generator.integers(80)), int(generator.integers(130))
        height, width = (int(side) for side in generator.integers(1, 10, size=2))
        world.change((top, top + height, left, left + width), int(generator.choice([-1, -1, 0, 1])))
        world.change((34, 39, 58, 63), -1)
        cells, bounds = world.reachable(generator, 6)
        still = [cell for cell in asked if np.isfinite(cost_from_centre(world, cell))][:5]
        cells, bounds = still + cells, np.append([cost_from_centre(world, cell) for cell in still], bounds)
        np.testing.assert_array_equal(world.kept.between(cells, bounds), world.plain(cells, bounds))
        asked = cells


def cost_from_centre(world, cell):
    return search(world.space, world.log_odds, world.clearance, (36, 60), FOOTPRINT).cost(cell)


def test_costs_are_searched_for_again_only_where_the_map_changed(monkeypatch):
    world, starts = World(), []
    monkeypatch.setattr(
        path_costs, "search", lambda *given, **options: starts.append(given[3]) or search(*given, **options)
    )
    cells, bounds = [(10, 5), (20, 15), (20, 125)], np.full(3, 50.0)
    before = world.kept.between(cells, bounds)
    assert len(starts) == 2
    world.kept.between(cells[::-1], bounds)
    assert len(starts) == 2
    world.change((30, 42, 68, 69), 1)
    after = world.kept.between(cells, bounds)
    assert after[0, 1] == before[0, 1]
    assert after[0, 2] == 100.0 > before[0, 2], "the door was shut"
    assert set(starts[2:]) == {(20, 125)}


def test_the_same_cell_twice_costs_nothing_between():
    cells, bounds = [(10, 5), (10, 5), (20, 15)], np.full(3, 50.0)
    costs = World().kept.between(cells, bounds)
    assert costs[0, 1] == 0.0
    assert costs[0, 2] == costs[1, 2] > 0.0


def test_no_more_than_the_latest_costs_are_kept(monkeypatch):
    monkeypatch.setattr(path_costs, "_MOST_KEPT", 10)
    generator, world = np.random.default_rng(0), World()
    for _ in range(4):
        cells, bounds = world.reachable(generator, 8)
        np.testing.assert_array_equal(world.kept.between(cells, bounds), world.plain(cells, bounds))
    world.kept.between([], np.empty(0))
    assert len(world.kept._costs) == 10
