"""The frame tree of some maps, made of the pairs that were accepted."""

from collections.abc import Mapping

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.bend.hypotheses import agrees_bent
from lidarium.mapping.merging.description.described_map import DescribedMap
from lidarium.mapping.merging.frame_tree import Edge, FrameTree
from lidarium.mapping.merging.joining.merged_maps import placed
from lidarium.mapping.merging.pair import is_contradicted
from lidarium.mapping.merging.pair_result import PairResult
from lidarium.mapping.merging.settings import MergeSettings


def joined_tree(
    features: Mapping[str, DescribedMap],
    pairs: Mapping[tuple[str, str], PairResult],
    settings: MergeSettings,
    origins: Mapping[str, tuple[float, float]] | None = None,
    tree: FrameTree[str] | None = None,
) -> FrameTree[str]:
    """Join maps by what was accepted of their pairs.

    Maps that are joined through others alone must not contradict each other either: else the weakest pair
    between them is dropped.

    Parameters
    ----------
    features : mapping of str to DescribedMap
        The maps.
    pairs : mapping of (str, str) to PairResult
        What came of each two, from lower left corner to lower left corner.
    settings : MergeSettings
        What contradicts.
    origins : mapping of str to (x, y) or None
        Lower left corner of each map in its frame [m]; (0, 0) for all where None.
    tree : FrameTree or None
        Of an earlier call, whose world shall stay where it is; it is changed. A new one where None.

    Returns
    -------
    FrameTree
        The maps' frames.
    """
    tree = tree or FrameTree(settings.cycle_distance_m, settings.cycle_angle)
    for name in tree.names:
        if name not in features:
            tree.remove_map(name)
    for name in features:
        tree.add_map(name)
    frames = {name: placed((origins or {}).get(name, (0.0, 0.0))) for name in features}
    edges = []
    for (a, b), result in pairs.items():
        if result.is_accepted and result.a_from_b is not None:
            centre = frames[b].apply(result.agreement.centre)
            a_from_b = frames[a] @ result.a_from_b @ frames[b].inverse()
            edges.append(pair_edge(a, b, result, a_from_b, (float(centre[0]), float(centre[1]))))
    are_bent = any(edge.slack_m > 0.0 for edge in edges)

    def contradicts(a: str, b: str, a_from_b: Transform) -> bool:
        implied = frames[a].inverse() @ a_from_b @ frames[b]
        if not is_contradicted(features[a], features[b], implied, settings):
            return False
        return not (are_bent and agrees_bent(features[a], features[b], implied, settings.bend))

    tree.set_edges(edges, contradicts)
    return tree


def pair_edge(
    a: str, b: str, result: PairResult, a_from_b: Transform, centre: tuple[float, float]
) -> Edge[str]:
    """Return the edge of an accepted pair; bent maps may miss each other by their bend around cycles."""
    if result.found_by != "bend" or not result.ranked:
        return Edge(a, b, a_from_b, result.agreement.evidence_m, centre)
    best = result.ranked[0]
    return Edge(a, b, a_from_b, best.evidence_m, centre, 2.0 * best.bend.bend_m)
