# SPDX-License-Identifier: GPL-3.0-or-later
"""Where bone may be under a given skin: the skin without its ears, how deep the tissue is, and where each skull
landmark must come to lie."""

import numpy as np
from scipy.sparse import coo_matrix, diags
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from ...sim.anatomy.tissue_depth import skin_counterparts, table
from ...sim.mesh import Mesh, edges, vertex_normals
from .mouth_lining import MouthLining
from .skull_nets import mirror_index, symmetric

#: Bone stays this far from the lining of nose and lids, and from that of the mouth, mm.
CLEARANCE, MOUTH = 0.6, 1.4

#: mm from a sample of the skin to the farthest place that it speaks for.
BETWEEN = 1.4
#: Half the width of the widest cavity behind lips, lids and nostrils, mm.
WIDE = 17.0

#: Thin-skinned places between the landmarks of the table: skin landmarks to average -> mm (estimated).
_BETWEEN = {
    ("en",): 4.0, ("en", "n"): 3.5, ("en", "al"): 5.0, ("ex",): 5.0, ("ps",): 4.0, ("pi",): 4.0, ("se",): 5.0,
    ("ex", "zy"): 7.0, ("tr",): 5.0, ("go", "gn"): 9.5, ("go", "gn", "gn"): 9.0,
    ("se", "al"): 3.0, ("se", "se", "al"): 3.0, ("prn", "en"): 3.0, ("se", "en"): 2.5, ("se", "se", "en"): 2.5,
}  # fmt: skip

#: The roots of the lower incisors want this much of the tissue's mean depth over the supramentale, mm (under its deviation).
_LESS = {"sl": 1.8, "id": 2.0}
_NEARER = {"sl": 1.0}


class BoneSpace:
    """The room for bone under a skin.

    Attributes
    ----------
    targets : bone landmark -> (3,) mm: the 22 of the skull and ``gn pr id``, at their tissue depth under the skin
    normals : bone landmark -> (3,) outward direction of the skin there
    """

    def __init__(self, skin: Mesh, groups: dict[str, np.ndarray], landmarks: dict[str, np.ndarray]):
        self.landmarks = {name: np.asarray(p, float) for name, p in landmarks.items()}
        triangles = skin.triangles
        inner = _weights(groups, "inner", skin) + _weights(groups, "mouth_bag", skin) > 0.5
        vertices = _without_ears(skin, _weights(groups, "ear_l", skin) + _weights(groups, "ear_r", skin))
        triangles = triangles[vertices[triangles, 2].max(axis=1) > self.landmarks["gn"][2] - 25]
        # Without the lips' and lids' edges: their skin faces inward and would not know outside from inside.
        outer = triangles[~inner[triangles].any(axis=1)]
        self.points, self.directions = sampled(vertices, outer, 2.5)
        self._tree = cKDTree(self.points)
        bag = _weights(groups, "mouth_bag", skin) > 0.4  # `mouth` knows it better
        self._all, self._all_directions = sampled(vertices, triangles[~bag[triangles].all(axis=1)], 2.5)
        self._all_tree = cKDTree(self._all)
        lined = triangles[inner[triangles].all(axis=1)]
        self._lining = sampled(vertices, lined, 2.5)[0] if len(lined) else np.zeros((0, 3))
        self._all_lined = np.zeros(len(self._all), dtype=bool)
        if len(lined):
            self._all_lined[:] = cKDTree(self._lining).query(self._all)[0] < 1e-6
        self.mouth = MouthLining(skin, groups)
        self._place_targets()
        known = {**skin_counterparts(self.landmarks), **self._extra_counterparts()}
        spots = [(known[n], table()[_base(n)].mean - _LESS.get(n, 0)) for n in known if not n.startswith(("po", "ans"))]
        for names, depth in _BETWEEN.items():
            for side in ("_l", "_r"):
                found = [self.landmarks.get(n + side, self.landmarks.get(n)) for n in names]
                spots.append((np.mean(found, axis=0), depth))
        self._depth_at = np.array([at for at, _ in spots])
        self._depth_of = np.array([depth for _, depth in spots])
        self.depth = self._depth(self.points)

    def _extra_counterparts(self):
        return {"gn": self.landmarks["gn"], "pr": self.landmarks["ls"], "id": self.landmarks["li"]}

    def _depth(self, points):
        """(n,) mm: the table's depths spread over the skin, nearest landmarks weighing most (Shepard 1968)."""
        weight = 1 / (np.linalg.norm(points[:, None] - self._depth_at[None], axis=2) ** 3 + 1e-3)
        return weight @ self._depth_of / weight.sum(axis=1)

    def _place_targets(self):
        self.targets, self.normals = {}, {}
        for name, at in {**skin_counterparts(self.landmarks), **self._extra_counterparts()}.items():
            middle = not name.endswith(("_l", "_r"))
            if name == "rhi":  # its counterpart is a point between landmarks: drop it onto the nasal bridge
                at = self.points[self._bridge(at)]
            normal = self.smooth_normal(at)
            if _base(name) == "po":
                normal = np.array([np.sign(at[0]), 0.0, 0.0])
            elif name in ("ans", "pr", "id", "sl"):
                normal = np.array([0.0, -1.0, 0.0])
            if name == "sl":  # the deepest point of the hollow lies below the roots
                normal = np.array([0.0, -0.91, 0.41])
            if middle:
                normal[0], at = 0.0, at * [0, 1, 1]
            normal = normal / np.linalg.norm(normal)
            self.normals[name] = normal
            self.targets[name] = at - (table()[_base(name)].mean - _NEARER.get(name, 0.0)) * normal

    def _bridge(self, at):
        near = np.abs(self.points[:, 0]) < 2
        cost = np.where(near, np.linalg.norm(self.points - at, axis=1), np.inf)
        return int(cost.argmin())

    def smooth_normal(self, at, radius=7.0):
        """(3,) outward direction of the skin around a point."""
        near = self._tree.query_ball_point(at, 2 * radius)
        distance = np.linalg.norm(self.points[near] - at, axis=1)
        total = (np.exp(-((distance / radius) ** 2))[:, None] * self.directions[near]).sum(axis=0)
        return total / np.linalg.norm(total)

    def too_shallow(self, points):
        """(n,) mm, positive where bone would be nearer to the skin than its depth there."""
        distance, near = _signed(points, self._tree, self.points, self.directions)
        distance = np.abs(distance)
        # Only the whole skin, linings included, tells inside from outside.
        clear, mouth = self._beside_mouth(points), self.mouth.depth(points, 3.0)
        mouth[mouth >= 3.0] = np.inf
        below = np.where(np.minimum(clear, mouth) > 0, distance, -distance)
        return np.maximum(np.maximum(self.depth[near] - below, CLEARANCE - clear), MOUTH - mouth)

    def beside(self, yz, deeper=0.0):
        """(k, 3) the left side of the bone as the skin's depth allows it, ``deeper`` mm more, at places (k, 2) y and z."""
        yz = np.asarray(yz, float)
        left = np.flatnonzero(self.points[:, 0] > 20)
        near = cKDTree(self.points[left, 1:]).query(yz, k=6)[1]
        best = left[near[np.arange(len(yz)), self.points[left[near], 0].argmax(axis=1)]]
        x = self.points[best, 0] - (self.depth[best] + deeper) / np.maximum(self.directions[best, 0], 0.5)
        return np.column_stack([x, yz])

    def before(self, xz, deeper=0.0):
        """(k,) y of the front of the bone as the skin's depth allows it, ``deeper`` mm more, at places (k, 2) x and z."""
        xz = np.asarray(xz, float)
        y = np.arange(self.points[:, 1].min(), -30.0, 2.0)
        spots = np.stack(np.broadcast_arrays(xz[:, None, 0], y[None], xz[:, None, 1]), axis=-1)
        free = self.too_shallow(spots.reshape(-1, 3)).reshape(spots.shape[:2]) + np.reshape(deeper, (-1, 1))
        k = np.maximum((free < 0).argmax(axis=1), 1)
        row = np.arange(len(xz))
        a, b = free[row, k - 1], free[row, k]
        return y[k] - np.clip(b / np.minimum(b - a, -1e-6), 0, 1)

    def mouth_limit(self, xy, rise, radius=3.0):
        """(k,) z of the mouth's roof (``rise`` +1) or floor (-1): the farthest lining near places (k, 2) seen from above."""
        level = self.landmarks["sto"][2]
        lining = self._lining[(np.abs(self._lining[:, 2] - level) < 30) & (rise * (self._lining[:, 2] - level) > 0)]
        if len(lining) == 0:
            return np.full(len(xy), level + rise * 9.0)
        tree = cKDTree(lining[:, :2])
        found = [tree.query_ball_point(p, radius) or [tree.query(p)[1]] for p in np.asarray(xy)]
        return np.array([rise * (rise * lining[near, 2]).max() for near in found])

    def lid_cups(self):
        """Lowest and highest corner (3,) mm of the box round the left eye's lids as they line the eyeball."""
        en, ex = self.landmarks["en_l"], self.landmarks["ex_l"]
        near = np.abs(self._lining - (en + ex) / 2) < [0.65 * (ex - en)[0], 32, 20]
        cups = self._lining[near.all(axis=1)]
        return cups.min(axis=0), cups.max(axis=0)

    def depth_seen(self, points):
        """(n,) mm to the nearest skin that is seen."""
        return self._tree.query(points)[0]

    def clearance(self, points):
        """(n,) mm to the nearest skin or lining, negative where there is air."""
        return np.minimum(self._beside_mouth(points), self.mouth.depth(points))

    def _beside_mouth(self, points):
        clear, near = _signed(points, self._all_tree, self._all, self._all_directions)
        # No cavity is so wide: what lies that far from its lining lies in the flesh behind it.
        return np.where(self._all_lined[near] & (clear < -WIDE), -clear, clear)

    def kept_inside(self, mesh: Mesh, clear=1.2) -> Mesh:
        """``mesh`` with vertices that come too near to any skin moved inward; those round the mouth are left alone."""
        vertices, mirror = mesh.vertices.copy(), mirror_index(mesh.vertices)
        for _ in range(10):
            room, near = _signed(vertices, self._all_tree, self._all, self._all_directions)
            move = np.where((room > -8) & (self.mouth.depth(vertices, 6.0) > 5.9), np.maximum(clear - room, 0), 0)
            vertices -= move[:, None] * self._all_directions[near]
            vertices = symmetric(vertices, mirror)
        return mesh.moved(vertices)

    def snapped(self, mesh: Mesh, names, reach=18.0) -> Mesh:
        """``mesh`` gently pushed so that its surface passes through the targets named (symmetric)."""
        vertices, mirror = mesh.vertices, mirror_index(mesh.vertices)
        for _ in range(4):
            tree = cKDTree(sampled(vertices, mesh.triangles, 1.0)[0])
            at = np.array([self.targets[n] for n in names])
            off = at - tree.data[tree.query(at)[1]]
            weight = np.exp(-((np.linalg.norm(at[:, None] - at[None], axis=2) / reach) ** 2))
            push = np.linalg.solve(weight + 1e-6 * np.eye(len(at)), off)
            vertices = vertices + np.exp(-((np.linalg.norm(vertices[:, None] - at[None], axis=2) / reach) ** 2)) @ push
            vertices = symmetric(vertices, mirror)
        return mesh.moved(vertices)


def _base(name):
    return name.removesuffix("_l").removesuffix("_r")


def _weights(groups, name, skin):
    return np.asarray(groups.get(name, np.zeros(len(skin.vertices))), float)


def sampled(vertices, triangles, spacing):
    """Points (k, 3) about ``spacing`` mm apart on a surface, and the smooth normals there."""
    normal = vertex_normals(vertices, triangles)
    corner, corner_normal = vertices[triangles], normal[triangles]
    side = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).max(axis=1)
    parts = np.maximum(1, np.ceil(side / spacing)).astype(int)
    points, normals = [], []
    for n in np.unique(parts):
        i, j = (a.ravel() for a in np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij"))
        keep = i + j <= n
        w = np.stack([i[keep], j[keep], n - i[keep] - j[keep]], axis=1) / n
        some = parts == n
        points.append(np.einsum("wk,tkd->twd", w, corner[some]).reshape(-1, 3))
        normals.append(np.einsum("wk,tkd->twd", w, corner_normal[some]).reshape(-1, 3))
    points, normals = np.concatenate(points), np.concatenate(normals)
    return points, normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)


def _signed(points, tree, samples, normals):
    distance, near = tree.query(points)
    rise = ((points - samples[near]) * normals[near]).sum(1)
    # Between samples the surface is their plane: the distance to the nearest of them would ripple.
    aside = np.sqrt(np.maximum(distance**2 - rise**2, 0))
    distance = np.hypot(rise, np.maximum(aside - BETWEEN, 0))
    return np.where(rise > 0, -distance, distance), near


def _without_ears(skin, ear):
    """Skin vertices with the ears replaced by the membrane that spans their roots (harmonic fill)."""
    free = np.flatnonzero(ear > 0.5)
    if len(free) == 0:
        return skin.vertices
    e = edges(skin.faces)
    n = len(skin.vertices)
    link = coo_matrix((np.ones(2 * len(e)), (np.r_[e[:, 0], e[:, 1]], np.r_[e[:, 1], e[:, 0]])), shape=(n, n)).tocsr()
    laplace = (diags(np.asarray(link.sum(1)).ravel()) - link).tocsr()
    fixed = np.setdiff1d(np.arange(n), free)
    vertices = skin.vertices.copy()
    vertices[free] = splu(laplace[free][:, free].tocsc()).solve(-(laplace[free][:, fixed] @ vertices[fixed]))
    return vertices
