"""Headers of YAML are short and without aliases."""

import pytest

from lidarium.mapping.files.guarded_yaml import MOST_YAML_BYTES, read_yaml


def test_values_are_read(tmp_path):
    (tmp_path / "a.yaml").write_text("image: map.png\nresolution: 0.05\norigin: [1, 2.5, 0]\n")
    assert read_yaml(tmp_path / "a.yaml") == {"image": "map.png", "resolution": 0.05, "origin": [1, 2.5, 0]}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: &x [1]\nb: *x\n", r"has an alias"),
        ("a: [1, 2\n", "a.yaml is not a yaml file"),
        ("a: !!python/object/apply:os.system ['true']\n", "a.yaml is not a yaml file"),
        ("# " + "x" * MOST_YAML_BYTES, "want at most 16,384"),
    ],
)
def test_what_is_no_short_header_is_refused_by_name(tmp_path, text, message):
    (tmp_path / "a.yaml").write_text(text)
    with pytest.raises(ValueError, match=message):
        read_yaml(tmp_path / "a.yaml")


def test_a_missing_header_is_missing(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"there is no file .*a\.yaml"):
        read_yaml(tmp_path / "a.yaml")
