# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known of smiles: how far they draw the corners of the mouth, lift the upper lip and widen the nose.

A mouth that smiles is wider by 27 %, its corners go outward and up at 47 degrees, and the upper lip is shorter by 28 %
(Tarantili, Halazonetis and Spyropoulos 2005, The spontaneous smile in dynamic motion, AJO-DO 128:8-15). That was measured
on smiles as such, against the same person's rest; without it a wide mouth may as well be a person's own. Back the corners
go farthest of all, with the lips closed (Schutte et al. 2023, The average facial expressions, PRS Global Open 11:e4762): as
far as up is taken for it, and a jaw that opens takes them farther. The nose gets wider by 14 %, its angle with the lip stays
(Parra et al. 2019, Three-dimensional analysis of nasolabial soft tissues while smiling, Int. J. Morphol. 37:232-236): the
wings go apart, and its base, which bone and cartilage hold, hardly rises with the lip (our own estimate).
"""

import numpy as np
from scipy.sparse import csr_matrix, vstack

from ..adapt.skin_fit import landmark_rows
from ..anatomy.head import Head
from .close_lips import CORNERS
from .explain import Expression, Told
from .responses import Responses

WIDER, RISE, SHORTER = 0.27, np.radians(47), 0.28
#: mm: corners go 7 to 22 mm (Paletz, Manktelow and Chaban 1994, The shape of a normal smile), which is a deviation of 3.3 mm,
#: or of 1.9 mm along each axis; a little of it is known from how strong the smile seems.
DEVIATION = 1.8
#: How much of a smile that seems weaker or stronger than others is believed: a face as such may look like that. It hardly looks
#: otherwise on one side than on the other, and what the sides do differently is believed.
HEEDED = 0.66
UNTOLD = 1e3  # mm: nothing is known along that axis
NOSE = ("al_l", "al_r", "sn")
BROADER = 0.14
#: mm by which a wing's way aside, and the base's, differ from person to person (our own estimates).
WINGS, BASE = 1.0, 1.5


def told_of_smile(reference: Head, table: Responses, drawn_rows, lip: int, opening: float, lifts=(1.0, 1.0)) -> Told:
    """What is `Told` of the reference's skin when it smiles.

    drawn_rows (n, n) sparse : gives the skin as drawn from its vertices
    lip : the vertex in the middle of the upper lip, where it meets the lower one
    opening : the jaw's, 0..1; lifts : how far it seems to lift the left and the right corner (`lifted`), of what smiles do
    """
    strength = 1 + HEEDED * (np.mean(lifts) - 1)
    sides = strength + np.asarray(lifts) - np.mean(lifts)
    n = drawn_rows.shape[0]
    marks = reference.landmark_positions()
    out = WIDER * np.linalg.norm(marks["ch_l"] - marks["ch_r"]) / 2
    up = strength * SHORTER * (marks["sn"] - marks["sto"])[2]
    middle = csr_matrix(([1.0], ([0], [lip])), shape=(1, n))
    corners, nose = (landmark_rows(reference.landmarks, names, n) for names in (CORNERS, NOSE))
    rows = (vstack([corners, middle, nose]) @ drawn_rows).tocsr()
    rise = out * np.tan(RISE)
    jaw_back = (rows[: len(CORNERS)] @ table.jaw_at(opening))[:, 1]
    at_corners = sides[:, None] * np.array([[out, rise, rise], [-out, rise, rise]])
    at_corners[:, 1] += jaw_back
    aside = strength * BROADER * np.linalg.norm(marks["al_l"] - marks["al_r"]) / 2
    moves = [*at_corners, [0, 0, up], [aside, 0, 0], [-aside, 0, 0], [0, 0, 0]]
    mouth = [[DEVIATION] * 3] * 2 + [[UNTOLD, UNTOLD, DEVIATION]]
    nose = [[WINGS, UNTOLD, UNTOLD]] * 2 + [[UNTOLD, BASE, BASE]]
    return Told(rows, np.array(moves), np.array(mouth + nose), smiles=True)


def told_of_jaw(told: Told, table: Responses, opening: float) -> Told:
    """What is `Told` of a mouth that does nothing but open: its corners, as in ``told``, go with the jaw."""
    rows = told.rows[: len(CORNERS)]
    return Told(rows, rows @ table.jaw_at(opening), np.full((len(CORNERS), 3), DEVIATION))


def lifted(told: Told, table: Responses, found: Expression) -> np.ndarray:
    """(2,) how far an expression, as ``found`` without knowing, lifts the left and the right corner of the mouth: the share
    of the smile that is ``told`` of; the jaw that opens lowers them."""
    jaw, moved = (told.rows @ field for field in (table.jaw_at(found.jaw), found.displacement))
    corners = slice(0, len(CORNERS))
    return (moved - jaw)[corners, 2] / (told.moves - jaw)[corners, 2].mean()
