"""On a GPU the same codes are found."""

import pytest
from scattered_points import room

from lidarium.mapping.sparse.quantisation.lloyd import improved
from lidarium.mapping.sparse.quantisation.on_gpu import has_gpu, improved_on_gpu
from lidarium.mapping.sparse.quantisation.quantiser import quantise
from lidarium.mapping.sparse.quantisation.settings import QuantisationSettings
from lidarium.mapping.sparse.quantisation.tiles import tiles_of

POINTS = room()


def test_torch_gives_the_codes_of_the_processor_on_any_of_its_devices():
    pytest.importorskip("torch")
    tiles = tiles_of(POINTS)
    devices = ("cpu", "cuda") if has_gpu() else ("cpu",)
    for device in devices:
        found = improved_on_gpu(tiles, POINTS[:40], 5, device=device)
        assert found == pytest.approx(improved(tiles, POINTS[:40], 5), abs=1e-5)


@pytest.mark.skipif(not has_gpu(), reason="torch finds no GPU")
def test_a_gpu_gives_the_same_quantisation():
    found, wanted = (quantise(POINTS, 40, QuantisationSettings(device=name)) for name in ("cuda", "cpu"))
    assert found.codes == pytest.approx(wanted.codes, abs=1e-5)


@pytest.mark.skipif(has_gpu(), reason="torch finds a GPU")
def test_a_gpu_that_is_not_there_is_told():
    with pytest.raises(RuntimeError, match="torch finds no GPU"):
        quantise(POINTS, 4, QuantisationSettings(device="cuda"))
    assert quantise(POINTS, 4, QuantisationSettings(device="auto")).counts.all()
