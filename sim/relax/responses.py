# SPDX-License-Identifier: GPL-3.0-or-later
"""How the reference's skin answers its jaw and the muscles of the lower face, from our own simulation and people's movement.

The table ``assets/tables/expression_responses.npz`` is made by ``assets/generators/make_expression_responses.py``.
"""

import io
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from ..anatomy.head import Head
from ..file_bytes import file_bytes

TABLE = Path(__file__).resolve().parents[2] / "assets" / "tables" / "expression_responses.npz"

#: Openings of the jaw that are simulated, shares of its widest.
OPENINGS = (0.1, 0.2, 0.35, 0.5)
#: Muscles that smile, speak and squint; those with two sides are simulated on the left.
MUSCLES = (
    "zygomaticus_major",
    "zygomaticus_minor",
    "levator_labii_superioris",
    "levator_labii_alaeque_nasi",
    "levator_anguli_oris",
    "risorius",
    "buccinator",
    "depressor_anguli_oris",
    "depressor_labii_inferioris",
    "mentalis",
    "platysma",
    "orbicularis_oris_upper",
    "orbicularis_oris_lower",
    "incisivus_labii_superioris",
    "incisivus_labii_inferioris",
    "orbicularis_oculi_orbital",
    "orbicularis_oculi_palpebral",
)
UNPAIRED = ("orbicularis_oris_upper", "orbicularis_oris_lower")
MOUTH = tuple(name for name in MUSCLES if not name.startswith("orbicularis_oculi"))


@dataclass(frozen=True, eq=False)
class Responses:
    """names : muscles with their sides; fields (k, n, 3) mm at full contraction; jaw (o, n, 3) mm at `OPENINGS`;
    smile (n, 3) mm : what people's smiles do beyond our muscles' at theirs in joy."""

    names: tuple[str, ...]
    fields: np.ndarray
    jaw: np.ndarray
    smile: np.ndarray

    def jaw_at(self, opening: float) -> np.ndarray:
        """(n, 3) mm that the skin moves when the jaw opens by ``opening`` (0..1), along straight lines between those
        that were simulated, and on beyond the last."""
        at = np.array([0.0, *OPENINGS])
        all_of = np.concatenate([np.zeros_like(self.jaw[:1]), self.jaw])
        k = int(np.clip(np.searchsorted(at, opening) - 1, 0, len(at) - 2))
        share = (opening - at[k]) / (at[k + 1] - at[k])
        return (1 - share) * all_of[k] + share * all_of[k + 1]

    @cached_property
    def reach(self) -> np.ndarray:
        """(n,) mm: the farthest that any of them moves a vertex, the jaw opened by a third."""
        moved = np.linalg.norm(np.concatenate([self.fields, self.jaw[2:3]]), axis=2)
        return moved.max(axis=0)


@lru_cache(maxsize=1)
def responses(path=TABLE) -> Responses:
    """The table, with the right side's muscles mirrored from the left's.

    Raises
    ------
    InputError : ``path`` cannot be read.
    """
    with np.load(io.BytesIO(file_bytes(path)), allow_pickle=False) as table:
        jaw, fields, smile = (table[name].astype(float) for name in ("jaw", "fields", "smile"))
        return Responses(*both_sides(fields, table["mirror"]), jaw, smile)


def both_sides(fields, mirror) -> tuple[tuple[str, ...], np.ndarray]:
    """Names with sides, and the fields (k, n, 3), of all muscles from those of `MUSCLES`, whose right side is mirrored."""
    names, out = [], []
    for name, field in zip(MUSCLES, fields, strict=True):
        if name in UNPAIRED:
            names.append(name)
            out.append(field)
        else:
            names += [f"{name}_l", f"{name}_r"]
            out += [field, field[mirror] * [-1, 1, 1]]
    return tuple(names), np.array(out)


def answers(reference: Head) -> bool:
    """Whether the table of responses was made of a head with this skin's vertices."""
    return responses().jaw.shape[1] == len(reference.skin.vertices)


def mirrored_vertices(vertices: np.ndarray) -> np.ndarray:
    """(n,) the vertex that lies where each one's mirror image does, on a head that is the same on both sides."""
    return cKDTree(vertices).query(vertices * [-1, 1, 1])[1].astype(np.int32)
