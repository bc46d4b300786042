# SPDX-License-Identifier: GPL-3.0-or-later
"""How skin moves in people: measured at some points of it, and the skin between.

Our tissue's smile lifts the medial cheek by 13 mm, where people's lift it by 6.7 +- 2.4 (Freytag et al. 2022, Aesthet. Surg. J.
42:1-9), and draws the corners of the mouth too little aside and back. Where such movement is known, it counts as much as the
simulation does (`HALF`): of cheeks that are raised, corners that are pulled, lips that are raised, lowered, stretched, pursed
or funnelled, a nose that wrinkles and a jaw that opens.

The table ``assets/tables/skin_movement.csv``, by ``assets/generators/skin_movement.py``, names its source.
"""

import io
from pathlib import Path

import numpy as np
from scipy.interpolate import RBFInterpolator
from scipy.sparse import identity
from scipy.sparse.linalg import spsolve

from ..adapt.rest import rest_of
from ..adapt.smooth_system import laplacian
from ..anatomy.head import Head
from ..file_bytes import file_bytes

TABLE = Path(__file__).resolve().parents[2] / "assets" / "tables" / "skin_movement.csv"

#: Action units of the table, each of both sides at its full (Ekman, Friesen and Hager 2002).
UNITS = ("AU6", "AU9", "AU11", "AU12", "AU15", "AU16", "AU17", "AU18", "AU20", "AU22", "AU27")
#: What each unit's muscle is (the same): Ekman's AU11 is what ICT-FaceKit raises the upper lip by. AU6, AU12 and AU27 are more
#: than a muscle: see the generator of the responses.
BY_MUSCLE = {
    "levator_labii_alaeque_nasi": "AU9",
    "levator_labii_superioris": "AU11",
    "depressor_anguli_oris": "AU15",
    "depressor_labii_inferioris": "AU16",
    "mentalis": "AU17",
    "risorius": "AU20",
}
#: Of these, the muscles of the upper and of the lower lip.
BY_LIPS = {
    "AU18": ("incisivus_labii_superioris", "incisivus_labii_inferioris"),
    "AU22": ("orbicularis_oris_upper", "orbicularis_oris_lower"),
}
HALF = 0.5
#: The raising of the cheeks that goes with a full pull at the corners: 0.6 to 0.8 in happiness, 6 + 12 of EMFACS (an estimate).
RAISED = 0.75
OFF_LIPS = 2.0  # mm from the edges of the lips, which lie on each other: nearer points may belong to either
ROUGH = 0.1  # how little the skin between bends to the points
INWARD = 4.0  # edges behind the seen skin over which a difference of the two fades
MIDLINE = 10.0  # mm beside it over which one side's muscle loses its say


def read_movement(path=TABLE) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Points (k, 3) mm on the left half of the reference's skin, and unit -> (k, 3) mm that they move.

    Raises
    ------
    InputError : ``path`` cannot be read.
    """
    table = np.loadtxt(io.BytesIO(file_bytes(path)), delimiter=",", skiprows=2, dtype=float)
    return table[:, :3], {unit: table[:, 3 + 3 * k : 6 + 3 * k] for k, unit in enumerate(UNITS)}


def measured(head: Head, parted: np.ndarray) -> dict[str, np.ndarray]:
    """Unit -> (n, 3) mm that the skin of the reference moves.

    parted (n, 3) mm : its vertices with the lips apart, so that what moves one lip does not move the other
    """
    rest = rest_of(head)
    vertices = head.skin.vertices
    points, moves = read_movement()
    seen = np.flatnonzero(~rest.inner)
    rim = vertices[rest.lip_rim]
    keep = np.linalg.norm(points[:, None] - rim, axis=2).min(axis=1) > OFF_LIPS
    points = points[keep]
    at = parted[seen[np.linalg.norm(points[:, None] - vertices[seen], axis=2).argmin(axis=1)]]
    aside = at[:, 0] > 0.5
    both = np.concatenate([at, at[aside] * [-1, 1, 1]])
    out = {}
    for unit, way in moves.items():
        way = way[keep]
        way = np.concatenate([np.where(aside[:, None], way, way * [0, 1, 1]), way[aside] * [-1, 1, 1]])
        out[unit] = RBFInterpolator(both, way, smoothing=ROUGH)(parted)
    return out


def of_left(head: Head, field) -> np.ndarray:
    """(n, 3) mm of what only the left side's muscle moves, of a ``field`` of both sides."""
    return np.clip(0.5 + head.skin.vertices[:, :1] / (2 * MIDLINE), 0, 1) * field


def with_measured(head: Head, simulated, known) -> np.ndarray:
    """The mean (n, 3) mm of a ``simulated`` field and what is ``known`` of it, each (n, 3) mm.

    Inside mouth, lids and nostrils, where nothing is known, the difference fades.
    """
    rest = rest_of(head)
    off = np.where(rest.inner[:, None], 0.0, HALF * (np.asarray(known) - simulated))
    inner = np.flatnonzero(rest.inner)
    bend = (laplacian(head.skin.vertices, head.skin.faces) + identity(len(off)) / INWARD**2).tocsr()[inner]
    off[inner] = spsolve(bend[:, inner].tocsc(), -(bend @ off))
    return simulated + off
