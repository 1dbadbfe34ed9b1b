"""Sparse maps as in the thesis's three experiments: quantisation, paths, memory."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lidarium.benchmarks.results_page import in_file
from lidarium.benchmarks.studies.shared.study import Progress, Study, kept_lines
from lidarium.benchmarks.studies.sparse import drops, paths, quantisation
from lidarium.benchmarks.studies.sparse.figures import figure_table
from lidarium.benchmarks.studies.sparse.pictures import draw_errors, draw_paths
from lidarium.benchmarks.studies.sparse.places import CELL_M, CLEAR_M, REQUESTS, SPACING_M
from lidarium.benchmarks.studies.sparse.tables import (
    MEASURES,
    error_table,
    failure_table,
    gpu_text,
    measure_table,
    memory_table,
    node_table,
    thesis_error_table,
    thesis_failure_table,
)
from lidarium.envs.settings.cameras import CAMERAS

ERRORS_PICTURE, PATHS_PICTURE = "sparse_errors.png", "sparse_paths.png"

PAGE = """# Sparse maps

Four furnished places: two laboratories, an arena and a flat, each with furniture on legs. A robot of
0.30 m and 1.2 m stops every {spacing} m and takes {turns} frames of 320 x 240 round about, with its
camera 1 m above the floor, looking down by 26 degrees, and exact poses. *Incremental*: at most 256 codes
a frame. *Full*: 2,048 codes of a sixteenth of all pixels. *Thesis's form*: codes as points, 32 a frame
and as many frames as the thesis has, edges as cylinders, no shortcuts, its parameters of each place.
*Grid*: an OctoMap of 5 cm made by the octomap library of the same frames, projected and inflated by 0.30
m, with A* that keeps off obstacles. *Laser*: the grid of a planar laser at 0.30 m that knows every cell
of its plane.

{requests} requests a place, both ends {clear:.0f} cm clear of what they could touch. A path collides
where the robot's circle reaches more than one cell of a raster of {cell:.0f} cm into what stands there.
The optimum is the shortest path of a circle among the solids themselves, by a graph of corners.

## Figures

{figures}

What limits the miss: unanswered requests in full maps end beside boxes that are a few centimetres
too wide; cutting such boxes and moving nodes into passages left these. Maps became small by two changes:
free codes merge within 25 cm, not 20, and files keep places in strips of ground, each of their columns
deflated with codes of its own. Wider merging lengthens paths. Robots that map while they drive keep 20 cm,
where .bt has 11.3 times the bytes in the worst place (1.80 deflated).

With the noise of an Xtion in its frames, of {requests} requests each, incremental maps of

- all points up to 4 m: {noisy_all};
- points up to {precise:.1f} m, where depths deviate by 1 cm: {noisy_precise}.

Boxes hold all of their points. Noise and rounding of 3 cm at 4 m widen boxes to both sides, so narrow places
close and starts and goals lie in boxes. Every place is seen from nearer as well, so far points are left out.
Boxes of the maps: {boxes_all} of all points, {boxes_precise} of precise ones.

Table tops and seats: of places that only they take up, and no laser's plane shows, the inflated grid of the
laser lets a robot stand at {laser}.

## Holes, stairs and pallets

{areas} holes, as many stairwells and pallets of {pallet:.0f} cm are put on the floor of each place, of
{low} to {high} m a side. {requests} requests a place have a path by the truth, both ends {clear:.0f} cm clear. A path
leads over an area if the robot's circle reaches more than a cell of the raster into it.

{drops}

## Paths

Means and standard deviations over the requests that both the grid and the sparse map answer. Turning and
dispersion are taken at points of 5 cm along the path; in the thesis's form at its own points, as the thesis
does. The printed figures are of other places: their relations can be compared, their sizes cannot.

{measures}

![Paths over the straight distance of their ends]({paths_picture})

### Requests without a path, and paths that collide

{failures}

{thesis_failures}

## Codes and graphs

{nodes}

## Memory

Kilobytes on disk, *deflated* by zlib. Sparse maps are deflated in themselves, without their graphs.

{memory}

## Quantisation

Mean distance of points to their codes [m], then median times [ms] on one core; 7 of Lloyd's steps, 10 seeds,
LBG once. {clouds} clouds: frames of a kitchen (7-Scenes), an office and table tops (Point Cloud Library),
whole places (kitchen, Open3D's living room, two laser scans of a room, OctoMap's building and stairs), and
simulated frames of the apartment.

{errors}

What the thesis prints in tables 5.3 and 5.4, with other clouds and another unit of depth, so that only ratios
compare; K-means++ there labels on a GPU. {gpu}

{thesis_errors}

![Errors and times over the number of codes]({errors_picture})
"""


def work(folder: Path, data: Path | None, every: int, _workers: int) -> Progress:
    """Measure every N-th place and cloud in this process, as times are taken; places of a part by fewer frames."""
    yield from paths.work(folder, every)
    yield from drops.work(folder, every)
    yield from quantisation.work(folder, data, every)


def page(folder: Path) -> str:
    """Return the results as markdown."""
    lines = kept_lines(folder / paths.PATHS_FILE)
    clouds = kept_lines(folder / quantisation.QUANTISATION_FILE)
    measures = (
        f"### {title}\n\n{measure_table(lines, name, column, digits, unit)}"
        for name, title, column, digits, unit in MEASURES
    )
    return PAGE.format(
        spacing=SPACING_M,
        turns=lines[0]["turns"],
        requests=f"{REQUESTS:,}",
        clear=100.0 * CLEAR_M,
        cell=100.0 * CELL_M,
        figures=figure_table(lines),
        noisy_all=_noisy(lines, "all"),
        noisy_precise=_noisy(lines, "precise"),
        boxes_all=_boxes(lines, "all"),
        boxes_precise=_boxes(lines, "precise"),
        precise=CAMERAS["xtion_noisy"].precise_m,
        laser=", ".join(f"{100.0 * (1.0 - line['tops']['laser']):.1f} % ({line['place']})" for line in lines),
        areas=drops.AREAS_A_KIND,
        pallet=100.0 * drops.PALLET_M,
        low=drops.SIDES_M[0],
        high=drops.SIDES_M[1],
        drops=drops.drops_table(kept_lines(folder / drops.DROPS_FILE)),
        measures="\n\n".join(measures),
        failures=failure_table(lines),
        thesis_failures=thesis_failure_table(lines),
        nodes=node_table(lines),
        memory=memory_table(lines),
        clouds=len(clouds),
        gpu=gpu_text(clouds),
        errors=in_file(error_table(clouds)),
        thesis_errors=in_file(thesis_error_table()),
        paths_picture=PATHS_PICTURE,
        errors_picture=ERRORS_PICTURE,
    )


def _noisy(lines: Sequence[Mapping[str, Any]], points: str) -> str:
    answered = [line["noisy"][points]["answered"] for line in lines]
    collide = int(np.sum([line["noisy"][points]["collide"] for line in lines]))
    return f"{', '.join(map(str, answered))} are answered, and {collide} paths collide"


def _boxes(lines: Sequence[Mapping[str, Any]], points: str) -> str:
    return ", ".join(str(line["noisy"][points]["occupied"]) for line in lines)


def pictures(folder: Path, images: Path) -> None:
    """Draw the page's pictures."""
    draw_paths(images / PATHS_PICTURE, kept_lines(folder / paths.PATHS_FILE))
    draw_errors(images / ERRORS_PICTURE, kept_lines(folder / quantisation.QUANTISATION_FILE))


STUDY = Study(page, work=work, pictures=pictures, quick=10, needs={"bench": ("octomap", "shapely")})
