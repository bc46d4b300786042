# SPDX-License-Identifier: GPL-3.0-or-later
"""Flesh under the jaw, which goes where there is room: out.

The simulated tissue is a layer of skin over what lies deeper. Between the jaw and the throat that is a hand's breadth of
muscle, gland and tongue, as incompressible as water, and an opening jaw presses into it from above and in front: the
skin under the chin and behind the angles of the jaw bulges. To first order the flesh flows as a fluid without
vortices does. The surface of the jaw is strewn with sources as strong as it advances; the skin is free, so that the
pressure on it is none, and each source has its mirror image outside, a sink (Lamb, Hydrodynamics, 1932, chapter III).
At a plane skin, at depth h and distance r from a source of flux q, the flow outward is then

    u = q h / (2 pi r^3)

The mouth's side of the jaw gives room to air and is left out; inside its arch lie tongue and floor of the mouth, which
go with it, so it is taken for as solid as its convex hull. Every point of the skin is taken for the plane that touches
it there: on skin that bends round the jaw the sum is more than the jaw displaces, up to twice.
"""

import numpy as np
from scipy.spatial import ConvexHull

from ..anatomy.head import Head
from ..mesh import vertex_normals
from ..tissue.jaw import jaw_transform

SPACING = 2.0  # mm between sources
DEPTH = 6.0  # mm of tissue that spreads a source at least
UPWARD = 0.5  # component of a normal from which on a surface faces the mouth
#: mm: below the teeth flesh lies between bones and cannot give way into the mouth; from none to all of that.
RAMP = 12.0
#: Component of a normal that faces forward, where flow ends and where it begins to: in front of the jaw skin is tied to bone.
AHEAD = (0.7, 0.3)
BELOW, THROAT = 2.0, 8.0  # mm under the chin from which on skin is the throat's wherever it faces, and ramp of that
HELD = 7.0  # mm above the chin's lowest point, from which on down skin has flesh under it and no bone


def pushed_out(head: Head, displacement, opening: float) -> np.ndarray:
    """The displacement (n, 3) mm of the skin by a jaw open by ``opening``, 0..1, with at least the flow outward."""
    normals = vertex_normals(head.skin.vertices, head.skin.triangles)
    lacks = np.maximum(flow(head, normals, opening) - np.einsum("ij,ij->i", displacement, normals), 0)
    level = (head.parts["teeth_lower"].vertices @ upright(head)[0]).min()
    return displacement + (under(head, normals, level) * lacks)[:, None] * normals


def held_up(head: Head, displacement) -> np.ndarray:
    """The displacement (n, 3) mm without what lets the skin under the jaw sink: the flesh bears it."""
    normals = vertex_normals(head.skin.vertices, head.skin.triangles)
    sinking = np.minimum(np.einsum("ij,ij->i", displacement, normals), 0)
    return displacement - (under(head, normals, chin(head) + HELD) * sinking)[:, None] * normals


def under(head: Head, normals, level: float) -> np.ndarray:
    """(n,) 0..1: seen skin below the height ``level``, mm, that lies on flesh and not on the front of the jaw."""
    up, ahead = upright(head)
    height = head.skin.vertices @ up
    aside = np.clip((AHEAD[0] - normals @ ahead) / (AHEAD[0] - AHEAD[1]), 0, 1)
    throat = np.clip((chin(head) - BELOW - height) / THROAT, 0, 1)
    return np.clip((level - height) / RAMP, 0, 1) * np.maximum(aside, throat) * (np.asarray(head.groups["inner"]) < 0.5)


def upright(head: Head):
    """Unit vectors (3,) up the face, from the chin to the root of the nose, and forward."""
    marks = head.landmark_positions()
    up = (marks["n"] - marks["gn"]) * [0, 1, 1]
    up /= np.linalg.norm(up)
    return up, np.array([0, -up[2], up[1]])


def chin(head: Head) -> float:
    """Height of the chin's lowest point, mm."""
    return float(head.landmark_positions()["gn"] @ upright(head)[0])


def flow(head: Head, normals, opening: float) -> np.ndarray:
    """(n,) mm outward that the flesh flows at the skin, ``normals`` (n, 3), when the jaw opens by ``opening``."""
    points, out, area = jaw_surface(head)
    turn, shift = jaw_transform(head.jaw, opening)
    flux = np.einsum("ij,ij->i", points @ turn.T + shift - points, out) * area
    total = np.zeros(len(normals))
    for part in np.array_split(np.arange(len(points)), 1 + len(points) // 1000):
        apart = head.skin.vertices[:, None] - points[part]
        depth = np.maximum(np.einsum("ijk,ik->ij", apart, normals), 0)
        total += (depth / (np.einsum("ijk,ijk->ij", apart, apart) + DEPTH**2) ** 1.5) @ flux[part]
    return total / (2 * np.pi)


def jaw_surface(head: Head):
    """Points (s, 3) mm, even over the hull of the jaw below the edge of its teeth but for its upper side, with their
    normals (s, 3) and the area, mm², of each."""
    bone = head.parts["mandible"].vertices
    up = upright(head)[0]
    bone = bone[bone @ up < (head.parts["teeth_lower"].vertices @ up).max()]
    hull = ConvexHull(bone)
    corners, normals = bone[hull.simplices], hull.equations[:, :3]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    lower = normals @ up < UPWARD
    corners, normals, area = corners[lower], normals[lower], area[lower]
    rng = np.random.default_rng(0)
    count = int(area.sum() / SPACING**2)
    pick = rng.choice(len(area), count, p=area / area.sum())
    points = np.einsum("sk,skx->sx", rng.dirichlet(np.ones(3), count), corners[pick])
    return points, normals[pick], area.sum() / count
