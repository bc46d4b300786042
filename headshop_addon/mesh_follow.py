# SPDX-License-Identifier: GPL-3.0-or-later
"""What is kept in a scan's own space goes with its mesh when an artist moves that within it, as *Set Origin* and *Apply* do.

A few vertices far from each other are kept with the object. Where they lie elsewhere now, and one affine map takes them there,
it holds for the landmarks too, and for the way from the axes of the scan's file. What is sculpted or cut moves nothing.
Here everything is in mm.
"""

import numpy as np

from . import bridge

KEPT = "headshop_vertices"
TURN = "headshop_turn"  # (3, 3) from the axes of the scan's file to its own space: a rotation, until an artist applied a scale
SHIFT = "headshop_shift"  # (3,) where the origin of its file is in its own space
#: How many vertices are kept, and how many of them must go one way: some map takes any four anywhere.
COUNT, ENOUGH = 12, 9
#: Among how many vertices they are chosen.
SAMPLED = 20_000
#: What is rounding and what still follows a map, of the largest coordinate; how much flatter a map may make the mesh.
ROUNDING, TINY, FLATTER = 1e-6, 1e-4, 1e4


def change(scan) -> np.ndarray | None:
    """The affine map (4, 4) from where the mesh was when `remember` was called to where it is; None if there is none to tell.

    Writes nothing: drawing may ask.
    """
    kept = scan.get(KEPT)
    if kept is None or kept["count"] != len(scan.data.vertices):
        return None
    return affine(np.reshape(kept["positions"], (-1, 3)), bridge.read_some_positions(scan, kept["indices"]))


def remember(scan) -> None:
    """Keep where the mesh is."""
    kept, count = scan.get(KEPT), len(scan.data.vertices)
    if count < COUNT:
        scan.pop(KEPT, None)
        return
    same = kept is not None and kept["count"] == count
    indices = list(kept["indices"]) if same else _spread(bridge.read_positions(scan))
    positions = bridge.read_some_positions(scan, indices).ravel().tolist()
    if not same or list(kept["positions"]) != positions:
        scan[KEPT] = {"count": count, "indices": indices, "positions": positions}


def settle(scan) -> None:
    """Let what is kept in the scan's own space be where its mesh has gone; before anything is written there, and by operators
    only."""
    gone = change(scan)
    if gone is None:
        remember(scan)
    else:
        carry(scan, gone)


def carry(scan, matrix: np.ndarray) -> None:
    """Take what is kept in the scan's own space along by a ``matrix`` (4, 4), by which its mesh was moved."""
    for item in scan.headshop.landmarks:
        both = np.array([item.co, item.found]) / bridge.METRES
        item.co, item.found = moved(matrix, both) * bridge.METRES
    write_file_axes(scan, matrix @ file_axes(scan))
    remember(scan)


def file_axes(scan) -> np.ndarray:
    """The affine map (4, 4) from the axes of the scan's file to its own space, as last settled."""
    matrix = np.eye(4)
    matrix[:3, :3] = np.reshape(scan.get(TURN, np.eye(3).ravel()), (3, 3))
    matrix[:3, 3] = scan.get(SHIFT, (0.0, 0.0, 0.0))
    return matrix


def write_file_axes(scan, matrix: np.ndarray) -> None:
    """Store what `file_axes` reads."""
    scan[TURN], scan[SHIFT] = matrix[:3, :3].ravel().tolist(), matrix[:3, 3].tolist()


def moved(matrix: np.ndarray | None, points) -> np.ndarray:
    """Points (..., 3) by an affine map (4, 4), or where they are without one."""
    return np.asarray(points) if matrix is None else points @ matrix[:3, :3].T + matrix[:3, 3]


def affine(before: np.ndarray, now: np.ndarray) -> np.ndarray | None:
    """The map (4, 4) that takes nearly all points (n, 3) from one place to another; None if there is none or they stay.

    Least squares; while a point is off, the one without which the others fit best is left out, as one that was sculpted.
    """
    size = max(np.abs(before).max(), np.abs(now).max())
    if np.count_nonzero(np.linalg.norm(now - before, axis=1) <= ROUNDING * size) >= ENOUGH:
        return None
    used = np.arange(len(before))
    while len(used) >= ENOUGH:
        middle = before[used].mean(axis=0)
        known = np.column_stack([before[used] - middle, np.ones(len(used))])
        inverse = np.linalg.pinv(known)
        fitted = inverse @ now[used]
        off = np.linalg.norm(now[used] - known @ fitted, axis=1)
        if off.max() <= TINY * size:
            turn = fitted[:3].T
            matrix = np.block([[turn, (fitted[3] - turn @ middle)[:, None]], [np.zeros(3), np.ones(1)]])
            return matrix if np.linalg.cond(turn) < FLATTER else None
        alone = np.einsum("ij,ji->i", known, inverse)  # 1 where the fit hangs on a point: it is never off
        used = np.delete(used, np.argmax(off / np.sqrt(np.maximum(1 - alone, 1e-9))))
    return None


def _spread(points: np.ndarray) -> list[int]:
    """Indices of `COUNT` of the points (n, 3), each as far as can be from those before it."""
    some = np.arange(0, len(points), len(points) // SAMPLED + 1)
    far, chosen = np.linalg.norm(points[some] - points.mean(axis=0), axis=1), []
    for _ in range(COUNT):
        chosen.append(int(some[far.argmax()]))
        far = np.minimum(far, np.linalg.norm(points[some] - points[chosen[-1]], axis=1))
    return chosen
