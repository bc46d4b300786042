# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known of smiles: how far they draw the corners of the mouth and lift the upper lip.

A mouth that smiles is wider by 27 %, its corners go outward and up at 47 degrees, and the upper lip is shorter by 28 %
(Tarantili, Halazonetis and Spyropoulos 2005, The spontaneous smile in dynamic motion, AJO-DO 128:8-15). That was measured
on smiles as such, against the same person's rest; without it a wide mouth may as well be a person's own. Back the corners
go farthest of all, with the lips closed (Schutte et al. 2023, The average facial expressions, PRS Global Open 11:e4762): as
far as up is taken for it, and a jaw that opens takes them farther.
"""

import numpy as np
from scipy.sparse import csr_matrix, vstack

from ..adapt.skin_fit import landmark_rows
from ..anatomy.head import Head
from .explain import Expression, Told
from .responses import Responses

WIDER, RISE, SHORTER = 0.27, np.radians(47), 0.28
#: mm: corners go 7 to 22 mm (Paletz, Manktelow and Chaban 1994, The shape of a normal smile), which is a deviation of 3.3 mm,
#: or of so much along each axis.
DEVIATION = 2.0
UNTOLD = 1e3  # mm: nothing is known along that axis
SMILE = 0.45  # share of a smile's lift of the corners from which on an expression is one
CORNERS = ("ch_l", "ch_r")


def told_of_smile(reference: Head, table: Responses, drawn_rows, lip: int, opening: float) -> Told:
    """What is `Told` of the reference's skin when it smiles.

    drawn_rows (n, n) sparse : gives the skin as drawn from its vertices
    lip : the vertex in the middle of the upper lip, where it meets the lower one
    opening : the jaw's, 0..1
    """
    n = drawn_rows.shape[0]
    marks = reference.landmark_positions()
    out = WIDER * np.linalg.norm(marks["ch_l"] - marks["ch_r"]) / 2
    up = SHORTER * (marks["sn"] - marks["sto"])[2]
    middle = csr_matrix(([1.0], ([0], [lip])), shape=(1, n))
    rows = (vstack([landmark_rows(reference.landmarks, CORNERS, n), middle]) @ drawn_rows).tocsr()
    rise = out * np.tan(RISE)
    corner = np.array([out, rise + (rows[:1] @ table.jaw_at(opening))[0, 1], rise])
    moves = [corner, corner * [-1, 1, 1], [0, 0, up]]
    sure = [[DEVIATION] * 3] * 2 + [[UNTOLD, UNTOLD, DEVIATION]]
    return Told(rows, np.array(moves), np.array(sure))


def smiles(told: Told, table: Responses, found: Expression) -> bool:
    """Whether an expression, as ``found`` without knowing, lifts the corners of the mouth as a smile does; the jaw that
    opens lowers them."""
    jaw, moved = (told.rows @ field for field in (table.jaw_at(found.jaw), found.displacement))
    corners = slice(0, len(CORNERS))
    lift, full = ((moves - jaw)[corners, 2].mean() for moves in (moved, told.moves))
    return bool(lift > SMILE * full)
