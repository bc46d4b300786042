# SPDX-License-Identifier: GPL-3.0-or-later
"""A triangle surface that answers: what is the closest point, what does a ray hit, does data end here?

Numpy and scipy only. Every triangle is covered by sample points of about equal spacing, kept in one k-d tree; the
triangles that own the nearest samples are the candidates, and the covering radius says when no other can be closer.
"""

from dataclasses import dataclass
from itertools import chain

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..mesh import vertex_normals
from ..triangle_projection import Triangles

SAMPLES = 160_000  # a finer cover does not pay for the time its tree takes
FIRST = 8  # nearest samples of a point that are looked at before it is known how many more must be
BATCH = 4000  # points whose lists of samples are held at once


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


def weld(vertices: np.ndarray, triangles: np.ndarray, tolerance: float = 1e-5):
    """Merge coincident vertices (texture seams split them) and drop collapsed triangles.

    Returns vertices (n, 3), triangles (m, 3).
    """
    span = max(float(np.ptp(vertices, axis=0).max()), 1e-9) if len(vertices) else 1.0
    grid = np.round((vertices - vertices.min(axis=0)) / (tolerance * span)).astype(np.int64)
    key = (grid[:, 0] << 42) ^ (grid[:, 1] << 21) ^ grid[:, 2]
    _, first, back = np.unique(key, return_index=True, return_inverse=True)
    merged = back.reshape(-1)[triangles]
    vertices = vertices[first]
    a, b, c = (vertices[merged[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.maximum.reduce([((b - a) ** 2).sum(1), ((c - b) ** 2).sum(1), ((a - c) ** 2).sum(1)])
    merged = merged[area > 1e-9 * np.maximum(longest, 1e-30)]
    used, merged = np.unique(merged, return_inverse=True)
    return vertices[used], merged.reshape(-1, 3).astype(np.int32)


def spread(corners: np.ndarray, spacing: float):
    """Sample points over triangles (m, 3, 3) -> points (s, 3), owner (s,), covering radius (m,) in mm."""
    middle = corners.mean(axis=1)
    reach = np.sqrt(((corners - middle[:, None]) ** 2).sum(2).max(1))
    parts = np.clip(np.ceil(reach / spacing), 1, 24).astype(int)
    while (parts**2).sum() > max(SAMPLES, 2 * len(corners)):
        spacing *= 1.2
        parts = np.clip(np.ceil(reach / spacing), 1, 24).astype(int)
    points, owner = [], []
    for n in np.unique(parts):
        of = np.flatnonzero(parts == n)
        i, j = np.divmod(np.arange(n * n), n)
        up = i + j < n
        # Middles of the n*n small triangles: the upright ones, then those standing on their tip.
        b = np.concatenate([(i[up] + 1 / 3) / n, (i[(i + j) < n - 1] + 2 / 3) / n])
        c = np.concatenate([(j[up] + 1 / 3) / n, (j[(i + j) < n - 1] + 2 / 3) / n])
        weights = np.stack([1 - b - c, b, c], axis=1)
        points.append(np.einsum("sk,mkx->msx", weights, corners[of]).reshape(-1, 3))
        owner.append(np.repeat(of, len(weights)))
    return np.concatenate(points), np.concatenate(owner), reach / parts


def least(row, cost):
    """The rows (r,) that occur in ``row`` (k,), ascending, and where the first of the least ``cost`` (k,) of each is.

    ``row`` must be in ascending order.
    """
    if len(row) == 0:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    start = np.flatnonzero(np.concatenate([[True], row[1:] != row[:-1]]))
    lowest = np.minimum.reduceat(cost, start)
    is_least = np.flatnonzero(cost == np.repeat(lowest, np.diff(np.append(start, len(row)))))
    first = is_least[np.concatenate([[True], row[is_least][1:] != row[is_least][:-1]])]
    return row[first], first


class Surface:
    """A welded triangle mesh (mm) with normals, open sides, component areas and a search tree.

    Parameters
    ----------
    vertices (n, 3) mm, triangles (m, 3); the triangles are wound counter-clockwise seen from outside.
    smooth : radius in mm over which normals are averaged (scanner noise turns single normals by 30 degrees).
    """

    def __init__(self, vertices, triangles, smooth: float = 0.0):
        vertices, triangles = np.asarray(vertices, dtype=float), np.asarray(triangles)
        self.vertices, self.triangles = weld(vertices, triangles)
        self.corners = self.vertices[self.triangles]
        a, b, c = self.corners[:, 0], self.corners[:, 1], self.corners[:, 2]
        cross = np.cross(b - a, c - a)
        double = np.linalg.norm(cross, axis=1)
        self.area = double / 2
        self.face_normals = cross / double[:, None]
        self._topology()
        self.normals = self._smoothed(smooth)
        # Finer than the triangles where there are few: less to try for each query.
        spacing = max(float(np.median(np.sqrt(double))), 1e-6) * (0.55 if len(double) < 30_000 else 0.75)
        self._samples, self._owner, self._cover = spread(self.corners, spacing)
        self._radius = float(self._cover.max())
        self._tree = cKDTree(self._samples)
        self._solid = Triangles(self.corners)

    def _topology(self):
        n = len(self.vertices)
        t = self.triangles.astype(np.int64)
        sides = np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]), axis=1)
        code, first, count = np.unique(sides[:, 0] * n + sides[:, 1], return_index=True, return_counts=True)
        pair = sides[first]
        self.edge_length = float(
            np.median(np.linalg.norm(self.vertices[pair[:, 0]] - self.vertices[pair[:, 1]], axis=1))
        )
        link = coo_matrix((np.ones(len(pair)), (pair[:, 0], pair[:, 1])), shape=(n, n)).tocsr()
        self._link = link + link.T
        self.border_vertex = np.zeros(n, dtype=bool)
        self.border_vertex[pair[count == 1].ravel()] = True
        _, label = connected_components(self._link, directed=False)
        #: Area in mm² of the connected piece each triangle belongs to: small pieces are specks.
        piece = label[self.triangles[:, 0]]
        self.piece_area = np.bincount(piece, self.area)[piece]

    def _smoothed(self, radius):
        normals = vertex_normals(self.vertices, self.triangles)
        rounds = int(np.clip(round((radius / max(self.edge_length, 1e-6)) ** 2), 0, 12)) if radius else 0
        for _ in range(rounds):
            normals = normals + self._link @ normals
            normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        return normals

    def turned(self) -> "Surface":
        """The same surface with its outside inside (for scans wound the wrong way round)."""
        out = object.__new__(Surface)
        out.__dict__.update(self.__dict__)
        out.triangles = self.triangles[:, ::-1]
        out.corners = self.corners[:, ::-1]
        out._solid = Triangles(out.corners)
        out.normals, out.face_normals = -self.normals, -self.face_normals
        return out

    def _contacts(self, count, found, distance, triangle, weights) -> Contacts:
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
        full.points[found] = np.einsum("kij,ki->kj", self.vertices[corner], weights)
        normal = np.einsum("kij,ki->kj", self.normals[corner], weights)
        full.normals[found] = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        full.border[found] = (self.border_vertex[corner] & (weights > 1e-6)).any(axis=1)
        return full

    def closest(self, points, reach: float = np.inf) -> Contacts:
        """The closest point of the surface for each of ``points`` (k, 3), if nearer than ``reach`` mm."""
        points = np.asarray(points, dtype=float).reshape(-1, 3)
        if len(points) == 0:
            return self._contacts(0, np.zeros(0, int), np.zeros(0), np.zeros(0, int), np.zeros((0, 3)))
        best = np.full(len(points), np.inf)
        triangle, weights = np.full(len(points), -1), np.zeros((len(points), 3))

        def improve(row, owner, far):
            """Let the pairs of query and triangle compete, if their nearest sample is near enough."""
            some = np.flatnonzero(far - self._cover[owner] < best[row])
            row, owner = self._once(row[some], owner[some])
            w, d = self._solid.closest(points, row, owner)
            at, pick = least(row, d)
            better = d[pick] < best[at]
            at, pick = at[better], pick[better]
            best[at], triangle[at], weights[at] = d[pick], owner[pick], w[pick]

        far, sample = self._nearest(points, FIRST, reach)
        near = np.flatnonzero(np.isfinite(far[:, 0]))
        improve(near, self._owner[sample[near, 0]], far[near, 0])
        row, column = np.nonzero(np.isfinite(far[:, 1:]))
        improve(row, self._owner[sample[row, column + 1]], far[row, column + 1])
        # No other triangle can be nearer than its nearest sample less the covering radius; where that leaves doubt,
        # all triangles with a sample in the ball of doubt are tried.
        doubt = np.flatnonzero((far[:, -1] - self._radius < best) & np.isfinite(far[:, -1]))
        for start in range(0, len(doubt), BATCH):
            at = doubt[start : start + BATCH]
            row, sample = self._within(points[at], best[at] + self._radius)
            off = points[at[row]] - self._samples[sample]
            improve(at[row], self._owner[sample], np.sqrt(np.einsum("ij,ij->i", off, off)))
        found = np.flatnonzero(best <= reach)
        return self._contacts(len(points), found, best[found], triangle[found], weights[found])

    def _nearest(self, points, count, reach):
        """Distance (k, count) and index (k, count) of the samples nearest to points (k, 3), infinite beyond reach."""
        count = min(count, self._tree.n)
        far, sample = self._tree.query(points, k=count, distance_upper_bound=reach + self._radius)
        return far.reshape(len(points), -1), sample.reshape(len(points), -1)

    def _within(self, points, reach):
        """Pairs of a point and a sample no farther than ``reach`` mm from it: (p,) and (p,)."""
        lists = self._tree.query_ball_point(points, reach, return_sorted=False)
        size = np.fromiter(map(len, lists), dtype=np.int64, count=len(lists))
        flat = np.fromiter(chain.from_iterable(lists), dtype=np.int64, count=int(size.sum()))
        return np.repeat(np.arange(len(lists)), size), flat

    def _once(self, row, owner):
        """Each pair of a point and a triangle once, in order."""
        pair = np.sort(row.astype(np.int64) * len(self.triangles) + owner)
        if len(pair):
            pair = pair[np.concatenate([[True], pair[1:] != pair[:-1]])]
        return np.divmod(pair, len(self.triangles))

    def ranked(
        self, points, normals, reach: float, agreement: float = 0.5, near: int = 24, bend: float = 1.0
    ) -> Contacts:
        """The best place for each point: near, and facing the same way.

        Among the triangles of the ``near`` samples nearest to each point those whose normal agrees with ``normals``
        (k, 3) by at least ``agreement`` (cosine) compete by distance x (1 + bend (1 - cosine)).
        """
        points = np.asarray(points, dtype=float).reshape(-1, 3)
        best = np.full(len(points), np.inf)
        triangle, weights, distance = np.full(len(points), -1), np.zeros((len(points), 3)), np.full(len(points), np.inf)

        def improve(row, owner, far):
            # What costs no less than the best so far even if it faced the same way needs no look.
            some = np.flatnonzero(far - self._cover[owner] < best[row])
            row, owner = self._once(row[some], owner[some])
            w, d = self._solid.closest(points, row, owner)
            normal = np.einsum("kij,ki->kj", self.normals[self.triangles[owner]], w)
            cosine = np.einsum("ij,ij->i", normal, normals[row])
            cosine /= np.maximum(np.sqrt(np.einsum("ij,ij->i", normal, normal)), 1e-12)
            cost = np.where((cosine >= agreement) & (d <= reach), d * (1 + bend * (1 - cosine)), np.inf)
            at, pick = least(row, cost)
            better = cost[pick] < best[at]
            at, pick = at[better], pick[better]
            best[at], triangle[at], weights[at], distance[at] = cost[pick], owner[pick], w[pick], d[pick]

        first = min(FIRST, near)
        far, sample = self._nearest(points, first, reach)
        for columns in (slice(0, 2), slice(2, first)):
            row, column = np.nonzero(np.isfinite(far[:, columns]))
            improve(row, self._owner[sample[:, columns][row, column]], far[:, columns][row, column])
        doubt = np.flatnonzero((far[:, -1] - self._radius < best) & np.isfinite(far[:, -1]))
        if near > first and len(doubt):
            far, sample = self._nearest(points[doubt], near, reach)
            row, column = np.nonzero(np.isfinite(far))
            improve(doubt[row], self._owner[sample[row, column]], far[row, column])
        at = np.flatnonzero(triangle >= 0)
        return self._contacts(len(points), at, distance[at], triangle[at], weights[at])

    def crossings(self, origins, directions, reach: float):
        """All crossings of the lines ``origin + t direction``, -reach <= t <= reach, with the surface.

        Returns (line (h,) index, t (h,) mm, triangle (h,), weights (h, 3)), ordered by line and then by |t|.
        directions (k, 3) unit vectors.
        """
        origins, directions = np.asarray(origins, dtype=float), np.asarray(directions, dtype=float)
        step = max(2 * self._radius, reach / 16)
        stations = np.arange(-reach, reach + step, step)
        ball = float(np.hypot(step / 2, self._radius) + self._radius)
        at = (origins[:, None] + stations[None, :, None] * directions[:, None]).reshape(-1, 3)
        station, sample = self._within(at, ball)
        line, owner = self._once(station // len(stations), self._owner[sample])
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
