# SPDX-License-Identifier: GPL-3.0-or-later
"""The edges of parted lips on a scan, looked for between the landmarks of the lips' red.

Between parted lips a scan has teeth, set back and with edges all round, or nothing; between closed ones a crease, and at
most a crack of missing data.
"""

import numpy as np
from scipy.ndimage import binary_erosion, distance_transform_edt, label
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..adapt.closest import Surface

MARKS = ("ls", "li", "ch_l", "ch_r")
STEPS, DEEP = 60, 25.0  # places looked at from lip to lip; mm looked in front and behind
STEP = 2.0  # mm: a step in depth this large from one place to the next is an edge
EATEN = 1.0  # mm by which a scanner loses an edge beside nothing
SPECK = 1.2  # mm: a hole no longer than this, with data as deep on both sides, is none
LIP = 8.0  # mm: what lies deeper than this behind the line from lip to lip is no lip
#: Height of a mouth from lip to lip against its width up to which lines begin and end on the straight ways from the lips'
#: middles to the corners, and from which on they do on an ellipse: of a round mouth those ways run within the gap.
OVAL, ROUND = 0.6, 0.9
ROUGH = 1.0  # mm by which an edge usually strays from a smooth line
FEWEST = 10  # edges that make a lip
#: Sides of the scan's triangles: how far beside a gap it is asked how deep it lies, and how near the scan must be; of how many
#: places.
BRIDGED, ABOUT = 1.0, 6
FLAKE = 0.7  # share of an island's outline where there is skin behind it from which on it hangs before that
MIDDLE = 0.3  # shares of the way to the corner up to here tell how wide the mouth is open


def lip_edges(target: Surface, given, forward, shares, arched: bool = False):
    """Edges of the upper and the lower lip (k, 2, 3) mm, NaN where there are none.

    Parameters
    ----------
    given : landmarks, name -> (3,) mm; without all of `MARKS` nothing is found
    forward : (3,) unit vector, out of the face
    shares : (k,) where to look: share of the way from the middle of the mouth to its left corner (to its right: below 0)
    arched : look along an ellipse, whatever the height of the mouth
    """
    shares = np.asarray(shares, dtype=float)
    out = np.full((len(shares), 2, 3), np.nan)
    if any(name not in given for name in MARKS):
        return out
    lines, depth = profiles(target, given, forward, shares, arched)
    depth = without_islands(depth, lips_only=True)
    for k, (line, behind) in enumerate(zip(lines, depth, strict=True)):
        length = np.linalg.norm(line[-1] - line[0])
        found = first_and_last_edge(behind, int(SPECK / length * STEPS))
        if found is None or any(behind[at] > LIP for at, _ in found):
            continue
        for side, (at, hole) in enumerate(found):
            way = (line[-1] - line[0]) / length * (1 if side == 0 else -1)
            out[k, side] = line[at] - behind[at] * forward + EATEN * hole * way
    return out


def profiles(target: Surface, given, forward, shares, arched: bool = False):
    """Lines (k, STEPS, 3) mm from the upper lip to the lower one at ``shares`` (k,), and how deep (k, STEPS) mm the scan lies
    behind them, see `lip_edges`."""
    aside = np.abs(shares)[:, None]
    corner = np.where(shares[:, None] > 0, given["ch_l"], given["ch_r"])
    middle, width = (given["ch_l"] + given["ch_r"]) / 2, np.linalg.norm(given["ch_l"] - given["ch_r"])
    round_ = float(arched) or np.clip((np.linalg.norm(given["ls"] - given["li"]) / width - OVAL) / (ROUND - OVAL), 0, 1)
    over = (1 - round_) * (1 - aside) + round_ * np.sqrt(np.clip(1 - aside**2, 0, None))
    upper, lower = (middle + aside * (corner - middle) + over * (given[name] - middle) for name in ("ls", "li"))
    lines = upper[:, None] + np.linspace(0, 1, STEPS)[:, None] * (lower - upper)[:, None]
    return lines, bridged_depths(target, lines.reshape(-1, 3), forward).reshape(len(shares), STEPS)


def without_islands(depth, lips_only: bool = False) -> np.ndarray:
    """Depths (c, r) mm, NaN where there is nothing, without what hardly any skin joins to the edge of what was looked at:
    teeth, which have edges all round. They may lie before the way from lip to lip, and touch a lip.

    lips_only : skin joins only to where the columns begin and end, as they are cut off beside the middle of the mouth
    """
    there = np.isfinite(depth)
    if there.all():
        return depth
    core = binary_erosion(there, np.ones((3, 3)), border_value=True)
    number = np.arange(depth.size).reshape(depth.shape)
    sides = []
    for one, other in ((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:])):
        joined = core[one] & core[other] & (np.abs(depth[one] - depth[other]) <= STEP)
        sides.append(np.stack([number[one][joined], number[other][joined]]))
    a, b = np.concatenate(sides, axis=1)
    part = connected_components(coo_matrix((np.ones(len(a)), (a, b)), shape=(depth.size,) * 2))[1].reshape(depth.shape)
    edge = np.zeros(depth.shape, dtype=bool)
    edge[:, [0, -1]] = True
    if not lips_only:
        edge[[0, -1]] = True
    skin = core & np.isin(part, part[edge & core])
    near = distance_transform_edt(~core, return_distances=False, return_indices=True)
    joined = there & skin[tuple(near)]
    return np.where(joined | in_front(depth, joined), depth, np.nan)


def in_front(depth, skin) -> np.ndarray:
    """(c, r) bool, islands that hang before the ``skin`` (c, r) bool of a map of depths (c, r) mm: strays and flakes."""
    # With a margin, so that nothing rolls over from the other side.
    depth, skin = np.pad(depth, 1, constant_values=np.nan), np.pad(skin, 1)
    islands, count = label(np.isfinite(depth) & ~skin)
    sides, before = np.zeros((2, count + 1))
    for axis in (0, 1):
        for way in (1, -1):
            over, beside, deep = (np.roll(x, way, axis) for x in (islands, skin, depth))
            rim = (islands > 0) & (over != islands)
            sides += np.bincount(islands[rim], minlength=count + 1)
            before += np.bincount(islands[rim & beside & (deep > depth)], minlength=count + 1)
    return ((islands > 0) & (before > FLAKE * sides)[islands])[1:-1, 1:-1]


def smoothed(edges, shares, at) -> np.ndarray:
    """The edges (k, 2, 3) mm found at ``shares`` (k,) as a smooth curve along each lip: places (m, 2, 3) ``at`` (m,).

    A cubic, by least squares that leave strays out of account ever more strictly (Cauchy's weights). NaN where too few
    were found.
    """
    there = np.isfinite(edges).all(axis=(1, 2))
    out = np.full((len(at), 2, 3), np.nan)
    if there.sum() < FEWEST:
        return out
    basis, wanted = (np.stack([x**power for power in range(4)], axis=1) for x in (shares[there], at))
    for lip in range(2):
        weight = np.ones(there.sum())
        for rough in ROUGH * np.array([5, 5, 4, 4, 3, 3, 2, 2, 1, 1, 1, 1]):
            rooted = np.sqrt(weight)[:, None]
            found = np.linalg.lstsq(rooted * basis, rooted * edges[there, lip], rcond=None)[0]
            off = np.linalg.norm(edges[there, lip] - basis @ found, axis=1)
            weight = 1 / (1 + (off / rough) ** 2) ** 2
        out[:, lip] = wanted @ found
    inside = (at > shares[there].min() - 0.1) & (at < shares[there].max() + 0.1)
    out[~inside] = np.nan
    return out


def opening(edges, shares) -> float:
    """mm between the lips in the middle of the mouth, of ``edges`` (k, 2, 3) at ``shares`` (k,); 0 where none are."""
    apart = np.linalg.norm(edges[:, 0] - edges[:, 1], axis=1)[np.abs(shares) < MIDDLE]
    return float(np.median(np.nan_to_num(apart))) if len(apart) else 0.0


def depths(target: Surface, points, forward, deep: float = DEEP) -> np.ndarray:
    """(k,) mm by which the scan's outermost surface lies behind each of the ``points`` (k, 3); NaN: there is none that lies
    less than ``deep`` mm off."""
    line, along, _, _ = target.crossings(points, np.tile(forward, (len(points), 1)), deep)
    out = np.full(len(points), np.nan)
    order = np.argsort(along, kind="stable")
    out[line[order]] = -along[order]  # the last one written lies farthest out
    return out


def bridged_depths(target: Surface, points, forward, deep: float = DEEP) -> np.ndarray:
    """(k,) as `depths`, but where the scan lacks single triangles, and so nothing or the inside of the mouth is seen, it is as
    deep as beside them."""
    out = depths(target, points, forward, deep)
    there = np.isfinite(out)
    if not target.gap_vertex.any() or not there.any():
        return out
    reach = BRIDGED * target.edge_length
    along = points @ forward
    across = points - along[:, None] * forward
    _, near = cKDTree(across[there]).query(across, min(ABOUT, there.sum()), distance_upper_bound=reach)
    level = np.append((along - out)[there], -np.inf)[near].reshape(len(points), -1).max(axis=1)  # outermost beside
    lost = np.flatnonzero(np.isfinite(level) & (~there | (along - out < level - STEP)))
    found = target.closest(across[lost] + level[lost, None] * forward, reach)
    on = found.found & ~found.border & target.gap_vertex[target.triangles[found.triangle]].any(axis=1)
    out[lost[on]] = along[lost[on]] - found.points[on] @ forward
    return out


def first_and_last_edge(depth: np.ndarray, speck: int):
    """On a line from lip to lip: ((place, beside nothing), ...) where the upper lip ends and where the lower begins.

    depth (k,) mm, NaN where there is nothing; speck : holes this long may be chance. None: the scan runs from lip to lip
    without an edge.
    """
    there = np.flatnonzero(np.isfinite(depth))
    if len(there) < 2:
        return None
    step = np.abs(np.diff(depth[there])) > STEP
    hole = np.diff(there) - 1 > np.where(step, 0, speck)
    edge = np.flatnonzero(hole | step)
    if len(edge) == 0:
        return None
    first, last = edge[0], edge[-1]
    return (there[first], bool(hole[first])), (there[last + 1], bool(hole[last]))
