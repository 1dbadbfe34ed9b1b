"""Maps as text, and texts that are none."""

import numpy as np
import pytest
from hypothesis import given
from made_sparse_maps import TRIPLES

from lidarium.mapping.sparse.files.text_form import parsed_text, read_text_map, text_content
from lidarium.mapping.sparse.sparse_map import SparseMap, free_codes, occupied_codes


def test_text_is_as_the_thesis_has_it():
    boxes = np.array([[[3.0, 0, 0], [3, 0, 0]], [[1.0, 2, 2], [1, 2, 2]], [[0, 0, -3.0], [0, 0, -3]]])
    found = text_content(SparseMap(occupied=occupied_codes(boxes), ground=free_codes([[0.5, -0.25, 0.0]])))
    assert found.splitlines() == [
        "# sparse-map v1 3 1",
        "3.000000 0.000000 0.000000",
        "1.000000 2.000000 2.000000",
        "0.000000 0.000000 -3.000000",
        "0.500000 -0.250000 0.000000",
    ]


@given(TRIPLES, TRIPLES)
def test_text_comes_back_to_six_decimals(occupied, free):
    codes = occupied_codes(np.stack([occupied, occupied], axis=1))
    after = parsed_text(text_content(SparseMap(occupied=codes, ground=free_codes(free))))
    for found, expected in ((after.centres, occupied), (after.free, free)):
        order = np.argsort(np.linalg.norm(expected, axis=1), kind="stable")
        np.testing.assert_allclose(found, expected[order], atol=5.1e-7, rtol=0.0)
    np.testing.assert_array_equal(after.boxes[:, 0], after.boxes[:, 1])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "it begins with ''"),
        ("# map v1 0 0\n", "want '# sparse-map v1"),
        ("# sparse-map v2 0 0\n", "version 'v2'"),
        ("# sparse-map v1 -1 0\n", "two whole numbers"),
        ("# sparse-map v1 999999999 1\n1 2 3\n", "cannot hold them"),
        ("# sparse-map v1 2 0\n1.000000 2.000000 3.000000\n", "claims 2 codes"),
        ("# sparse-map v1 1 0\n1 2 3\n4 5 6\n", "there are 2 lines"),
        ("# sparse-map v1 1 0\n1.0 2.0\n", "line 2 is '1.0 2.0'"),
        ("# sparse-map v1 1 0\n1.0 2.0 x\n", "want three numbers"),
        ("# sparse-map v1 1 0\n1.0 2.0 nan\n", "within 1,000,000 m"),
    ],
)
def test_a_text_that_is_no_map_is_refused_by_its_name(tmp_path, text, message):
    path = tmp_path / "map.txt"
    path.write_text(text)
    with pytest.raises(ValueError, match=message) as caught:
        read_text_map(path)
    assert str(path) in str(caught.value)
