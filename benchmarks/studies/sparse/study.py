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
    error_table,
    failure_table,
    gpu_text,
    mean_table,
    measure_table,
    memory_table,
    node_table,
    printed_failures,
    thesis_error_table,
    thesis_failure_table,
)
from lidarium.envs.settings.cameras import CAMERAS

ERRORS_PICTURE, PATHS_PICTURE = "sparse_errors.png", "sparse_paths.png"

PAGE = """# Sparse maps

Four furnished places: two laboratories, an arena and a flat, each with furniture on legs. A robot of
0.30 m and 1.2 m stops every {spacing} m and takes {turns} frames of 320 x 240 all around, with its
camera 1 m above the floor, looking down by 26 degrees, and exact poses. *Incremental*: at most 256 codes
a frame. *Full*: 2,048 codes of a sixteenth of all pixels. *Thesis's form*: codes as points, 32 a frame
and as many frames as in the thesis, edges as cylinders, no shortcuts, and its parameters of each place.
*Grid*: an OctoMap of 5 cm by the octomap library of the same frames, projected and inflated by 0.30
m, with A* that keeps off obstacles. *Laser*: the grid of a planar laser at 0.30 m that knows every cell
of its plane.

{requests} requests a place, both ends {clear:.0f} cm clear of obstacles. A path collides if the robot's circle
reaches more than one cell of a raster of {cell:.0f} cm into an obstacle. The optimum is the shortest path of a
circle among the solids, by a graph of corners.

## Figures

{figures}

Requests that full maps leave unanswered end beside boxes that are a few centimetres too wide. Robots that map
while they drive merge free codes within 20 cm, not 25 cm, for shorter paths; then .bt has 11.3 times the bytes
in the worst place (1.80 deflated).

With the noise of an Xtion in its frames, of {requests} requests each, incremental maps of

- all points up to 4 m: {noisy_all};
- points up to {precise:.1f} m, where depths deviate by 1 cm: {noisy_precise}.

Noise and rounding of 3 cm at 4 m widen boxes, so narrow places close and starts and goals lie in boxes; far
points are therefore left out. Boxes of the maps: {boxes_all} of all points, {boxes_precise} of precise ones.

Table tops and seats: of the area that only they take up, outside the laser's plane, the inflated grid of the
laser lets a robot stand at {laser}.

## Holes, stairs and pallets

{areas} holes, {areas} stairwells and {areas} pallets of {pallet:.0f} cm are put on the floor of each place,
with sides of {low} to {high} m. {requests} requests a place have a true path, both ends {clear:.0f} cm clear.
A path leads over an area if the robot's circle reaches more than a cell of the raster into it.

{drops}

## Paths

Means on incremental maps, over the requests that both the grid and the sparse map answer; the file has standard
deviations and full maps, too. Turning and dispersion are taken at points of 5 cm along the path; in the
thesis's form at its own points, as in the thesis. The printed figures are of other places: compare ratios, not
sizes.

{means}

{measures}

![Paths over the straight distance of their ends]({paths_picture})

### Requests without a path, and paths that collide

{failures}

{printed_failures}

{thesis_failures}

## Codes and graphs

{nodes}

## Memory

Kilobytes on disk, *deflated* by zlib, and ratios, beside the thesis's printed sizes. Sparse maps are deflated in
themselves, without their graphs.

{memory}

## Quantisation

Mean distance of points to their codes [m], then median times [ms] on one core; 7 of Lloyd's steps, 10 seeds,
LBG once. {clouds} clouds: frames of a kitchen (7-Scenes), an office and table tops (Point Cloud Library),
whole places (kitchen, Open3D's living room, two laser scans of a room, OctoMap's building and stairs), and
simulated frames of the apartment.

{errors}

Tables 5.3 and 5.4 of the thesis, with other clouds and another unit of depth, so that only ratios compare;
K-means++ there labels on a GPU. {gpu}

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
        means=mean_table(lines),
        measures=in_file(measure_table(lines)),
        failures=failure_table(lines),
        printed_failures=printed_failures(),
        thesis_failures=in_file(thesis_failure_table(lines)),
        nodes=in_file(node_table(lines)),
        memory=in_file(memory_table(lines)),
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
