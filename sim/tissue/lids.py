# SPDX-License-Identifier: GPL-3.0-or-later
"""Lids slide over the eyeball: every lid vertex keeps its place along the lid and its height over the eye and turns
about the axis from the inner to the outer corner. At closure 1 both margins meet on one line, most of the way down.
"""

from dataclasses import replace

import numpy as np
from scipy.interpolate import PchipInterpolator

from ..anatomy.eyeball import reach
from ..anatomy.head import Eye, Head
from ..mesh import edges
from .layers import Layers
from .lid_closing import lower_share, relief
from .lid_edges import LidEdge, strips
from .lid_opening import missing_opening
from .structures import Lids

#: The middle of a lid lags behind its ends as it closes, so that its edge stays an arc: exponents over the share at the
#: corners of the eye and at its middle.
_LAG = (0.75, 1.4)
#: Closed lids are pressed on each other by this much, mm, as the edges are measured column by column: between the columns
#: they reach farther, so it is less than nothing.
_SEAL = -0.08
#: Share of a vertical gaze that the lids follow: (upper lid down, up; lower lid down, up).
_FOLLOW = (0.75, 0.6, 0.3, 0.12)
#: Share of a sideways gaze by which the middle of the lids is carried along: the cornea's bulge takes them with it, the
#: corners of the eye stay.
_ASIDE = 0.25
#: mm between skin and eyeball where the lid is taut.
_TAUT = 2.6
#: Share of an open eye's slit that a levator gives back to an eye that was scanned shut, per share by which it widens an
#: open one.
_WAKE = 3.125


def eye_profile(eye: Eye) -> tuple[np.ndarray, np.ndarray]:
    """Angle from the gaze (b,) rad and eyeball radius (b,) mm there: the cornea stands out of the sphere."""
    grid = np.linspace(0, np.pi, 181)
    return grid, reach(eye, grid)


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
        return a, np.arctan2(u, f), np.hypot(u, f)

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
    rel = v[touching] - eye.centre
    angle = np.arccos(np.clip(rel @ eye.gaze / np.maximum(distance[touching], 1e-9), -1, 1))
    clearance = np.minimum(distance[touching] - np.interp(angle, profile_angle, profile), 0.15)
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
        contact_column=touching,
        clearance=clearance,
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
    upper = lids.upper[surface.rows]
    seal = np.zeros(len(lids.column))
    for _ in range(8):
        shut = head.skin.vertices.copy()
        shut[lids.column] = lid_targets(replace(lids, seal=seal), 1.0, 1.0, np.zeros(2))
        at, level = surface.reach(shut, lids.upper)
        gap = _along(at[upper], level[upper], within) - _along(at[~upper], level[~upper], within)
        seal = np.clip(seal + 0.4 * fade * (gap + _SEAL / lids.eye.radius), -0.2, 0.2)
    return seal


def _along(x, y, at):
    order = np.argsort(x, kind="stable")
    return np.interp(at, x[order], y[order])


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


def depth_in_eyeballs(lids_of_both, skin: np.ndarray, gaze_of) -> float:
    """mm by which skin (n, 3) reaches deepest into an eyeball, beyond what it does at rest; 0 where it does not.

    lids_of_both : a model's `Lids`; gaze_of(side) -> (2,) rad
    """
    deepest = 0.0
    for lids in lids_of_both:
        points = skin[lids.contact_column]
        gap = np.linalg.norm(points - lids.eye.centre, axis=1) - eyeball_radius(lids, points, gaze_of(lids.side))
        deepest = max(deepest, float((np.minimum(lids.clearance, 0) - gap).max(initial=0.0)))
    return deepest


def lid_targets(lids: Lids, upper: float, lower: float, gaze: np.ndarray) -> np.ndarray:
    """(v, 3) mm: where the lid vertices want to be. upper, lower: 0 rest, 1 closed, negative wider.

    The upper lid follows a vertical gaze (lid kinematics: 0.8 to 1 of it), the lower one a little. The cornea lifts the
    lid that it slides under, and the fold over the crease is drawn flat as the lid goes down.
    """
    down, rise = max(-float(gaze[1]), 0.0), max(float(gaze[1]), 0.0)
    woken = np.clip(-_WAKE * upper, 0, None) * (1 - lids.awake)
    awake = np.clip(lids.awake + woken, 0, 1)
    shut = np.clip(upper, 0, 1)
    along = awake * (1 - 0.6 * shut) * (_FOLLOW[3] * rise - _FOLLOW[2] * down)
    follow = awake * (1 - shut) * (_FOLLOW[1] * rise - _FOLLOW[0] * down) + shut * along
    turn_upper = -_lagging(lids, upper) * (1 - lids.lower_share) * lids.opening + lids.middle * follow
    turn_lower = _lagging(lids, lower) * lids.lower_share * lids.opening + lids.middle * along
    turn_upper, turn_lower = turn_upper + woken * lids.missing, turn_lower - woken * lids.missing
    # never past each other: the meeting line limits both, whichever way the eye looks
    closed = turn_lower - turn_upper
    over = np.where(closed > lids.opening, lids.opening / np.maximum(closed, 1e-9), 1.0)
    share = np.clip(closed * over / np.maximum(lids.opening, 1e-9), 0, 1)
    press = lids.seal * share**4 * (lids.opening > 0)
    turn = np.where(lids.upper, turn_upper * over - press, turn_lower * over + press)
    angle = lids.elevation + lids.weight * turn

    rest = at_rest(lids) - lids.eye.centre
    rest_size = np.linalg.norm(rest, axis=1)
    gap = rest_size - eyeball_radius(lids, lids.eye.centre + rest, np.zeros(2))
    # skin that hung in the fold is drawn flat over the ball
    drawn = np.clip(-turn / np.maximum(0.8 * lids.opening, 0.1), 0, 1) * (lids.upper & ~lids.inner)
    drawn = drawn * np.clip(4 * lids.weight * (1 - lids.weight), 0, 1)
    height = gap - drawn * np.maximum(gap - _TAUT - 6 * (1 - lids.weight) ** 3, 0)
    plane = np.cos(angle)[:, None] * lids.forward + np.sin(angle)[:, None] * lids.up
    # to the subject's left is along the lid, out or in
    aside = _ASIDE * lids.eye.radius * np.sin(float(gaze[0])) * np.sign(lids.axis[0]) * lids.middle * lids.weight
    target = (lids.along + aside)[:, None] * lids.axis + lids.radius[:, None] * plane
    size = np.linalg.norm(target, axis=1)
    # near the ball, heights are over what lies below now
    under = eyeball_radius(lids, lids.eye.centre + target, gaze)
    close = np.where(lids.inner, 1.0, lids.weight) * np.clip((5.0 - gap) / 2.5, 0, 1)
    # a lining that is drawn out between margin and fornix stands off, or it would cut the corner
    out = np.where(lids.upper, -turn, turn)
    out = np.clip(out, 0, None) if not lids.awake else np.abs(turn)
    height = height + lids.inner * out * (0.4 + 2.5 * (1 - lids.weight)) * (lids.weight < 0.99)
    want = size + close * (under + height - size) + (1 - close) * (height - gap)
    want = np.maximum(want, under + np.minimum(gap, 0.15))
    return lids.eye.centre + target * (want / np.maximum(size, 1e-9))[:, None] + (share**2)[:, None] * lids.relief


def _lagging(lids: Lids, amount: float):
    """(v,) how far each part of a lid is when its blink is at ``amount``."""
    if not 0 < amount < 1:
        return amount
    return amount ** (_LAG[0] + (_LAG[1] - _LAG[0]) * lids.middle**2)


def at_rest(lids: Lids) -> np.ndarray:
    """(v, 3) mm, the lid vertices as scanned."""
    plane = np.cos(lids.elevation)[:, None] * lids.forward + np.sin(lids.elevation)[:, None] * lids.up
    return lids.eye.centre + lids.along[:, None] * lids.axis + lids.radius[:, None] * plane
