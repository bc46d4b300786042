# SPDX-License-Identifier: GPL-3.0-or-later
"""What a head is: parts, landmarks, muscles, jaw and eyes, as plain arrays in millimetres.

The reference head and every head made from it share all connectivity, groups and names; only positions differ.
"""

from dataclasses import dataclass, replace

import numpy as np

from ..errors import InputError
from ..mesh import Mesh, surface_points
from . import landmark_names

#: Parts in the order of building; each becomes an ordinary Blender object.
PARTS = ("skin", "skull", "mandible", "eye_l", "eye_r", "teeth_upper", "teeth_lower", "tongue")

#: Parts that move rigidly with the mandible.
JAW_PARTS = ("mandible", "teeth_lower", "tongue")

#: Material names of each part, indexed by ``Mesh.material``.
MATERIALS = {
    "skin": ("skin",),
    "skull": ("bone",),
    "mandible": ("bone",),
    "eye_l": ("sclera", "iris", "pupil", "cornea", "caruncle"),
    "eye_r": ("sclera", "iris", "pupil", "cornea", "caruncle"),
    "teeth_upper": ("enamel", "gum"),
    "teeth_lower": ("enamel", "gum"),
    "tongue": ("tongue",),
}

#: Vertex groups of the skin, (n,) weights 0..1. ``inner`` marks what no scanner sees (mouth bag, lid backs, nostrils).
SKIN_GROUPS = (
    *("face", "inner", "jaw", "neck", "scalp", "lip_upper", "lip_lower", "mouth_bag"),
    *(n + s for n in ("lid_upper", "lid_lower", "brow", "cheek", "ear", "nostril") for s in ("_l", "_r")),
    *("nose", "chin", "forehead"),
)


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Named points that ride on a mesh.

    names : k names; part : k part names; corners (k, 3) int32 vertex indices into that part; weights (k, 3).
    """

    names: tuple[str, ...]
    part: tuple[str, ...]
    corners: np.ndarray
    weights: np.ndarray

    def on(self, vertices_of: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Name -> (3,) mm, given the vertices of each part."""
        part, places = np.array(self.part), np.empty((len(self.names), 3))
        for name in set(self.part):
            on = part == name
            places[on] = surface_points(vertices_of[name], self.corners[on], self.weights[on])
        return dict(zip(self.names, places, strict=True))


@dataclass(frozen=True, eq=False)
class Muscle:
    """A muscle as an array of fibres (Kähler 2002, section 3; Lee 1995, 3.4 and 3.5).

    Attributes
    ----------
    name : e.g. ``zygomaticus_major_l``
    kind : ``linear``, ``sheet`` or ``sphincter``
    fibres : (f, p, 3) mm, each from its origin (fixed end, p = 0) to its insertion; a closed ring repeats no point
    width, thickness : mm of the whole belly
    max_shortening : fraction of the length lost at full contraction
    origin, insertion : ``skull``, ``mandible`` or ``soft``: what either end is fixed to
    ring : True for a closed sphincter (orbicularis oculi), False otherwise
    centre : (3,) mm, the point a sphincter pulls towards, or None
    shape : closed surface to look at
    """

    name: str
    kind: str
    fibres: np.ndarray
    width: float
    thickness: float
    max_shortening: float
    origin: str
    insertion: str
    shape: Mesh
    ring: bool = False
    centre: np.ndarray | None = None

    @property
    def path(self) -> np.ndarray:
        """(p, 3) mm, the middle line."""
        return self.fibres.mean(axis=0)


@dataclass(frozen=True, eq=False)
class Jaw:
    """The hinge through both condyles. Opening turns about it and slides the condyles forward and down.

    condyle_l, condyle_r, incisor : (3,) mm; incisor is the edge between the lower middle incisors (for direction and
    opening in mm). open_max rad; slide_max, side_max, forward_max mm (condylar slide at full opening; lateral; protrusion).
    """

    condyle_l: np.ndarray
    condyle_r: np.ndarray
    incisor: np.ndarray
    open_max: float = 0.45
    slide_max: float = 11.9
    side_max: float = 8.5
    forward_max: float = 8.0


#: Radius of limbus and pupil by the globe's: 11.7 mm (Rüfer 2005) and 3.8 mm across in a globe of 24 mm.
IRIS_SHARE, PUPIL_SHARE = 5.85 / 12, 1.9 / 12


@dataclass(frozen=True, eq=False)
class Eye:
    """An eyeball: centre (3,) mm, radius mm, gaze (3,) unit vector of the rest gaze.

    iris_radius, pupil_radius : mm; 0: in proportion to the globe (see `eyeball.eye_of_size` for others)
    """

    centre: np.ndarray
    radius: float
    gaze: np.ndarray
    iris_radius: float = 0.0
    pupil_radius: float = 0.0

    def __post_init__(self):
        for name, share in (("iris_radius", IRIS_SHARE), ("pupil_radius", PUPIL_SHARE)):
            if not getattr(self, name):
                object.__setattr__(self, name, share * self.radius)


@dataclass(frozen=True, eq=False)
class Head:
    """A whole head in one place.

    Attributes
    ----------
    parts : part name (`PARTS`) -> Mesh
    groups : skin vertex group (`SKIN_GROUPS`) -> (n,) float32
    landmarks : the 60 of `landmark_names.SKIN` on the skin
    skull_landmarks : the 22 of `landmark_names.SKULL` on skull or mandible
    feature_mesh : (f, 3) int32, triangles over the skin landmarks (Kähler 2002, figure 4)
    muscles : tuple of Muscle
    jaw : Jaw
    eyes : (left Eye, right Eye)
    """

    parts: dict[str, Mesh]
    groups: dict[str, np.ndarray]
    landmarks: SurfacePoints
    skull_landmarks: SurfacePoints
    feature_mesh: np.ndarray
    muscles: tuple[Muscle, ...]
    jaw: Jaw
    eyes: tuple[Eye, Eye]

    @property
    def skin(self) -> Mesh:
        """The skin's mesh."""
        return self.parts["skin"]

    def vertices(self) -> dict[str, np.ndarray]:
        """Part -> (n, 3) mm."""
        return {name: mesh.vertices for name, mesh in self.parts.items()}

    def landmark_positions(self) -> dict[str, np.ndarray]:
        """Skin landmark -> (3,) mm."""
        return self.landmarks.on(self.vertices())

    def skull_landmark_positions(self) -> dict[str, np.ndarray]:
        """Skull landmark -> (3,) mm."""
        return self.skull_landmarks.on(self.vertices())

    def with_vertices(self, vertices_of: dict[str, np.ndarray]) -> "Head":
        """The head with other vertex positions for the parts named.

        Raises
        ------
        InputError : it has no such part, or that has more or fewer vertices.
        """
        for name in vertices_of:
            if name not in self.parts:
                raise InputError(f"The head has no part {name!r}: its parts are {', '.join(self.parts)}.")
        parts = {n: m.moved(vertices_of[n]) if n in vertices_of else m for n, m in self.parts.items()}
        return replace(self, parts=parts)


def require_head(head) -> None:
    """Raise `InputError` unless ``head`` is a `Head`."""
    if not isinstance(head, Head):
        raise InputError(f"The head is given as {type(head).__name__}: give a Head, such as storage.load_head() reads.")


def landmark_array(positions: dict[str, np.ndarray], names=landmark_names.SKIN) -> np.ndarray:
    """(k, 3) in the order of ``names``; NaN where a landmark is absent."""
    missing = np.full(3, np.nan)
    return np.array([np.asarray(positions.get(name, missing), dtype=float) for name in names])


def moved_muscles_and_jaw(head: Head, move) -> tuple[tuple[Muscle, ...], Jaw]:
    """Muscles and jaw of ``head`` with every point sent through ``move``: (k, 3) mm -> (k, 3) mm, or (3,) -> (3,)."""
    muscles = tuple(
        replace(
            m,
            fibres=move(m.fibres),
            centre=None if m.centre is None else move(m.centre),
            shape=m.shape.moved(move(m.shape.vertices)),
        )
        for m in head.muscles
    )
    jaw = replace(head.jaw, **{k: move(getattr(head.jaw, k)) for k in ("condyle_l", "condyle_r", "incisor")})
    return muscles, jaw
