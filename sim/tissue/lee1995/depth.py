# SPDX-License-Identifier: GPL-3.0-or-later
"""How thick the layers are: they vary over the face with the head's own tissue depth.

The paper has one thickness for all ("our work does not yet exploit knowledge of the variable thickness of the layers",
section 6). Here a column reaches as deep as the head's own bone lies under the skin, and the fascia stands at its share
of that depth. Where the bone of a head cannot be right (a bad scan) its depth is kept within three standard deviations
of adults' means at the landmarks around (`anatomy.tissue_depth`).
"""

from dataclasses import replace

import numpy as np

from ...anatomy import tissue_depth
from ...anatomy.head import Head
from ..layers import build_layers
from ..parameters import DEFAULT
from ..structures import Layers

#: Landmarks that only the table of depths knows -> the skin landmark over them.
_MORE = {"gn": "gn", "pr": "ls", "id": "li"}


def depth_range(head: Head) -> tuple[np.ndarray, np.ndarray]:
    """(n,) least and (n,) greatest plausible depth of tissue in mm under every skin vertex: mean ∓ 3 sd of adults.

    Between landmarks by inverse squares of the distance.
    """
    marks = head.landmark_positions()
    points, mean, sd = [], [], []
    for name, at in tissue_depth.skin_counterparts(marks).items():
        depth = tissue_depth.depths()[name]
        points.append(at)
        mean.append(depth.mean)
        sd.append(depth.sd)
    for name, skin in _MORE.items():
        if skin in marks:
            points.append(marks[skin])
            mean.append(tissue_depth.table()[name].mean)
            sd.append(tissue_depth.table()[name].sd)
    v = head.skin.vertices
    if not points:
        return np.full(len(v), 0.5), np.full(len(v), np.inf)
    away = ((v[:, None] - np.array(points)[None]) ** 2).sum(axis=2)
    weight = 1 / (away + 1.0)
    weight /= weight.sum(axis=1, keepdims=True)
    mean, sd = weight @ np.array(mean), weight @ np.array(sd)
    return np.maximum(mean - 3 * sd, 1.0), mean + 3 * sd


def layered(head: Head) -> Layers:
    """The columns of ``head``, bony ones as deep as its tissue is and never implausibly deep or shallow."""
    layers = build_layers(head, DEFAULT)
    n = len(layers.area)
    least, most = depth_range(head)
    skin, fascia, bone = layers.nodes[:n], layers.nodes[n : 2 * n], layers.nodes[2 * n :]
    depth = np.maximum(np.linalg.norm(bone - skin, axis=1), 1e-6)
    factor = np.where(layers.bony, np.clip(depth, least, most) / depth, 1.0)[:, None]
    nodes = np.concatenate([skin, skin + factor * (fascia - skin), skin + factor * (bone - skin)])
    return replace(layers, nodes=nodes)
