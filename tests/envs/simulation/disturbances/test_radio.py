"""Radio: who reaches whom, against slow references."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.envs.floors.floor import Raster
from lidarium.envs.settings.radio import RADIO_KINDS, RadioSettings
from lidarium.envs.simulation.disturbances.radio import links, path_loss, solid_length

RESOLUTION = 0.1


def raster(generator, rows=40, columns=50, share=0.15):
    return Raster((generator.random((rows, columns)) < share).astype(np.uint8), (-1.0, 2.0), RESOLUTION)


def sampled_length(solid, x, y, to_x, to_y, samples=40_000):
    """Length within solid cells by many points on the line."""
    shares = (np.arange(samples) + 0.5) / samples
    columns, rows = (
        np.floor(x + shares * (to_x - x)).astype(int),
        np.floor(y + shares * (to_y - y)).astype(int),
    )
    inside = (rows >= 0) & (rows < solid.shape[0]) & (columns >= 0) & (columns < solid.shape[1])
    return solid[rows[inside], columns[inside]].sum() / samples * math.hypot(to_x - x, to_y - y)


PLACE = st.tuples(st.floats(-3.0, 53.0), st.floats(-3.0, 43.0))


@settings(max_examples=60, derandomize=True, database=None)
@given(one=PLACE, other=PLACE, seed=st.integers(0, 1000))
def test_the_way_through_walls_is_that_of_many_samples_and_the_same_both_ways(one, other, seed):
    solid = raster(np.random.default_rng(seed)).solid
    length = solid_length(solid, *one, *other)
    assert length == pytest.approx(sampled_length(solid, *one, *other), abs=0.05)
    assert length == pytest.approx(solid_length(solid, *other, *one), abs=1e-9)


def test_lines_along_the_lattice_and_of_no_length_end():
    solid = np.ones((5, 5), np.uint8)
    assert solid_length(solid, 0.0, 2.0, 5.0, 2.0) == pytest.approx(5.0)
    assert solid_length(solid, 2.0, 0.0, 2.0, 5.0) == pytest.approx(5.0)
    assert solid_length(solid, 0.0, 0.0, 5.0, 5.0) == pytest.approx(5.0 * math.sqrt(2.0))
    assert solid_length(solid, 2.5, 2.5, 2.5, 2.5) == 0.0


def slow_links(radio, places, floor):
    """Who reaches whom, pair by pair, in plain words."""
    reached = np.zeros((len(places), len(places)), bool)
    for i, one in enumerate(places):
        for j, other in enumerate(places):
            if i == j or radio.kind == "none":
                continue
            distance = math.dist(one, other)
            cells = [
                (value - corner) / RESOLUTION
                for place in (one, other)
                for value, corner in zip(place, floor.origin, strict=True)
            ]
            walls = sampled_length(floor.solid, *cells) * RESOLUTION
            if radio.kind == "all":
                reached[i, j] = True
            elif radio.kind == "range":
                reached[i, j] = distance <= radio.reach
            elif radio.kind == "line_of_sight":
                reached[i, j] = distance <= radio.reach and walls == 0.0
            else:
                loss = radio.reference_loss + 10.0 * radio.free_exponent * math.log10(
                    max((distance - walls) / radio.reference_distance, 1.0)
                )
                if walls > 0.0:
                    loss += radio.wall_loss + 10.0 * radio.wall_exponent * math.log10(max(walls / 0.1, 1.0))
                reached[i, j] = radio.power - loss > radio.threshold
    return reached


@pytest.mark.parametrize("kind", RADIO_KINDS)
@pytest.mark.parametrize("seed", range(4))
def test_every_kind_of_radio_reaches_whom_the_slow_reference_says(kind, seed):
    generator = np.random.default_rng(seed)
    floor, radio = raster(generator, share=0.03), RadioSettings(kind=kind, reach=2.5, threshold=-64.0)
    places = generator.uniform([-1.0, 2.0], [4.0, 6.0], (9, 2))
    assert np.array_equal(links(radio, places, floor), slow_links(radio, places, floor))


def test_loss_grows_with_the_way_and_with_walls():
    radio = RadioSettings(kind="signal")
    distance = np.array([1.0, 3.5, 7.0, 70.0])
    assert path_loss(radio, distance, np.zeros(4)) == pytest.approx(
        [31.0, 31.0, 31.0 + 20.0 * math.log10(2.0), 31.0 + 20.0 * math.log10(20.0)]
    )
    through = path_loss(radio, np.array([10.0, 10.0]), np.array([0.1, 0.2]))
    assert through[0] == pytest.approx(31.0 + 20.0 * math.log10(9.9 / 3.5) + 6.5)
    assert through[1] > through[0] + 11.0


def test_shadowing_is_the_same_both_ways():
    radio, floor = RadioSettings(kind="signal", shadowing=8.0), raster(np.random.default_rng(0), share=0.0)
    places = np.random.default_rng(1).uniform([0.0, 0.0], [60.0, 60.0], (12, 2))
    chance = np.random.default_rng(2).standard_normal((12, 12))
    reached = links(radio, places, floor, chance)
    assert np.array_equal(reached, reached.T)
    assert not np.array_equal(reached, links(radio, places, floor))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"kind": "smoke"}, "kind of the radio is 'smoke'; want one of all, none"),
        ({"reach": 0.0}, "reach of the radio is 0.0; want a number above 0"),
        ({"loss": 1.0}, "loss of the radio is 1.0; want a probability"),
        ({"latency_s": -1.0}, "latency_s of the radio is -1.0"),
        ({"power": math.inf}, "power of the radio is inf"),
    ],
)
def test_radios_that_cannot_be_are_refused(values, message):
    with pytest.raises(ValueError, match=message):
        RadioSettings(**values)
