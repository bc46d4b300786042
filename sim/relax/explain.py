# SPDX-License-Identifier: GPL-3.0-or-later
"""Which part of a face is the person and which the expression.

Points of a face, laid on the reference by what expressions do not move, differ from the reference's by a person's shape
``d``, by what jaw and muscles do, ``E a``, and by what our muscles do not do as that person's did, ``e``:

    y = d + E a + e + noise,   d ~ N(0, K),  e ~ N(0, K_e),  a >= 0

``K`` is the covariance of neutral people (`people`), ``K_e`` is large only where ``E a`` is. The contractions are those
of generalised least squares with shrinkage, the rest is the mean of a Gaussian process given the data (Rasmussen and
Williams 2006, equations 2.25 and 2.42).
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.spatial.distance import cdist

from ..acting.expressions import expressions
from .responses import Responses

OPEN = 1.0  # opening of the jaw that shrinkage expects
SMILE = 2.0  # strength of a smile, by the joy of the table of expressions, that it expects
ALONE = 0.5  # contraction of a muscle beyond its share in the smile
UNEVEN = 0.15  # difference between the sides
#: What our muscles do otherwise than a person's: share of what they do, and
#: its reaches in mm with their shares of the variance.
UNLIKE = 0.6
REACHES = ((16.0, 0.5), (6.0, 0.5))
LEAST = 0.4  # mm of the same where little moves, at the mouth
ROUNDS = 3


@dataclass(frozen=True, eq=False)
class Expression:
    """jaw : opening, 0..1; muscles : name -> contraction; displacement (n, 3) mm of the reference's skin by both, and
    by what they leave unexplained; modelled (n, 3) mm : by both alone."""

    jaw: float
    muscles: dict[str, float]
    displacement: np.ndarray
    modelled: np.ndarray


def explain(table: Responses, vertices, sampling, offsets, people, noise, names=None) -> Expression:
    """The `Expression` of a face.

    Parameters
    ----------
    table : how the reference's skin answers
    vertices : (n, 3) mm, the reference's skin
    sampling : (k, n) sparse, rows that give the points from the vertices
    offsets : (k, 3) mm, the face's points less the reference's, laid on it
    people : (3 k, 3 k) mm², covariance of neutral people's
    names : the muscles to consider (all of the table by default)
    noise : mm, one or (k,), by which points may be wrong
    """
    from scipy.optimize import nnls  # slow to load, and few scans have an open mouth

    pick = [k for k, name in enumerate(table.names) if names is None or name in names]
    fields = table.fields[pick]
    y = np.asarray(offsets, dtype=float).ravel()
    still = np.repeat(np.broadcast_to(noise, len(offsets)) ** 2, 3)
    # The lips touch, but what moves one does not move the other: distances are those of an open mouth.
    parted = vertices + table.jaw_at(0.35)
    places = sampling @ parted
    alike = likeness(places, places)
    sampled = np.stack([(sampling @ field).ravel() for field in fields], axis=1)
    shrink = shrinkage([table.names[k] for k in pick])
    opening, contraction = 0.2, np.full(len(pick), 0.3)
    for _ in range(ROUNDS):
        unlike = unlikeness(table, fields, opening, contraction)
        error = sampling @ unlike
        own = alike * error[:, None] * error[None, :]
        total = people + np.kron(own, np.eye(3)) + np.diag(still)
        factor = cho_factor(total, lower=True)
        step = max(opening, 0.05)
        jaw = (sampling @ table.jaw_at(step)).ravel() / step
        system = solve_triangular(factor[0], np.column_stack([jaw, sampled]), lower=True)
        right = solve_triangular(factor[0], y, lower=True)
        system = np.column_stack([system, np.zeros(len(system))])  # the smile has no field but its muscles'
        found, _ = nnls(np.concatenate([system, shrink]), np.concatenate([right, np.zeros(len(shrink))]))
        opening, contraction = float(found[0]), found[1:-1]
    modelled = table.jaw_at(opening) + np.einsum("k,knj->nj", contraction, fields)
    left = y - jaw * opening - sampled @ contraction
    weights = cho_solve(factor, left).reshape(-1, 3)
    across = likeness(parted, places) * unlike[:, None] * error[None, :]
    muscles = {table.names[k]: float(a) for k, a in zip(pick, contraction, strict=True)}
    return Expression(opening, muscles, modelled + across @ weights, modelled)


def likeness(a, b) -> np.ndarray:
    """(j, k) correlation between points (j, 3) and (k, 3) mm of what muscles do otherwise."""
    apart = cdist(a, b, "sqeuclidean")
    return sum(share * np.exp(-apart / (2 * reach**2)) for reach, share in REACHES)


def shrinkage(names) -> np.ndarray:
    """Rows (r, k + 2) that cost nothing where jaw and muscles do what faces usually do: little, both sides alike, and
    those of a smile together. Columns: the jaw, the muscles ``names``, the smile's strength."""
    count = len(names)
    joy = expressions()["joy"].muscles
    rows = [np.zeros(count + 2), np.zeros(count + 2)]
    rows[0][0], rows[1][-1] = 1 / OPEN, 1 / SMILE
    for k, name in enumerate(names):
        row = np.zeros(count + 2)
        row[k + 1], row[-1] = 1 / ALONE, -joy.get(name, 0.0) / ALONE
        rows.append(row)
        if name.endswith("_l") and name[:-1] + "r" in names:
            row = np.zeros(count + 2)
            row[k + 1], row[names.index(name[:-1] + "r") + 1] = 1 / UNEVEN, -1 / UNEVEN
            rows.append(row)
    return np.array(rows)


def unlikeness(table: Responses, fields, opening: float, contraction) -> np.ndarray:
    """(n,) mm, the deviation of what a person's muscles do from what ours do."""
    moved = (np.linalg.norm(fields, axis=2) * contraction[:, None]) ** 2
    jaw = np.linalg.norm(table.jaw_at(opening), axis=1) ** 2
    near = np.clip(table.reach / 6.0, 0, 1)
    return np.sqrt(UNLIKE**2 * (moved.sum(axis=0) + jaw) + (LEAST * near) ** 2)
