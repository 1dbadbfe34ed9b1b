"""Paths of release 0.2 that have moved name the new one."""

import importlib

import pytest

from lidarium.moved import MOVED


@pytest.mark.parametrize("old", sorted(MOVED))
def test_a_path_that_has_moved_names_the_new_one(old):
    importlib.import_module(f"lidarium.{MOVED[old]}")
    with pytest.raises(ImportError, match=rf"moved.* to lidarium\.{MOVED[old]}\b.*internal"):
        importlib.import_module(f"lidarium.{old}")


def test_other_paths_that_are_nowhere_are_no_modules():
    with pytest.raises(ModuleNotFoundError, match=r"No module named 'lidarium\.nowhere'"):
        importlib.import_module("lidarium.nowhere")
