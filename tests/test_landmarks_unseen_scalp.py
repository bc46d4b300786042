# SPDX-License-Identifier: GPL-3.0-or-later
"""Scalp that a scan does not show is laid where the likeliest head to go with its face has it; scalp that it shows counts."""

import numpy as np
import pytest

from headshop.sim.adapt.build import build_head
from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.thin_plate_spline import similarity
from headshop.sim.anatomy.landmark_names import SKIN
from headshop.sim.landmarks.first_look import first_look
from headshop.sim.landmarks.pose_search import Pose
from headshop.sim.landmarks.shape_fit import REST, Expression, fit_shape
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.landmarks.under_hair import HARDLY, LOOSE, fit_under_hair, without_moved
from headshop.sim.mesh import Mesh, vertex_normals
from headshop.sim.mesh_subdivision import drawn
from headshop.sim.progress import finish
from headshop.sim.relax.responses import responses

SKULL = ("v", "op", "eu", "tr")
BEHIND = 20.0  # mm behind the ears to which the scan goes


@pytest.fixture(scope="module")
def space(reference):
    return shape_space(reference)


@pytest.fixture(scope="module")
def person(space):
    """Somebody of the shape space, lips closed and eyes open: the skin (n, 3) mm and its landmarks."""
    k = np.arange(space.modes.shape[2])
    skin = space.shaped(np.where(k < 12, 0.8 * (-1.0) ** k, 0.0))
    return skin, {n: p for n, p in space.landmarks(skin).items() if n in SKIN}


@pytest.fixture(scope="module")
def mask(space, person):
    """A scan of the face of that person, up to the hair: (Mesh, (n,) bool: what it shows)."""
    skin, marks = person
    seen = (skin[:, 2] < marks["tr"][2]) & (skin[:, 1] < marks["t_l"][1] + BEHIND)
    return Mesh.from_triangles(skin, space.triangles[seen[space.triangles].all(axis=1)]), seen


def test_the_likeliest_head_has_the_crown_of_measured_heads(space, reference):
    """From nasion to vertex it has .9 of what it has from nasion to gnathion; all that lies below nasion is the reference's."""
    marks = space.landmarks(space.points)
    assert (marks["v"][2] - marks["n"][2]) / (marks["n"][2] - marks["gn"][2]) == pytest.approx(0.9, abs=0.03)
    rest = drawn(reference.skin.faces, reference.skin.vertices)[space.vertices]
    low = rest[:, 2] < reference.landmark_positions()["n"][2]
    assert np.array_equal(space.points[low], rest[low])


def test_scalp_without_data_is_the_likeliest_heads(space, person, mask, reference):
    """Nearer to the person's own than the reference's is, though nothing of it is seen."""
    skin, marks = person
    scan, seen = mask
    target = Surface(scan.vertices, scan.triangles)
    given = {n: p for n, p in marks.items() if n.partition("_")[0] not in SKULL}
    look = finish(first_look(reference, target, given))
    assert look.target is target and not any(look.left_out.values())
    scalp = space.hairy & ~seen & (skin[:, 2] > marks["tr"][2] + 20)
    assert not target.closest(skin[scalp], 15.0).found.any()
    off = look.filled.closest(skin[scalp]).distance
    names = list(given)
    rest = reference.landmark_positions()
    matrix, shift = similarity([rest[n] for n in names], [given[n] for n in names])
    plain = Surface(reference.skin.vertices @ matrix.T + shift, reference.skin.triangles).closest(skin[scalp]).distance
    assert off.mean() < 5.0 and off.mean() < 0.6 * plain.mean()
    assert np.isin(np.flatnonzero(scalp), np.flatnonzero(np.isin(space.vertices, look.hidden))).mean() > 0.95


def test_how_ears_are_shaped_tells_nothing_of_the_scalp_behind_them(space, person, mask, reference):
    """Whose ears are thicker and stand off more has the same skull: it once swelled beside them, to a ridge."""
    skin, marks = person
    given = {n: p for n, p in marks.items() if n.partition("_")[0] not in SKULL}
    ears = skin + 4.0 * space.ear[:, None] * vertex_normals(skin, space.triangles)
    behind = space.hairy & (skin[:, 1] > marks["t_l"][1]) & (skin[:, 2] > marks["t_l"][2] + 5)
    behind &= skin[:, 2] < marks["tr"][2] - 20
    behind[behind] = ~Surface(skin, mask[0].triangles).closest(skin[behind], 25.0).found
    assert behind.sum() > 10

    def scalp(vertices):
        scan = Mesh.from_triangles(vertices, mask[0].triangles)
        filled = finish(first_look(reference, Surface(scan.vertices, scan.triangles), given)).filled
        return filled.closest(skin[behind])

    one, other = scalp(skin), scalp(ears)
    assert np.linalg.norm(one.points - other.points, axis=1).max() < 4.0


def test_a_head_built_of_a_mask_says_its_scalp_is_invented(space, person, mask, reference):
    skin, marks = person
    scan, seen = mask
    built = finish(build_head(reference, scan, {n: p for n, p in marks.items() if n not in ("v", "op")}, detail=0))
    scalp = space.hairy & (skin[:, 2] > marks["tr"][2] + 20)
    rows = space.vertices[scalp]
    assert built.attributes["fitted"][rows].max() == 0 and np.isnan(built.attributes["distance_mm"][rows]).all()
    assert "scalp" in built.fit["invented"] and built.fit["left_out_mm2"]["hair"] == 0
    off = np.linalg.norm(built.head.skin.vertices[rows] - skin[scalp], axis=1)
    assert built.head.skin.vertices[rows][:, 2].max() == pytest.approx(skin[:, 2].max(), abs=6.0)
    assert np.mean(off) < 12.0


def test_a_picked_back_of_the_head_is_heeded_and_a_guessed_one_is_not(space, person, mask, reference):
    """A head is built to where it was picked to end, though the scan shows nothing of it."""
    skin, marks = person
    scan, _ = mask
    far = marks | {"op": marks["op"] + [0.0, 18.0, 0.0]}

    def ends(given, found=()):
        look = finish(first_look(reference, Surface(scan.vertices, scan.triangles), given, found=found))
        high = look.filled.vertices[np.abs(look.filled.vertices[:, 2] - marks["op"][2]) < 25]
        return high[:, 1].max()

    without = {n: p for n, p in marks.items() if n != "op"}
    assert ends(far) == pytest.approx(far["op"][1], abs=3.0)
    assert ends(far) > ends(without) + 10
    assert ends(far, found=("op",)) == pytest.approx(ends(without), abs=0.5)
    head = finish(build_head(reference, scan, far, detail=0)).head
    assert abs(head.landmark_positions()["op"] - far["op"])[1] < 3.0


def test_a_scalp_that_is_seen_bare_counts_as_skin(space, person):
    """Before it is known to be, it is mistrusted: what stands off it could be hair."""
    skin, _ = person
    target = Surface(skin, space.triangles)
    first = finish(fit_shape(space, target, Pose(1.0, np.eye(3), np.zeros(3), 0.0)))
    second = finish(fit_under_hair(space, target, first, REST))
    assert not second.covered.any()
    high = space.hairy & (skin[:, 2] > np.median(skin[space.hairy, 2]))
    across = vertex_normals(skin, space.triangles)
    before, after = (np.abs(((fit.points - skin) * across).sum(axis=1))[high].mean() for fit in (first, second.fit))
    assert after < 0.9 * before


def test_what_an_expression_moves_tells_nothing_of_the_skull(space, person, mask):
    """Cheeks that bulge in a smile change no head."""
    skin, marks = person
    table = responses()
    smile = sum(table.fields[table.names.index(f"zygomaticus_major_{side}")] for side in "lr")[space.vertices]
    still = without_moved(space)
    share = still.area / space.area
    assert share[skin[:, 2] > marks["tr"][2]] == pytest.approx(1)
    assert share[np.linalg.norm(smile, axis=1) > 4] == pytest.approx(HARDLY)
    _, seen = mask
    triangles = space.triangles[seen[space.triangles].all(axis=1)]
    shown = Expression(parted=True)
    calm, smiling = (Surface(points, triangles) for points in (skin, skin + smile))
    start = finish(fit_shape(space, calm, Pose(1.0, np.eye(3), np.zeros(3), 0.0), expression=shown))

    def scalp(space, target):
        fit = finish(fit_shape(space, target, start.pose, LOOSE, start.coefficients, expression=shown, hair=none))
        return fit.points[space.hairy & ~seen]

    none = np.zeros(len(skin), dtype=bool)
    changes = [np.linalg.norm(scalp(s, smiling) - scalp(s, calm), axis=1).mean() for s in (space, still)]
    assert changes[1] < 0.6 * changes[0], changes
    used = finish(fit_under_hair(space, smiling, start, shown)).scalp.points[space.hairy & ~seen]
    assert np.linalg.norm(used - scalp(still, smiling), axis=1).mean() < 0.5 * changes[0]
