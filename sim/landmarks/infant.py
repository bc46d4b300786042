# SPDX-License-Identifier: GPL-3.0-or-later
"""The face of an infant: what heads of the first years are like, of whom that of a grown one is no likely shape.

Faces grow more than skulls do (Farkas, Posnick and Hreczko 1992), noses and jaws most of all, so that a child of one year has
half to nine tenths of a grown person's measurements, each another share.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from ..adapt.closest import Surface
from ..adapt.thin_plate_spline import similarity
from ..anatomy.head import Head
from ..scan.individual import displaced, functionals, read_table, smoothest
from .expression import line_of
from .lip_line import lip_height
from .shape_fit import CHANGE, ShapeFit, Told, fit_shape, part_of
from .shape_space import ShapeSpace

TABLE = Path(__file__).resolve().parents[2] / "assets" / "tables" / "infant_face.csv"
ROUNDS = 6  # in which the head and the directions of its measurements come to agree
MOUTH = ("sto", "ls", "li", "ch_l", "ch_r")  # what moves with the lips
TRIES = 2  # times that lips are looked for


def infant_space(reference: Head, space: ShapeSpace) -> ShapeSpace:
    """``space``, the shape space of the ``reference``, about the head of a child of one year instead.

    Its points are those of that head blown up to about the reference's size, its ``size`` what it has of that. Heads vary about
    it as grown ones do.
    """
    return replace(space, points=infant_points(reference, space.points), size=_size(_shares(read_table(TABLE))))


def likelier_space(reference: Head, space: ShapeSpace, size: float, marks: dict[str, np.ndarray]) -> ShapeSpace:
    """``space``, the shape space of the ``reference``, or `infant_space`, if heads that are ``size`` times the reference are
    likelier there and ``marks``, name -> (3,) mm, lie more as on those, which of a small cast of a grown head they do not."""
    infants = infant_space(reference, space)
    if abs(np.log(size / infants.size)) > abs(np.log(size / space.size)):
        return space
    return min((space, infants), key=lambda each: _amiss(each, marks))


def _amiss(space, marks):
    """mm, of a head of the reference's size, by which ``marks`` lie amiss on the likeliest of the ``space``, all of them."""
    laid = space.landmarks(space.points)
    own, places = (np.array([of[name] for name in marks if name in laid]) for of in (laid, marks))
    matrix, shift = similarity(own, places)
    return np.linalg.norm(own @ matrix.T + shift - places) / np.cbrt(np.linalg.det(matrix))


def infant_points(reference: Head, points: np.ndarray) -> np.ndarray:
    """(n, 3) mm: where ``points`` (n, 3) of the ``reference`` lie on the head of a child of one year that is blown up to about
    its size, by the mean growth of the measurements.

    Among all heads with the measurements of ``assets/tables/infant_face.csv`` it is the one that differs from the reference
    by the smoothest displacement (`sim.scan.individual`).
    """
    table, marks = read_table(TABLE), reference.landmark_positions()
    shares = _shares(table)
    sources, rows, of = functionals(marks, table)
    wanted = shares[of] / _size(shares) * _measured(rows, sources)
    places = np.array(list(marks.values()))
    for _ in range(ROUNDS):
        change = wanted - _measured(rows, sources)
        strength = smoothest(sources, rows, change[:, None])
        moved = places + displaced(places, sources, strength)[:, :, 0]
        rows = functionals(dict(zip(marks, moved, strict=True)), table)[1]
    return points + displaced(points, sources, strength)[:, :, 0]


def _shares(table):
    """(rows,) what a child of one year has of each measurement of a grown person's."""
    return np.array([float(row["of_adult"]) for row in table])


def _size(shares):
    """Their mean, as factors have it."""
    return float(np.exp(np.log(shares).mean()))


def _measured(rows, places):
    """(a,) mm: what measurements ``rows`` (a, p, 3), `functionals`, are of ``places`` (p, 3) mm."""
    return np.einsum("apk,pk->a", rows, places)


def with_mouth_in_place(space: ShapeSpace, target: Surface, fit: ShapeFit):
    """A generator: yields the fraction done, returns ``fit``, or one whose lips meet in the crease nearest to them if they
    do not meet in one. MakeHuman's babies have theirs some 10 mm, of a grown head, lower than the norms."""
    for k in range(TRIES):
        if line_of(space, fit, target) is not None:
            break
        marks = space.landmarks(fit.points)
        middle = lip_height(target, marks, -fit.pose.turn[:, 1], fit.pose.scale)
        if middle is None:
            break
        told = Told.of(space, {name: marks[name] + middle - marks["sto"] for name in MOUTH})
        fit = yield from part_of(fit_shape(space, target, fit.pose, CHANGE, fit.coefficients, told=told), k, TRIES)
    return fit
