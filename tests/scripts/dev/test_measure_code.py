"""Figures of the sources are counted as a reader would count them."""

import subprocess

from lidarium.scripts.dev.measure_code import public_names, sizes, sole_importers, way, words

ONE = "from lidarium.mapping.two import thing\n\ndef shown():\n    return thing()\n\ndef _hidden():\n    pass\n"
TWO = "def thing():\n    return 1\n\nclass Other:\n    pass\n"


def test_a_checkout_is_measured(tmp_path):
    for name, text in {"envs/one.py": ONE, "mapping/two.py": TWO, "tests/test_one.py": "x = 1\n"}.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    (tmp_path / "README.md").write_text("three short words")
    subprocess.run(["git", "init", "-q", str(tmp_path)], check=True)
    subprocess.run(["git", "-C", str(tmp_path), "add", "."], check=True)
    found = dict(sizes(tmp_path))
    assert found["product: files, lines"] == "2, 12"
    assert found["public names; of these imported by another module"] == "3; 1"
    assert found["modules with one importer"] == "1"
    assert words(tmp_path, are_results=False) == 3


def test_names_with_an_underscore_and_modules_of_two_importers_do_not_count():
    assert public_names(ONE) == ["shown"]
    assert sole_importers({"envs/one.py": ONE, "mapping/two.py": TWO}) == {"mapping.two": "envs.one"}
    assert not sole_importers({"envs/one.py": ONE, "envs/three.py": ONE, "mapping/two.py": TWO})


def test_the_way_of_a_call_has_the_files_of_the_checkout_alone(tmp_path):
    (tmp_path / "part.py").write_text("def passed():\n    return 1\n")
    scope = {}
    exec(compile((tmp_path / "part.py").read_text(), str(tmp_path / "part.py"), "exec"), scope)
    assert way(tmp_path, scope["passed"]) == "1, 0"
    assert way(tmp_path, lambda: None) == "0, 0"
