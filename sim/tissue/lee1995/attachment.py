# SPDX-License-Identifier: GPL-3.0-or-later
"""Which fascia each muscle pulls, and how: muscles of a head as the vectors and chains of 3.4, 3.5 and 5.

"The face construction algorithm determines the nodes affected by each muscle in a precomputation step."
"""

import numpy as np
from scipy.spatial import cKDTree

from ...anatomy.head import Head, Muscle
from ...mesh import vertex_normals
from ..muscle_field import JAW_MUSCLES, LID_MUSCLES, base_name
from ..structures import Layers
from . import muscles, piecewise, pucker
from .structures import Attachments

#: The sphincters of the lips, as `Control.lips` counts them.
LIPS = ("orbicularis_oris_upper", "orbicularis_oris_lower")
#: A muscle whose middle line is longer than its chord by this share is a chain of segments.
_BENT = 0.04
_SEGMENTS = 4
#: How far tendons reach beside the belly until Theta_2 is 0: as far again as it is wide, at most this, mm.
_BESIDE = 8.0
#: Shares of a sphincter's force: along its fibres, pursing, protruding (the lips only).
_LIPS, _EYE = (0.45, 0.35, 1.0), (0.5, 0.5, 0.0)


def build_attachments(head: Head, layers: Layers, table: dict) -> Attachments:
    """Every muscle's force on fascia at activation 1, before calibration. table : as `tissue.model.strengths`"""
    n = len(layers.area)
    spare = _spare(head)
    usable = np.flatnonzero(layers.free[:n] & (spare > 0.02))
    share = spare[usable, None]
    fascia = layers.nodes[n : 2 * n]
    normals = vertex_normals(fascia, head.skin.triangles)
    parts = []
    for k, muscle in enumerate(head.muscles):
        base = base_name(muscle.name)
        if base in JAW_MUSCLES or base in LID_MUSCLES:
            continue
        force, forward = muscle_force(muscle, fascia[usable], normals[usable])
        hit = np.flatnonzero(np.linalg.norm(share * force, axis=1) > 0.02)
        many = np.ones(len(hit))
        tie, lip = many * (muscle.origin == "mandible"), many * (LIPS.index(base) if base in LIPS else -1)
        parts.append((k * many, usable[hit], (share * force)[hit], tie, lip, (share * forward)[hit]))
    none = [np.zeros(0)] * 2 + [np.zeros((0, 3))] + [np.zeros(0)] * 2 + [np.zeros((0, 3))]
    owner, column, force, tie, lip, forward = (np.concatenate(x) for x in zip(*(parts or [none]), strict=True))
    goals = [float(table.get(base_name(m.name), {}).get("excursion_mm", 4.0)) for m in head.muscles]
    return Attachments(
        names=tuple(m.name for m in head.muscles),
        owner=owner.astype(int),
        column=column.astype(int),
        force=force,
        tie=tie,
        lip=lip.astype(int),
        forward=forward,
        strength=np.zeros(len(goals)),
        excursion=np.array(goals, float),
    )


def muscle_force(muscle: Muscle, points: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Force of ``muscle`` on fascia at ``points`` (k, 3) with outward ``normals``, of unit size where it is full, and the
    protruding part of it, both (k, 3)."""
    width = 0.5 * muscle.width + min(muscle.width, _BESIDE)
    if muscle.kind == "sphincter":
        return _sphincter(muscle, points, normals, width)
    path = muscle.path[::-1]  # from the free end to the fixed one
    chord = np.linalg.norm(path[-1] - path[0])
    length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
    if length < (1 + _BENT) * chord:
        force = muscles.muscle_forces(points, path[0], path[-1], _normals(path[[0, -1]], points, normals)[0], width)
    else:
        chain = _resampled(path, _SEGMENTS)
        force = piecewise.muscle_forces(points, chain, _normals(chain, points, normals), width)
    return force, np.zeros_like(force)


def _sphincter(muscle, points, normals, width):
    """Two chains that start far apart and end where the ring is fixed: at the inner corner of the eye, in the middle of
    a lip; with the forces of section 5 across them."""
    path = muscle.path
    along, purse, protrude = _EYE if muscle.ring else _LIPS
    fixed = int(np.argmin(np.abs(path[:, 0]))) if muscle.ring else len(path) // 2
    force, near = np.zeros_like(points), np.zeros(len(points))
    for half in (path[: fixed + 1], path[fixed:][::-1]):
        chain = _resampled(half, _SEGMENTS)
        across = _normals(chain, points, normals)
        force += along * piecewise.muscle_forces(points, chain, across, width)
        near = np.maximum(near, piecewise.nearness(points, chain, across, width))
    centre = muscle.centre if muscle.centre is not None else path.mean(axis=0)
    forward = np.array([0.0, -1.0, 0.0])
    if muscle.ring and (near > 0.5).any():
        forward = normals[near > 0.5].mean(axis=0)
        forward /= np.linalg.norm(forward)
    extent = np.abs(path - centre).max(axis=0)
    half = np.maximum(extent, 0.25 * extent.max())
    pushed = protrude * near[:, None] * pucker.protruding(points, centre, forward, half.max())
    return force + purse * near[:, None] * pucker.pursing(points, centre, forward, half) + pushed, pushed


def _resampled(path, count):
    """(count + 1, 3) points at equal distances along ``path`` (p, 3)."""
    at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    want = np.linspace(0, at[-1], count + 1)
    return np.stack([np.interp(want, at, path[:, axis]) for axis in range(3)], axis=1)


def _normals(chain, points, normals):
    """(N, 3) unit normals of the segments of ``chain``: the fascia's, made square to the segment."""
    middle = (chain[1:] + chain[:-1]) / 2
    near = cKDTree(points).query(middle, min(8, len(points)))[1].reshape(len(middle), -1)
    normal = normals[near].mean(axis=1)
    way = np.diff(chain, axis=0)
    way = way / np.linalg.norm(way, axis=1, keepdims=True)
    normal = normal - np.einsum("ij,ij->i", normal, way)[:, None] * way
    return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)


def _spare(head: Head):
    """(n,) 0 where skin has no muscle of its own: lids are turned as they are (4.2), and what lines
    mouth, nostrils and sockets goes with the skin."""
    n = len(head.skin.vertices)
    zero = np.zeros(n)
    lid = np.max([np.asarray(head.groups.get(f"lid_{u}_{s}", zero)) for u in ("upper", "lower") for s in "lr"], axis=0)
    return np.clip(1 - lid, 0, 1) ** 2 * (np.asarray(head.groups.get("inner", zero)) < 0.5)
