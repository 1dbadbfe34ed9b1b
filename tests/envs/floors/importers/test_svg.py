import math

import pytest

from lidarium.envs.floors.importers import load_file, takes_resolution

ROOM = '<rect x="0" y="0" width="600" height="400" fill="none" stroke="black" stroke-width="10"/>'


def written(tmp_path, inside, head='xmlns="http://www.w3.org/2000/svg" viewBox="0 0 600 400"'):
    (tmp_path / "plan.svg").write_text(f"<svg {head}>{inside}</svg>")
    return tmp_path / "plan.svg"


def free_area(tmp_path, inside, resolution=0.01):
    """Return the free area of a plan [m2]."""
    floor = load_file(written(tmp_path, inside), resolution)
    return float((floor.raster(0.025, 0.2, 0.2).solid == 0).sum()) * 0.025**2


def test_a_room_is_as_large_as_it_is_drawn(tmp_path):
    floor = load_file(written(tmp_path, ROOM), 0.01)
    assert floor.name == "plan"
    assert floor.bounds == pytest.approx((0.05, -3.95, 5.95, -0.05), abs=0.026)
    assert free_area(tmp_path, ROOM) == pytest.approx(5.9 * 3.9, rel=0.01)


def test_a_thin_line_lets_nothing_through(tmp_path):
    wall = '<path d="M300 0V400" stroke="black" stroke-width="0.1" fill="none"/>'
    assert free_area(tmp_path, ROOM + wall) == pytest.approx(2.92 * 3.9, rel=0.02)


@pytest.mark.parametrize(
    ("shape", "area"),
    [
        ('<circle cx="300" cy="200" r="100"/>', math.pi),
        ('<ellipse cx="300" cy="200" rx="100" ry="50" style="fill:#222"/>', math.pi / 2),
        ('<polygon points="100,100 300,100 300,300" fill="rgb(10%, 20%, 10%)"/>', 2.0),
        ('<path d="M200 200a100,100 0 01200 0z"/>', math.pi / 2),
        ('<path d="M100 100h100v100h-100z m20 20v60h60v-60z" fill="navy"/>', 0.64 + 0.36),
        ('<rect x="100" y="100" width="100" height="100" fill="#eee"/>', 0.0),
        ('<rect x="100" y="100" width="100" height="100" fill="none"/>', 0.0),
        ('<rect x="100" y="100" width="100" height="100" display="none"/>', 0.0),
        ('<defs><rect x="100" y="100" width="100" height="100"/></defs><text>door</text>', 0.0),
        ('<g transform="translate(200 100) scale(2)" fill="black"><rect width="50" height="50"/></g>', 1.0),
        ('<g fill="white"><rect x="100" y="100" width="100" height="100" fill="inherit"/></g>', 0.0),
        (
            '<style>.a{fill:none} .b, .c{fill:#000}</style><rect class="a c" x="9" y="9" '
            'width="100" height="100"/>',
            1.0,
        ),
        (
            '<rect x="100" y="100" width="100" height="100"/><rect x="90" y="90" width="120" '
            'height="120" fill="white"/>',
            0.0,
        ),
    ],
)
def test_what_is_dark_is_solid(tmp_path, shape, area):
    # Where a ring encloses something, what it encloses is no part of the largest area.
    assert free_area(tmp_path, ROOM + shape) == pytest.approx(5.9 * 3.9 - area, abs=0.06)


def test_a_drawing_needs_a_resolution(tmp_path):
    assert takes_resolution(written(tmp_path, ROOM))
    with pytest.raises(ValueError, match=r"does not say how large it is; give --resolution"):
        load_file(tmp_path / "plan.svg")


@pytest.mark.parametrize(
    ("inside", "message"),
    [
        ("", r"no dark lines or areas"),
        ('<rect width="5" height="5" fill="white"/>', r"no dark lines or areas"),
        (ROOM + '<path d="M0 0C1 2"/>', r"a path has 'C' with 2 numbers; want 6"),
        ("<g>" * 80 + "</g>" * 80, r"nested more than 64 deep"),
        ("<g>", r"is not XML"),
        (ROOM + '<path d="M0 0L1e300 1e300" stroke="black"/>', r"plan.svg"),
    ],
)
def test_what_is_no_plan_is_refused(tmp_path, inside, message):
    with pytest.raises(ValueError, match=message):
        load_file(written(tmp_path, inside), 0.01)


def test_a_plan_that_is_too_large_says_what_to_do(tmp_path):
    with pytest.raises(ValueError, match=r"plan.svg"):
        load_file(written(tmp_path, ROOM), 100.0)
    (tmp_path / "other.svg").write_text("<html/>")
    with pytest.raises(ValueError, match=r"begins with 'html'; want an svg element"):
        load_file(tmp_path / "other.svg", 0.01)
