# SPDX-License-Identifier: GPL-3.0-or-later
"""Named regions of the reference skin as smooth weights, painted on the layout."""

import numpy as np
from scipy.sparse import coo_matrix, diags
from scipy.sparse.linalg import spsolve

from ...sim.anatomy.head import SKIN_GROUPS
from ...sim.mesh import edges
from .skin_jaw import jaw_weights
from .skin_layout import HALF, ROWS, Layout


class _Painter:
    """Weights on the vertices of a layout, addressed by grid place and ring."""

    def __init__(self, layout: Layout, vertices: np.ndarray):
        self.layout = layout
        pairs = edges(layout.faces)
        length = np.linalg.norm(vertices[pairs[:, 0]] - vertices[pairs[:, 1]], axis=1)
        weight = 1 / np.maximum(length, 0.5)
        ij = (np.r_[pairs[:, 0], pairs[:, 1]], np.r_[pairs[:, 1], pairs[:, 0]])
        self.link = coo_matrix((np.r_[weight, weight], ij), shape=(layout.count,) * 2).tocsr()
        self.plain = coo_matrix((np.ones(2 * len(pairs)), ij), shape=(layout.count,) * 2).tocsr()

    def grid(self, u0, u1, v0, v1, sides=(1, -1)) -> np.ndarray:
        """Vertices of columns u0..u1 and rows v0..v1 (inclusive) on the given sides."""
        found = [
            self.layout.grid[v, (s * u) % (2 * HALF)]
            for s in sides
            for u in range(u0, min(u1, HALF) + 1)
            for v in range(v0, min(v1, ROWS - 1) + 1)
        ]
        found = np.unique(found)
        return found[found >= 0]

    def ring(self, hole, first, last, indices=None) -> np.ndarray:
        """Vertices of rings first..last; last None goes on into the patch."""
        rings = self.layout.rings[hole]
        end = len(rings) - 1 if last is None else last
        part = rings[first : end + 1]
        size = part.shape[1]
        part = part if indices is None else part[:, np.asarray(list(indices)) % size]
        out = part.ravel()
        return np.union1d(out, self.layout.patches[hole].ravel()) if last is None and indices is None else out

    def field(self, *values) -> np.ndarray:
        """(n,) harmonic weights between fixed ones, given as (vertices, weight); later pairs win."""
        known = np.full(self.layout.count, np.nan)
        for vertices, weight in values:
            known[vertices] = weight
        fixed = np.isfinite(known)
        laplacian = (diags(np.asarray(self.link.sum(axis=1)).ravel()) - self.link).tocsr()
        out = np.where(fixed, known, 0.0)
        free = np.flatnonzero(~fixed)
        out[free] = spsolve(laplacian[free][:, free].tocsc(), -laplacian[free][:, fixed] @ known[fixed])
        return np.clip(out, 0, 1)

    def patch(self, *values, rounds=1) -> np.ndarray:
        """(n,) weights set to (vertices, weight), 0 elsewhere, then softened."""
        out = np.zeros(self.layout.count)
        for vertices, weight in values:
            out[vertices] = weight
        degree = np.asarray(self.plain.sum(axis=1)).ravel()
        for _ in range(rounds):
            out = 0.5 * out + 0.5 * (self.plain @ out) / degree
        return out


def skin_groups(layout: Layout, vertices: np.ndarray) -> dict[str, np.ndarray]:
    """Group name (`SKIN_GROUPS`) -> (n,) float32 weights 0..1, mirror-exact."""
    p = _Painter(layout, vertices)
    out = {"jaw": jaw_weights(p, vertices)}
    holes = [h + s for h in ("eye", "nostril") for s in ("_l", "_r")]
    front = [p.grid(0, 11, 4, 24), p.ring("mouth", 0, None), *(p.ring(h, 0, None) for h in holes)]
    ears = np.concatenate([p.ring("ear_l", 0, None), p.ring("ear_r", 0, None)])
    rest = [p.layout.crown.ravel(), p.grid(0, HALF, 0, 1), p.grid(0, HALF, 27, ROWS), p.grid(15, HALF, 0, ROWS), ears]
    out["face"] = p.field((np.concatenate(rest), 0), (np.concatenate(front), 1))
    inner = [p.ring("mouth", 7, None)]
    inner += [p.ring("eye" + s, 7, None) for s in ("_l", "_r")] + [p.ring("nostril" + s, 2, None) for s in ("_l", "_r")]
    out["inner"] = p.patch((np.concatenate(inner), 1), rounds=0)
    out["mouth_bag"] = p.patch((p.ring("mouth", 8, None), 1), (p.ring("mouth", 7, 7), 0.5), rounds=0)
    head = np.concatenate([p.layout.crown.ravel(), p.grid(0, HALF, 0, 24), *front, ears])
    out["neck"] = p.field(
        (p.grid(0, HALF, 0, 20), 0), (p.grid(0, 12, 0, 25), 0), (head, 0), (p.grid(0, HALF, 30, ROWS), 1)
    )
    skull = [p.layout.crown.ravel(), p.grid(0, HALF, 0, 0), p.grid(14, HALF, 0, 5), p.grid(20, HALF, 0, 17)]
    out["scalp"] = p.field(
        (p.grid(0, 12, 2, ROWS), 0), (np.concatenate(front), 0), (p.grid(0, HALF, 23, ROWS), 0), (ears, 0),
        (p.grid(13, 15, 7, ROWS), 0), (np.concatenate(skull), 1),
    )  # fmt: skip
    for side, indices in (("upper", range(20, 35)), ("lower", range(4, 19))):
        out["lip_" + side] = p.patch(
            (p.ring("mouth", 2, 2, indices), 0.35), (p.ring("mouth", 3, 7, indices), 1),
            (p.ring("mouth", 3, 7, (3, 19)), 0.5), rounds=0,
        )  # fmt: skip
    for s, sides in (("_l", (1,)), ("_r", (-1,))):
        for side, indices in (("upper", range(15, 26)), ("lower", range(3, 14))):
            out[f"lid_{side}{s}"] = p.patch(
                (p.ring("eye" + s, 1, 1, indices), 0.15), (p.ring("eye" + s, 2, 2, indices), 0.5),
                (p.ring("eye" + s, 3, 3, indices), 0.85), (p.ring("eye" + s, 4, 7, indices), 1),
                (p.ring("eye" + s, 8, 8, indices), 0.6), (p.ring("eye" + s, 2, 7, (2, 14)), 0.5), rounds=0,
            )  # fmt: skip
        out["brow" + s] = p.patch((p.grid(2, 11, 4, 4, sides), 0.9), (p.grid(3, 11, 5, 5, sides), 1), rounds=2)
        out["cheek" + s] = p.patch((p.grid(6, 12, 11, 20, sides), 1), rounds=4)
        out["ear" + s] = p.patch((p.ring("ear" + s, 1, None), 1), (p.ring("ear" + s, 0, 0), 0.25), rounds=0)
        out["nostril" + s] = p.patch((p.ring("nostril" + s, 0, None), 1), (p.grid(4, 4, 12, 15, sides), 0.8), rounds=1)
    out["nose"] = p.patch(
        (p.grid(0, 2, 7, 15), 1),
        (p.grid(0, 4, 9, 15), 1),
        (p.ring("nostril_l", 0, None), 1),
        (p.ring("nostril_r", 0, None), 1),
    )
    out["chin"] = p.patch((p.grid(0, 4, 23, 25), 1), (p.grid(0, 4, 22, 22), 0.6), rounds=2)
    out["forehead"] = p.patch((p.grid(0, 10, 1, 3), 1), rounds=2)
    groups = {}
    for name in SKIN_GROUPS:
        groups[name] = out[name]
    for name, weights in groups.items():  # exact mirror images, whatever the order of summation was
        twin = {"_l": name[:-2] + "_r", "_r": None}.get(name[-2:], name)
        if twin is None:
            continue
        one = np.clip(0.5 * (weights + groups[twin][layout.mirror]), 0, 1).astype(np.float32)
        groups[name] = one
        groups[twin] = one[layout.mirror] if twin != name else one
        if twin == name:
            groups[name] = np.maximum(one, one[layout.mirror])
    return groups
