# SPDX-License-Identifier: GPL-3.0-or-later
"""Model, State, Control, Solution: what is built once, what changes, what is asked for and what came out."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ..anatomy.head import Eye, Jaw
from ..errors import InputError
from .parameters import Parameters
from .surroundings import Surroundings


@dataclass(frozen=True, eq=False)
class Layers:
    """Where the prisms stand (Lee, Terzopoulos and Waters 1995, 3.1). All (n,) or (n, 3), one column per skin vertex,
    but for what is said of single nodes.

    nodes : (3 n, 3) mm at rest: epidermis, then fascia, then the bone node (or soft anchor) of each column
    area : mm² of skin each column stands for
    bony : bool, the column stands on bone
    mandible : share 0..1 by which the bone node moves with the mandible
    jaw : share by which skin and fascia would move with the mandible if they were free of all else
    sink : (3 n,) share by which each node goes down besides as the lower incisors do when the jaw turns (`throat`)
    bone_normal : (n, 3) outward normal of the bone under the column
    restoration : stiffness of the nodal restoration force of 3.8
    soften : factor 0..1 on the muscle-layer springs (boneless places)
    sheet : factor on stretching and bending of the skin (lid skin is thin and lies in folds)
    free : (2 n,) bool, epidermis and fascia nodes that the solver moves
    """

    nodes: np.ndarray
    area: np.ndarray
    bony: np.ndarray
    mandible: np.ndarray
    jaw: np.ndarray
    sink: np.ndarray
    bone_normal: np.ndarray
    restoration: np.ndarray
    soften: np.ndarray
    sheet: np.ndarray
    free: np.ndarray

    @cached_property
    def carried(self) -> tuple[np.ndarray, np.ndarray]:
        """Nodes (k,) that go with the mandible, and the share (k, 1) by which each does."""
        share = np.concatenate([self.jaw, self.jaw, self.mandible])
        rows = np.flatnonzero(share)
        return rows, share[rows, None]


@dataclass(frozen=True, eq=False)
class Springs:
    """The springs of 3.3. kind is an index into `springs.KINDS`; ``stiff`` and ``limit``: second phase (biphasic), which only
    some of the rows ``biphasic`` have; the limit of others is infinite."""

    first: np.ndarray
    second: np.ndarray
    kind: np.ndarray
    rest: np.ndarray
    stiffness: np.ndarray
    stiff: np.ndarray
    limit: np.ndarray
    biphasic: slice
    difference: Any  # sparse (s, 3 n): node positions -> spring vectors
    gather: Any  # its transpose in row form


@dataclass(frozen=True, eq=False)
class MuscleField:
    """Where each muscle pulls (3.4, 3.5). Entry e: muscle ``owner[e]`` pulls fascia column ``column[e]``.

    weight : Theta_1 * Theta_2 times the column's area (a force per mm² of skin)
    direction : (e, 3) unit vectors at rest
    tie : share by which the direction turns with the mandible (muscles that arise from it)
    strength, reach : (k,) force per mm² at activation 1 and the shortening in mm at which the muscle is spent
    excursion : (k,) mm of skin motion expected at activation 1
    lip : (e,) 0 for entries of the upper lip's orbicularis oris, 1 of the lower lip's, -1 of other muscles
    forward : (e, 3) by which such an entry's direction changes as its centre of contraction moves forward (Kähler et al.
        2002, section 3); zeros for other muscles
    """

    names: tuple[str, ...]
    owner: np.ndarray
    column: np.ndarray
    weight: np.ndarray
    direction: np.ndarray
    tie: np.ndarray
    strength: np.ndarray
    reach: np.ndarray
    excursion: np.ndarray
    lip: np.ndarray
    forward: np.ndarray


@dataclass(frozen=True, eq=False)
class Pressure:
    """Air in the mouth: entry e pushes fascia ``column[e]`` along ``direction[e]`` (e, 3), out of the mouth.

    weight (e,) mm² of skin it acts on; strength: force per mm² at a puff of 1; reach: mm of motion at which it is spent
    """

    column: np.ndarray
    direction: np.ndarray
    weight: np.ndarray
    strength: float
    reach: float


@dataclass(frozen=True, eq=False)
class Lids:
    """One eye's lids as angles over the eyeball; see `lids`.

    column : (v,) skin vertices that ride on the lids; weight (v,) 1 at the margin, 0 where the lid ends
    axis, forward, up : the eye's frame; along, elevation, radius (v,) the cylindrical coordinates of each vertex
    hold (v,) share of the lid stiffness with which it is held to its place
    upper : (v,) bool; opening (v,) rad between the margins at the vertex's place;
    missing (v,) rad that each lid of a scan with closed eyes lacks to an open eye; awake: 0 for such an eye, 1 for open ones
    inner (v,) bool: behind the margin
    middle : (v,) 0 at the corners of the eye, 1 between them
    lower_share (v,) share of the opening that the lower lid covers in a blink
    relief (v, 3) mm by which shut lids lie otherwise than plain turning would have it
    gap (v,) mm that each vertex lies off the eyeball at rest
    seal (v,) rad by which each lid goes on when closed, until the limit surfaces meet
    edge : `lid_edges.LidEdge`, the drawn edges, or None; within (v,) mm along the lid where each vertex meets the other lid
    profile : (b,) eyeball radius over the angle from the gaze, `profile_angle` (b,)
    """

    side: str
    eye: Eye
    column: np.ndarray
    weight: np.ndarray
    axis: np.ndarray
    forward: np.ndarray
    up: np.ndarray
    along: np.ndarray
    elevation: np.ndarray
    radius: np.ndarray
    upper: np.ndarray
    hold: np.ndarray
    opening: np.ndarray
    missing: np.ndarray
    awake: float
    middle: np.ndarray
    inner: np.ndarray
    lower_share: np.ndarray
    relief: np.ndarray
    seal: np.ndarray
    gap: np.ndarray
    contact_column: np.ndarray
    clearance: np.ndarray
    profile_angle: np.ndarray
    profile: np.ndarray
    edge: Any = None  # lid_edges.LidEdge
    within: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Model:
    """A head ready to act: built once by `build_model`, never changed (``cache`` keeps factorisations)."""

    parameters: Parameters
    layers: Layers
    springs: Springs
    prisms: np.ndarray  # (t, 6) nodes: three of the epidermis, three of the fascia
    prism_volume: np.ndarray  # (t,) mm³ at rest
    region: np.ndarray  # (t,) number of each prism's region in regions.REGIONS
    bending: Any  # sparse (n, n): Laplacian of a field on the skin, mm^-1 after area weighting
    muscles: MuscleField
    pressure: Pressure
    seal: Any  # seal.Seal
    lids: tuple[Lids, ...]
    contacts: Any  # contact.Surfaces
    drawn: Any  # drawn_contact.DrawnSurfaces
    jaw: Jaw
    eyes: tuple[Eye, Eye]
    faces: np.ndarray
    triangles: np.ndarray
    mass: np.ndarray  # (2 n,) g
    exposed: np.ndarray  # (n,) bool: skin that air can blow on
    rigid: dict[str, np.ndarray]  # vertices at rest of the parts that move rigidly
    cache: dict = field(default_factory=dict, repr=False)

    @property
    def count(self) -> int:
        """Number of skin vertices."""
        return len(self.layers.area)

    @property
    def muscle_names(self) -> tuple[str, ...]:
        """Names in the order of `Control.activations`."""
        return self.muscles.names


@dataclass(frozen=True, eq=False)
class State:
    """positions (3 n, 3) mm and velocities (3 n, 3) mm/s of all nodes."""

    positions: np.ndarray
    velocities: np.ndarray

    @property
    def skin(self) -> np.ndarray:
        """(n, 3) mm, the epidermis."""
        return self.positions[: len(self.positions) // 3]


#: Shapes of what a `Control` asks for; None: one for each muscle.
_ASKED = {
    **{"activations": (None,), "jaw": (3,), "lids": (2, 2), "gaze": (2,), "lips": (2,), "eyes": (2, 2)},
    **dict.fromkeys(("cheeks", "seal", "tongue"), ()),
}


def require_control(control) -> None:
    """Raise `InputError` unless ``control`` is a `Control`."""
    if not isinstance(control, Control):
        raise InputError(
            f"The control is given as {type(control).__name__}: give a Control, which pose.control makes of a model and a "
            "Pose."
        )


@dataclass(frozen=True, eq=False)
class Control:
    """What is asked of the face.

    activations : (k,) 0..1 in the order of `Model.muscle_names`
    jaw : (3,) open 0..1, forward 0..1 (negative: back), side -1..1 (positive: to the subject's left)
    lids : (2, 2) left and right eye; upper and lower: 0 at rest, 1 closed, negative: opened wider
    gaze : (2,) rad, of both eyes to the subject's left and up
    tongue : 0..1, how far it is put out
    eyes : (2, 2) rad, what the left and the right eye turn besides
    lips : (2,) -1..1, upper and lower: where the centre of contraction of that lip's orbicularis oris lies, from behind
        (the lip is drawn against the teeth) to in front (it is pushed out more than at 0)
    seal : 0..1, how firmly the lips are held together where they touch at rest
    cheeks : -1..1, pressure of the air in the mouth: 1 puffed, -1 sucked in
    around : gravity, motion of the head, wind

    Raises
    ------
    InputError : one of them has another shape, or is not a finite number.
    """

    activations: np.ndarray
    jaw: np.ndarray
    lids: np.ndarray
    gaze: np.ndarray
    lips: np.ndarray = field(default_factory=lambda: np.zeros(2))
    cheeks: float = 0.0
    seal: float = 0.0
    tongue: float = 0.0
    eyes: np.ndarray = field(default_factory=lambda: np.zeros((2, 2)))
    around: Surroundings = field(default_factory=Surroundings)

    def __post_init__(self):
        for name, shape in _ASKED.items():
            try:
                value = np.asarray(getattr(self, name), dtype=float)
            except (TypeError, ValueError):
                value = np.full(shape, np.nan)
            if value.ndim != len(shape) or (None not in shape and value.shape != shape) or not np.isfinite(value).all():
                count = "one" if not shape else "one for each muscle" if None in shape else " by ".join(map(str, shape))
                raise InputError(
                    f"The control's {name} must be finite numbers, {count}: let pose.control make it of a pose."
                )
            if shape:
                object.__setattr__(self, name, value)

    def contractions(self, count: int) -> np.ndarray:
        """(k,) 0..1 of the ``count`` muscles of a model.

        Raises
        ------
        InputError : it was made for a head with more or fewer.
        """
        if len(self.activations) != count:
            given = len(self.activations)
            raise InputError(f"The control has {given} activations and the model {count} muscles: give one for each.")
        return np.clip(self.activations, 0, 1)

    def gaze_of(self, side: str) -> np.ndarray:
        """(2,) rad to the subject's left and up, of the eye on ``side`` ("l" or "r")."""
        return np.asarray(self.gaze, float) + self.eyes["lr".index(side)]


@dataclass(frozen=True, eq=False)
class Solution:
    """What `solve` found; ``residual`` is the largest remaining step in mm, diagnostics a dict of plain numbers."""

    state: State
    converged: bool
    residual: float
    iterations: int
    diagnostics: dict
