# SPDX-License-Identifier: GPL-3.0-or-later
"""The 60 landmarks on the reference skin, by their definitions (Farkas 1994) or by place."""

import numpy as np

from ...sim.anatomy.head import SurfacePoints
from ...sim.anatomy.landmark_names import SKIN
from .skin_layout import Layout

#: Landmarks that are vertices of the layout: grid (u, v) or (hole, ring, index), left side.
PLACES = {
    "g": (0, 5),
    "n": (0, 6),
    "sn": (0, 15),
    "ls": ("mouth", 3, 27),
    "li": ("mouth", 3, 11),
    "sto": ("mouth", 6, 27),
    "en": ("eye_l", 5, 2),
    "ex": ("eye_l", 5, 14),
    "ps": ("eye_l", 5, 20),
    "pi": ("eye_l", 5, 8),
    "ch": ("mouth", 3, 19),
    "al": (4, 14),
}


def _nearest(point, a, b, c):
    """Index and barycentric weights of the triangle (k, 3) x 3 nearest to a point (Ericson 2005, 5.1.5, vectorised)."""
    ab, ac, ap = b - a, c - a, point - a
    d00, d01, d11 = (np.einsum("ij,ij->i", x, y) for x, y in ((ab, ab), (ab, ac), (ac, ac)))
    d20, d21 = np.einsum("ij,ij->i", ap, ab), np.einsum("ij,ij->i", ap, ac)
    det = np.maximum(d00 * d11 - d01 * d01, 1e-12)
    v, w = (d11 * d20 - d01 * d21) / det, (d00 * d21 - d01 * d20) / det
    options = [np.stack([1 - v - w, v, w], 1)]
    zero = np.zeros(len(a))
    for i, j, p, q in ((0, 1, a, b), (1, 2, b, c), (2, 0, c, a)):
        edge = q - p
        along = np.clip(np.einsum("ij,ij->i", point - p, edge) / np.maximum((edge**2).sum(1), 1e-12), 0, 1)
        weights = np.stack([zero, zero, zero], 1)
        weights[:, i], weights[:, j] = 1 - along, along
        options.append(weights)
    best, chosen = np.inf, None
    for k, weights in enumerate(options):
        foot = weights[:, :1] * a + weights[:, 1:2] * b + weights[:, 2:] * c
        distance = ((foot - point) ** 2).sum(1)
        if k == 0:
            distance = np.where((weights >= 0).all(1), distance, np.inf)
        at = int(distance.argmin())
        if distance[at] < best - 1e-12:
            best, chosen = distance[at], (at, weights[at])
    return chosen


class _Finder:
    def __init__(self, layout: Layout, vertices: np.ndarray, triangles: np.ndarray, inner: np.ndarray):
        self.layout, self.vertices = layout, vertices
        left = (layout.mirror[triangles] >= triangles).all(axis=1) & ~(inner[triangles] > 0.5).any(axis=1)
        self.left = triangles[left]
        self.all = triangles
        grid = layout.grid
        self.front, self.back = grid[:, 0], grid[:, grid.shape[1] // 2]

    def vertex(self, v):
        row = self.all[(self.all == v).any(axis=1)][0]
        k = int(np.flatnonzero(row == v)[0])
        return np.roll(row, -k), np.array([1.0, 0.0, 0.0])

    def near(self, point):
        a, b, c = (self.vertices[self.left[:, k]] for k in range(3))
        at, weights = _nearest(np.asarray(point, float), a, b, c)
        return self.left[at], weights

    def place(self, place):
        if isinstance(place[0], str):
            hole, ring, index = place
            return self.vertex(self.layout.rings[hole][ring, index])
        u, v = place
        return self.vertex(self.layout.grid[v, u])

    def between(self, first, second, share):
        """The point of an edge, ``share`` of the way from one grid place to the next."""
        return self.on_edge(*(self.layout.grid[v, u] for u, v in (first, second)), share)

    def on_edge(self, a, b, share):
        """The same between two vertices."""
        row = self.all[(self.all == a).any(axis=1) & (self.all == b).any(axis=1)][0]
        third = row[(row != a) & (row != b)][0]
        return np.array([a, b, third]), np.array([1 - share, share, 0.0])

    def apex(self, line, score):
        """Where a line of vertices is highest by score(positions): top of the parabola through the three about it."""
        line = np.asarray(line)
        line = line[line >= 0]
        at = self.vertices[line]
        k = int(np.clip(np.argmax(score(at)), 1, len(line) - 2))
        height, s = score(at)[k - 1 : k + 2], np.linalg.norm(np.diff(at[k - 1 : k + 2], axis=0), axis=1)
        bend, slope, _ = np.polyfit([-s[0], 0, s[1]], height, 2)
        top = float(np.clip(-slope / (2 * bend), -s[0], s[1])) if bend < 0 else 0.0
        other = line[k - 1] if top < 0 else line[k + 1]
        return self.on_edge(line[k], other, abs(top) / s[0 if top < 0 else 1])

    def extreme(self, candidates, score):
        """The candidate vertex with the greatest score(positions)."""
        candidates = np.asarray(candidates)
        candidates = candidates[candidates >= 0]
        return self.vertex(candidates[int(np.argmax(score(self.vertices[candidates])))])


def skin_landmarks(
    layout: Layout, vertices: np.ndarray, triangles: np.ndarray, inner: np.ndarray, seeds: dict
) -> SurfacePoints:
    """The 60 landmarks on the skin; left and right are exact mirror images.

    seeds : name without side -> (3,) mm on the left, for landmarks that only touch or measurement decide: the nearest
    point of the outer skin is taken.
    """
    f = _Finder(layout, vertices, triangles, inner)
    found = {name: f.place(place) for name, place in PLACES.items()}
    found |= {name: f.near(point) for name, point in seeds.items()}
    crown = layout.crown[:, layout.crown.shape[1] // 2]
    found["v"] = f.apex(crown, lambda p: p[:, 2])
    found["op"] = f.apex(f.back, lambda p: np.where(p[:, 2] > -20, p[:, 1], -np.inf))
    found["tr"] = f.between((0, 1), (0, 0), 0.75)
    found["se"] = f.apex(f.front[5:10], lambda p: p[:, 1])
    found["prn"] = f.apex(f.front[10:15], lambda p: -p[:, 1])
    mouth = layout.rings["mouth"]
    found["sl"] = f.extreme(np.r_[mouth[1:3, 11], f.front[22:24]], lambda p: p[:, 1])
    found["pg"] = f.apex(f.front[22:26], lambda p: -p[:, 1])
    found["gn"] = f.place((0, 25))
    found["sbal"] = f.near(0.5 * (vertices[layout.grid[15, 2]] + vertices[layout.grid[15, 3]]))
    grid = layout.grid
    found["eu"] = f.extreme(grid[0:7, 12:20].ravel(), lambda p: p[:, 0])
    ear = layout.rings["ear_l"]
    found["sa"] = f.extreme(ear[1:5].ravel(), lambda p: p[:, 2])
    found["sba"] = f.extreme(ear[1:5].ravel(), lambda p: -p[:, 2])
    found["pa"] = f.extreme(ear[1:5].ravel(), lambda p: p[:, 1])
    found["pra"] = f.extreme(ear[2, 0:3], lambda p: -p[:, 1])
    corners, weights = [], []
    for name in SKIN:
        base, side = (name[:-2], name[-1]) if name[-2:] in ("_l", "_r") else (name, "")
        c, w = found[base]
        corners.append(layout.mirror[c] if side == "r" else c)
        weights.append(w)
    return SurfacePoints(SKIN, ("skin",) * len(SKIN), np.array(corners, np.int32), np.array(weights))
