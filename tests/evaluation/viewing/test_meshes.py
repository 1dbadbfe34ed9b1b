"""Triangles cover what they are of, and face outwards."""

import numpy as np

from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.evaluation.viewing import meshes


def volume(mesh):
    """Volume that triangles enclose, by the theorem of Gauss."""
    a, b, c = (mesh.vertices[mesh.triangles[:, corner]].astype(np.float64) for corner in range(3))
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0


def area(mesh):
    a, b, c = (mesh.vertices[mesh.triangles[:, corner]].astype(np.float64) for corner in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()


def test_boxes_enclose_their_volume():
    boxes = np.array([[(0.0, 0.0, 0.0), (1.0, 2.0, 3.0)], [(5.0, 5.0, 5.0), (5.5, 6.0, 7.0)]])
    mesh = meshes.boxes_mesh(boxes)
    assert mesh.triangles.shape == (24, 3)
    assert np.isclose(volume(mesh), 6.0 + 1.0)


def test_no_boxes_are_no_triangles():
    mesh = meshes.boxes_mesh(np.zeros((0, 2, 3)))
    assert mesh.vertices.shape == mesh.triangles.shape == (0, 3)


def test_a_body_is_nearly_a_cylinder():
    mesh = meshes.body_mesh(0.2, 0.5)
    share = volume(mesh) / (np.pi * 0.2**2 * 0.5)
    assert 0.98 < share < 1.0
    assert mesh.vertices[:, 2].max() == 0.5


def test_a_fan_covers_what_lies_between_beams():
    angles = np.linspace(-np.pi / 2, np.pi / 2, 181)
    laser = np.array([3.0, 1.0, 0.3])
    ends = laser + 2.0 * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(181)])
    assert np.isclose(area(meshes.fan_mesh(laser, ends)), np.pi * 2.0, rtol=1e-3)


def test_a_floor_is_cut_at_a_height_and_its_furniture_keeps_its_colours():
    floor = load_floor("open_apartment")
    low, high = (meshes.floor_meshes(floor, height) for height in (0.4, 1.3))
    for found, height in ((low, 0.4), (high, 1.3)):
        assert np.isclose(max(mesh.vertices[:, 2].max() for mesh in found.values()), height)
        assert min(mesh.vertices[:, 2].min() for mesh in found.values()) >= 0.0
        assert all(area(mesh) > 0.0 for mesh in found.values())
    assert len(high) > 3


def test_a_path_is_as_many_pieces_as_it_has_steps():
    pieces = meshes.segments(np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 2.0)]), 0.5)
    assert np.array_equal(pieces, [[(0, 0, 0.5), (1, 0, 0.5)], [(1, 0, 0.5), (1, 2, 0.5)]])
    assert meshes.segments(np.zeros((1, 2)), 0.5).shape == (0, 2, 3)
