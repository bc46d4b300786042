# SPDX-License-Identifier: GPL-3.0-or-later
"""How deep the surfaces of an acting head reach into each other: told from the meshes themselves.

The skin is drawn, subdivided and on the limit surface, and every vertex of it is measured: not the points that a solver
looks at, nor by its means. Lids against the eyeball with its cornea; lips and the lining of lips and cheeks against the
crowns of the teeth (inside or not by winding number); each lip against the triangles of the other; fascia against skull and
mandible. What is beyond the depth at rest counts. Gums are left out: the lining has grown onto them.

A point of a lip is in the other lip if it lies behind the nearest point of it, in flesh, and half the way there is in flesh
too (in a fold of its own lip it is not): by the winding number of all of the skin, which is 1 in flesh and 0 in the air, less
what the open neck and the eyes let out. Only so can be told apart what
came through and what has the flesh between: round the corner of the mouth the outside of one lip lies behind the lining of
the other, and on the other side of it.
"""

import numpy as np

from ..adapt.closest import Surface
from ..anatomy.head import Head
from ..anatomy.inside import inside
from ..anatomy.teeth import crowns
from ..mesh import vertex_normals
from ..mesh_subdivision import smoother
from ..tissue.energy import Pose
from ..tissue.eye_surface import eyeball_radius
from ..tissue.gingiva import attached
from ..tissue.solver import rest_state
from ..tissue.structures import Model

#: Pairs of surfaces that are measured.
NAMES = ("lip_lip", "lid_eyeball", "skin_teeth", "fascia_skull")
#: mm: lips look for each other so far, what lies so far behind may be in the other; how far before the skin it is looked
#: whether there is flesh.
_FAR, _BEHIND, _OFF = 4.0, 0.02, 0.01


class Ruler:
    """Measures poses of one head, drawn with its skin subdivided ``levels`` times."""

    def __init__(self, head: Head, model: Model, rest: Pose, levels: int = 2):
        """rest : the pose in which nothing is asked of the face."""
        self.model, n = model, model.count
        self.rows, quads = smoother(head.skin.faces, n, levels)
        self.triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
        group = {k: self.rows @ np.asarray(head.groups[k], float) for k in ("lip_upper", "lip_lower", "mouth_bag")}
        self.lips = [np.flatnonzero(group[k] > 0.3) for k in ("lip_upper", "lip_lower")]
        self.patches = [
            self.triangles[(group[k] > 0.3)[self.triangles].all(axis=1)] for k in ("lip_upper", "lip_lower")
        ]
        free = self.rows @ attached(head)[0] < 0.3
        self.mouth = np.flatnonzero((np.max(list(group.values()), axis=0) > 0.05) & free)
        self.teeth = {}
        for part in ("teeth_upper", "teeth_lower"):
            mesh = head.parts[part]
            enamel = np.zeros(len(mesh.vertices), bool)
            used = mesh.faces[mesh.material == 0]
            enamel[used[used >= 0]] = True
            crown = mesh.triangles[(enamel & crowns(mesh))[mesh.triangles].all(axis=1)]
            self.teeth[part] = mesh.vertices, crown, mesh.triangles[enamel[mesh.triangles].all(axis=1)]
        bony = model.layers.bony & model.layers.free[:n]
        self.bones = {}
        for part, low in (("skull", False), ("mandible", True)):
            mesh = head.parts[part]
            column = np.flatnonzero(bony & ((model.layers.mandible > 0.5) == low))
            self.bones[part] = column, Surface(mesh.vertices, mesh.triangles), mesh
        self.rest = self.depths(rest_state(model).positions, rest)

    def depths(self, positions, pose: Pose) -> dict:
        """Pair of `NAMES` -> two arrays of depths (k,) mm, as far as they are known; less than nothing is apart: the upper
        lip's points and the lower's, the left eye and the right, the upper row of teeth and the lower, skull and mandible.

        positions : (3 n, 3) mm, all nodes
        """
        n = self.model.count
        skin = self.rows @ positions[:n]
        out = {name: [] for name in NAMES}
        normals = vertex_normals(skin, self.triangles)
        for own, other in ((0, 1), (1, 0)):
            out["lip_lip"].append(self._behind(skin, normals, self.lips[own], self.patches[other]))
        for lids in self.model.lids:
            away = np.linalg.norm(skin - lids.eye.centre, axis=1)
            depth = np.full(len(skin), -1.0)
            near = np.flatnonzero(away < lids.eye.radius + 3)
            depth[near] = eyeball_radius(lids, skin[near], pose.gaze_of(lids.side)) - away[near]
            out["lid_eyeball"].append(depth)
        for part, (vertices, crown, whole) in self.teeth.items():
            if part == "teeth_lower":
                vertices = vertices @ pose.rotation.T + pose.translation
            out["skin_teeth"].append(self._within(skin, self.mouth, vertices, crown, whole))
        for part, (column, surface, mesh) in self.bones.items():
            points = positions[n + column]
            if part == "mandible":
                points = (points - pose.translation) @ pose.rotation
            found = surface.closest(points, 8.0)
            sign = np.where(inside(points, mesh.vertices, mesh.triangles), 1, -1)
            out["fascia_skull"].append(np.where(found.found, sign * found.distance, -1.0))
        return out

    def _behind(self, skin, normals, rows, patch):
        used, local = np.unique(patch, return_inverse=True)
        found = Surface(skin[used], local.reshape(patch.shape)).closest(skin[rows], _FAR)
        depth = np.full(len(rows), -1.0)
        at = np.flatnonzero(found.found)
        at = at[np.einsum("ij,ij->i", skin[rows[at]] - found.points[at], found.normals[at]) < -_BEHIND]
        for share in (0.0, 0.5):
            place = (
                skin[rows[at]] + share * (found.points[at] - skin[rows[at]]) + (1 - share) * _OFF * normals[rows[at]]
            )
            at = at[inside(place, skin, self.triangles)] if len(at) else at
        depth[at] = found.distance[at]
        return depth

    @staticmethod
    def _within(skin, rows, vertices, crown, whole):
        low, high = vertices[crown].min(axis=(0, 1)), vertices[crown].max(axis=(0, 1))
        depth = np.full(len(rows), -1.0)
        at = np.flatnonzero(((skin[rows] > low) & (skin[rows] < high)).all(axis=1))
        if len(at):
            lost = at[inside(skin[rows[at]], vertices, whole)]
            if len(lost):
                depth[lost] = Surface(vertices, crown).closest(skin[rows[lost]]).distance
        return depth

    def __call__(self, positions, pose: Pose) -> dict:
        """Pair of `NAMES` -> mm of the deepest, beyond rest."""
        now = self.depths(positions, pose)
        return {
            name: max(
                float((d - np.maximum(r, 0)).max(initial=0.0)) for d, r in zip(now[name], self.rest[name], strict=True)
            )
            for name in NAMES
        }

    def lip_gap(self, positions) -> float:
        """mm between the lips where they are nearest to each other."""
        skin = self.rows @ positions[: self.model.count]
        return float(Surface(skin, self.patches[1]).closest(skin[self.lips[0]]).distance.min())
