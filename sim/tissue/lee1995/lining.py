# SPDX-License-Identifier: GPL-3.0-or-later
"""The lining of the mouth stays inside the face. The paper has none: its face is skin alone, open where the mouth is.

`layers.sheet_ties` finds lining and skin that lie back to back. Round the corners of the mouth they do not: there the
lining turns into the lip. What is left over is kept behind the nearest skin that it lies behind at rest.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from ...anatomy.head import Head
from ...mesh import vertex_normals
from ..contact import Surfaces
from ..structures import Layers

_REACH, _NEAREST = 14.0, 24  # mm; columns of skin looked at
_BEHIND = 0.6  # cosine between the way to the skin and the skin's normal


def kept_inside(head: Head, layers: Layers, contacts: Surfaces) -> Surfaces:
    """``contacts`` with a partner among the skin for every lining column that moves and has none yet."""
    n = len(layers.area)
    v = head.skin.vertices
    zero = np.zeros(n)
    inner = np.asarray(head.groups.get("inner", zero)) > 0.5
    bag = inner & (np.asarray(head.groups.get("mouth_bag", zero)) > 0.3)
    alone = np.setdiff1d(np.flatnonzero(bag & layers.free[:n]), contacts.sheets)
    skin = np.flatnonzero(~inner)
    if not len(alone) or not len(skin):
        return contacts
    normals = vertex_normals(v, contacts.triangles)
    distance, near = cKDTree(v[skin]).query(v[alone], min(_NEAREST, len(skin)))
    near = skin[near.reshape(len(alone), -1)]
    over = np.einsum("kmj,kmj->km", v[near] - v[alone][:, None], normals[near])
    distance = distance.reshape(near.shape)
    fits = (over > _BEHIND * distance) & (distance < _REACH)
    fits &= np.abs(layers.jaw[near] - layers.jaw[alone][:, None]) < 0.3
    best = np.argmin(np.where(fits, distance, np.inf), axis=1)
    row = np.flatnonzero(fits.any(axis=1))
    pairs = np.stack([alone[row], near[row, best[row]]], axis=1)
    return replace(
        contacts,
        sheets=np.concatenate([contacts.sheets, pairs]),
        sheet_gap=np.concatenate([contacts.sheet_gap, over[row, best[row]]]),
    )
