# SPDX-License-Identifier: GPL-3.0-or-later
"""What a posed skin says about itself, by whatever model: one ruler for models that know of nothing but the skin."""

import numpy as np

from ..mesh import vertex_normals
from ..tissue import contact
from ..tissue.arch import arch_contacts
from ..tissue.eye_surface import depth_in_eyeballs
from ..tissue.jaw import jaw_transform
from ..tissue.planes import depths, joined
from ..tissue.structures import Control
from ..tissue.volume import prism_volumes


def measured(model, control: Control, skin: np.ndarray) -> dict[str, float]:
    """Numbers for the report of a pose of the ``skin`` (n, 3) mm.

    model : has ``layers``, ``contacts``, ``lids`` and ``jaw``, as `tissue.structures.Model`

    Returns
    -------
    peak_mm : the largest motion of a vertex; volume_drift : share of the volume between the skin and the bone under it
    that was gained or lost; penetration_mm : the deepest that skin reaches into eyeball, teeth, other lip or its own
    lining, beyond what it does at rest
    """
    layers = model.layers
    n = len(skin)
    rotation, translation = jaw_transform(model.jaw, *control.jaw)
    rest = layers.nodes[:n]
    bone = layers.nodes[2 * n :]
    posed = bone + layers.mandible[:, None] * (bone @ rotation.T + translation - bone)
    every = model.contacts.triangles
    triangles = every[layers.bony[every].all(axis=1) & layers.free[:n][every].any(axis=1)]
    prisms = np.concatenate([triangles, triangles + n], axis=1)
    before, after = (prism_volumes(np.concatenate(x), prisms).sum() for x in ((rest, bone), (skin, posed)))
    normals = vertex_normals(skin, every)
    planes = joined(
        arch_contacts(model.contacts, skin, rotation, translation),
        contact.sheet_contacts(model.contacts, normals),
        contact.lip_contacts(model.contacts, skin, normals, rest, vertex_normals(rest, every)),
    )
    deepest = max(depths(planes, skin).max(initial=0.0), depth_in_eyeballs(model.lids, skin, control.gaze_of))
    return {
        "volume_drift": float(after / before - 1) if before > 0 else 0.0,
        "penetration_mm": float(deepest),
        "peak_mm": float(np.linalg.norm(skin - rest, axis=1).max(initial=0.0)),
    }
