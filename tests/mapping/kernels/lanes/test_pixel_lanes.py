"""Raised pixels are those of a plain loop."""

import numpy as np

from lidarium.mapping.kernels.compilation import kernel
from lidarium.mapping.kernels.in_python.plain import raised_pixels
from lidarium.mapping.kernels.lanes.beam_lanes import PIXEL_LANES, raise_lanes


@kernel
def raised(pixels, start, slope, first, last):
    raise_lanes(pixels.ctypes.data, np.float32(start), np.float32(slope), first, last)


def test_pixels_are_raised_as_by_a_plain_loop():
    generator = np.random.default_rng(0)
    for _ in range(500):
        pixels = generator.uniform(0.0, 1.0, PIXEL_LANES).astype(np.float32)
        start, slope = np.float32(generator.uniform(0.0, 1.0)), np.float32(generator.uniform(-0.1, 0.1))
        first, last = (int(number) for number in generator.integers(-20, 36, 2))
        expected = raised_pixels(pixels, start, slope, first, last)
        raised(pixels, start, slope, first, last)
        assert (pixels == expected).all()
