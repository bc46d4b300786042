# SPDX-License-Identifier: GPL-3.0-or-later
"""A mesh of the surface that points without faces were measured on; where they saw nothing it has holes."""

import numpy as np

from ..errors import InputError
from ..mesh import Mesh, edges
from ..progress import Progress, Work, finish, portion
from .facing import outward
from .neighbourhoods import CLOSE, batches, discs, nearest, spacing, specks
from .sphere_fit import Spheres
from .surface_nets import Grid
from .thinning import Settled, settling, thinned

#: Fewer points than this show no face, more would not fit the memory of an ordinary machine.
FEWEST, MOST = 1000, 100_000_000
#: A cell of the grid is as wide as so many spacings of the points, or wider, so that about so many cells lie on the surface:
#: up to a width at which it still shows what they do, and from there on, so that no more than these do.
WIDTH, CELLS = 0.8, 150_000
WIDEST, MOST_CELLS = 1.2, 1_000_000
SAME = 4e-6  # of the extent: points that are no farther apart are one, as those of triangles that share no vertex
#: Points that tell the spacing of all. Some may be `FARTHER` spacings apart; more are outliers.
TELLING = 20_000
FARTHER = 4.0
#: Points farther than this from the middle of all, times as far as nine tenths are, are none of it.
STRAY = 10.0
#: A sphere is right near its points alone. Farther from the plane of the nearest than this part of a cell, that plane tells
#: the side; and a cell is looked at if that may pass it.
NEAR = 0.5
#: The surface ends so many spacings beyond the last point, and gaps of as many cells on either side are none.
BEYOND = 1.0
GAP = 3
#: A vertex that has to be moved farther than this many cells is of no surface, but lies midway between two.
MOVED = 1.5
#: Normals that are given are of use if so many of the nearest agree with each; some programs leave their signs to chance.
AGREE = 0.95
LABEL = "Making a mesh of the points"


def meshed(cloud: Mesh) -> Mesh:
    """`meshing`, at once."""
    return finish(meshing(cloud))


def meshing(cloud: Mesh) -> Work:
    """Work returning the mesh of a ``cloud``, a mesh without faces, in any unit; with the colours that its points have.

    Its ``normals`` tell which side is out if it has any and they agree. Points are averaged where they are closer than is of
    use, and where they are noisy; specks of a few are left out.

    Raises
    ------
    InputError : there are too few points, or too many, or all lie in one place.
    """
    yield Progress(0.0, LABEL)
    points, values = _usable(cloud)
    distance = nearest(points, CLOSE, points[:: 1 + len(points) // TELLING])[0]
    apart = spacing(distance)
    cell = _cell(apart, len(points))
    yield Progress(0.05, LABEL)
    settled = yield from portion(settling(points, values, cell / 2, LABEL), 0.05, 0.2)
    kept = (
        np.zeros(0, bool) if settled is None else ~specks(settled.apart, settled.distance[:, 1:], settled.near[:, 1:])
    )
    _refuse_few(kept)
    yield Progress(0.2, LABEL)
    settled, _ = Settled.of(settled.points[kept], settled.values[kept])
    told = None if cloud.normals is None else _as_told(settled)
    facing = outward(settled.points, settled.facing, settled.near) if told is None else told
    yield Progress(0.35, LABEL)
    surface = Spheres(settled.points, facing, settled.apart, settled.values)
    cell = max(cell, _cell(settled.apart, len(settled.apart)))
    return (yield from portion(_drawn(surface, cell, cloud.colour is not None), 0.35, 1.0))


def _usable(cloud):
    """Points (n, 3) and what is known of them (n, 0, 3 or 6), colours before normals; without strays, and those without a
    place."""
    points = cloud.vertices
    known = [table for table in (cloud.colour, cloud.normals) if table is not None]
    values = np.nan_to_num(np.concatenate([np.zeros((len(points), 0)), *known], axis=1))
    if len(points) > MOST:
        raise InputError(f"The scan has {len(points)} points, more than memory allows: reduce it to {MOST} or fewer.")
    usable = np.isfinite(points).all(axis=1)
    _refuse_few(usable)
    from_middle = np.abs(points - np.median(points[usable], axis=0)).max(axis=1)
    with np.errstate(invalid="ignore"):
        usable &= from_middle <= STRAY * np.quantile(from_middle[usable], 0.9)
    extent = np.ptp(points[usable], axis=0).max()
    points, values, _ = thinned(points[usable], max(SAME * extent, np.finfo(float).tiny), values[usable])
    _refuse_few(np.ones(len(points), bool))
    return points, values


def _cell(apart, count):
    """How wide the cells are for ``count`` points, some of which are ``apart`` (n,) from each other."""
    spacing = np.median(apart)
    area = np.mean(np.minimum(apart, FARTHER * spacing) ** 2) * count
    return max(WIDTH * spacing, min(WIDEST * spacing, np.sqrt(area / CELLS)), np.sqrt(area / MOST_CELLS))


def _refuse_few(usable):
    count = int(usable.sum())
    if count < FEWEST:
        raise InputError(
            f"The scan has no faces, and only {count} points that tell a surface, too few for a head: choose another "
            "file, or make a mesh of it (the scanner's software can)."
        )


def _as_told(settled: Settled):
    """Its planes' normals (n, 3) on the side that the last three of its values tell, or None if neighbours' disagree."""
    normals = settled.values[:, -3:]
    turned = np.where(np.einsum("ij,ij->i", settled.facing, normals)[:, None] < 0, -settled.facing, settled.facing)
    agree = np.einsum("nki,ni->nk", normals[settled.near[:, 1:]], normals) > 0
    return turned if agree.mean() > AGREE else None


def _drawn(surface: Spheres, cell: float, coloured: bool) -> Work:
    """Work returning the mesh of ``surface`` in cells of this size, and the first three of its values as colours."""
    grid = Grid(discs(surface.points, surface.normals, 2 * surface.apart, cell), cell)
    yield Progress(0.1, LABEL)
    side = surface.about(grid.corner)
    of_cells = side[grid.at]
    passed = (of_cells.min(axis=1) < NEAR * cell) & (of_cells.max(axis=1) > -NEAR * cell)
    exact = np.unique(grid.at[passed])
    for rows in batches(len(exact)):
        yield Progress(0.2 + 0.5 * rows.start / len(exact), LABEL)
        corner = exact[rows]
        fitted = surface.outside(grid.corner[corner])
        flipped = (np.abs(side[corner]) > NEAR * cell) & (fitted * side[corner] < 0)
        side[corner] = np.where(flipped, side[corner], fitted)
    first, quads = grid.surface(side)
    yield Progress(0.8, LABEL)
    vertices = surface.onto(first)[0]
    yield Progress(0.9, LABEL)
    vertices, away, values = surface.onto(vertices)
    seen = _closed(away < BEYOND, quads) & (np.linalg.norm(vertices - first, axis=1) < MOVED * cell)
    used, quads = np.unique(quads[seen[quads].all(axis=1)], return_inverse=True)
    colour = values[used, :3].astype(np.float32) if coloured else None
    return Mesh(vertices[used], quads.reshape(-1, 4).astype(np.int32), colour=colour)


def _closed(seen, quads):
    """(v,) bool: vertices that are ``seen``, and those in gaps of which no vertex is farther than `GAP` from seen ones."""
    one, other = edges(quads).T
    for wanted in (True,) * GAP + (False,) * GAP:
        ends = (seen[one] == wanted) | (seen[other] == wanted)
        seen = seen.copy()
        seen[one[ends]] = seen[other[ends]] = wanted
    return seen
