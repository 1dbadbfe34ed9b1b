"""How two frames or maps lie to each other, by their codes.

Each code of the second is paired with the nearest code of the first; the motion that brings it onto the
plane there is solved for, again and again, while pairs have to be ever nearer. The farthest pairs are left
out. A motion along which nothing resists, as along a corridor, cannot be found; it is refused.

Source: Y. Chen, G. Medioni, "Object modelling by registration of multiple range images", 1992 (point to
plane); D. Chetverikov et al., "The trimmed iterative closest point algorithm", 2002.
"""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lidarium.mapping.geometry.bounds import above, check_settings, share, within
from lidarium.mapping.sparse.rigid_motions import checked_poses, moved_points, turned
from lidarium.mapping.sparse.surface_codes import Codes

DIRECTIONS = (
    "turns about x",
    "turns about y",
    "turns about z",
    "shifts along x",
    "shifts along y",
    "shifts along z",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class RegistrationSettings:
    """How codes are registered.

    Attributes
    ----------
    first_distance_m, last_distance_m : float
        How far apart pairs may be at first, and in the end [m].
    kept_share : float
        Share of the pairs that is kept, the nearest ones.
    most_angle : float
        By how much the normals of a pair may differ [rad].
    steps : int
        How often pairs are sought.
    least_pairs : int
        With fewer pairs nothing is solved for.
    least_overlap : float
        Share of the second's weight that has to have a partner.
    least_resistance, least_turn_resistance : float
        What a shift, or a turn by the spread of the codes, along any direction has to change at least, as a
        share of what it changes when all planes face it.
    most_rms_m : float
        How far the pairs may be from their planes in the end, root of the mean square [m].
    """

    first_distance_m: Annotated[float, above(0.0, 100.0)] = 1.0
    last_distance_m: Annotated[float, above(0.0, 100.0)] = 0.2
    kept_share: Annotated[float, share(has_minimum=False)] = 0.85
    most_angle: Annotated[float, above(0.0, math.pi / 2.0)] = math.radians(35.0)
    steps: Annotated[int, within(1, 1000)] = 40
    least_pairs: Annotated[int, within(6, 1_000_000)] = 12
    least_overlap: Annotated[float, share()] = 0.3
    least_resistance: Annotated[float, share()] = 0.02
    least_turn_resistance: Annotated[float, share()] = 0.005
    most_rms_m: Annotated[float, above(0.0, 10.0)] = 0.1

    def __post_init__(self) -> None:
        check_settings(self, "registration")


@dataclass(frozen=True, eq=False, slots=True)
class Registration:
    """What registration found.

    Attributes
    ----------
    transform : (4, 4) float64
        Maps points of the second into the first.
    overlap : float
        Share of the second's weight that has a partner.
    rms : float
        Distance of the pairs from their planes, root of the mean square [m].
    refusal : str
        Why the transform is not to be used; empty where it is.
    """

    transform: NDArray[np.float64]
    overlap: float
    rms: float
    refusal: str = ""

    @property
    def is_accepted(self) -> bool:
        """Whether the transform is to be used."""
        return not self.refusal


def register(
    first: Codes,
    second: Codes,
    guess: NDArray[np.float64] | None = None,
    settings: RegistrationSettings | None = None,
) -> Registration:
    """Find the motion that brings the second codes onto the first.

    Parameters
    ----------
    first, second : Codes
        Codes of two frames or maps.
    guess : (4, 4) float64 or None
        Where the search begins; the identity where None.
    settings : RegistrationSettings or None
        How; the defaults where None.

    Returns
    -------
    Registration
        The motion, with a reason where it is refused.

    Raises
    ------
    ValueError
        Where the guess is no rigid motion.
    """
    settings = settings or RegistrationSettings()
    motion = np.eye(4) if guess is None else checked_poses(guess).copy()
    # Codes of no surface say nothing of where a plane is.
    first = _on_surfaces(first)
    if len(first.centres) == 0 or len(second.centres) == 0:
        return Registration(motion, 0.0, math.inf, "one of both has no codes on surfaces")
    tree = cKDTree(first.centres)
    narrowing = (settings.last_distance_m / settings.first_distance_m) ** (1.0 / max(settings.steps // 2, 1))
    reach = settings.first_distance_m
    for _ in range(settings.steps):
        pairs = _pairs(tree, first, second, motion, reach, settings)
        if len(pairs.gaps) < settings.least_pairs:
            return Registration(
                motion,
                pairs.overlap,
                math.inf,
                f"{len(pairs.gaps)} pairs; want at least {settings.least_pairs}",
            )
        step, _ = _solved(pairs)
        motion = step @ motion
        at_end = reach <= settings.last_distance_m
        if at_end and float(np.abs(step - np.eye(4)).max()) < 1e-7:
            break
        reach = max(reach * narrowing, settings.last_distance_m)
    return _judged(_pairs(tree, first, second, motion, reach, settings), motion, settings)


class _Pairs(NamedTuple):
    """Where codes of the second lie, to the planes of their partners."""

    places: NDArray[np.float64]
    normals: NDArray[np.float64]
    gaps: NDArray[np.float64]
    weights: NDArray[np.float64]
    overlap: float


def _on_surfaces(codes: Codes) -> Codes:
    has_normal = np.abs(codes.normals).max(axis=1, initial=0.0) > 0.0
    return Codes(codes.centres[has_normal], codes.normals[has_normal], codes.weights[has_normal])


def _pairs(
    tree: "cKDTree[None, None]",
    first: Codes,
    second: Codes,
    motion: NDArray[np.float64],
    reach: float,
    settings: RegistrationSettings,
) -> _Pairs:
    places = moved_points(second.centres, motion)
    found = tree.query(places, distance_upper_bound=reach)
    distances, partners = np.asarray(found[0]), np.asarray(found[1])
    own = turned(second.normals, motion)
    near = np.isfinite(distances)
    near[near] = (
        np.abs(np.einsum("ij,ij->i", own[near], first.normals[partners[near]]))
        >= math.cos(settings.most_angle)
    ) | (np.abs(own[near]).max(axis=1) == 0.0)
    overlap = float(second.weights[near].sum() / max(second.weights.sum(), 1e-12))
    places, partners, weights = places[near], partners[near], second.weights[near]
    normals = first.normals[partners]
    gaps = np.einsum("ij,ij->i", first.centres[partners] - places, normals)
    kept = np.argsort(np.abs(gaps), kind="stable")[: math.ceil(settings.kept_share * len(gaps))]
    weights = np.sqrt(weights[kept] * first.weights[partners[kept]])
    return _Pairs(places[kept], normals[kept], gaps[kept], weights / max(weights.sum(), 1e-12), overlap)


def _solved(pairs: _Pairs) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the motion that brings places onto their planes, and its matrix (6, 6)."""
    middle = pairs.weights @ pairs.places
    arms = pairs.places - middle
    size = max(math.sqrt(float(pairs.weights @ np.einsum("ij,ij->i", arms, arms))), 1e-9)
    rows = np.concatenate([np.cross(arms / size, pairs.normals), pairs.normals], axis=1)
    matrix = (rows * pairs.weights[:, None]).T @ rows
    sides = (rows * pairs.weights[:, None]).T @ pairs.gaps
    solution = np.asarray(np.linalg.lstsq(matrix, sides, rcond=1e-9)[0], np.float64)
    motion = np.eye(4)
    motion[:3, :3] = _turn(solution[:3] / size)
    motion[:3, 3] = middle + solution[3:] - motion[:3, :3] @ middle
    return motion, matrix


def _judged(pairs: _Pairs, motion: NDArray[np.float64], settings: RegistrationSettings) -> Registration:
    """Return the motion, refused where it is not to be trusted."""
    if len(pairs.gaps) < settings.least_pairs:
        refusal = f"{len(pairs.gaps)} pairs; want at least {settings.least_pairs}"
        return Registration(motion, pairs.overlap, math.inf, refusal)
    rms = math.sqrt(float(pairs.weights @ pairs.gaps**2))
    values, vectors = np.linalg.eigh(_solved(pairs)[1])
    refusal = ""
    directions = np.abs(vectors).argmax(axis=0)
    least = np.where(directions < 3, settings.least_turn_resistance, settings.least_resistance)
    weakest = int(np.argmin(values - least))
    if values[weakest] < least[weakest]:
        direction = DIRECTIONS[int(directions[weakest])]
        refusal = f"nothing holds {direction}: {values[weakest]:.2g} of resistance; want {least[weakest]:g}"
    elif pairs.overlap < settings.least_overlap:
        refusal = f"overlap is {pairs.overlap:.2f}; want at least {settings.least_overlap:g}"
    elif rms > settings.most_rms_m:
        refusal = f"pairs are {rms:.3f} m from their planes; want at most {settings.most_rms_m:g} m"
    return Registration(motion, pairs.overlap, rms, refusal)


def _turn(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation (3, 3) about a vector by its length [rad]."""
    angle = float(np.linalg.norm(vector))
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross)
