# SPDX-License-Identifier: GPL-3.0-or-later
"""`build_model`: a head whose muscles displace its skin directly (Waters 1986, chapter 4).

The zone of each muscle is looked up once on the head at rest and rides on the skin from then on; a pose then is a sum.
Three things the thesis leaves to whoever segments the face by hand are read off the head here: which lip a muscle moves
(the one whose share of the jaw is that of its insertion), what is inside (it follows the skin that it hangs on), and
what lies on bone (it slides, 4.2 iii).
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from ..anatomy.head import JAW_PARTS, Eye, Head, Jaw, Muscle
from ..mesh import vertex_normals
from ..tissue.contact import Surfaces, build_surfaces
from ..tissue.geometry import cotangent_stiffness, short_diagonals, smoothed
from ..tissue.layers import build_layers, sheet_ties
from ..tissue.lid_targets import lid_targets
from ..tissue.lids import build_lids
from ..tissue.model import strengths
from ..tissue.muscle_field import JAW_MUSCLES, LID_MUSCLES, base_name
from ..tissue.parameters import DEFAULT
from ..tissue.structures import Layers, Lids
from .from_head import muscles_in_skin
from .linear import LinearMuscle
from .sheet import SheetMuscle
from .sphincter import Sphincter

#: mm over which the skin inside mouth and nostrils keeps the slope of what it hangs on, and follows it at all.
_STRETCH, _FADE = 15.0, 15.0
_LIPS = ("orbicularis_oris_upper", "orbicularis_oris_lower")
#: mm behind its plane that a sphincter still moves.
_DEEP = 30.0


@dataclass(frozen=True, eq=False)
class Model:
    """Built once by `build_model`, never changed. n skin vertices, k muscles, s sphincters.

    heads : (k, 3) mm, V1 of the linear muscles; tie : (k,) share by which each muscle's fixed end goes with the jaw
    pulls : sparse (n, k), K A R of the linear muscles; slides : sparse (n, k), K D x of the sheets, mm
    directions : (k, 3) unit vectors of the sheets
    reaches, squares : sparse (n, k), mm that each muscle moves the skin by at full tension, and mm²
    rings : s times (muscle, `Sphincter`, tie of its centre, 0 or 1 of the upper or lower lip, else -1); squeezes : (s, n) K F
    lids_at_rest : for each of ``lids`` its vertices (v, 3) mm as `lid_targets` has them open
    hung : (j,) vertices that go with the jaw
    firm : (n,) how far the skin lies on bone; normal : (n, 3) outward, evened out
    """

    muscle_names: tuple[str, ...]
    skin: np.ndarray
    heads: np.ndarray
    tie: np.ndarray
    pulls: sparse.csr_matrix
    slides: sparse.csr_matrix
    directions: np.ndarray
    reaches: sparse.csr_matrix
    squares: sparse.csr_matrix
    rings: tuple[tuple[int, Sphincter, float, int], ...]
    squeezes: np.ndarray
    firm: np.ndarray
    normal: np.ndarray
    layers: Layers
    lids: tuple[Lids, ...]
    lids_at_rest: tuple[np.ndarray, ...]
    contacts: Surfaces
    hung: np.ndarray
    jaw: Jaw
    eyes: tuple[Eye, Eye]
    faces: np.ndarray
    rigid: dict[str, np.ndarray]

    @property
    def count(self) -> int:
        """Number of skin vertices."""
        return len(self.skin)


def build_model(head: Head, table: dict | None = None) -> Model:
    """Muscle vectors of ``head``, each so strong that the skin's peak at full tension moves by the table's millimetres.

    table : as `tissue.model.strengths`; the shipped one by default
    """
    table = strengths() if table is None else table
    layers = build_layers(head, DEFAULT)
    lids = tuple(x for x in (build_lids(head, layers, side) for side in "lr") if x is not None)
    skin, n = head.skin.vertices, len(head.skin.vertices)
    moves = _Skin(head, layers, lids)
    count = len(head.muscles)
    heads, directions, tie = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros(count)
    pulls, slides, reaches = np.zeros((3, n, count))
    rings, squeezes = [], []
    for k, (muscle, vector) in enumerate(zip(head.muscles, muscles_in_skin(head), strict=True)):
        base = base_name(muscle.name)
        goal = float(table.get(base, {}).get("excursion_mm", 4.0))
        if base in JAW_MUSCLES or base in LID_MUSCLES or goal <= 0:
            continue
        influence, share = moves.influence(vector, muscle)
        far = _moved(vector, skin)
        influence = moves.followed(influence * goal / max((influence * far).max(), 1e-6))
        reaches[:, k] = influence * far
        tie[k] = {"mandible": 1.0, "skull": 0.0}.get(muscle.origin, share)
        if isinstance(vector, Sphincter):
            lip = _LIPS.index(base) if base in _LIPS else -1
            rings.append((k, vector, 0.0 if lip < 0 else 0.5, lip))  # the mouth's centre goes half the way of the jaw
            squeezes.append(influence)
        elif isinstance(vector, SheetMuscle):
            slides[:, k] = reaches[:, k]
            directions[k] = vector.direction
        else:
            pulls[:, k] = influence
            heads[k] = vector.head
    ties = sheet_ties(head, layers)
    return Model(
        muscle_names=tuple(m.name for m in head.muscles),
        skin=skin,
        heads=heads,
        tie=tie,
        pulls=sparse.csr_matrix(pulls),
        slides=sparse.csr_matrix(slides),
        directions=directions,
        reaches=sparse.csr_matrix(reaches),
        squares=sparse.csr_matrix(reaches**2),
        rings=tuple(rings),
        squeezes=np.array(squeezes).reshape(-1, n),
        firm=moves.firm,
        normal=moves.normal,
        layers=layers,
        lids=lids,
        lids_at_rest=tuple(lid_targets(each, 0.0, 0.0, np.zeros(2)) for each in lids),
        contacts=build_surfaces(head, layers, ties),
        hung=np.flatnonzero(layers.jaw > 0),
        jaw=head.jaw,
        eyes=head.eyes,
        faces=head.skin.faces,
        rigid={
            p: head.parts[p].vertices for p in (*JAW_PARTS, "eye_l", "eye_r", "skull", "teeth_upper") if p in head.parts
        },
    )


class _Skin:
    """What of a head's skin muscles may move, and how its inside follows."""

    def __init__(self, head: Head, layers: Layers, lids):
        n = len(layers.area)
        self.vertices = head.skin.vertices
        self.jaw = layers.jaw
        groups = {k: np.asarray(w, float) for k, w in head.groups.items()}
        still = np.zeros(n)
        for each in lids:
            still[each.column] = np.maximum(still[each.column], each.weight)
        inner = groups.get("inner", np.zeros(n)) > 0.5
        self.seen = ~inner
        free = layers.free[:n]
        triangles = short_diagonals(self.vertices, head.skin.faces)
        laplacian = cotangent_stiffness(self.vertices, triangles)
        # lids turn over the eyeball instead; what ends at the border of the face ends softly
        loose = smoothed(free.astype(float), laplacian, layers.area, 5.0)
        self.spare = (1 - np.clip(1.2 * still, 0, 1)) ** 2 * np.clip(2 * loose - 1, 0, 1) * free
        self.firm = np.clip(smoothed((layers.bony & ~inner).astype(float), laplacian, layers.area, 6.0), 0, 1) ** 2
        normal = smoothed(vertex_normals(self.vertices, triangles), laplacian, layers.area, 4.0)
        self.normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
        self._inside = np.flatnonzero(inner & free)
        self._outside = np.flatnonzero(~inner)
        # smooth in slope too: a membrane would drop off at once behind a corner of the mouth
        bent = laplacian @ sparse.diags(1 / layers.area) @ laplacian
        held = (bent + laplacian / _STRETCH**2 + sparse.diags(layers.area / _FADE**4)).tocsr()
        self._matrix = splu(held[self._inside][:, self._inside].tocsc()) if len(self._inside) else None
        self._border = held[self._inside][:, self._outside]

    def influence(self, vector, muscle: Muscle) -> tuple[np.ndarray, float]:
        """(n,) influence on the skin that is seen, on the lip that the muscle ends in alone; and its share of the jaw."""
        influence = vector.influence(self.vertices) * self.seen
        if isinstance(vector, Sphincter):
            deep = (vector.centre - self.vertices) @ vector.frame[2]
            influence = influence * np.clip(2 - deep / _DEEP, 0, 1)
        # an arc of the lips has its middle in one of them
        end = muscle.path[len(muscle.path) // 2] if isinstance(vector, Sphincter) else vector.tail
        distance = np.linalg.norm(self.vertices - end, axis=1)
        near = np.exp(-0.5 * (distance / 4.0) ** 2) * self.seen
        share = float(near @ self.jaw / max(near.sum(), 1e-12))
        apart = np.clip(1.5 - 2 * np.abs(self.jaw - share), 0, 1)
        return influence * self.spare * apart * apart * (3 - 2 * apart), share

    def followed(self, values: np.ndarray) -> np.ndarray:
        """(n,) ``values`` of the skin that is seen, carried on into mouth and nostrils and fading there."""
        out = values.copy()
        if self._matrix is not None:
            out[self._inside] = self._matrix.solve(-(self._border @ values[self._outside]))
            out[self._inside] *= self.spare[self._inside]
        return np.clip(out, 0, max(values.max(), 0))


def _moved(vector, skin) -> np.ndarray:
    """(n,) mm that the skin would move if a muscle of spring 1 had all its influence everywhere."""
    if isinstance(vector, LinearMuscle):
        return np.linalg.norm(vector.head - skin, axis=1)
    if isinstance(vector, SheetMuscle):
        return np.clip((vector.head - skin) @ vector.direction, 0, vector.length)
    return np.linalg.norm(vector.way(skin), axis=1)
