"""Kernels of a first start are listed by a name that can be imported."""

from importlib import import_module

from lidarium.mapping.grids import map_deltas
from lidarium.scripts.dev.list_kernels import _place_of


def test_the_place_of_a_kernel_leads_back_to_it():
    for kernel in (map_deltas.note_word, map_deltas.seen_spans, map_deltas.note_changes):
        module, _, name = _place_of(kernel).partition(":")
        assert getattr(import_module(module), name) is kernel
