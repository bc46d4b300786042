# SPDX-License-Identifier: GPL-3.0-or-later
"""What is built once: fibres, the spring mesh of the muscles' axes, attachments, and the model of them all."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...anatomy.head import Eye, Jaw
from ..seal import Seal
from ..structures import Layers, Pressure, Springs
from .parameters import Parameters


@dataclass(frozen=True, eq=False)
class Fibres:
    """The fibres of all muscles that move skin as control polygons (2002, section 3), end to end: k points.

    points (k, 3) mm; fibre (k,) which polygon; muscle (k,) which row of `Axes.muscles`; station (k,) which station of the
    axis it belongs to; along (k,) mm from its root; start (k,) bool, first of its polygon; share (k,) by which it moves
    with the mandible; normal (k, 3) outward; thickness (k,) mm; belly (k,) 0..1, how much of the bulge is seen there
    """

    points: np.ndarray
    fibre: np.ndarray
    muscle: np.ndarray
    station: np.ndarray
    along: np.ndarray
    start: np.ndarray
    share: np.ndarray
    normal: np.ndarray
    thickness: np.ndarray
    belly: np.ndarray


@dataclass(frozen=True, eq=False)
class Axes:
    """The spring mesh along the muscles' middle axes (2002, section 3): s stations, q nodes, c springs, m muscles.

    muscles (m,) indices into the names of the model; round (m,) bool: contracts toward a centre; flat (m,) bool: a ring
    that slides on its surface; centre, line (m, 3): that centre, and the unit line it moves along; lip (m,) 0 upper,
    1 lower, -1 none; slide (m,) mm at full contraction; shortening (m,) share of its length lost then
    stations (s, 3) mm; muscle (s,); along (s,) mm from the root; total (m,) mm; share (s,); normal (s, 3); node (s,), -1
    where fixed to bone; bed (s,) stiffness
    first, second (c,) stations; owner (c,) muscle, -1 for ties between muscles; rest (c,) mm; stiffness (c,) per strain
    """

    muscles: np.ndarray
    round: np.ndarray
    flat: np.ndarray
    centre: np.ndarray
    line: np.ndarray
    lip: np.ndarray
    slide: np.ndarray
    shortening: np.ndarray
    stations: np.ndarray
    muscle: np.ndarray
    along: np.ndarray
    total: np.ndarray
    share: np.ndarray
    normal: np.ndarray
    node: np.ndarray
    bed: np.ndarray
    first: np.ndarray
    second: np.ndarray
    owner: np.ndarray
    rest: np.ndarray
    stiffness: np.ndarray

    @property
    def count(self) -> int:
        """Number of nodes that move."""
        return int(self.node.max(initial=-1)) + 1


@dataclass(frozen=True, eq=False)
class Attachments:
    """Where each of n skin vertices is attached (2002, section 3: assigned once, never again).

    foot (n, 3) mm at rest, inside; weights: sparse (n, k), how the foot moves with the points of `Fibres` (rows sum to
    1 at most, the rest stays with bone); share (n,) by which the foot moves with the mandible; stiffness (n,) factor
    """

    foot: np.ndarray
    weights: Any
    share: np.ndarray
    stiffness: np.ndarray


@dataclass(frozen=True, eq=False)
class Skull:
    """The skull's tangent plane under each skin vertex on bone, found once: the skull itself is not needed again (2002,
    section 3). node (b,) skin vertices; point, normal (b, 3); share (b,) 1 on the mandible; margin, stiffness (b,)."""

    node: np.ndarray
    point: np.ndarray
    normal: np.ndarray
    share: np.ndarray
    margin: np.ndarray
    stiffness: np.ndarray


@dataclass(frozen=True, eq=False)
class Model:
    """A head ready to act. Nodes: n skin vertices, their n feet, the n mirrored feet. ``stiffness`` (n,): all but
    that of volume and contact about each vertex, which bounds the step of `leapfrog`; ``mass`` (n,) g."""

    parameters: Parameters
    muscle_names: tuple[str, ...]
    layers: Layers
    springs: Springs
    prisms: np.ndarray
    prism_volume: np.ndarray
    skull: Skull
    attachments: Attachments
    fibres: Fibres
    axes: Axes
    lids: tuple
    contacts: Any
    seal: Seal
    pressure: Pressure
    jaw: Jaw
    eyes: tuple[Eye, Eye]
    rest: np.ndarray
    free: np.ndarray
    stiffness: np.ndarray
    mass: np.ndarray
    rigid: dict[str, np.ndarray]
    cache: dict = field(default_factory=dict, repr=False)

    @property
    def count(self) -> int:
        """Number of skin vertices."""
        return len(self.mass)
