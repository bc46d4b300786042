# SPDX-License-Identifier: GPL-3.0-or-later
"""The skull without its lower jaw, modelled from rounded solids under the skin, and the 22 skull landmarks."""

import numpy as np

from ...sim.anatomy.head import SurfacePoints
from ...sim.anatomy.landmark_names import SKULL
from ...sim.mesh import Mesh
from .mandible import mandible_box, mandible_field
from .skull_depth import CLEARANCE, BoneSpace
from .skull_field import carve, curve, ellipsoid, join, meet, plate, tube
from .skull_nets import surface_nets

#: Corners of the upper dental arch as seen from above: mm lateral of the midline, mm behind the incisors.
ARCH = np.array([(0, 0), (8.5, 1.6), (16.5, 7.5), (21, 15), (24, 23), (26.5, 32), (28, 41), (28, 46)], float)

#: From the outer corner of the eye to the side rim of the orbit, mm.
RIM_SIDE = np.array([4.5, 11.0, 2.5])

#: mm kept between the skull and the mandible.
JOINT_GAP = 2.2


def malar_centre(space: BoneSpace) -> np.ndarray:
    """(3,) mm, the middle of the left cheekbone's body."""
    rim = space.landmarks["ex_l"] + RIM_SIDE
    return np.array([rim[0] - 1.5, rim[1] + 1.0, space.targets["or_l"][2] - 8.0])


def skull_field(space: BoneSpace):
    """The skull as a signed distance field: a function of points (n, 3) mm -> (n,) mm (see `skull_field`)."""
    at, skin = space.targets, space.landmarks
    g, n, rhi, ans, zy, po = (at[k] for k in ("g", "n", "rhi", "ans", "zy_l", "po_l"))
    into = {k: at[k] - space.normals[k] * 4.0 for k in ("os_l", "or_l", "zy_l", "g", "n", "rhi")}
    rim_side = skin["ex_l"] + RIM_SIDE
    eye = (skin["en_l"] + skin["ex_l"]) / 2
    middle = np.array([0.0, (g[1] + at["op"][1]) / 2, 0.36 * at["v"][2]])
    radii = np.array([at["eu_l"][0] + 3, (at["op"][1] - g[1]) / 2 + 4, at["v"][2] - middle[2] + 4])
    base = po[2] - 18.0

    alveolus = np.column_stack([ARCH[:, 0], at["pr"][1] + 4.5 + ARCH[:, 1]])
    roof = np.maximum(space.mouth_limit(alveolus, +1) + CLEARANCE + 4.0, at["pr"][2] + 3.0)
    ridge = curve(np.column_stack([alveolus, roof]), 60)
    top = ridge + [0, 0, 8]
    rise = np.linspace(0, 1, 8)[:, None, None]
    alveolar = (ridge[None] + rise * (top - ridge)[None]).reshape(-1, 3)
    ridges = plate(alveolar, np.tile(np.interp(np.arange(60), [0, 40, 59], [4.8, 4.8, 3.4]), 8))

    malar = malar_centre(space)
    crest = np.array([alveolus[5, 0] + 2, alveolus[5, 1] - 2, roof[5] + 3.0])
    # Nose bones: a roof from the midline down to the frontal processes of the maxilla.
    ridge_line = curve([at["n"] + [0, 4.6, 5.0], at["n"] + [0, 4.4, 0], rhi - 4.2 * space.normals["rhi"]], 20)
    nose_side = np.array([[8.0, n[1] + 7, n[2] + 1], [9.5, n[1] + 7, (n[2] + rhi[2]) / 2],
                          [13.2, (n[1] + ans[1]) / 2 + 6, rhi[2] - 9.0], [15.0, ans[1] + 4, ans[2] + 6]])  # fmt: skip
    eave = curve(nose_side[:3], 20)
    across = np.linspace(0, 1, 12)[:, None, None]
    shell = ridge_line + across * (eave - ridge_line) + np.array([0, -1.2, 0.6]) * 4 * across * (1 - across)
    bridge = plate(shell.reshape(-1, 3), np.full(12 * 20, 4.2))

    rim = np.array([[11.0, n[1] + 6, eye[2]], rim_side, at["os_l"], at["or_l"]])
    rim_normal = np.linalg.svd(rim - rim.mean(axis=0))[2][-1]
    rim_normal = rim_normal * np.sign(rim_normal[1])

    def behind_rim(p):
        return 3.0 - (p - rim.mean(axis=0)) @ rim_normal

    jaw = mandible_field(space)
    jaw_box = np.array(mandible_box(space))

    def braincase(p):
        case = ellipsoid(p, middle, radii)
        case = meet(case, base - p[:, 2], 25)
        nuchal = np.array([0.0, 0.62, -0.78])
        case = meet(case, (p - [0, po[1] + 45, base]) @ nuchal, 25)
        front = np.array([0.0, -0.62, -0.78])
        case = meet(case, (p - [0, po[1] - 42, base]) @ front, 25)
        # Temples: room for the temporal muscle.
        temple = ellipsoid(p, [zy[0] + 32, rim_side[1] + 26, rim_side[2] + 6], (44, 38, 50))
        return carve(case, temple, 18)

    def field(points):
        p = points * [1, 1, 1]
        p[:, 0] = np.abs(p[:, 0])
        bone = braincase(p)
        # Middle of the base: sphenoid and pterygoid process.
        bone = join(bone, ellipsoid(p, [0, po[1] - 42, base + 14], (24, 26, 22)), 10)
        bone = carve(bone, ellipsoid(p, [zy[0] - 12, zy[1] - 14, base - 2], (17, 21, 28)), 8)
        bone = join(bone, tube(p, [[14, po[1] - 40, base + 2], [15, po[1] - 41, base - 16]], [6, 3.5]), 5)
        # Brow: from the glabella along the upper rim of the orbit down to the cheekbone.
        brow = tube(p, [into["g"] + [0, 1, -1], [14, into["os_l"][1] - 1.0, into["g"][2] - 1], into["os_l"],
                        [rim_side[0] - 6, (into["os_l"][1] + rim_side[1]) / 2 - 1, into["os_l"][2] - 3],
                        rim_side + [0, 0, 6], rim_side + [0.5, 0, -6]], [6.5, 5.5, 5.5, 5.2, 5.0, 4.6])  # fmt: skip
        bone = join(bone, brow, 8)
        # Maxilla: body, alveolar ridge, palate.
        upper = ellipsoid(p, [21, at["or_l"][1] + 14, (at["or_l"][2] + ans[2]) / 2 - 1], (17, 17, 19))
        upper = join(upper, ridges(p), 7)
        upper = join(upper, ellipsoid(p, [0, alveolus[4, 1] - 2, roof[2] + 4], (25, 26, 5)), 5)
        bone = join(bone, upper, 6)
        # Cheekbone and arch.
        cheek = tube(p, [rim_side + [0, 0.5, -4], malar + [0.5, 0, 8], malar, into["or_l"] + [2, 1.0, -2]],
                     [4.6, 5.5, 9.0, 5.5])  # fmt: skip
        cheek = join(cheek, tube(p, [malar + [-2, 2, -4], crest], [8.0, 6.0]), 6)
        arch = tube(p, [malar + [3, 2, -1], [zy[0] - 6.5, (malar[1] + zy[1]) / 2 - 4, malar[2] + 2.0],
                        into["zy_l"] + [0.4, -6, 0], into["zy_l"] + [0.4, 6, 1.0], [zy[0] - 5, po[1] - 10, po[2] + 4.5],
                        [po[0] - 1, po[1] - 2, po[2] + 6]],
                    [7.5, 5.4, 4.8, 4.8, 5.2, 6.5], ((1, 0, 0), 1.35))  # fmt: skip
        bone = join(join(bone, cheek, 6), arch, 5)
        # Temporal bone around the ear canal.
        bone = join(bone, ellipsoid(p, [po[0] - 9.5, po[1] - 1, po[2] + 4], (10, 15, 13)), 6)
        # Mastoid process behind the ear canal.
        bone = join(
            bone, tube(p, [[po[0] - 4, po[1] + 16, po[2] + 2], [po[0] - 8, po[1] + 11, po[2] - 20]], [11, 5]), 7
        )
        # Orbits in walls of their own; the nasal aperture; the nose bones over it.
        orbit = _orbit(p, eye)
        bone = join(bone, meet(orbit - 6.5, behind_rim(p), 5), 5)
        bone = carve(bone, orbit, 4.0)
        t = np.clip((rhi[2] + 4 - p[:, 2]) / (rhi[2] + 4 - ans[2]), 0, 1)
        wide = 4.0 + 8.5 * np.sin(t * np.pi * 0.62) ** 0.9
        nose = np.maximum(p[:, 0] - wide, np.maximum(p[:, 2] - rhi[2] - 3, ans[2] + 1.5 - p[:, 2]))
        nose = meet(nose, p[:, 1] - (ans[1] + 32), 4)
        bone = carve(bone, nose, 2.5)
        bone = join(bone, bridge(p), 4)
        side = tube(p, nose_side, [5.0, 6.0, 6.6, 5.6])
        bone = join(bone, side, 4)
        bone = join(bone, tube(p, [[0, ans[1] + 11, ans[2] - 4], [0, ans[1] + 3.2, ans[2] - 1.5]], [4.5, 3.4]), 4)
        bone = carve(bone, ellipsoid(p, [0, po[1] + 22, base - 2], (14, 17, 12)), 5)
        near = np.flatnonzero(bone < 12)
        bone[near] = meet(bone[near], space.too_shallow(p[near]), 4)
        near = near[((p[near] > jaw_box[0]) & (p[near] < jaw_box[1])).all(axis=1)]
        bone[near] = carve(bone[near], jaw(p[near]) - JOINT_GAP, 1.5)
        return bone

    return field


def _orbit(p, eye):
    """The orbit: a rounded four-sided cone, its axis turned inward behind the middle of the eye opening ``eye``."""
    depth = p[:, 1] - (eye[1] - 6)
    share = np.clip(depth / 48, -0.35, 0.93)[:, None]
    middle = np.array([eye[0] - 1.0, eye[2] + 1.5]) * (1 - share) + np.array([13.5, eye[2] + 3.0]) * share
    half = np.array([19.5, 17.0]) * (1 - share**2 * np.sign(share)) + np.array([3.0, 3.0]) * share
    ring = np.abs((p[:, [0, 2]] - middle) / np.maximum(half, 2.0))
    cone = ((ring**2.5).sum(1) ** 0.4 - 1) * half.min(1)
    return meet(cone, depth - 40, 8)


def make_skull(skin: Mesh, groups: dict[str, np.ndarray], landmarks: dict[str, np.ndarray]) -> Mesh:
    """The skull (without mandible) as one closed symmetric mesh of quads, its landmarks at their tissue depths."""
    space = BoneSpace(skin, groups, landmarks)
    at = space.targets
    low = np.array([-at["eu_l"][0] - 8, min(at["rhi"][1], at["g"][1]) - 8, at["pr"][2] - 10])
    high = np.array([at["eu_l"][0] + 8, at["op"][1] + 8, at["v"][2] + 8])
    mesh = surface_nets(skull_field(space), low, high, 5.0, fine=((low[1], 14), (low[2], at["g"][2] + 4)), growth=9.0)
    names = [name for name in SKULL if name not in ("pg", "sl", "go_l", "go_r")]
    return space.kept_inside(space.snapped(mesh, names, reach=12.0))


def make_skull_landmarks(
    skin: Mesh, groups: dict[str, np.ndarray], landmarks: dict[str, np.ndarray], skull: Mesh, mandible: Mesh
) -> SurfacePoints:
    """The 22 skull landmarks as points on the two bones, where their targets touch them."""
    space = BoneSpace(skin, groups, landmarks)
    parts, corners, weights = [], [], []
    for name in SKULL:
        part = "mandible" if name.split("_")[0] in ("pg", "sl", "go") else "skull"
        mesh = {"skull": skull, "mandible": mandible}[part]
        corner, weight = _closest(space.targets[name], mesh)
        parts.append(part)
        corners.append(corner)
        weights.append(weight)
    return SurfacePoints(SKULL, tuple(parts), np.array(corners, np.int32), np.array(weights))


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
