"""The package as a whole: light to import, layered, typed, documented."""

import ast
import importlib.util
import inspect
import json
import os
import pkgutil
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import lidarium
from lidarium.extras import install_command

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("mapping", "envs", "agents", "evaluation", "training", "benchmarks", "scripts")
SOURCES = {
    path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
    for folder in FOLDERS
    for path in sorted((ROOT / folder).rglob("*.py"))
}
HEAVY = ("matplotlib", "numba", "cv2", "scipy", "imageio", "tyro", "tqdm", "torch", "pandas")


def modules_after(code):
    """Names of the modules loaded after some code in a fresh interpreter."""
    result = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport json, sys\nprint(json.dumps(sorted(sys.modules)))"],
        capture_output=True,
        text=True,
        check=True,
    )
    return set(json.loads(result.stdout.splitlines()[-1]))


def test_importing_lidarium_loads_nothing_heavy():
    loaded = modules_after("import lidarium")
    assert not loaded & set(HEAVY)
    assert {name for name in loaded if name.startswith("lidarium.")} <= {"lidarium.registry"}


def test_stepping_an_environment_loads_no_plotting():
    loaded = modules_after("import lidarium\nenv = lidarium.parallel_env(robots=1)\nenv.reset(seed=0)")
    assert "numba" in loaded
    assert not loaded & {"matplotlib", "imageio", "tyro"}


def test_the_package_is_a_command_that_has_a_version():
    for arguments in (["-m", "lidarium", "--version"], ["-m", "lidarium_command", "--version"]):
        result = subprocess.run([sys.executable, *arguments], capture_output=True, text=True, check=True)
        assert result.stdout == f"lidarium {lidarium.__version__}\n"


def test_versions_of_pettingzoo_without_a_register_do():
    code = (
        "import pettingzoo\nif hasattr(pettingzoo, 'register'): del pettingzoo.register\n"
        "import gymnasium, lidarium\nassert 'lidarium/Exploration-v1' in gymnasium.registry"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_version_is_that_of_the_distribution():
    from importlib.metadata import version

    assert lidarium.__version__ == version("lidarium")


def test_type_hints_are_shipped():
    folder = Path(lidarium.__file__).parent
    assert (folder / "py.typed").is_file()


def test_layers_import_downwards_only():
    """The contract of .importlinter, read from the sources themselves."""
    rank = {folder: place for place, folder in enumerate(FOLDERS)}
    for path, source in SOURCES.items():
        own = rank[path.split("/")[0]]
        for node in ast.walk(ast.parse(source)):
            names = (
                [node.module or ""]
                if isinstance(node, ast.ImportFrom)
                else [a.name for a in node.names]
                if isinstance(node, ast.Import)
                else []
            )
            assert not (isinstance(node, ast.ImportFrom) and node.level), f"{path}: relative import"
            for name in names:
                parts = name.split(".")
                assert parts[0] not in FOLDERS, f"{path}: imports {name} without the package's name"
                if parts[0] == "lidarium" and len(parts) > 1 and parts[1] in rank:
                    assert rank[parts[1]] <= own, f"{path}: imports {name}"


def test_the_import_linter_keeps_its_contracts():
    """Layers point downwards, and no two rooms import each other."""
    command = shutil.which(
        "lint-imports", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    )
    if command is None:
        pytest.skip("import-linter is not installed")
    result = subprocess.run(
        [command, "--config", str(ROOT / ".importlinter"), "--no-cache"],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT / "src")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    assert "2 kept, 0 broken" in result.stdout


def test_editors_find_every_module_below_the_source_folder():
    """An editable install links the root folders below ``src/lidarium``."""
    for folder in FOLDERS:
        assert (ROOT / "src" / "lidarium" / folder).resolve() == (ROOT / folder).resolve()
    found = importlib.util.find_spec("lidarium.envs.faces.parallel")
    assert Path(found.origin) == ROOT / "src" / "lidarium" / "envs" / "faces" / "parallel.py"


def modules():
    for folder in FOLDERS:
        package = importlib.import_module(f"lidarium.{folder}")
        yield package
        for found in pkgutil.walk_packages(package.__path__, f"lidarium.{folder}."):
            yield importlib.import_module(found.name)


def test_every_public_function_and_class_is_documented():
    missing = []
    for module in modules():
        if not module.__doc__:
            missing.append(module.__name__)
        for name, member in vars(module).items():
            if name.startswith("_") or getattr(member, "__module__", None) != module.__name__:
                continue
            plain = getattr(member, "py_func", member)
            if not (inspect.isfunction(plain) or inspect.isclass(plain)):
                continue
            if not inspect.getdoc(plain):
                missing.append(f"{module.__name__}.{name}")
            if inspect.isclass(plain):
                missing += [
                    f"{module.__name__}.{name}.{attribute}"
                    for attribute, value in vars(plain).items()
                    if not attribute.startswith("_")
                    and (inspect.isfunction(value) or isinstance(value, (property, classmethod, staticmethod)))
                    and not inspect.getdoc(getattr(value, "__func__", value))
                ]
    assert not missing


def test_documented_defaults_are_those_of_the_code():
    """Entries such as ``spacing : float, default 0.25``; of several names, their common default or one each."""
    found = 0
    for module in modules():
        for owner in vars(module).values():
            if not inspect.isclass(owner) or owner.__module__ != module.__name__ or not owner.__doc__:
                continue
            for names, told in re.findall(r"^(\w[\w, ]*) : .*, default (.+)$", inspect.cleandoc(owner.__doc__), re.M):
                parameters = inspect.signature(owner).parameters
                values = [parameters[name].default for name in names.split(", ")]
                values = values[:1] if len(set(values)) == 1 else values
                shown = ", ".join(f'"{value}"' if isinstance(value, str) else repr(value) for value in values)
                assert told == shown, (owner.__name__, names)
                found += 1
    assert found > 300


def test_every_public_function_outside_of_kernels_has_type_hints():
    bare = []
    for path, source in SOURCES.items():
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.FunctionDef) and not any(
                "kernel" in ast.unparse(each) for each in node.decorator_list
            ):
                arguments = [
                    each for each in (*node.args.args, *node.args.kwonlyargs) if each.arg not in ("self", "cls")
                ]
                if not node.name.startswith("_") and (
                    node.returns is None or any(each.annotation is None for each in arguments)
                ):
                    bare.append(f"{path}: {node.name}")
    assert not bare


def test_no_file_is_longer_than_700_lines():
    assert not [path for path, source in SOURCES.items() if source.count("\n") > 700]


def test_nothing_is_left_undone_in_the_sources():
    words = re.compile(r"\b(TODO|FIXME|XXX|HACK|NotImplemented\b(?!Error))")
    assert not [path for path, source in SOURCES.items() if words.search(source)]


def test_no_module_draws_from_the_global_random_state():
    names = re.compile(
        r"np\.random\.(?!default_rng|Generator|SeedSequence|BitGenerator)\w+|^import random|^from random",
        re.MULTILINE,
    )
    assert not [path for path, source in SOURCES.items() if names.search(source)]


def test_policies_are_made_by_name_from_the_top():
    assert lidarium.policy("nearest_frontier").level == "waypoint"
    with pytest.raises(ValueError, match="did you mean 'nearest_frontier'"):
        lidarium.policy("nearest_frontir")


def test_without_stable_baselines_the_error_says_how_to_install_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "stable_baselines3.common.vec_env", None)
    monkeypatch.delitem(sys.modules, "lidarium.envs.faces.stable_baselines", raising=False)
    with pytest.raises(ImportError, match=re.escape(install_command("rl"))):
        lidarium.sb3_vec_env(1)
