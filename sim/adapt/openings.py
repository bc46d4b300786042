# SPDX-License-Identifier: GPL-3.0-or-later
"""The rims of mouth, eyes and nostrils: what a scanner sees worst and an eye sees first.

Data beside a rim jumps to what lies behind it (eyeball, teeth, shadow), so rims do not look for data: they follow the
skin around them smoothly, hold on to the landmarks, and the lips, or closed lids, hold on to each other.
"""

import numpy as np
from scipy.sparse import coo_matrix

from ..anatomy.head import Head
from ..mesh import edges
from .closest import Surface
from .fine_fit import Anchors

TOGETHER = 3.0  # weight of a pair of rim points, against 1 for a point of data
CLOSED = 0.3  # opening of the lids against the reference's below which an eye counts as closed
LIDS = ("upper", "lower")
#: mm inside the margins of lids, and before and behind, of what lies between them, and shares of the way from either corner up
#: to which all is left: there lids and eyeball are not told apart.
WITHIN, BALL, CORNER = 0.7, 12.0, 0.25
SHUT = 1.2  # mm: lips and margins of lids this close on the reference lie on each other


def rims(reference: Head) -> np.ndarray:
    """(n,) bool: skin vertices seen from outside with a neighbour that is not (lips, lids, nostrils)."""
    inner = np.asarray(reference.groups["inner"]) > 0.5
    a, b = edges(reference.skin.faces).T
    out = np.zeros(len(inner), dtype=bool)
    out[a[~inner[a] & inner[b]]] = True
    out[b[~inner[b] & inner[a]]] = True
    return out


def _rim_of(reference: Head, rim, name):
    return np.flatnonzero(rim & (np.asarray(reference.groups[name]) > 0.5))


def lip_pairs(reference: Head, rim) -> np.ndarray:
    """(k, 2) vertices of the upper and lower lip's rim that lie on each other on the reference; none where it parts them."""
    v = reference.skin.vertices
    upper, lower = (_rim_of(reference, rim, f"lip_{x}") for x in ("upper", "lower"))
    if len(upper) == 0 or len(lower) == 0:
        return np.zeros((0, 2), dtype=int)
    gap = np.linalg.norm(v[upper][:, None] - v[lower][None], axis=2)
    pairs = np.concatenate(
        [np.stack([upper, lower[gap.argmin(axis=1)]], axis=1), np.stack([upper[gap.argmin(axis=0)], lower], axis=1)]
    )
    pairs = np.unique(pairs, axis=0)
    return pairs[np.linalg.norm(v[pairs[:, 0]] - v[pairs[:, 1]], axis=1) < SHUT]


def lip_linings(reference: Head, gap: float = 3.0) -> np.ndarray:
    """(k, 2) vertices behind the rims of upper and lower lip that face each other within ``gap`` mm."""
    v = reference.skin.vertices
    inner = np.asarray(reference.groups["inner"]) > 0.5
    upper, lower = (
        np.flatnonzero(inner & (np.asarray(reference.groups[f"lip_{x}"]) > 0.3)) for x in ("upper", "lower")
    )
    if len(upper) == 0 or len(lower) == 0:
        return np.zeros((0, 2), dtype=int)
    between = np.linalg.norm(v[upper][:, None] - v[lower][None], axis=2)
    pairs = np.stack([upper, lower[between.argmin(axis=1)]], axis=1)
    return pairs[between.min(axis=1) < gap]


def _eye_frame(en, ex, up):
    """Origin and rows (along, upward, forward) of an eye: from the inner to the outer corner; ``up`` roughly."""
    along = ex - en
    along = along / np.linalg.norm(along)
    upward = up - (up @ along) * along
    upward = upward / np.linalg.norm(upward)
    return np.stack([along, upward, np.cross(along, upward)])


def lid_margins(reference: Head, rim, given, matrix, closed=(), lines=None):
    """Where the margins of the lids belong: extra landmarks on the rims of both eyes.

    A squinting or closed eye keeps the shape of its margins, lower or higher, so each is scaled to pass the height of
    its one landmark (``ps``, ``pi``), wherever along the lid that was picked; a warp through the landmark alone would
    pinch the lid there.

    matrix (3, 3) turns the reference into the scan's place; closed: sides of closed eyes, whose margins both pass midway
    between the two; lines: side -> `LidLine` with which those rise and fall, or None.

    Returns vertices (k,), targets (k, 3), and 0..1 (k,): 1 in an eye that is half or twice as open as the reference's, or
    more unlike it, 0 in one as open.
    """
    v, rest = reference.skin.vertices, reference.landmark_positions()
    rows, targets, changes = [], [], []
    for side in ("l", "r"):
        corners = [f"en_{side}", f"ex_{side}"]
        if not all(n in given and n in rest for n in corners):
            continue
        old, new = (
            _eye_frame(p[corners[0]], p[corners[1]], up) for p, up in ((rest, np.eye(3)[2]), (given, matrix[:, 2]))
        )
        start, length = rest[corners[0]], np.linalg.norm(rest[corners[1]] - rest[corners[0]])
        goal, reach = given[corners[0]], np.linalg.norm(given[corners[1]] - given[corners[0]])
        scale = reach / length
        change = 1.0 if side in closed else unlike(rest, given, side)
        for lid, mark in (("lower", f"pi_{side}"), ("upper", f"ps_{side}")):
            margin = _rim_of(reference, rim, f"lid_{lid}_{side}")
            if mark not in given or mark not in rest or len(margin) < 3:
                continue
            local = (v[margin] - start) @ old.T
            order = np.argsort(local[:, 0], kind="stable")
            margin, local = margin[order], local[order]
            heights = local[:, 1].copy()
            at = np.mean([given[f"{x}_{side}"] for x in ("pi", "ps")], axis=0) if side in closed else given[mark]
            picked = (at - goal) @ new.T / scale
            here = [np.interp(picked[0], local[:, 0], local[:, k]) for k in (1, 2)]
            crest = local[np.abs(local[:, 1]).argmax(), 1]
            bulge = np.clip(local[:, 1] / crest, 0, 1)  # 0 at the corners, 1 where the margin is highest
            share = np.clip(here[0] / crest, 0.4, 1)
            lift = ((picked[1] - here[0]) / share, np.clip((picked[2] - here[1]) / share, -4, 4))
            local[:, 1] += bulge * lift[0]
            local[:, 2] += bulge * lift[1]
            line = (lines or {}).get(side)
            if line is not None:
                crease = (line.at(local[:, 0] / length) - goal) @ new[1] / scale
                local[:, 1] = crease + heights - _seam(reference, rim, side, start, old, local[:, 0])
            rows.append(margin)
            targets.append(goal + scale * local @ new)
            changes.append(np.full(len(margin), change))
    if not rows:
        return np.zeros(0, dtype=int), np.zeros((0, 3)), np.zeros(0)
    return np.concatenate(rows), np.concatenate(targets), np.concatenate(changes)


def between_lids(surface: Surface, reference: Head, given, matrix, margins, places) -> np.ndarray:
    """(t,) bool: the triangles of ``surface`` that lie between the margins of open lids, so on an eyeball and no skin.

    matrix (3, 3) turns the reference into the scan's place; margins (k,), places (k, 3) mm : as `lid_margins` has them
    """
    out = np.zeros(len(surface.triangles), dtype=bool)
    for side in ("l", "r"):
        lids = [np.isin(margins, np.flatnonzero(np.asarray(reference.groups[f"lid_{x}_{side}"]) > 0.5)) for x in LIDS]
        if min(on.sum() for on in lids) < 3:
            continue
        corners = given[f"en_{side}"], given[f"ex_{side}"]
        frame, scale = _eye_frame(*corners, matrix[:, 2]), np.cbrt(np.linalg.det(matrix))
        length = np.linalg.norm(corners[1] - corners[0])
        # No more of the scan is looked at than the slab between the corners: a fifteenth of a head.
        along = (surface.vertices - corners[0]) @ (frame[0] / length)
        a, b, c = surface.triangles.T
        share = (along[a] + along[b] + along[c]) / 3
        some = np.flatnonzero((share > CORNER) & (share < 1 - CORNER))
        local = (surface.vertices[surface.triangles[some]].mean(axis=1) - corners[0]) @ frame.T
        upper, lower = (_along((places[on] - corners[0]) @ frame.T, local[:, 0]) for on in lids)
        depth = local[:, 2] - (upper[1] + lower[1]) / 2
        inside = (local[:, 1] < upper[0] - WITHIN * scale) & (local[:, 1] > lower[0] + WITHIN * scale)
        out[some] |= inside & (np.abs(depth) < BALL * scale)
    return out


def _along(margin, x):
    """Height and depth (2, t) of a ``margin`` (k, 3) in the frame of its eye, at ``x`` (t,); NaN beside it."""
    order = np.argsort(margin[:, 0], kind="stable")
    return np.array([np.interp(x, margin[order, 0], margin[order, k], np.nan, np.nan) for k in (1, 2)])


def _seam(reference, rim, side, start, frame, along):
    """Height (k,) mm, ``along`` (k,) mm the eye in its ``frame``, midway between the margins of its lids."""
    height = np.zeros(len(along))
    for lid in ("upper", "lower"):
        local = (reference.skin.vertices[_rim_of(reference, rim, f"lid_{lid}_{side}")] - start) @ frame.T
        order = np.argsort(local[:, 0], kind="stable")
        height += np.interp(along, local[order, 0], local[order, 1]) / 2
    return height


def opening(positions, side: str) -> float:
    """How far an eye with the landmarks ``positions`` is open, against its length."""
    top, bottom, inner, outer = (positions[f"{x}_{side}"] for x in ("ps", "pi", "en", "ex"))
    return float(np.linalg.norm(top - bottom) / np.linalg.norm(inner - outer))


def unlike(rest, given, side: str) -> float:
    """0..1: by how many times an eye is more or less open than the reference's, ``rest``; 1 from two on."""
    if not all(f"{x}_{side}" in p for x in ("ps", "pi") for p in (rest, given)):
        return 1.0
    return float(min(1.0, abs(np.log2(max(opening(given, side), 1e-6) / opening(rest, side)))))


def closed_eyes(reference: Head, landmarks, given) -> list[str]:
    """Sides whose lids the landmarks put together: ``ps`` and ``pi`` were both given and nearly meet, if only side by side."""
    rest = reference.landmark_positions()
    out = []
    for side in ("l", "r"):
        names = [f"{x}_{side}" for x in ("ps", "pi", "en", "ex")]
        if all(n in given for n in names[:2]) and all(n in rest for n in (*names, "n", "gn")):

            def height(p, names=names):
                along, up = p[names[3]] - p[names[2]], p["n"] - p["gn"]
                up = up - (up @ along) / (along @ along) * along
                return (p[names[0]] - p[names[1]]) @ up / (np.linalg.norm(up) * np.linalg.norm(along))

            if height(landmarks) < CLOSED * height(rest):
                out.append(side)
    return out


def rim_anchors(reference: Head, rim, matrix) -> Anchors:
    """Pairs of rim points that stay together; see `offset_anchors`."""
    pairs = [lip_pairs(reference, rim), lip_linings(reference)]
    pairs += [touching_lids(reference, rim, side) for side in ("l", "r")]
    return offset_anchors(reference, np.unique(np.concatenate(pairs), axis=0), matrix, TOGETHER)


def offset_anchors(reference: Head, pairs, matrix, weight: float) -> Anchors:
    """Pairs (k, 2) of vertices that keep their offset, as rows of the last stage's system; targets are positions, so rows are
    differences.

    matrix (3, 3) turns and scales the reference's offsets into the scan's place.
    """
    v = reference.skin.vertices
    n = len(v)
    upper, lower = pairs.T
    k = len(upper)
    place = (np.tile(np.arange(k), 2), np.concatenate([upper, lower]))
    sampling = coo_matrix((np.repeat([1.0, -1.0], k), place), shape=(k, n)).tocsr()
    return Anchors(sampling, (v[upper] - v[lower]) @ matrix.T, np.full(k, weight))


def touching_lids(reference: Head, rim, side: str) -> np.ndarray:
    """(k, 2) vertices of the upper and lower lid's rim that lie on each other; none where the eye is open."""
    v = reference.skin.vertices
    upper, lower = (_rim_of(reference, rim, f"lid_{x}_{side}") for x in ("upper", "lower"))
    if len(upper) == 0 or len(lower) == 0:
        return np.zeros((0, 2), dtype=int)
    gap = np.linalg.norm(v[upper][:, None] - v[lower][None], axis=2)
    pairs = np.stack([upper, lower[gap.argmin(axis=1)]], axis=1)
    return pairs[(gap.min(axis=1) < SHUT) & (pairs[:, 0] != pairs[:, 1])]
