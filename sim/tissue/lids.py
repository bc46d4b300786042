# SPDX-License-Identifier: GPL-3.0-or-later
"""Lids slide over the eyeball: every lid vertex keeps its place along the lid and its height over the eye and turns
about the axis from the inner to the outer corner. At closure 1 both margins meet on one line, most of the way down.
"""

from dataclasses import replace

import numpy as np
from scipy.interpolate import PchipInterpolator

from ..anatomy.head import Head
from ..angles import bearing
from ..mesh import edges
from .eye_surface import eye_profile, eyeball_radius
from .layers import Layers
from .lid_closing import lower_share, relief
from .lid_edges import LidEdge, strips
from .lid_opening import missing_opening
from .lid_targets import lid_targets
from .structures import Lids

#: Closed lids are pressed on each other by this much, mm, as the edges are measured column by column: between the columns
#: they reach farther, so it is less than nothing.
_SEAL = -0.08


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
    frame = np.stack([axis, forward, up])

    def place(p):
        a, f, u = np.moveaxis((p - eye.centre) @ frame.T, -1, 0)
        return a, bearing(u, f), np.hypot(u, f)

    along, elevation, radius = place(v[column])
    upper = upper_group[column] >= lower_group[column]
    back = np.asarray(head.groups.get("inner", np.zeros(len(v)))) > 0.5
    inner = back[column]
    # the margin is where the outer lid ends and its back begins
    pair = edges(head.skin.faces)
    turn = np.unique(np.concatenate([pair[back[pair[:, 1]], 0], pair[back[pair[:, 0]], 1]]))
    edge = np.isin(column, turn) & ~inner & (share[column] > 0.4)
    surface = LidEdge(head, column, edge, inner, frame, eye.centre)
    root, length = strips(pair, column, surface.rows, v)
    at, level = surface.reach(v, upper)
    if len(at) >= 8:
        first, last = at.argmin(), at.argmax()
        corners = (at[first], level[first]), (at[last], level[last])
        along_margin = np.where(root >= 0, at[root], along)
    else:
        corners = tuple(place(p)[:2] for p in (en, ex))
        along_margin = along
    (a0, _), (a1, _) = corners
    curves = []
    for is_upper, name in ((True, "ps"), (False, "pi")):
        rows = upper[surface.rows] == is_upper
        if rows.sum() >= 3:
            curves.append(_margin(at[rows], level[rows], corners))
        else:
            middle = place(marks[f"{name}_{side}"])
            curves.append(_margin(np.array([middle[0]]), np.array([middle[1]]), corners))
    within = np.clip(along_margin, a0, a1)
    opening = np.clip(curves[0](within) - curves[1](within), 0, 1.4)
    across = np.clip((2 * within - a0 - a1) / (a1 - a0), -1, 1)
    missing = missing_opening(within, corners, *curves, upper, eye, float(eye.radius * eye.gaze @ axis))
    # weight: 1 at the margin, 0 where the lid's own group ends; the groups are taken as drawn, scaled to reach 1
    weight = np.clip(share[column] / max(np.percentile(share[column], 90), 1e-3), 0, 1)
    off = np.abs(elevation - np.where(upper, curves[0](within), curves[1](within)))
    weight = np.maximum(weight, np.clip(1.4 - off / 0.25, 0, 1) * ((within > a0) & (within < a1)))
    # the lining unfolds from the fornix as the lid goes
    weight = np.where(inner, weight * np.clip(1.1 - 0.55 * off, 0.3, 1), weight)
    profile_angle, profile = eye_profile(eye)
    distance = np.linalg.norm(v - eye.centre, axis=1)
    touching = np.flatnonzero((distance < 1.6 * eye.radius) & layers.free[: len(v)])
    angle = np.arccos(np.clip((v - eye.centre) @ eye.gaze / np.maximum(distance, 1e-9), -1, 1))
    gap = distance - np.interp(angle, profile_angle, profile)
    lids = Lids(
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
        inner=inner,
        hold=weight**2 * np.where(inner, 0.5, 1.0),
        opening=opening,
        missing=np.zeros(len(column)) if missing is None else missing,
        awake=float(missing is None),
        middle=1 - across**4,
        lower_share=lower_share(within, corners, *curves, eye.radius),
        relief=np.zeros((len(column), 3)),
        seal=np.zeros(len(column)),
        gap=gap[column],
        contact_column=touching,
        clearance=np.minimum(gap[touching], 0.15),
        profile_angle=profile_angle,
        profile=profile,
    )
    if opening.max() <= 0 or len(surface.rows) < 8:
        return lids
    flat = lid_targets(lids, 1.0, 1.0, np.zeros(2))
    row = np.full(len(v), -1)
    row[column] = np.arange(len(column))
    near = row[pair][(row[pair] >= 0).all(axis=1)]
    if lids.awake:  # the skin of lids scanned shut lies spread already
        spread = relief(lids, flat, root, length, near, lambda points: eyeball_radius(lids, points, np.zeros(2)))
        lids = replace(lids, relief=spread)
    return replace(lids, seal=_seal(lids, head, surface, within), edge=surface, within=within)


def _seal(lids: Lids, head: Head, surface: LidEdge, within) -> np.ndarray:
    """(v,) rad that each vertex turns on when closed, so that the limit surfaces just meet."""
    fade = lids.opening > 0.02
    seal = np.zeros(len(lids.column))
    for _ in range(8):
        shut = head.skin.vertices.copy()
        shut[lids.column] = lid_targets(replace(lids, seal=seal), 1.0, 1.0, np.zeros(2))
        gap = surface.gap(shut, lids.upper, within)
        seal = np.clip(seal + 0.4 * fade * (gap + _SEAL / lids.eye.radius), -0.2, 0.2)
    return seal
