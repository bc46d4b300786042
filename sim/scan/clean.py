# SPDX-License-Identifier: GPL-3.0-or-later
"""What a raw scan must lose before anything can be computed on it, and nothing more: holes and specks stay."""

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from ..errors import InputError
from ..mesh import Mesh, cross_sides
from ..point_cloud.meshed import meshing
from ..progress import Progress, Work, finish, portion
from .strays import stray_vertices
from .texture import has_pictures, triangle_corners
from .views import laying_together
from .winding import wound_alike

#: Fewer triangles than this are no head.
FEWEST_TRIANGLES = 100
#: More than this would not fit the memory of an ordinary machine.
MOST_TRIANGLES = 40_000_000
#: Times its own size that a scan may lie from the origin, as georeferenced ones do.
FARTHEST = 1000
#: A triangle is a line when its height is below this part of its longest edge.
FLAT = 1e-7


def clean_scan(mesh: Mesh) -> tuple[Mesh, dict]:
    """`cleaning`, at once."""
    return finish(cleaning(mesh))


def cleaning(mesh: Mesh) -> Work:
    """Work returning a triangle mesh without NaN vertices, zero-area, duplicate faces and unused vertices; equal ones welded,
    neighbours wound the same way round, and views that overlap laid onto each other (`views`). Points without faces become a
    mesh first (`point_cloud.meshing`).

    It returns the mesh (colours kept: the mean of those welded; pictures too) and counts: ``vertices``, ``triangles``,
    ``components`` of the result, ``points`` that it was made of (0: it had faces), what was removed: ``nonfinite_vertices``,
    ``nonfinite_faces``, ``welded_vertices``, ``stray_vertices`` with the faces at them, ``zero_area_faces``,
    ``duplicate_faces``, ``unused_vertices``, the ``turned_faces``, and how many ``sheets`` were laid onto each other, that were
    ``sheets_apart``.

    Raises
    ------
    InputError : nothing usable is there: no points, too few of them or of faces, too many, all NaN, all in one point or plane,
    too far from the origin.
    """
    counts = {"points": 0}
    if len(mesh.vertices) and not len(mesh.faces):
        counts["points"] = len(mesh.vertices)
        mesh = yield from portion(meshing(mesh), 0.0, 0.9)
        yield Progress(0.9, "Cleaning the scan")
        return (yield from portion(_cleaning(mesh, counts), 0.9, 1.0))
    return (yield from _cleaning(mesh, counts))


def _cleaning(mesh, counts):
    """`cleaning` of a mesh with faces, adding to ``counts``."""
    yield Progress(0.0, "Cleaning the scan")
    points, triangles = mesh.vertices, mesh.triangles
    rows = np.arange(len(triangles))
    _refuse_hopeless(points, triangles)
    finite = np.isfinite(points).all(axis=1)
    counts["nonfinite_vertices"] = int((~finite).sum())
    if not finite.any():
        raise InputError("No vertex of the scan has a position (all are NaN): export the scan again.")
    usable = finite[triangles].all(axis=1)
    counts["nonfinite_faces"] = int((~usable).sum())
    triangles, rows = triangles[usable], rows[usable]
    kept = np.zeros(len(points), dtype=bool)
    kept[triangles.ravel()] = True
    counts["unused_vertices"] = int((finite & ~kept).sum())
    index = np.cumsum(kept) - 1
    points, triangles = points[kept], index[triangles]
    colour = None if mesh.colour is None else mesh.colour[kept]

    yield Progress(0.15, "Cleaning the scan")
    same, count = _coincident(points)
    yield Progress(0.4, "Cleaning the scan")
    counts["welded_vertices"] = len(points) - count
    points, colour = _merged(points, colour, same, count)
    triangles = same[triangles]
    stray = stray_vertices(points, triangles)
    counts["stray_vertices"] = int(stray.sum())
    whole = ~stray[triangles].any(axis=1)
    triangles, rows = triangles[whole], rows[whole]
    _refuse_extent(points[~stray])

    yield Progress(0.5, "Cleaning the scan")
    flat = _flat(points, triangles)
    counts["zero_area_faces"] = int(flat.sum())
    triangles, rows = triangles[~flat], rows[~flat]
    yield Progress(0.6, "Cleaning the scan")
    again = _repeated(triangles)
    yield Progress(0.85, "Cleaning the scan")
    counts["duplicate_faces"] = int(again.sum())
    triangles, rows = triangles[~again], rows[~again]

    kept = np.zeros(len(points), dtype=bool)
    kept[triangles.ravel()] = True
    counts["unused_vertices"] += int((~kept & ~stray).sum())
    triangles = (np.cumsum(kept) - 1)[triangles]
    points, colour = points[kept], None if colour is None else colour[kept]
    if len(triangles) < FEWEST_TRIANGLES:
        raise InputError(
            f"Only {len(triangles)} usable triangles are left of the scan, too few for a head: choose another file."
        )
    _refuse_flat(points)
    turned = wound_alike(triangles, len(points))
    counts["turned_faces"] = int(turned.sum())
    triangles[turned] = triangles[turned, ::-1]
    yield Progress(0.9, "Cleaning the scan")
    pieces, label = components(triangles, len(points))
    laying = laying_together(points, triangles, label)
    points, once, counts["sheets"], counts["sheets_apart"] = yield from portion(laying, 0.9, 1.0)
    if not once.all():
        triangles, rows, turned = triangles[once], rows[once], turned[once]
        kept = np.zeros(len(points), dtype=bool)
        kept[triangles.ravel()] = True
        triangles = (np.cumsum(kept) - 1)[triangles]
        points, colour = points[kept], None if colour is None else colour[kept]
        pieces = components(triangles, len(points))[0]
    counts |= {"vertices": len(points), "triangles": len(triangles), "components": pieces}
    clean = replace(Mesh.from_triangles(points, triangles), colour=colour)
    return _with_pictures(clean, mesh, rows, turned), counts


def _with_pictures(clean: Mesh, mesh: Mesh, rows, turned) -> Mesh:
    """``clean`` with the pictures of ``mesh``, of whose triangles ``rows`` (t,) were kept and ``turned`` (t,) bool turned."""
    if not has_pictures(mesh):
        return clean
    corners, material = triangle_corners(mesh)
    corners = corners[rows]
    corners[turned] = corners[turned, ::-1]
    uv = np.zeros((len(rows), 4, 2), np.float32)
    uv[:, :3] = corners
    return replace(clean, uv=uv, material=material[rows], pictures=mesh.pictures)


def components(triangles: np.ndarray, vertex_count: int) -> tuple[int, np.ndarray]:
    """How many separate pieces triangles (m, 3) form, and the piece (vertex_count,) of each vertex."""
    a, b = triangles[:, [0, 1]].ravel(), triangles[:, [1, 2]].ravel()
    graph = coo_matrix((np.ones(len(a), dtype=np.int8), (a, b)), shape=(vertex_count, vertex_count))
    _, label = connected_components(graph, directed=False)
    used = np.unique(label[triangles[:, 0]])
    return len(used), label


def _refuse_hopeless(points, triangles):
    if len(points) == 0:
        raise InputError("The scan has no vertices: choose another file, or export it again.")
    if len(triangles) < FEWEST_TRIANGLES:
        raise InputError(
            f"The scan has {len(triangles)} triangle{'s' if len(triangles) > 1 else ''}, too few for a head: choose "
            "another file, or export it with more detail."
        )
    if len(triangles) > MOST_TRIANGLES:
        raise InputError(
            f"The scan has {len(triangles)} triangles, more than memory allows: reduce it to {MOST_TRIANGLES} or fewer."
        )
    if triangles.min() < 0 or triangles.max() >= len(points):
        raise InputError("The scan is damaged, a face names a vertex that does not exist: export it again.")


def _refuse_extent(points):
    """Blender's numbers, which have 24 bits, are .02 mm apart where a head is `FARTHEST` times its size from the origin."""
    extent = np.ptp(points, axis=0).max() if len(points) else 1.0
    if not 0 < extent < 1e12:
        raise InputError(f"The scan measures {extent:g} units across, which is no head in any unit: check the export.")
    away = np.linalg.norm((points.min(axis=0) + points.max(axis=0)) / 2) if len(points) else 0.0
    if away > FARTHEST * extent:
        raise InputError(
            f"The scan lies {away / extent:,.0f} times its own size from the origin of its coordinates, too far to be exact: "
            "move it there, and its landmarks with it, and export it again."
        )


def _refuse_flat(points):
    centred = points - points.mean(axis=0)
    spread = np.sqrt(np.maximum(np.linalg.eigvalsh(centred.T @ centred / len(points)), 0))
    if spread[0] < 1e-4 * spread[2]:
        raise InputError("The scan is flat, all its points lie in one plane: choose the scan of a head.")


def _coincident(points):
    """Vertices in exactly one place: the new index of each (n,) and how many there are.

    UV seams, STL triangles and merged sheets repeat positions bit by bit. One sort of a 64-bit mix of the coordinates
    is far faster than sorting rows; neighbours in it are then compared for real.
    """
    order = np.argsort(_mixed(np.ascontiguousarray(points.T) + 0.0), kind="stable")  # + 0.0 turns -0 into 0
    new = np.ones(len(points), dtype=bool)
    new[1:] = (points[order[1:]] != points[order[:-1]]).any(axis=1)
    first = order[np.maximum.accumulate(np.where(new, np.arange(len(points)), 0))]  # the first vertex of each place
    leader = np.empty(len(points), dtype=np.int64)
    leader[order] = first
    own = leader == np.arange(len(points))
    return (np.cumsum(own) - 1)[leader], int(own.sum())


def _merged(points, colour, same, count):
    out = np.empty((count, 3))
    out[same] = points
    if colour is None:
        return out, None
    share = np.bincount(same, minlength=count)
    mean = np.stack([np.bincount(same, colour[:, k], minlength=count) / share for k in range(3)], axis=1)
    return out, mean.astype(np.float32)


def _flat(points, triangles):
    planes = points.T.copy()
    a, b, c = (planes.take(triangles[:, k], axis=1) for k in range(3))
    longest = np.maximum.reduce([_squares(e) for e in (b - a, c - a, c - b)])
    return np.sqrt(_squares(cross_sides(a, b, c))) <= FLAT * longest


def _squares(v):
    return v[0] * v[0] + v[1] * v[1] + v[2] * v[2]


def _repeated(triangles):
    """True for each triangle whose three corners were seen before, in any order."""
    a, b, c = triangles.T.astype(np.int64)
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    rows = np.stack([low, a + b + c - low - high, high])
    order = np.argsort(_mixed(rows), kind="stable")
    rows = rows[:, order]
    again = np.zeros(len(triangles), dtype=bool)
    again[order[1:]] = (rows[:, 1:] == rows[:, :-1]).all(axis=0)
    return again


def _mixed(columns):
    """One 64-bit number per item from columns (k, n) of 64-bit ones; equal items get equal numbers."""
    key = np.zeros(columns.shape[1], dtype=np.uint64)
    for column in columns:
        key ^= column.view(np.uint64)
        key *= np.uint64(0x9E3779B97F4A7C15)
        key ^= key >> np.uint64(29)
    return key
