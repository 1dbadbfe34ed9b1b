"""Merging of maps from the command line, and the files that it leaves."""

import json
import math

import cv2
import numpy as np
import pytest
import yaml
from drawn_maps import RESOLUTION, about_middle, apartment, blank, bowed, hall, kept, moved, room

from lidarium.mapping.files.map_files import MapImage, read_ros_map, write_ros_map
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import FREE, UNKNOWN
from lidarium.mapping.merging.frame_tree import Edge, FrameTree
from lidarium.mapping.merging.joining import Merged
from lidarium.mapping.merging.pair import PairResult
from lidarium.mapping.merging.regions.segmentation import RegionSettings
from lidarium.scripts.commands.merge import corner_of, draw_regions, write_merged
from lidarium.scripts.main import main

ORIGINS = {"west": (-3.0, 2.0, 0.5), "east": (10.0, -4.0, 0.0)}


@pytest.fixture
def maps(tmp_path):
    """Two parts of one apartment as ROS maps with origins of their own, and the true transform between
    their ROS frames."""
    truth = about_middle(2.0, apartment())
    levels = {
        "west": kept(apartment(), slice(0, 180), slice(0, 150)),
        "east": moved(kept(apartment(), slice(0, 180), slice(58, 220)), truth),
    }
    paths = [write_ros_map(tmp_path / "in", name, levels[name], ORIGINS[name], RESOLUTION) for name in levels]
    west_from_east = Transform(*ORIGINS["west"]) @ truth.inverse() @ Transform(*ORIGINS["east"]).inverse()
    return [str(path) for path in paths], west_from_east


@pytest.fixture
def elsewhere(tmp_path):
    return str(write_ros_map(tmp_path / "in", "elsewhere", room(blank(), 20, 20, 90, 130), (0.0, 0.0, 0.0), RESOLUTION))


def test_two_maps_are_joined_in_the_ros_frame_of_the_first(maps, tmp_path, capsys):
    paths, truth = maps
    assert main(["merge", *paths, "--out", str(tmp_path / "out"), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result == json.loads((tmp_path / "out" / "transforms.json").read_text())
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "map.pgm",
        "map.yaml",
        "merge.png",
        "transforms.json",
    ]
    assert result["world"] == "west"
    assert result["maps"]["west"] == {"x": 0.0, "y": 0.0, "theta": 0.0, "group": 0}
    place = Transform(*ORIGINS["east"]).apply((8.0, 8.0))
    (pair,) = result["pairs"]
    for found in (result["maps"]["east"], pair):
        distance, angle = Transform(found["x"], found["y"], found["theta"]).difference(truth, place)
        assert distance < 0.05
        assert angle < math.radians(0.5)
    assert set(pair) == {
        "a",
        "b",
        "accepted",
        "reason",
        "x",
        "y",
        "theta",
        "found_by",
        "matches",
        "inliers",
        "score",
        "overlap_m2",
        "agreeing_m",
        "contradiction_m",
        "hit_rate",
        "confidence",
        "bend_m",
        "strain",
        "scale",
        "covariance",
        "covariance_at",
        "alternatives",
        "time_ms",
    }
    assert pair["accepted"] is True
    assert pair["hit_rate"] > 0.9
    assert pair["contradiction_m"] < 0.2
    assert pair["bend_m"] < 0.03
    assert np.linalg.eigvalsh(pair["covariance"])[0] > 0.0
    best, *others = pair["alternatives"]
    assert all(best["evidence_m"] >= other["evidence_m"] for other in others)


def test_the_fused_map_lies_in_the_worlds_frame(maps, tmp_path, capsys):
    paths, _ = maps
    assert main(["merge", *paths, "--out", str(tmp_path / "out")]) == 0
    assert "joined: west, east" in capsys.readouterr().out
    fused, west = read_ros_map(tmp_path / "out" / "map.yaml"), read_ros_map(tmp_path / "in" / "west.yaml")
    assert fused.origin[2] == pytest.approx(0.5)
    # The centres of the first map's free cells are free in the fused map.
    rows, columns = np.nonzero(west.levels == 255)
    points = Transform(*west.origin).apply(np.stack([columns + 0.5, rows + 0.5], axis=1) * RESOLUTION)
    cells = np.floor(Transform(*fused.origin).inverse().apply(points) / RESOLUTION + 1e-6).astype(int)
    assert (fused.levels[cells[:, 1], cells[:, 0]] == 255).mean() > 0.97


def test_what_cannot_be_joined_is_refused_with_the_reason_of_each_pair(maps, elsewhere, tmp_path, capsys):
    (west, _), _ = maps
    assert main(["merge", west, elsewhere, "--out", str(tmp_path / "out")]) == 3
    told = capsys.readouterr().out
    assert "refused" in told
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["merge.png", "transforms.json"]
    result = json.loads((tmp_path / "out" / "transforms.json").read_text())
    assert result["maps"] == {"west": None, "elsewhere": None}
    assert result["pairs"][0]["accepted"] is False
    assert result["pairs"][0]["reason"]


def test_of_three_maps_those_that_join_are_written(maps, elsewhere, tmp_path, capsys):
    (west, east), _ = maps
    assert main(["merge", elsewhere, west, east, "--out", str(tmp_path / "out"), "--json"]) == 3
    result = json.loads(capsys.readouterr().out)
    assert result["maps"]["elsewhere"] is None
    assert result["world"] == "west"
    assert [pair["accepted"] for pair in result["pairs"]] == [False, False, True]
    assert (tmp_path / "out" / "map.yaml").exists()


def test_plain_images_need_a_resolution(tmp_path, capsys):
    for name, levels in (("one", apartment()), ("two", moved(apartment(), about_middle(1.0, apartment())))):
        cv2.imwrite(str(tmp_path / f"{name}.png"), levels[::-1])
    paths = [str(tmp_path / "one.png"), str(tmp_path / "two.png")]
    assert main(["merge", *paths, "--out", str(tmp_path / "out")]) == 2
    assert "--resolution" in capsys.readouterr().err
    assert main(["merge", *paths, "--resolution", str(RESOLUTION), "--out", str(tmp_path / "out")]) == 0


def test_colours_are_read_as_greys_and_equal_names_are_numbered(tmp_path, capsys):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        cv2.imwrite(str(tmp_path / folder / "map.png"), np.repeat(apartment()[::-1, :, None], 3, axis=2))
    paths = [str(tmp_path / folder / "map.png") for folder in "ab"]
    assert main(["merge", *paths, "--resolution", "0.05", "--json", "--out", str(tmp_path / "out")]) == 0
    assert list(json.loads(capsys.readouterr().out)["maps"]) == ["map", "map-2"]


@pytest.mark.parametrize("grey", [0, 127, 255])
def test_maps_of_one_colour_are_refused(grey, tmp_path, capsys):
    for name in "ab":
        cv2.imwrite(str(tmp_path / f"{name}.png"), np.full((30, 30), grey, np.uint8))
    assert (
        main(
            [
                "merge",
                str(tmp_path / "a.png"),
                str(tmp_path / "b.png"),
                "--resolution",
                "0.05",
                "--out",
                str(tmp_path / "out"),
            ]
        )
        == 3
    )
    assert "too few" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("key", "value", "word"),
    [
        ("resolution", 0.0, "resolution"),
        ("origin", [math.nan, 0.0, 0.0], "origin"),
        ("image", "gone.pgm", "gone.pgm"),
        ("origin", None, "origin"),
    ],
)
def test_bad_headers_are_named(maps, tmp_path, capsys, key, value, word):
    (west, east), _ = maps
    header = yaml.safe_load((tmp_path / "in" / "east.yaml").read_text())
    (tmp_path / "in" / "east.yaml").write_text(yaml.safe_dump({**header, key: value}))
    assert main(["merge", west, east, "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr()
    assert word in told.err
    assert "Traceback" not in told.err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["merge", "one.yaml"], "want two or more"),
        (["merge", "one.yaml", "two.yaml"], "no file one.yaml"),
        (["merge", "a.png", "b.png", "--resolution", "0"], "resolution is 0"),
        (["merge", "a.png", "b.png", "--resolution", "nan"], "resolution is nan"),
        (["merge", "a.yaml", "b.yaml", "--resolution", "0.1"], "--resolution is given, but ROS maps state theirs"),
    ],
)
def test_bad_arguments_are_named(arguments, word, capsys, tmp_path):
    assert main([*arguments, "--out", str(tmp_path / "out")]) == 2
    assert word in capsys.readouterr().err


def test_halves_of_one_image_come_out_exact(tmp_path, capsys):
    whole = apartment()
    cv2.imwrite(str(tmp_path / "whole.png"), whole[::-1])
    part = np.rot90(kept(whole, slice(0, 170), slice(40, 200)))
    cv2.imwrite(str(tmp_path / "part.png"), part[::-1])
    paths = [str(tmp_path / f"{name}.png") for name in ("whole", "part")]
    options = ["--resolution", "0.05", "--json", "--out", str(tmp_path / "out")]
    assert main(["merge", *paths, *options]) == 0
    found = json.loads(capsys.readouterr().out)["maps"]["part"]
    turned = np.argwhere(part == 0)[:, ::-1] + 0.5
    places = Transform(found["x"], found["y"], found["theta"]).apply(turned * 0.05) / 0.05 - 0.5
    np.testing.assert_allclose(places, np.rint(places), atol=1e-4)
    columns, rows = np.rint(places).astype(int).T
    assert (whole[rows, columns] == 0).all()


def test_a_refused_pair_is_joined_by_a_guess_or_by_force(maps, elsewhere, tmp_path, capsys):
    (west, east), truth = maps
    out = str(tmp_path / "out")
    guess = f"{truth.x + 0.4},{truth.y - 0.4},{truth.theta + 0.03}"
    assert main(["merge", west, east, "--guess", guess, "--tolerance", "strict", "--json", "--out", out]) == 0
    found = json.loads(capsys.readouterr().out)["maps"]["east"]
    place = Transform(*ORIGINS["east"]).apply((8.0, 8.0))
    distance, angle = Transform(found["x"], found["y"], found["theta"]).difference(truth, place)
    assert distance < 0.05
    assert angle < math.radians(0.5)
    assert main(["merge", west, elsewhere, "--force", "--json", "--out", out]) == 0
    (pair,) = json.loads(capsys.readouterr().out)["pairs"]
    assert pair["accepted"] is True
    assert pair["reason"].startswith("forced against: ")


def test_maps_of_unlike_scale_are_refused_with_the_scale(shared_cases, tmp_path, capsys):
    folder, out = shared_cases / "maps-of-unlike-scale", str(tmp_path / "out")
    for percent, wanted in ((3, 0.971), (10, 0.909)):
        paths = [str(folder / "first.yaml"), str(folder / f"second_{percent}.yaml")]
        assert main(["merge", *paths, "--json", "--out", out]) == 3
        (remark,) = json.loads(capsys.readouterr().out)["remarks"]
        assert float(remark.split(" times")[0].split()[-1]) == pytest.approx(wanted, abs=0.005)


def test_maps_whose_unknown_grey_nav2_calls_free_are_joined(shared_cases, tmp_path, capsys):
    paths = [str(shared_cases / "nav2-unknown-is-free" / f"{name}.yaml") for name in "ab"]
    assert main(["merge", *paths, "--json", "--out", str(tmp_path)]) == 0
    found = json.loads(capsys.readouterr().out)["maps"]["b"]
    wanted = (0.0, 10.0, -math.pi / 2.0)
    assert [found[name] for name in ("x", "y", "theta")] == pytest.approx(wanted, abs=0.005)


def test_a_symmetric_place_is_joined_and_doubtful(tmp_path, capsys):
    levels = room(room(blank(240, 240), 20, 20, 90, 190), 106, 90, 100, 50)
    levels[104:112, 100:130] = FREE
    turned = moved(levels, about_middle(0.4, levels))
    paths = [
        str(write_ros_map(tmp_path / "in", name, grid, (0.0, 0.0, 0.0), RESOLUTION))
        for name, grid in (("one", levels), ("other", turned))
    ]
    assert main(["merge", *paths, "--out", str(tmp_path / "out")]) == 4
    assert "doubtful: one and other: the place is symmetric or a map is mirrored" in capsys.readouterr().out
    (remark,) = json.loads((tmp_path / "out" / "transforms.json").read_text())["remarks"]
    assert remark.startswith("doubtful: one and other")


@pytest.mark.parametrize(
    ("guess", "word"),
    [
        ("1,2", "want X,Y,THETA"),
        ("1,2,nan", "want X,Y,THETA"),
        ("a,b,c", "want X,Y,THETA"),
        ("900,0,0", "off the map"),
    ],
)
def test_bad_guesses_are_named_before_anything_is_written(maps, tmp_path, capsys, guess, word):
    (west, east), _ = maps
    assert main(["merge", west, east, "--guess", guess, "--out", str(tmp_path / "out")]) == 2
    assert word in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_guess_and_force_are_of_two_maps(maps, elsewhere, tmp_path, capsys):
    (west, east), _ = maps
    for option in (["--guess", "0,0,0"], ["--force"]):
        assert main(["merge", west, east, elsewhere, *option, "--out", str(tmp_path / "out")]) == 2
        assert "two maps" in capsys.readouterr().err


def test_bent_maps_join_with_a_tolerance_alone(tmp_path, capsys):
    write_ros_map(tmp_path, "straight", hall(), (0.0, 0.0, 0.0), RESOLUTION)
    write_ros_map(tmp_path, "bent", bowed(hall(), 0.35, RESOLUTION), (0.0, 0.0, 0.0), RESOLUTION)
    paths = [str(tmp_path / f"{name}.yaml") for name in ("straight", "bent")]
    for tolerance, code in (("strict", 3), ("normal", 0), ("drift", 0)):
        options = ["--tolerance", tolerance, "--json", "--out", str(tmp_path / tolerance)]
        assert main(["merge", *paths, *options]) == code
        (pair,) = json.loads(capsys.readouterr().out)["pairs"]
    assert pair["found_by"] == "bend"
    assert pair["bend_m"] > 0.05
    assert pair["confidence"] > 0.8


@pytest.mark.parametrize("structure", ["corners", "regions", "all"])
def test_maps_are_joined_by_each_structure(structure, maps, tmp_path, capsys):
    paths, _ = maps
    options = ["--structure", structure, "--json", "--out", str(tmp_path / "out")]
    assert main(["merge", *paths, *options]) == 0
    (pair,) = json.loads(capsys.readouterr().out)["pairs"]
    assert (pair["matches"] > 0) == (structure != "regions")
    assert (
        pair["found_by"]
        in {
            "corners": {"corners", "correlation"},
            "regions": {"regions", "correlation"},
            "all": {"corners", "regions", "correlation"},
        }[structure]
    )


def test_regions_are_drawn_where_asked(maps, tmp_path, capsys):
    paths, _ = maps
    assert main(["merge", *paths, "--out", str(tmp_path / "plain")]) == 0
    assert not (tmp_path / "plain" / "regions.png").exists()
    capsys.readouterr()
    assert main(["merge", *paths, "--regions", "--out", str(tmp_path / "out")]) == 0
    assert "merge.png, regions.png" in capsys.readouterr().out
    assert (tmp_path / "out" / "regions.png").stat().st_size > 10_000


def test_unknown_structures_are_named(maps, tmp_path, capsys):
    paths, _ = maps
    assert main(["merge", *paths, "--structure", "rooms", "--out", str(tmp_path / "out")]) == 2
    assert "structure" in capsys.readouterr().err


def test_unknown_modes_are_named(maps, tmp_path, capsys):
    (west, east), _ = maps
    assert main(["merge", west, east, "--mode", "printed", "--out", str(tmp_path / "out")]) == 2
    assert "mode" in capsys.readouterr().err


def test_maps_are_bent_to_agree_only_where_asked(tmp_path, capsys):
    levels = {"straight": hall(), "bowed": bowed(hall(), 0.35)}
    paths = [str(write_ros_map(tmp_path / "in", name, levels[name], (0.0, 0.0, 0.0), RESOLUTION)) for name in levels]
    walls, pictures = {}, set()
    for name, options in (("rigid", []), ("bent", ["--deform"])):
        out = tmp_path / name
        assert main(["merge", *paths, "--out", str(out), *options, "--json"]) == 0
        result = json.loads(capsys.readouterr().out)
        bowed_map = result["maps"]["bowed"]
        assert ("deformation" in bowed_map) == bool(options)
        walls[name] = int((read_ros_map(out / "map.yaml").levels == 0).sum())
        pictures.add((out / "merge.png").read_bytes())
    assert len(pictures) == 2
    assert result["maps"]["straight"]["deformation"] is None
    found = bowed_map["deformation"]
    assert set(found) == {"mean_m", "most_m", "strain", "agreeing_m", "contradiction_m"}
    assert found["contradiction_m"] < 1.0
    assert found["agreeing_m"] > 30.0
    assert 0.05 < found["mean_m"] < found["most_m"] < 0.6
    # Walls that lie on each other are fewer cells than walls beside each other.
    assert walls["bent"] < 0.9 * walls["rigid"]


def scaled_maps(folder):
    """Return the paths of a map and of a plan drawn 1.25 times as small, and where the plan's frame lies."""
    truth = about_middle(0.6, hall(), (480, 480))
    plan = moved(hall(), truth, (480, 480))
    origin = (2.0, -1.0, 0.3)
    paths = [
        write_ros_map(folder, "seen", hall(), (0.0, 0.0, 0.0), RESOLUTION),
        write_ros_map(folder, "plan", plan, tuple(np.array(origin) / (1.25, 1.25, 1.0)), RESOLUTION / 1.25),
    ]
    return [str(path) for path in paths], truth.inverse() @ Transform(*origin).inverse()


@pytest.mark.parametrize("scale", ["auto", "1.25"])
def test_a_plan_of_another_scale_is_joined(scale, tmp_path, capsys):
    paths, truth = scaled_maps(tmp_path / "in")
    assert main(["merge", *paths, "--out", str(tmp_path / "out"), "--scale", scale]) == 0
    found = json.loads((tmp_path / "out" / "transforms.json").read_text())["maps"]["plan"]
    assert f"plan grown {found['scale']:.3f} times" in capsys.readouterr().out
    assert found["scale"] == pytest.approx(1.25, rel=0.01)
    place = truth.inverse().apply((8.0, 5.0))
    # A point p of the plan lies at scale * R p + t.
    there = Transform(found["x"], found["y"], found["theta"]).apply(np.array(place) / 1.25 * found["scale"])
    assert math.dist(there, (8.0, 5.0)) < 0.15


@pytest.mark.parametrize("scale", ["0", "-1", "nan", "much", "1e9"])
def test_a_scale_that_is_none_is_refused(scale, maps, tmp_path, capsys):
    paths, _ = maps
    assert main(["merge", *paths, "--out", str(tmp_path / "out"), f"--scale={scale}"]) == 2
    told = " ".join(capsys.readouterr().err.replace("│", " ").split())
    assert "want fixed, auto, or a number from 0.01 to 100" in told
    assert not (tmp_path / "out").exists()


def test_a_scale_is_of_two_maps_and_is_sought_without_a_guess(maps, elsewhere, tmp_path, capsys):
    paths, _ = maps
    assert main(["merge", *paths, elsewhere, "--out", str(tmp_path / "out"), "--scale", "auto"]) == 2
    assert "a scale is of two maps; 3 are given" in capsys.readouterr().err
    guess = ["--guess", "0,0,0"]
    assert main(["merge", *paths, "--out", str(tmp_path / "out"), "--scale", "auto", *guess]) == 2
    assert "without --guess" in capsys.readouterr().err


ORIGIN = (-3.0, 2.0, math.pi / 2)
SHIFT = Transform(-1.5, -0.5)


def two_rooms():
    return room(room(blank(), 20, 20, 40, 60), 70, 20, 50, 90)


@pytest.fixture
def merged():
    """Two maps of one place, one of them shifted, and a third that joins none."""
    levels = {"west": two_rooms(), "east": moved(two_rooms(), SHIFT.inverse()), "other": two_rooms()}
    tree = FrameTree()
    for name in levels:
        tree.add_map(name)
    tree.add_edge(Edge("west", "east", SHIFT, 10.0))
    found = PairResult(True, "accepted", SHIFT)
    return Merged(levels, RESOLUTION, {("west", "east"): found}, tree)


def images_of(merged):
    origins = {"west": ORIGIN, "east": (10.0, -4.0, 0.0), "other": (0.0, 0.0, 0.0)}
    return {name: MapImage(merged.levels[name], origin, RESOLUTION) for name, origin in origins.items()}


def test_a_corner_is_where_the_map_has_its_origin(merged):
    corner = corner_of(images_of(merged)["west"])
    assert corner.apply([0.0, 0.0]) == pytest.approx([-3.0, 2.0])
    assert corner.apply([1.0, 0.0]) == pytest.approx([-3.0, 3.0])


def test_a_group_of_maps_becomes_one_in_the_frame_of_its_first(merged, tmp_path):
    result = {"world": "west"}
    files = write_merged(merged, [], images_of(merged), result, tmp_path)
    assert files == ["map.yaml", "map.pgm", "transforms.json", "merge.png"]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(files)
    assert json.loads((tmp_path / "transforms.json").read_text()) == result
    assert cv2.imread(str(tmp_path / "merge.png")).shape[2] == 3
    fused, written = merged.fused(["west", "east"]), read_ros_map(tmp_path / "map.yaml")
    assert written.resolution == pytest.approx(RESOLUTION)
    assert np.count_nonzero(written.levels == FREE) == np.count_nonzero(fused.levels == FREE)
    # The lower left corner of what is known, in the turned frame of the first map.
    x, y = fused.origin
    assert written.origin == pytest.approx((-3.0 - y, 2.0 + x, math.pi / 2))
    known = np.argwhere(merged.levels["west"] != UNKNOWN).min(axis=0)[::-1] * RESOLUTION
    assert fused.origin == pytest.approx(tuple(known), abs=1e-6)


def test_each_further_group_has_a_number(merged, tmp_path):
    merged.levels["more"] = merged.levels["other"]
    merged.tree.add_map("more")
    merged.tree.add_edge(Edge("other", "more", Transform(), 5.0))
    images = {**images_of(merged), "more": images_of(merged)["other"]}
    files = write_merged(merged, [], images, {}, tmp_path)
    assert files[:4] == ["map.yaml", "map.pgm", "map-2.yaml", "map-2.pgm"]
    assert all((tmp_path / name).is_file() for name in files)


def test_bent_maps_are_written_where_there_are_any(merged, tmp_path):
    bent = merged.deformed(["west", "east"])
    write_merged(merged, [bent], images_of(merged), {}, tmp_path)
    written = read_ros_map(tmp_path / "map.yaml")
    assert written.levels.shape == bent.fused.levels.shape


def test_regions_are_drawn_of_each_map(merged, tmp_path):
    assert draw_regions(merged, images_of(merged), RegionSettings(), tmp_path) == "regions.png"
    picture = cv2.imread(str(tmp_path / "regions.png"))
    assert picture.std() > 5.0
    # Panels for three maps beside each other.
    assert picture.shape[1] > 2 * picture.shape[0]


@pytest.mark.parametrize("option", [["--tolerance", "normal"], ["--structure", "all"]])
def test_options_that_the_thesis_has_not_are_refused(maps, tmp_path, option, capsys):
    paths, _ = maps
    assert main(["merge", *paths, "--mode", "thesis", *option, "--out", str(tmp_path / "out")]) == 2
    assert f"{option[0]} is set and the mode thesis; want --mode default" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_covariance_is_in_the_frame_of_the_first_map(maps, tmp_path, capsys):
    paths, _ = maps
    found = []
    for yaw in (0.0, math.pi / 2):
        header = yaml.safe_load((tmp_path / "in" / "west.yaml").read_text())
        (tmp_path / "in" / "west.yaml").write_text(yaml.safe_dump({**header, "origin": [0.0, 0.0, yaw]}))
        assert main(["merge", *paths, "--out", str(tmp_path / "out"), "--json"]) == 0
        found.append(json.loads(capsys.readouterr().out)["pairs"][0])
    (x, y), (xx, xy, _), (_, yy, _) = found[0]["covariance_at"], *found[0]["covariance"][:2]
    np.testing.assert_allclose(found[1]["covariance_at"], [-y, x], atol=2e-3)
    (turned_xx, turned_xy, _), (_, turned_yy, _) = found[1]["covariance"][:2]
    np.testing.assert_allclose([turned_xx, turned_yy, turned_xy], [yy, xx, -xy], rtol=0.01, atol=1e-8)


def test_more_maps_than_can_be_fused_are_refused_at_once(capsys):
    assert main(["merge", *(f"map-{k}.yaml" for k in range(65))]) == 2
    assert "65 maps are given; want at most 64: merge them in parts" in capsys.readouterr().err
