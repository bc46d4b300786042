# SPDX-License-Identifier: GPL-3.0-or-later
"""People with hair of many kinds, made of the reference head, and what is known of them."""

from functools import partial

import numpy as np
import pytest
from scipy.sparse import csr_matrix, identity, vstack
from scipy.spatial import cKDTree

from headshop.sim.adapt.closest import Surface
from headshop.sim.anatomy.landmark_names import SKIN
from headshop.sim.mesh import Mesh, vertex_normals
from headshop.sim.mesh_subdivision import drawn
from headshop.sim.scan.individual import draw_field

RISE = 12.0  # mm from where hair begins to where it is as thick
HIGH = 0.2  # of its height above the brows by which the skull is higher than most
SPARE = 30.0  # mm from the tragus that hair leaves free
SHORT, TUFT, STRANDS = 6.0, 1.2, (9.0, 4.0)  # mm: short hair, how far it varies, and from where to where it does


@pytest.fixture(scope="session")
def grown(reference):
    """``grown(thick, high, lowest)`` -> `somebody`: the scan, the skin below, and its landmarks (mm)."""
    return partial(somebody, reference)


@pytest.fixture(scope="session")
def short():
    """mm, the height of `shag`."""
    return SHORT


@pytest.fixture(scope="session")
def shag():
    """``shag(points)`` -> (n,) mm, the height of short hair in tufts over ``points`` (n, 3) mm."""
    return in_tufts


@pytest.fixture(scope="session")
def falling():
    """``falling(points)`` -> (n,) mm, the height of such hair that falls on a forehead."""
    return partial(in_tufts, thick=9.0, tuft=2.5)


@pytest.fixture(scope="session")
def shaggy(grown, shag):
    """Somebody with short hair, in tufts."""
    return grown(shag)


@pytest.fixture(scope="session")
def of_face():
    """``of_face(truth)`` -> of all landmarks, those that no hair hides."""
    hidden = ("eu", "ft", "v", "op", "tr")
    return lambda truth: {n: p for n, p in truth.items() if n in SKIN and n.partition("_")[0] not in hidden}


@pytest.fixture(scope="session")
def surface_of():
    """``surface_of(mesh)`` -> the surface of a scan."""
    return lambda mesh: Surface(mesh.vertices, mesh.triangles, smooth=2.0)


def somebody(reference, thick, high=HIGH, lowest=np.inf):
    """Somebody with a high skull and hair ``thick`` mm, on scalp and nape, and on the forehead down to ``lowest`` mm above the
    brows: the scan, the skin below, and its landmarks (mm)."""
    field = draw_field(reference.landmark_positions(), np.random.default_rng(5))
    skin = reference.skin
    rest = reference.landmark_positions()
    at = skin.vertices
    whole = drawn(skin.faces, at + field(at))
    above = np.maximum(at[:, 2] - rest["g"][2], 0)
    whole[:, 2] += high * above**2 / above.max()
    grows = reference.groups["scalp"] > 0.5
    grows |= (at[:, 1] > rest["pa_l"][1] + 15) & (at[:, 2] > rest["gn"][2] + 25)
    fringe = (at[:, 2] > rest["sci_l"][2] + lowest) & (at[:, 1] < rest["t_l"][1] - 20)
    grows |= fringe & (reference.groups["inner"] < 0.5)
    free = cKDTree(at[~grows]).query(at)[0]
    free = np.minimum(free, cKDTree([rest["t_l"], rest["t_r"]]).query(at)[0] - SPARE)
    rise = np.clip(free / RISE, 0, 1) * grows
    outer = skin.triangles[~(reference.groups["inner"] > 0.5)[skin.triangles].any(axis=1)]
    fine, parts_of = subdivided(outer, len(whole))
    points, normals = parts_of @ whole, parts_of @ vertex_normals(whole, outer)
    points = points + (thick(points) * (parts_of @ rise))[:, None] * normals
    parts = {name: part.vertices for name, part in reference.parts.items() if name != "skin"}
    truth = reference.landmarks.on({"skin": whole} | parts)
    return Mesh.from_triangles(points, fine), whole, truth


def subdivided(triangles, n):
    """Each of ``triangles`` (t, 3) in four, twice, and the new vertices as sparse rows over the ``n`` old ones."""
    rows = identity(n, format="csr")
    for _ in range(2):
        ends = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
        side, which = np.unique(ends, axis=0, return_inverse=True)
        k = np.arange(len(side))
        middle = csr_matrix(
            (np.full(2 * len(side), 0.5), (np.r_[k, k], side.T.ravel())), shape=(len(side), rows.shape[0])
        )
        ab, bc, ca = which.reshape(3, -1) + rows.shape[0]
        a, b, c = triangles.T
        rows = vstack([rows, middle @ rows]).tocsr()
        triangles = np.concatenate([np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return triangles, rows


def in_tufts(points, thick=SHORT, tuft=TUFT):
    """(n,) mm, the height of short hair in tufts over ``points`` (n, 3) mm."""
    rng = np.random.default_rng(3)
    out = np.full(len(points), thick)
    for size in STRANDS:
        waves, phase = rng.normal(size=(3, 200)) / size, rng.uniform(0, 2 * np.pi, 200)
        out += tuft * np.sqrt(2 / 200) * np.cos(points @ waves + phase).sum(axis=1)
    return np.maximum(out, 0)
