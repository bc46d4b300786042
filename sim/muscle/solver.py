# SPDX-License-Identifier: GPL-3.0-or-later
"""A pose by direct displacement: jaw, then the resultant of all muscles, then lids. Nothing is iterated."""

from dataclasses import dataclass

import numpy as np

from ..acting.measures import measured
from ..mesh import vertex_normals
from ..tissue.arch import arch_contacts
from ..tissue.contact import eye_planes, lip_contacts, sheet_contacts
from ..tissue.jaw import jaw_transform
from ..tissue.lid_targets import lid_targets
from ..tissue.planes import joined, project
from ..tissue.structures import Control, Solution, require_control
from .confluence import sharing
from .jaw import turned
from .model import Model


@dataclass(frozen=True, eq=False)
class State:
    """skin : (n, 3) mm."""

    skin: np.ndarray


def rest_state(model: Model) -> State:
    """The scan itself."""
    return State(model.skin.copy())


def solve(model: Model, control: Control, state: State | None = None, **_limits) -> Solution:
    """The pose; ``state`` and limits of iteration are taken for the sake of one interface and change nothing.

    Beside `look` lips that got into each other, and outer skin into the lining of the mouth, are moved apart again.
    """
    skin = displaced(model, control)
    if np.any(skin != model.skin):
        triangles = model.contacts.triangles
        normals, rest = vertex_normals(skin, triangles), vertex_normals(model.skin, triangles)
        lips = lip_contacts(model.contacts, skin, normals, model.skin, rest)
        skin = project(joined(sheet_contacts(model.contacts, normals), lips), skin)
    found = measured(model, control, skin)
    return Solution(State(skin), True, 0.0, 1, {"residual": 0.0, **found})


def look(model: Model, control: Control) -> tuple[State, bool]:
    """The pose without the numbers about it, and that it is at rest."""
    return State(displaced(model, control)), True


def displaced(model: Model, control: Control) -> np.ndarray:
    """(n, 3) mm, the skin in the pose. Raises `InputError` where that is no control of the model."""
    require_control(control)
    tension = control.contractions(len(model.muscle_names))
    rotation, translation = jaw_transform(model.jaw, *control.jaw)
    closed = not np.any(control.jaw)
    pivot = (model.jaw.condyle_l + model.jaw.condyle_r) / 2
    skin = model.skin
    if not closed:
        skin = skin.copy()
        skin[model.hung] = turned(skin[model.hung], model.layers.jaw[model.hung], rotation, translation, pivot)
    total = resultant(model, skin, tension, rotation, translation, control.lips)
    normal = model.normal
    if not closed:
        normal = normal + model.layers.mandible[:, None] * (normal @ rotation.T - normal)
    pressing = model.firm * np.minimum(np.einsum("ij,ij->i", total, normal), 0)
    skin = skin + total - pressing[:, None] * normal
    moved = False
    for lids, rest in zip(model.lids, model.lids_at_rest, strict=True):
        upper, lower = control.lids["lr".index(lids.side)]
        gaze = control.gaze_of(lids.side)
        if upper or lower or gaze.any():
            skin[lids.column] += lid_targets(lids, upper, lower, gaze) - rest
            moved = True
    if moved or not closed or tension.any():
        planes = [eye_planes(lids, skin, control.gaze_of(lids.side)) for lids in model.lids]
        skin = project(joined(*planes, arch_contacts(model.contacts, skin, rotation, translation)), skin)
    return skin


def resultant(
    model: Model, skin: np.ndarray, tension: np.ndarray, rotation, translation, lips=(0.0, 0.0)
) -> np.ndarray:
    """(n, 3) mm: what the muscles at ``tension`` (k,) do together to the skin (n, 3) that the jaw left (4.8).

    Each vector still leads to its own bone: those that arise on the mandible went with it (4.5.3).

    lips : (2,) -1..1, how much less or more the upper and the lower lip pout
    """
    tie = model.tie[:, None]
    heads = model.heads + tie * (model.heads @ rotation.T + translation - model.heads)
    directions = model.directions + tie * (model.directions @ rotation.T - model.directions)
    total = model.pulls @ (tension[:, None] * heads) - (model.pulls @ tension)[:, None] * skin
    total += model.slides @ (tension[:, None] * directions)
    for (k, ring, tie_of_centre, lip), squeeze in zip(model.rings, model.squeezes, strict=True):
        if tension[k]:
            centre = ring.centre + tie_of_centre * (rotation @ ring.centre + translation - ring.centre)
            total += (tension[k] * squeeze)[:, None] * ring.way(skin, centre, 1.0 if lip < 0 else 1.0 + lips[lip])
    return total * sharing(model.reaches, model.squares, tension)[:, None]
