# SPDX-License-Identifier: GPL-3.0-or-later
"""Which part of a face is the person and which the expression.

Points of a face, laid on the reference by what expressions do not move, differ from the reference's by a person's shape
``d``, by what jaw and muscles do, ``E a``, and by what our muscles do not do as that person's did, ``e``:

    y = d + E a + e + noise,   d ~ N(0, K),  e ~ N(0, K_e),  a >= 0

``K`` is the covariance of neutral people (`people`), ``K_e``, that of `unlike`, is large only where ``E a`` is. The
contractions are those of generalised least squares with shrinkage, the rest is the mean of a Gaussian process given the
data (Rasmussen and Williams 2006, equations 2.25 and 2.42). What is known of an expression, and of no person, is data without
a ``d`` (`Told`).
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.sparse import csr_matrix, diags, vstack

from ..acting.expressions import expressions
from ..anatomy.head import Jaw
from .responses import Responses
from .unlike import unlike

OPEN = 1.0  # opening of the jaw that shrinkage expects
#: How far a smiling jaw opens otherwise than by its share in joy: teeth of people who smile are apart by some millimetres.
PART = 0.07
SMILE = 2.0  # strength of a smile, by the joy of the table of expressions, that it expects
ALONE = 0.7  # contraction of a muscle beyond its share in the smile
UNEVEN = 0.4  # difference between the sides
ROUNDS = 3


@dataclass(frozen=True, eq=False)
class Expression:
    """jaw : opening, 0..1; muscles : name -> contraction; displacement (n, 3) mm of the reference's skin by both, and
    by what they leave unexplained; modelled (n, 3) mm : by both alone; cost : how far the face, what is told and what
    expressions usually do are from it, the sum of squares in deviations."""

    jaw: float
    muscles: dict[str, float]
    displacement: np.ndarray
    modelled: np.ndarray
    cost: float


@dataclass(frozen=True, eq=False)
class Told:
    """rows (k, n) sparse, moves (k, 3) mm and deviations (k, 3) mm: how far an expression is known to move points of the
    skin that the rows give; smiles : whether it is a smile, whose jaw opens with it."""

    rows: csr_matrix
    moves: np.ndarray
    deviations: np.ndarray
    smiles: bool = False


def explain(
    table: Responses, vertices, jaw: Jaw, sampling, offsets, people, noise, names=None, still=None, told=None
) -> Expression:
    """The `Expression` of a face.

    Parameters
    ----------
    table : how the reference's skin answers
    vertices : (n, 3) mm, the reference's skin
    jaw : the reference's
    sampling : (k, n) sparse, rows that give the points from the vertices
    offsets : (k, 3) mm, the face's points less the reference's, laid on it
    people : (3 k, 3 k) mm², covariance of neutral people's
    noise : mm, one, (k,) or (k, 3), by which points may be wrong
    names : the muscles to consider (all of the table by default)
    still : (k,) bool, points that are known as they are without any expression (None: none)
    told : `Told`, what else is known of the expression (None: nothing)
    """
    from scipy.optimize import nnls  # slow to load, and few scans have an open mouth

    pick = [k for k, name in enumerate(table.names) if names is None or name in names]
    fields = table.fields[pick]
    y = np.asarray(offsets, dtype=float).ravel()
    noise = np.asarray(noise, dtype=float)
    noise = np.broadcast_to(noise[:, None] if noise.ndim == 1 else noise, (len(offsets), 3)).ravel()
    rows = sampling if still is None else diags((~np.asarray(still)).astype(float)) @ sampling
    if told is not None:
        rows = vstack([rows, told.rows]).tocsr()
        y, noise = np.append(y, told.moves), np.append(noise, told.deviations)
        people = np.pad(people, (0, told.moves.size))
    smiles = told is not None and told.smiles
    shrink = shrinkage([table.names[k] for k in pick], smiles)
    # The strength of a smile moves the skin by what people's do beyond our muscles; in other faces it only ties these.
    fields = np.concatenate([fields, table.smile[None] * smiles])
    sampled = np.stack([(rows @ field).ravel() for field in fields], axis=1)
    opening, contraction = 0.2, np.full(len(fields), 0.3)
    for _ in range(ROUNDS):
        others = unlike(table, fields, vertices, jaw, opening, contraction)
        factor = cho_factor(people + others.covariance(rows) + np.diag(noise**2), lower=True)
        step = max(opening, 0.05)
        by_jaw = (rows @ table.jaw_at(step)).ravel() / step
        system = solve_triangular(factor[0], np.column_stack([by_jaw, sampled]), lower=True)
        right = solve_triangular(factor[0], y, lower=True)
        found, _ = nnls(np.concatenate([system, shrink]), np.concatenate([right, np.zeros(len(shrink))]))
        opening, contraction = float(found[0]), found[1:]
    modelled = table.jaw_at(opening) + np.einsum("k,knj->nj", contraction, fields)
    left = y - by_jaw * opening - sampled @ contraction
    beyond = (others.covariance(None, rows) @ cho_solve(factor, left)).reshape(-1, 3)
    muscles = {table.names[k]: float(a) for k, a in zip(pick, contraction[:-1], strict=True)}
    cost = np.sum(solve_triangular(factor[0], left, lower=True) ** 2) + np.sum((shrink @ found) ** 2)
    return Expression(opening, muscles, modelled + beyond, modelled, float(cost))


def shrinkage(names, smiles: bool = False) -> np.ndarray:
    """Rows (r, k + 2) that cost nothing where jaw and muscles do what faces usually do: little, both sides alike, and
    those of a smile together. Columns: the jaw, the muscles ``names``, the smile's strength.

    smiles : whether the face is known to smile, so that the jaw opens with the smile and little else
    """
    count = len(names)
    pose = expressions()["joy"]
    joy = pose.muscles
    rows = [np.zeros(count + 2), np.zeros(count + 2)]
    rows[0][0], rows[1][-1] = 1 / OPEN, 1 / SMILE
    if smiles:
        rows[0][0], rows[0][-1] = 1 / PART, -pose.jaw_open / PART
    for k, name in enumerate(names):
        row = np.zeros(count + 2)
        row[k + 1], row[-1] = 1 / ALONE, -joy.get(name, 0.0) / ALONE
        rows.append(row)
        if name.endswith("_l") and name[:-1] + "r" in names:
            row = np.zeros(count + 2)
            row[k + 1], row[names.index(name[:-1] + "r") + 1] = 1 / UNEVEN, -1 / UNEVEN
            rows.append(row)
    return np.array(rows)
