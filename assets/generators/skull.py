# SPDX-License-Identifier: GPL-3.0-or-later
"""The skull without its lower jaw, modelled from rounded solids under the skin, and the 22 skull landmarks."""

import numpy as np

from ...sim.anatomy.head import SurfacePoints
from ...sim.anatomy.landmark_names import SKULL
from ...sim.mesh import Mesh, edges
from ...sim.tissue.jaw import jaw_transform
from .mandible import Mandible, jaw_of, mandible_box
from .skull_arch import DentalArch
from .skull_depth import BoneSpace
from .skull_face import Cheekbone, Maxilla, canine_fossa
from .skull_field import carve, join, meet
from .skull_marks import skull_marks
from .skull_mesh import bone_mesh
from .skull_orbit import Nose, Orbit, opened
from .skull_vault import Vault, base_middle, foramen, joint, temporal_bone
from .teeth_places import tooth_places

#: mm kept between the skull and the mandible.
JOINT_GAP = 1.6

#: mm between the skull and the moving ramus, and the positions (opening, forward, side) that are kept free.
MOVING_GAP = 1.3
MOTION = (
    *((x, 0, 0) for x in (0.2, 0.4, 0.6, 0.8, 1.0)), (0, -1, 0), (0, 0.5, 0), (0, 1, 0), (0.4, 1, 0),
    *((x, 0, s) for x in (0, 0.5) for s in (-1, -0.5, 0.5, 1)), (0, 0.6, 1), (0, 0.6, -1),
)  # fmt: skip


class Skull:
    """The left half of the skull as a signed distance field: call it with points (n, 3) mm -> (n,) mm."""

    def __init__(self, space: BoneSpace, arch: DentalArch, jaw: Mandible):
        self.space, self.arch, self.jaw = space, arch, jaw
        self.marks = skull_marks(space)
        self.vault = Vault(space, self.marks)
        self.orbit, self.nose = Orbit(self.marks), Nose(space, self.marks)
        self.maxilla = Maxilla(space, self.marks, arch)
        self.cheekbone = Cheekbone(space, self.marks, arch)
        self.jaw_box = np.array(mandible_box(space))
        # Where the ramus goes as the jaw opens, comes forward and goes to either side.
        self.joint = jaw_of(space, jaw.arch.places[0])
        self.motion = [jaw_transform(self.joint, *pose) for pose in MOTION]

    def __call__(self, points):
        p = np.array(points)
        p[:, 0] = np.abs(p[:, 0])
        space, m = self.space, self.marks
        bone = self.vault.hollowed(p, self.vault.case(p))
        near = np.flatnonzero((bone < 60) & ((p[:, 1] < 20) | (p[:, 2] < 30)))
        bone[near] = self._face_and_base(p[near], bone[near], space, m)
        near = np.flatnonzero(bone < 12)
        bone[near] = meet(bone[near], space.too_shallow(p[near]), 2.5)
        low = near[p[near, 2] < m.floor + 6]
        bone[low] = self.nose.cleared(self.arch.on(bone[low], p[low], 15.0), p[low])
        near = near[((p[near] > self.jaw_box[0]) & (p[near] < self.jaw_box[1])).all(axis=1)]
        bone[near] = carve(bone[near], self.jaw(p[near]) - JOINT_GAP, 1.0)
        c = self.marks.condyle
        near = near[
            (np.abs(bone[near]) < 9)
            & (p[near, 0] > 22)
            & (np.abs(p[near, 1] - c[1] + 20) < 38)
            & (p[near, 2] > c[2] - 40)
        ]
        swept = np.full(len(near), np.inf)
        for rotation, translation in self.motion:
            swept = np.minimum(swept, self.jaw.upper((p[near] - translation) @ rotation))
        bone[near] = carve(bone[near], swept - MOVING_GAP, 1.0)
        return bone

    def _face_and_base(self, p, bone, space, m):
        bone = join(bone, self.vault.ridges(p), 12)
        bone = join(bone, base_middle(p, space, m), 6)
        bone = join(bone, temporal_bone(p, space, m), 5)
        bone = foramen(bone, p, space, m)
        bone = join(bone, self.vault.brow(p), 6)
        bone = join(bone, self.maxilla.body(p), 5)
        bone = canine_fossa(bone, p, space, m)
        bone = join(bone, self.cheekbone(p), 4)
        bone = joint(bone, p, space, m)
        return opened(bone, p, self.orbit, self.nose)


def make_skull(skin: Mesh, groups: dict[str, np.ndarray], landmarks: dict[str, np.ndarray]) -> Mesh:
    """The skull (without mandible) as one closed symmetric mesh of quads, its landmarks at their tissue depths."""
    space = BoneSpace(skin, groups, landmarks)
    places = tooth_places(skin, groups, landmarks)
    upper, lower = (DentalArch(space, places[k], rise) for k, rise in (("upper", 1), ("lower", -1)))
    field = Skull(space, upper, Mandible(space, lower))
    at = space.targets
    low = np.array([0, min(at["rhi"][1], at["g"][1]) - 8, upper.crest.min() - 6])
    high = np.array([at["eu_l"][0] + 8, at["op"][1] + 8, at["v"][2] + 8])
    brow, back = at["g"][2] + 12.0, at["po_l"][1] + 30.0

    def far(p):
        """The vault above the brow, and the back of the head."""
        return p[:, 2] - np.interp(p[:, 1], [at["g"][1], at["po_l"][1], back, back + 12], [brow, brow - 24, -8, -60])

    # Where the edge of the nasal aperture is thin.
    finer = ((0.0, 11.0, 3.4), (low[1], at["ans"][1] + 4.0, 3.2), (at["ans"][2] + 2.0, at["rhi"][2] + 8.0, 3.2))
    mesh = bone_mesh(field, low, high, 4.75, upper, far, 9.5, finer)
    names = [name for name in SKULL if name not in ("pg", "sl", "go_l", "go_r")]
    return space.snapped(mesh, names, reach=12.0)


def make_skull_landmarks(
    skin: Mesh, groups: dict[str, np.ndarray], landmarks: dict[str, np.ndarray], skull: Mesh, mandible: Mesh
) -> SurfacePoints:
    """The 22 skull landmarks as points on the two bones, where their targets touch them."""
    space = BoneSpace(skin, groups, landmarks)
    parts, corners, weights = [], [], []
    for name in SKULL:
        part = "mandible" if name.split("_")[0] in ("pg", "sl", "go") else "skull"
        mesh = {"skull": skull, "mandible": mandible}[part]
        middle = not name.endswith(("_l", "_r"))
        corner, weight = (_closest_on_midline if middle else _closest)(space.targets[name], mesh)
        parts.append(part)
        corners.append(corner)
        weights.append(weight)
    return SurfacePoints(SKULL, tuple(parts), np.array(corners, np.int32), np.array(weights))


def _closest_on_midline(point, mesh):
    """Corners (3,) and weights (3,) of the closest point of the mesh's edges on x = 0."""
    pairs = edges(mesh.faces)
    pairs = pairs[(mesh.vertices[pairs, 0] == 0).all(axis=1)]
    a, b = mesh.vertices[pairs[:, 0]], mesh.vertices[pairs[:, 1]]
    share = np.clip(((point - a) * (b - a)).sum(axis=1) / np.maximum(((b - a) ** 2).sum(axis=1), 1e-12), 0, 1)
    k = np.linalg.norm(a + share[:, None] * (b - a) - point, axis=1).argmin()
    return pairs[k][[0, 1, 1]], np.array([1 - share[k], share[k], 0.0])


def _closest(point, mesh):
    """Corners (3,) and weights (3,) of the closest point of a mesh (Ericson 2005, 5.1.5)."""
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    best = []
    edge_b, edge_c, to = b - a, c - a, point - a
    bb, bc, cc = (edge_b**2).sum(1), (edge_b * edge_c).sum(1), (edge_c**2).sum(1)
    pb, pc = (to * edge_b).sum(1), (to * edge_c).sum(1)
    area = np.maximum(bb * cc - bc * bc, 1e-12)
    v, w = (cc * pb - bc * pc) / area, (bb * pc - bc * pb) / area
    on = (v >= 0) & (w >= 0) & (v + w <= 1)
    best.append(np.stack([1 - v - w, v, w], axis=1))
    for i, j in ((0, 1), (1, 2), (2, 0)):
        corner = (a, b, c)
        along = corner[j] - corner[i]
        t = np.clip(((point - corner[i]) * along).sum(1) / np.maximum((along**2).sum(1), 1e-12), 0, 1)
        weight = np.zeros((len(a), 3))
        weight[:, i], weight[:, j] = 1 - t, t
        best.append(weight)
    best = np.stack(best)
    where = best[..., :1] * a + best[..., 1:2] * b + best[..., 2:] * c
    distance = np.linalg.norm(where - point, axis=2)
    distance[0, ~on] = np.inf
    kind, triangle = np.unravel_index(distance.argmin(), distance.shape)
    return mesh.triangles[triangle], best[kind, triangle]
