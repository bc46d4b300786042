# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a fitted face is to be relaxed, and what the head is then made of."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..acting.plain_posing import plainly_posed
from ..adapt.rest import rest_of
from ..adapt.thin_plate_spline import similarity
from ..anatomy.head import Head
from ..errors import InputError
from ..mesh_subdivision import drawn
from ..tissue.jaw import jaw_transform
from .relaxed import Relaxed, relaxed
from .responses import answers
from .upper_teeth import incisal_edge

if TYPE_CHECKING:
    from ..adapt.skin_fit import SkinFit

#: ``auto`` relaxes where the lips are parted.
CHOICES = ("auto", "always", "never")

#: How far a face whose lips are closed must seem to smile to be said to. Of 32 neutral heads menpo's seems to most, by .26;
#: ICT-FaceKit's smiles of .4 seem to by .23 to .33, those of .7 by .44 to .63, and the smiling scan of Fran by 1.11.
SMILES = 0.42

DEEP = 3  # edges behind the lips from which on the mouth's lining lies on the jaws


def require_choice(choice: str) -> None:
    """Raise `InputError` for a choice that is none of `CHOICES`."""
    if choice not in CHOICES:
        raise InputError(f"To relax {choice!r} is unknown: choose {', '.join(CHOICES)}.")


def neutral_of(fit: "SkinFit", choice: str) -> Relaxed | None:
    """The relaxed skin under which bone, teeth and muscles of a head are to be made; None: under the skin as scanned.

    An open mouth is always closed for that, as flesh over bone is known of closed ones; `kept_open` opens it again.
    """
    if choice == "always" or fit.reference is not fit.lips_closed:
        skin = drawn(fit.lips_closed.skin.faces, fit.cage)
        matrix, _ = similarity(fit.lips_closed.skin.vertices, skin)
        forward = -matrix[:, 1] / np.linalg.norm(matrix[:, 1])
        teeth = incisal_edge(fit.target, fit.lips_closed.landmarks.on({"skin": skin}), forward)
        return relaxed(fit.lips_closed, fit.cage, fit.fitted.fitted, fit.unseen, teeth)
    return None


def smiles_closed(fit: "SkinFit") -> bool:
    """Whether a face seems to smile with its lips closed, which ``auto`` leaves alone: a person may look like that.

    Of heads on another reference than ours that is not known.
    """
    if fit.reference is not fit.lips_closed or not answers(fit.lips_closed):
        return False
    return neutral_of(fit, "always").report["smile"] > SMILES


def kept_open(reference: Head, head: Head, scanned: np.ndarray, opening: float) -> Head:
    """``head`` with the skin as ``scanned`` (n, 3) mm and the jaw open by ``opening``, 0..1, as its lining follows.

    reference : the head that ``head`` was made from
    """
    posed = plainly_posed(head, jaw_open=min(opening, 1.0))
    rest = rest_of(reference)
    lining = np.zeros(len(scanned))
    rows = rest.organs["mouth"]
    lining[rows] = np.clip(rest.behind[rows] / DEEP, 0, 1)
    skin = scanned + lining[:, None] * (posed.skin.vertices - scanned)
    rotation, shift = jaw_transform(head.jaw, min(opening, 1.0))
    jaw = replace(head.jaw, incisor=rotation @ head.jaw.incisor + shift)
    return replace(posed.with_vertices({"skin": skin}), jaw=jaw)
