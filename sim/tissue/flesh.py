# SPDX-License-Identifier: GPL-3.0-or-later
"""Lips and cheeks have flesh between the skin and the lining of the mouth: where they are drawn thin over teeth, the lining may
not come out through the skin.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..mesh import vertex_normals
from .drawn_samples import Samples, drawn_samples
from .geometry import short_diagonals, unit

#: mm between the points; mm of flesh from which on it is looked after; mm to the lining at most.
SPACING, THICK, DEEP = 1.6, 1.5, 14.0
#: Share of its thickness at rest that flesh keeps.
KEPT = 0.3
#: tan of the angle to the normal at which the lining across is looked for, at most.
ASIDE = 0.35


@dataclass(frozen=True, eq=False)
class Flesh:
    """outer, inner : points of the skin and of the lining across from each (k); least (k,) mm that stays between them;
    triangles (t, 3) at the vertices that they depend on."""

    outer: Samples
    inner: Samples
    least: np.ndarray
    triangles: np.ndarray


def build_flesh(faces, skin, around, lining) -> Flesh:
    """Pairs of points on both faces of lips and cheeks.

    faces (m, 4), skin (n, 3) mm at rest; around (n,) bool: vertices of the mouth, free to move; lining (n,) bool: of these,
    those inside
    """
    outer, inner = (drawn_samples(faces, skin, around & side, SPACING) for side in (~lining, lining))
    if not len(outer) or not len(inner):
        return Flesh(outer[:0], inner[:0], np.zeros(0), np.zeros((0, 3), int))
    triangles = short_diagonals(skin, faces)
    normals = vertex_normals(skin, triangles)
    places, behind = outer.at(skin), inner.at(skin)
    out, back = unit(outer.at(normals)), unit(inner.at(normals))
    _, near = cKDTree(behind).query(places, k=min(24, len(behind)), distance_upper_bound=DEEP)
    found = near < len(behind)
    near = np.where(found, near, 0)
    way = places[:, None] - behind[near]
    deep = np.einsum("ikj,ij->ik", way, out)
    aside = np.sqrt(np.maximum(np.einsum("ikj,ikj->ik", way, way) - deep**2, 0))
    against = np.einsum("ikj,ij->ik", back[near], out) < -0.5
    cost = np.where(found & against & (deep > THICK) & (aside < ASIDE * deep), aside + 0.5 * deep, np.inf)
    best = cost.argmin(axis=1)
    kept = np.flatnonzero(np.isfinite(cost[np.arange(len(cost)), best]))
    best = best[kept]
    mate = near[kept, best]
    facing = unit(out[kept] - back[mate])
    least = KEPT * np.einsum("ij,ij->i", way[kept, best], facing)
    outer, inner = outer[kept], inner[mate]
    used = np.zeros(len(skin), bool)
    used[outer.rows.indices] = used[inner.rows.indices] = True
    return Flesh(outer, inner, least, triangles[used[triangles].any(axis=1)])


def flesh_contacts(flesh: Flesh, skin):
    """A piece for `planes_of`: flesh of ``skin`` (n, 3) mm that has become too thin."""
    normals = vertex_normals(skin, flesh.triangles)
    facing = unit(unit(flesh.outer.at(normals)) - unit(flesh.inner.at(normals)))
    thick = np.einsum("ij,ij->i", flesh.outer.at(skin) - flesh.inner.at(skin), facing)
    thin = np.flatnonzero(thick < flesh.least)
    both = flesh.outer.along(thin, facing[thin]), flesh.inner.along(thin, -facing[thin])
    column, value = (np.concatenate(pair, axis=1) for pair in zip(*both, strict=True))
    return column, value, flesh.least[thin]
