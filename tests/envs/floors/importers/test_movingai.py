import gzip

import numpy as np
import pytest

from lidarium.envs.floors.importers import load_file, takes_resolution

GRID = """type octile
height 6
width 8
map
@@@@@@@@
@....@.@
@.SG.@.@
@....TT@
@.W....@
@@@@@@@@
"""


def written(tmp_path, text, name="grid.map"):
    (tmp_path / name).write_text(text)
    return tmp_path / name


def test_cells_are_as_large_as_they_are_said_to_be(tmp_path):
    floor = load_file(written(tmp_path, GRID), 0.5)
    assert floor.name == "grid"
    assert floor.bounds == pytest.approx((0.5, 0.5, 3.5, 2.5))
    raster = floor.raster(0.5, 0.2, 0.2)
    # The first line is at the top; the two cells behind the wall at the right are another room.
    wanted = np.array([[1, 0, 1, 1, 1, 1], [1, 1, 1, 1, 0, 0], [1, 1, 1, 1, 0, 0], [1, 1, 1, 1, 0, 0]])
    column, row = (round((low - start) / 0.5) for low, start in zip((0.5, 0.5), raster.origin, strict=True))
    assert np.array_equal(raster.solid[row : row + 4, column : column + 6] == 0, wanted)


def test_windows_line_ends_and_packed_files_are_read(tmp_path):
    plain = load_file(written(tmp_path, GRID), 0.5)
    windows = load_file(written(tmp_path, GRID.replace("\n", "\r\n"), "windows.map"), 0.5)
    (tmp_path / "packed.map.gz").write_bytes(gzip.compress(GRID.encode()))
    packed = load_file(tmp_path / "packed.map.gz", 0.5)
    assert plain.geometry_sha256 == windows.geometry_sha256 == packed.geometry_sha256


def test_a_grid_needs_a_resolution(tmp_path):
    assert takes_resolution(written(tmp_path, GRID))
    with pytest.raises(ValueError, match=r"does not say how large a cell is; want image_resolution \(--resolution"):
        load_file(tmp_path / "grid.map")


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (("height 6", "height 7"), r"has 6 lines of cells; its height is 7"),
        (("width 8", "width 9"), r"line 5 has 8 cells; the width is 9"),
        (("width 8", "width x"), r"no good width; want a line 'width N'"),
        (("height 6\n", ""), r"no good height"),
        (("map\n", ""), r"no line 'map'"),
        (("SG", "S?"), r"line 7 has a cell '\?'; want one of \. G S @ O T W"),
        (("type octile\n", "octile\n"), r"content of no known floor format"),
    ],
)
def test_what_is_no_grid_is_refused_by_line(tmp_path, changed, message):
    with pytest.raises(ValueError, match=message):
        load_file(written(tmp_path, GRID.replace(*changed)), 0.5)
