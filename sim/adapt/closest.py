# SPDX-License-Identifier: GPL-3.0-or-later
"""A triangle surface that answers: what is the closest point, what does a ray hit, does data end here?

Numpy and scipy only. Every triangle is covered by sample points of about equal spacing, kept in one k-d tree; the
triangles that own the nearest samples are the candidates, and the covering radius says when no other can be closer.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..box_tree import BoxTree
from ..mesh import cross_sides, vertex_normals
from ..triangle_projection import Triangles
from .cover import Cover
from .merging import clustered, weld
from .open_ends import data_ends
from .ranking import Ranking, least

FIRST = 8  # nearest samples of a point that are looked at before it is known how many more must be
BATCH = 20_000  # points looked at together
FEW = 10_000  # sides that tell how long they are in the median
SAME = 1e-3  # mm: vertices as near as that are one
#: Steps outward in which the outer wall of a shell is looked for; cosine from which on that faces apart from the inner one, and
#: the share of a skin before which it does.
LAYERS, ALIKE, MOST = 6, 0.5, 0.5
ENOUGH = 300_000  # triangles that show all of a head that a mesh of some thousand vertices can follow


@dataclass(frozen=True, eq=False)
class Contacts:
    """Points found on a surface, one per query; ``found`` is False where there is none within reach.

    distance (k,) mm; triangle (k,) int; weights (k, 3) barycentric; points (k, 3) mm; normals (k, 3) unit, smoothed;
    border (k,) bool: the point lies on or beside an open side of the surface.
    """

    found: np.ndarray
    distance: np.ndarray
    triangle: np.ndarray
    weights: np.ndarray
    points: np.ndarray
    normals: np.ndarray
    border: np.ndarray


def mixed(planes, corners, weights):
    """(k, 3) sums of columns of ``planes`` (3, n) at ``corners`` (k, 3) by ``weights`` (k, 3)."""
    a, b, c = (planes.take(corners[:, k], axis=1) * weights[:, k] for k in range(3))
    return (a + b + c).T


class Surface:
    """A welded triangle mesh (mm) with normals, open sides, component areas and a search tree.

    Parameters
    ----------
    vertices (n, 3) mm, triangles (m, 3); the triangles are wound counter-clockwise seen from outside.
    smooth : radius in mm over which normals are averaged (scanner noise turns single normals by 30 degrees).
    """

    def __init__(self, vertices, triangles, smooth: float = 0.0):
        self.vertices, self.triangles = weld(np.asarray(vertices, dtype=float), np.asarray(triangles))
        self._smooth = smooth
        self._parts: tuple[Surface, ...] = ()
        self._planes = self.vertices.T.copy()
        cross = cross_sides(*(self._planes.take(self.triangles[:, k], axis=1) for k in range(3)))
        self._double = np.sqrt(cross[0] ** 2 + cross[1] ** 2 + cross[2] ** 2)
        self.face_normals = (cross / self._double).T

    # Found when first asked for: a scan of millions of triangles is asked little.

    @property
    def area(self) -> np.ndarray:
        """(m,) mm² of each triangle."""
        return self._double / 2

    @cached_property
    def corners(self) -> np.ndarray:
        """(m, 3, 3) mm: the corners of each triangle."""
        return self.vertices.take(self.triangles, axis=0)

    @cached_property
    def solid(self) -> Triangles:
        return Triangles(self.corners)

    @cached_property
    def cover(self) -> Cover:
        return Cover(self.corners, self.area)

    @cached_property
    def _boxes(self) -> BoxTree:
        return BoxTree.of(self.vertices, self.triangles)

    @cached_property
    def _sides(self):
        """Sides of the triangles, each once: vertices (e,) and (e,), and how many triangles it belongs to (e,)."""
        count = self._upper
        return np.repeat(np.arange(count.shape[0]), np.diff(count.indptr)), count.indices, count.data

    @cached_property
    def _upper(self) -> csr_matrix:
        """(n, n) sparse: to how many triangles each side belongs, in the row of the lower of its vertices."""
        a, b, c = self.triangles.T
        ends = [np.concatenate([end(u, v) for u, v in ((a, b), (b, c), (c, a))]) for end in (np.minimum, np.maximum)]
        ones = np.ones(len(ends[0]), dtype=np.int32)
        return coo_matrix((ones, tuple(ends)), shape=(len(self.vertices),) * 2).tocsr()  # sums what comes again

    @cached_property
    def edge_length(self) -> float:
        """Median length of the sides, of some of them where there are many, mm."""
        a, b, _ = self._sides
        some = slice(None, None, max(len(a) // FEW, 1))
        return float(np.median(np.linalg.norm(self.vertices[a[some]] - self.vertices[b[some]], axis=1)))

    @cached_property
    def _open(self) -> np.ndarray:
        """(k, 2) vertices of the open sides."""
        a, b, count = self._sides
        return np.stack([a[count == 1], b[count == 1]], axis=1)

    @cached_property
    def border_vertex(self) -> np.ndarray:
        """(n,) bool: vertices on open sides where data ends."""
        if self._parts:  # each ends where it did
            ends = np.concatenate([part.vertices[part.border_vertex] for part in self._parts])
            rim = np.unique(self._open)
            out = np.zeros(len(self.vertices), dtype=bool)
            out[rim] = cKDTree(ends).query(self.vertices[rim])[0] < SAME if len(ends) else False
            return out

        def nearest(points):
            owner = self.cover.owner[self.cover.nearest(points, 1, np.inf)[1][:, 0]]
            return self.solid.closest(points, np.arange(len(points)), owner)[1]

        return data_ends(self.vertices, self.triangles, self._open, nearest)

    @cached_property
    def gap_vertex(self) -> np.ndarray:
        """(n,) bool: vertices on open sides beyond which data goes on."""
        out = np.zeros(len(self.vertices), dtype=bool)
        out[self._open] = True
        return out & ~self.border_vertex

    @cached_property
    def _link(self):
        """(n, n) sparse: 1 where a side joins two vertices."""
        link = self._upper
        link = csr_matrix((np.ones(len(link.data)), link.indices, link.indptr), shape=link.shape)
        return link + link.T

    @cached_property
    def piece_area(self) -> np.ndarray:
        """(m,) mm² of the connected piece each triangle belongs to: small pieces are specks."""
        _, label = connected_components(self._link, directed=False)
        piece = label[self.triangles[:, 0]]
        return np.bincount(piece, self.area)[piece]

    @cached_property
    def normals(self) -> np.ndarray:
        """(n, 3) unit, smoothed."""
        normals = vertex_normals(self.vertices, self.triangles)
        rounds = 0
        if self._smooth:
            rounds = int(np.clip(round((self._smooth / max(self.edge_length, 1e-6)) ** 2), 0, 12))
        for _ in range(rounds):
            normals = normals + self._link @ normals
            normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        return normals

    @cached_property
    def _normal_planes(self):
        return np.ascontiguousarray(self.normals.T)

    def turned(self) -> "Surface":
        """The same surface with its outside inside (for scans wound the wrong way round)."""
        out = object.__new__(Surface)
        kept = (
            "vertices",
            "_planes",
            "_smooth",
            "_parts",
            "_double",
            "cover",
            "_boxes",
            "_upper",
            "_sides",
            "edge_length",
            "_open",
            "border_vertex",
            "gap_vertex",
            "_link",
            "piece_area",
        )
        out.__dict__.update({name: value for name, value in self.__dict__.items() if name in kept})
        out.triangles, out.face_normals = self.triangles[:, ::-1], -self.face_normals
        return out

    def without(self, triangles: np.ndarray) -> "Surface":
        """This surface without some of its ``triangles`` (m,) bool; itself where they are none."""
        return Surface(self.vertices, self.triangles[~triangles], self._smooth) if triangles.any() else self

    def beside(self, vertices, triangles) -> "Surface":
        """This surface and another one, ``vertices`` (k, 3) mm and ``triangles`` (t, 3), as one."""
        both = np.concatenate([self.triangles, triangles + len(self.vertices)])
        out = Surface(np.concatenate([self.vertices, vertices]), both, self._smooth)
        out._parts = (self, Surface(vertices, triangles, self._smooth))
        return out

    def coarser(self, most: int = ENOUGH) -> "Surface":
        """This surface with about ``most`` triangles, by merging vertices that are closest; itself where it has no more.

        What is finer than the skin's own mesh tells a fit nothing but the scanner's noise.
        """
        if len(self.triangles) <= most:
            return self
        # A grid of cells cuts a surface into about 1.5 pieces, of 2 triangles each, per cell's area.
        out, cell = self, np.sqrt(3 * self.area.sum() / most)
        for _ in range(4):
            out = Surface(*clustered(self.vertices, self.triangles, cell), self._smooth)
            if len(out.triangles) <= 1.2 * most:
                break
            cell *= 1.05 * np.sqrt(len(out.triangles) / most)
        return out

    def smooth_normals(self, triangle, weights) -> np.ndarray:
        """(k, 3) at places with barycentric ``weights`` (k, 3) on triangles (k,), about as long as one."""
        return mixed(self._normal_planes, self.triangles[triangle], weights)

    def contacts(self, count, found, distance, triangle, weights) -> Contacts:
        """Spread what was found (indices ``found``) over ``count`` queries."""
        ok = np.zeros(count, dtype=bool)
        ok[found] = True
        full = Contacts(
            found=ok,
            distance=np.full(count, np.inf),
            triangle=np.full(count, -1),
            weights=np.zeros((count, 3)),
            points=np.full((count, 3), np.nan),
            normals=np.zeros((count, 3)),
            border=np.zeros(count, dtype=bool),
        )
        corner = self.triangles[triangle]
        full.distance[found], full.triangle[found], full.weights[found] = distance, triangle, weights
        full.points[found] = mixed(self._planes, corner, weights)
        normal = self.smooth_normals(triangle, weights)
        full.normals[found] = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        full.border[found] = (self.border_vertex[corner] & (weights > 1e-6)).any(axis=1)
        return full

    def closest(self, points, reach: float = np.inf) -> Contacts:
        """The closest point of the surface for each of ``points`` (k, 3), if nearer than ``reach`` mm."""
        points = np.asarray(points, dtype=float).reshape(-1, 3)
        if len(points) == 0:
            return self.contacts(0, np.zeros(0, int), np.zeros(0), np.zeros(0, int), np.zeros((0, 3)))
        best = np.full(len(points), np.inf)
        triangle, weights = np.full(len(points), -1), np.zeros((len(points), 3))

        def improve(row, owner):
            """Let the pairs of query and triangle compete."""
            w, d = self.solid.closest(points, row, owner)
            at, pick = least(row, d)
            better = d[pick] < best[at]
            at, pick = at[better], pick[better]
            best[at], triangle[at], weights[at] = d[pick], owner[pick], w[pick]

        # The triangle of the nearest sample bounds the distance; only boxes nearer than that can hold a nearer one.
        far, sample = self.cover.nearest(points, 1, reach)
        near = np.flatnonzero(np.isfinite(far[:, 0]))
        improve(near, self.cover.owner[sample[near, 0]])
        for start in range(0, len(near), BATCH):
            at = near[start : start + BATCH]
            row, owner = self._boxes.near(points[at], best[at] * (1 + 1e-12))
            improve(at[row], owner)
        found = np.flatnonzero(best <= reach)
        return self.contacts(len(points), found, best[found], triangle[found], weights[found])

    def _once(self, row, owner):
        """Each pair of a point and a triangle once, in order."""
        pair = np.sort(row.astype(np.int64) * len(self.triangles) + owner)
        if len(pair):
            pair = pair[np.concatenate([[True], pair[1:] != pair[:-1]])]
        return np.divmod(pair, len(self.triangles))

    def facing(self, points, reach: float) -> np.ndarray:
        """(k, 3) about the normal of what is near each of ``points`` (k, 3), zero where nothing is within ``reach`` mm."""
        far, sample = self.cover.nearest(points, 1, reach)
        found = np.isfinite(far[:, 0])
        out = np.zeros((len(points), 3))
        out[found] = self.face_normals[self.cover.owner[sample[found, 0]]]
        return out

    def inside_out(self, points, normals, reach: float) -> bool:
        """Whether most of what is within ``reach`` mm of ``points`` (k, 3) of a skin faces the other way than their
        ``normals`` (k, 3): scans may be wound either way.

        Where there are two layers that face apart, the one farther out has it: those are the walls of a shell, a hollow print
        for one. Laid on a scan turned as its inner wall has it, a skin would lie on that, which is as much a face.
        """
        facing = self.facing(points, reach)
        near = facing.any(axis=1)
        if not near.any():
            return False
        points, normals = points[near], normals[near]
        side = 1.0 if np.median(np.einsum("ij,ij->i", facing[near], normals)) >= 0 else -1.0
        outer, step = np.zeros(len(points), dtype=bool), reach / LAYERS
        for far in step * np.arange(1, LAYERS + 1):
            before = self.facing(points + far * normals, step)
            outer |= side * np.einsum("ij,ij->i", before, normals) < -ALIKE
        return bool((side < 0) != (outer.mean() > MOST))

    def ranked(
        self, points, normals, reach: float, agreement: float = 0.5, near: int = 24, bend: float = 1.0
    ) -> Contacts:
        """The best place for each point: near, and facing the same way.

        Among the triangles of the ``near`` samples nearest to each point those whose normal agrees with ``normals``
        (k, 3) by at least ``agreement`` (cosine) compete by distance x (1 + bend (1 - cosine)).
        """
        points = np.asarray(points, dtype=float).reshape(-1, 3)
        ranking, cover = Ranking(self, points, normals, reach, agreement, bend), self.cover

        def improve(row, owner, far):
            some = np.flatnonzero(far - cover.radius[owner] < ranking.cost[row])
            row, owner = self._once(row[some], owner[some])
            ranking.improve(row, owner, np.zeros(len(row)))

        first = min(FIRST, near)
        far, sample = cover.nearest(points, first, reach)
        for columns in (slice(0, 2), slice(2, first)):
            row, column = np.nonzero(np.isfinite(far[:, columns]))
            improve(row, cover.owner[sample[:, columns][row, column]], far[:, columns][row, column])
        doubt = np.flatnonzero((far[:, -1] - cover.most < ranking.cost) & np.isfinite(far[:, -1]))
        if near > first and len(doubt):
            seen = far[doubt, -1:]
            far, sample = cover.nearest(points[doubt], near, reach)
            row, column = np.nonzero(np.isfinite(far) & (far >= seen))
            improve(doubt[row], cover.owner[sample[row, column]], far[row, column])
        return ranking.contacts()

    def crossings(self, origins, directions, reach: float):
        """All crossings of the lines ``origin + t direction``, -reach <= t <= reach, with the surface.

        Returns (line (h,) index, t (h,) mm, triangle (h,), weights (h, 3)), ordered by line and then by |t|.
        directions (k, 3) unit vectors.
        """
        origins, directions = np.asarray(origins, dtype=float), np.asarray(directions, dtype=float)
        line, owner = self._once(*self._boxes.along(origins, directions, reach))
        a, ab = self.corners[owner, 0], self.corners[owner, 1] - self.corners[owner, 0]
        ac, d, o = self.corners[owner, 2] - a, directions[line], origins[line]
        p = np.cross(d, ac)
        det = np.einsum("ij,ij->i", ab, p)
        safe = np.where(np.abs(det) > 1e-12, det, 1)
        u = np.einsum("ij,ij->i", o - a, p) / safe
        q = np.cross(o - a, ab)
        v = np.einsum("ij,ij->i", d, q) / safe
        t = np.einsum("ij,ij->i", ac, q) / safe
        slack = -1e-9
        hit = (np.abs(det) > 1e-12) & (u >= slack) & (v >= slack) & (u + v <= 1 - slack) & (np.abs(t) <= reach)
        order = np.flatnonzero(hit)
        order = order[np.lexsort((np.abs(t[order]), line[order]))]
        weights = np.stack([1 - u - v, u, v], axis=1)[order]
        return line[order], t[order], owner[order], weights
