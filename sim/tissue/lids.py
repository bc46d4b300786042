# SPDX-License-Identifier: GPL-3.0-or-later
"""Lids slide over the eyeball: every lid vertex keeps its place along the lid and its height over the eye and turns
about the axis from the inner to the outer corner. At closure 1 both margins meet on one line, most of the way down.
"""

import numpy as np
from scipy.interpolate import PchipInterpolator

from ..anatomy.head import Eye, Head
from ..mesh import edges
from .layers import Layers
from .structures import Lids

#: Share of the opening that the lower lid covers in a blink (the upper lid does the rest).
LOWER_SHARE = 0.12
#: Closed lids press on each other: rad beyond the first touch, against the rounding of their edges.
_SEAL = 0.012
#: rad between the margins of an open eye (11 mm on a ball of 12 mm), and how much of it a full levator restores to an
#: eye that was scanned closed, per share by which it widens an open one.
_OPEN, _WAKE = 0.9, 3.2


def eye_profile(vertices: np.ndarray, eye: Eye) -> tuple[np.ndarray, np.ndarray]:
    """Angle from the gaze (b,) rad and eyeball radius (b,) mm there: the cornea stands out of the sphere."""
    rel = vertices - eye.centre
    radius = np.linalg.norm(rel, axis=1)
    angle = np.arccos(np.clip(rel @ eye.gaze / np.maximum(radius, 1e-9), -1, 1))
    grid = np.linspace(0, np.pi, 64)
    out = np.full(len(grid), eye.radius)
    step = grid[1]
    for k, g in enumerate(grid):
        near = np.abs(angle - g) < 1.2 * step
        if near.any():
            out[k] = max(eye.radius, radius[near].max())
    return grid, np.minimum(out, 1.25 * eye.radius)


def _margin(along, elevation, corners):
    """The margin as a function of the place along the lid, through both corners (2, 2) of the eye."""
    (a0, e0), (a1, e1) = corners
    inside = (along > a0 + 0.3) & (along < a1 - 0.3)
    order = np.argsort(along[inside])
    x, y = along[inside][order], elevation[inside][order]
    # vertices almost above each other become one
    step = np.concatenate([[0], np.cumsum(np.diff(x) > 0.4)]).astype(int) if len(x) else np.zeros(0, int)
    count = np.maximum(np.bincount(step), 1)
    x, y = (np.bincount(step, values) / count for values in (x, y)) if len(x) else (x, y)
    return PchipInterpolator(np.concatenate([[a0], x, [a1]]), np.concatenate([[e0], y, [e1]]))


def build_lids(head: Head, layers: Layers, side: str) -> Lids | None:
    """The lids of one eye (``"l"`` or ``"r"``), or None where the head has no lid skin there."""
    eye = head.eyes[0 if side == "l" else 1]
    v = head.skin.vertices
    upper_group = np.asarray(head.groups.get(f"lid_upper_{side}", np.zeros(len(v))), float)
    lower_group = np.asarray(head.groups.get(f"lid_lower_{side}", np.zeros(len(v))), float)
    share = np.maximum(upper_group, lower_group)
    column = np.flatnonzero((share > 0.01) & layers.free[: len(v)])
    marks = head.landmark_positions()
    if len(column) < 8 or f"en_{side}" not in marks:
        return None
    en, ex = marks[f"en_{side}"], marks[f"ex_{side}"]
    axis = (ex - en) / np.linalg.norm(ex - en)
    forward = eye.gaze - (eye.gaze @ axis) * axis
    forward /= np.linalg.norm(forward)
    up = np.cross(forward, axis)
    if up[2] < 0:
        up = -up

    def place(p):
        rel = p - eye.centre
        f, u = rel @ forward, rel @ up
        return rel @ axis, np.arctan2(u, f), np.hypot(u, f)

    along, elevation, radius = place(v[column])
    upper = upper_group[column] >= lower_group[column]
    inner = np.asarray(head.groups.get("inner", np.zeros(len(v))), float)[column] > 0.5
    (a0, e0, _), (a1, e1, _) = place(en), place(ex)
    corners = (a0, e0), (a1, e1)
    # the margin is where the outer lid ends and its back begins
    back = np.asarray(head.groups.get("inner", np.zeros(len(v)))) > 0.5
    pair = edges(head.skin.faces)
    turn = np.unique(np.concatenate([pair[back[pair[:, 1]], 0], pair[back[pair[:, 0]], 1]]))
    edge = np.isin(column, turn) & ~inner & (share[column] > 0.5)
    curves = []
    for is_upper, name in ((True, "ps"), (False, "pi")):
        rows = edge & (upper == is_upper)
        if rows.sum() >= 3:
            curves.append(_margin(along[rows], elevation[rows], corners))
        else:
            middle = place(marks[f"{name}_{side}"])
            curves.append(_margin(np.array([middle[0]]), np.array([middle[1]]), corners))
    within = np.clip(along, a0, a1)
    opening = np.clip(curves[0](within) - curves[1](within), 0, 1.4)
    across = np.clip((2 * within - a0 - a1) / (a1 - a0), -1, 1)
    missing = np.clip(_OPEN * (1 - across**2) - opening, 0, None) * float(opening.max() < 0.5 * _OPEN)
    # weight: 1 at the margin, 0 where the lid's own group ends; the groups are taken as drawn, scaled to reach 1
    weight = np.clip(share[column] / max(np.percentile(share[column], 90), 1e-3), 0, 1)
    off = np.abs(elevation - np.where(upper, curves[0](within), curves[1](within)))
    weight = np.maximum(weight, np.clip(1.4 - off / 0.25, 0, 1) * ((along > a0) & (along < a1)))
    profile_angle, profile = eye_profile(head.parts[f"eye_{side}"].vertices, eye)
    distance = np.linalg.norm(v - eye.centre, axis=1)
    touching = np.flatnonzero((distance < 1.6 * eye.radius) & layers.free[: len(v)])
    rel = v[touching] - eye.centre
    angle = np.arccos(np.clip(rel @ eye.gaze / np.maximum(distance[touching], 1e-9), -1, 1))
    clearance = np.minimum(distance[touching] - np.interp(angle, profile_angle, profile), 0.15)
    return Lids(
        side=side,
        eye=eye,
        column=column,
        weight=weight,
        axis=axis,
        forward=forward,
        up=up,
        along=along,
        elevation=elevation,
        radius=radius,
        upper=upper,
        hold=weight**2 * np.where(inner, 0.5, 1.0),
        opening=opening,
        missing=missing,
        contact_column=touching,
        clearance=clearance,
        profile_angle=profile_angle,
        profile=profile,
    )


def gaze_direction(eye: Eye, gaze: np.ndarray) -> np.ndarray:
    """(3,) unit vector: the rest gaze turned by ``gaze`` rad to the subject's left and up."""
    return gaze_rotation(gaze) @ eye.gaze


def gaze_rotation(gaze: np.ndarray) -> np.ndarray:
    """(3, 3): first up about the left-right axis, then left about the vertical."""
    left, rise = float(gaze[0]), float(gaze[1])
    c, s = np.cos(left), np.sin(left)
    yaw = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    c, s = np.cos(-rise), np.sin(-rise)
    pitch = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    return yaw @ pitch


def eyeball_radius(lids: Lids, points: np.ndarray, gaze: np.ndarray) -> np.ndarray:
    """(k,) mm: how far the eyeball reaches from its centre toward ``points`` (k, 3)."""
    rel = points - lids.eye.centre
    size = np.maximum(np.linalg.norm(rel, axis=1), 1e-9)
    angle = np.arccos(np.clip(rel @ gaze_direction(lids.eye, gaze) / size, -1, 1))
    return np.interp(angle, lids.profile_angle, lids.profile)


def lid_targets(lids: Lids, upper: float, lower: float, gaze: np.ndarray) -> np.ndarray:
    """(v, 3) mm: where the lid vertices want to be. upper, lower: 0 rest, 1 closed, negative wider.

    The upper lid follows a vertical gaze; the lower one follows a downward gaze by half.
    """
    follow = float(gaze[1])
    seal = _SEAL * np.clip(upper, 0, 1) ** 4 * (lids.opening > 0)
    travel = (1 - LOWER_SHARE) * lids.opening + (_WAKE * lids.missing if upper < 0 else 0.0)
    turn_upper = -upper * travel - seal + 0.55 * follow * np.minimum(lids.opening / 0.5, 1)
    turn_lower = lower * LOWER_SHARE * lids.opening + (0.3 * min(follow, 0) + 0.1 * max(follow, 0)) * np.minimum(
        lids.opening / 0.5, 1
    )
    # never past each other: the meeting line limits both
    closed = turn_lower - turn_upper
    most = lids.opening + _SEAL
    over = np.where(closed > most, most / np.maximum(closed, 1e-9), 1.0)
    angle = lids.elevation + lids.weight * np.where(lids.upper, turn_upper, turn_lower) * over
    frame = lids.along[:, None] * lids.axis

    def at(radius):
        plane = np.cos(angle)[:, None] * lids.forward + np.sin(angle)[:, None] * lids.up
        return lids.eye.centre + frame + radius[:, None] * plane

    target = at(lids.radius)
    rel = target - lids.eye.centre
    size = np.linalg.norm(rel, axis=1)
    rest = at_rest(lids) - lids.eye.centre
    rest_size = np.linalg.norm(rest, axis=1)
    gap = np.minimum(rest_size - eyeball_radius(lids, lids.eye.centre + rest, np.zeros(2)), 0.15)
    need = eyeball_radius(lids, target, gaze) + gap
    return lids.eye.centre + rel * (np.maximum(size, need) / np.maximum(size, 1e-9))[:, None]


def at_rest(lids: Lids) -> np.ndarray:
    """(v, 3) mm, the lid vertices as scanned."""
    plane = np.cos(lids.elevation)[:, None] * lids.forward + np.sin(lids.elevation)[:, None] * lids.up
    return lids.eye.centre + lids.along[:, None] * lids.axis + lids.radius[:, None] * plane
