# SPDX-License-Identifier: GPL-3.0-or-later
"""What a control means for a model: jaw, muscles and lids posed, and with them the feet of the skin.

The mandible carries what is attached to it (Kähler et al. 2002, section 3); soft places between skull and mandible go by
their share.
"""

from dataclasses import dataclass

import numpy as np

from ..jaw import jaw_transform
from ..lid_targets import lid_targets
from ..structures import Control, require_control
from .bulge import rise
from .fibres import arc_lengths, contracted
from .merged import aims, settled
from .skin_mesh import mirrored
from .sphincter import drawn_together
from .structures import Axes, Model

#: How far the centre of a lip goes behind its rest, and beyond the usual in front, as shares of `Parameters.protrusion`.
_BACK, _FORTH = 1.5, 1.0


@dataclass(frozen=True, eq=False)
class Pose:
    """nodes (3 n, 3): skin carried by the jaw alone, feet and mirrored feet where they are; rotation (3, 3) and
    translation (3,) of the mandible; fibres (k, 3); lid_node (v,), lid_goal (v, 3), lid_stiffness (v,); gaze
    (2, 2) of both eyes; puff -1..1 of the air in the mouth; seal 0..1 of the lips."""

    nodes: np.ndarray
    rotation: np.ndarray
    translation: np.ndarray
    fibres: np.ndarray
    lid_node: np.ndarray
    lid_goal: np.ndarray
    lid_stiffness: np.ndarray
    gaze: np.ndarray
    puff: float
    seal: float


def carried(points, share, rotation, translation) -> np.ndarray:
    """Points (k, 3) moved by ``share`` (k,) of the mandible's motion."""
    return points + share[:, None] * (points @ rotation.T + translation - points)


def muscle_shapes(model: Model, rotation, translation, contraction, forward=(0.0, 0.0)):
    """The fibres under ``contraction`` (m,) 0..1 and with the centres of the lips ``forward`` (upper, lower; -1..1).

    Returns their points with the jaw alone and now (k, 3) mm, how their tangents turn as rotation vectors (k, 3), and the
    length that is left (k,) as a ratio.
    """
    fibres, axes = model.fibres, model.axes
    points = carried(fibres.points, fibres.share, rotation, translation)
    posed = carried(axes.stations, axes.share, rotation, translation)
    centre = carried(axes.centre, _mean_share(axes), rotation, translation)
    line, normal = axes.line, axes.normal
    way = slides(axes, contraction, forward)
    aim = aims(axes, posed, centre, line, normal, contraction, way)
    axis = settled(axes, posed, aim, contraction, model.parameters) if axes.count else posed
    # how much each axis has shortened, and what it moved beside that
    start = np.diff(axes.muscle, prepend=-1) != 0
    before, now = arc_lengths(posed, start), arc_lengths(axis, start)
    c_axis = np.clip(1 - now / np.maximum(before, 1e-9), -0.3, 0.6)
    c_axis[start] = 0.0
    last = np.append(np.flatnonzero(start)[1:], len(posed)) - 1
    whole = np.clip(1 - now[last] / np.maximum(before[last], 1e-9), 0.0, 0.6)[axes.muscle]
    shift = way[axes.muscle]
    own = contracted(posed, before, start, axes.muscle, c_axis)[0]
    flat = axes.flat[axes.muscle, None]
    together = drawn_together(posed, centre[axes.muscle], whole, shift, line[axes.muscle], normal * flat)
    circular = axes.round[axes.muscle]
    beside = axis - np.where(circular[:, None], together, own)
    # the same for every fibre
    s, m = fibres.station, fibres.muscle
    along = arc_lengths(points, fibres.start)
    slid, turned = contracted(points, along, fibres.start, fibres.fibre, c_axis[s])
    keep = fibres.normal * axes.flat[m, None]
    drawn = drawn_together(points, centre[m], whole[s], shift[s], line[m], keep)
    around = axes.round[m, None]
    here = np.where(around, drawn, slid) + beside[s]
    ratio = 1 - np.where(around[:, 0], whole[s], _local(c_axis, before, axes)[s])
    return points, here, np.where(around, 0.0, turned), np.clip(ratio, 0.4, 1.6)


def slides(axes: Axes, contraction, forward) -> np.ndarray:
    """(m,) mm by which the centre of each sphincter moves along its line: with the contraction of its lip, more of it or
    back against the teeth as ``forward`` (upper, lower) says, -1..1."""
    forward = np.clip(np.append(np.asarray(forward, float), 0.0), -1, 1)[axes.lip]
    return axes.slide * contraction * (1 + np.where(forward < 0, _BACK, _FORTH) * forward)


def _local(c_axis, before, axes: Axes) -> np.ndarray:
    """(s,) contraction of the whole axis each station belongs to: a fibre's segments shorten alike."""
    last = np.append(np.flatnonzero(np.diff(axes.muscle)), len(before) - 1)
    return c_axis[last][axes.muscle]


def _mean_share(axes: Axes) -> np.ndarray:
    count = np.bincount(axes.muscle)
    return np.bincount(axes.muscle, axes.share) / np.maximum(count, 1)


def pose_of(model: Model, control: Control) -> Pose:
    """The constants of a solve for ``control``. Raises `InputError` where that is no control of the model."""
    require_control(control)
    n = model.count
    rotation, translation = jaw_transform(model.jaw, *control.jaw)
    skin = carried(model.rest[:n], model.layers.jaw, rotation, translation)
    at = model.attachments
    foot = carried(at.foot, at.share, rotation, translation)
    offset = model.rest[:n] - at.foot
    offset = offset + at.share[:, None] * (offset @ rotation.T - offset)
    fibres = model.fibres.points
    if model.axes.count:
        contraction = control.contractions(len(model.muscle_names))[model.axes.muscles]
        before, fibres, turned, ratio = muscle_shapes(model, rotation, translation, contraction, control.lips)
        foot = foot + at.weights @ (fibres - before)
        offset = turned_by(at.weights @ turned, offset)
        outward = offset / np.maximum(np.linalg.norm(offset, axis=1, keepdims=True), 1e-9)
        foot = foot + (at.weights @ rise(ratio, model.fibres.thickness, model.fibres.belly))[:, None] * outward
    return Pose(
        np.concatenate([skin, foot, mirrored(foot + offset, foot)]),
        rotation,
        translation,
        fibres,
        *_lid_goals(model, control),
        np.array([control.gaze_of(side) for side in "lr"]),
        float(np.clip(control.cheeks, -1, 1)),
        float(np.clip(control.seal, 0, 1)),
    )


def turned_by(vector, offset) -> np.ndarray:
    """Offsets (n, 3) turned by rotation vectors (n, 3) of sines of angles; their length stays."""
    sine = np.linalg.norm(vector, axis=1, keepdims=True)
    axis = vector / np.maximum(sine, 1e-12)
    sine = np.clip(sine, 0, 1)
    cosine = np.sqrt(1 - sine**2)
    along = np.einsum("ij,ij->i", axis, offset)[:, None] * axis
    return offset * cosine + np.cross(axis, offset) * sine + (1 - cosine) * along


def _lid_goals(model: Model, control: Control):
    node, goal, stiffness = [np.zeros(0, int)], [np.zeros((0, 3))], [np.zeros(0)]
    closure = np.asarray(control.lids, float).reshape(2, 2)
    for lids in model.lids:
        upper, lower = closure["lr".index(lids.side)]
        way = lid_targets(lids, upper, lower, control.gaze_of(lids.side)) - lid_targets(lids, 0.0, 0.0, np.zeros(2))
        node.append(lids.column)
        goal.append(model.rest[lids.column] + way)
        stiffness.append(model.parameters.lid * lids.hold)
    return np.concatenate(node), np.concatenate(goal), np.concatenate(stiffness)
