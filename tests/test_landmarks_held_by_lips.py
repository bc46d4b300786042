# SPDX-License-Identifier: GPL-3.0-or-later
"""What somebody holds between the lips is told from the face, and the skin behind it is invented."""

import numpy as np
import pytest

from headshop.sim.acting.plain_posing import plainly_posed
from headshop.sim.adapt import build
from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.scan_surface import NO_SKIN
from headshop.sim.anatomy.landmark_names import SKIN
from headshop.sim.landmarks.find import find_landmarks
from headshop.sim.landmarks.first_look import first_look
from headshop.sim.mesh import Mesh
from headshop.sim.mesh_subdivision import smoother
from headshop.sim.progress import finish
from headshop.sim.relax.mouth_gap import MARKS
from headshop.sim.relax.parted import parted_lips
from headshop.sim.scan.clean import clean_scan
from headshop.sim.scan.ply import read_ply

RADIUS, LONG = 4.0, 38.0  # mm of the tube
ASIDE = 9.0  # mm from the middle of the mouth to the tube, to the subject's right


@pytest.fixture(scope="module")
def face(reference):
    """The outside of the reference as it is drawn: (vertices, triangles)."""
    rows, quads = smoother(reference.skin.faces, len(reference.skin.vertices))
    vertices = rows @ reference.skin.vertices
    inner = rows @ reference.groups["inner"] > 0.5
    triangles = Mesh(vertices, quads).triangles
    return vertices, triangles[~inner[triangles].any(axis=1)]


@pytest.fixture(scope="module")
def marks(reference):
    """Landmarks of the reference, those of the skin."""
    return {n: p for n, p in reference.landmark_positions().items() if n in SKIN}


@pytest.fixture(scope="module")
def tube(marks):
    """A tube that comes out of the mouth and hangs down before the lip and chin: (vertices, triangles)."""
    around, along = np.linspace(0, 2 * np.pi, 24, endpoint=False), np.linspace(0, LONG, 39)
    start = marks["sto"] + [-ASIDE, -9.0, 2.0]
    ring = RADIUS * np.stack([np.cos(around), np.sin(around), np.zeros_like(around)], axis=1)
    vertices = (start + ring + np.stack([0 * along, 0 * along, -along], axis=1)[:, None]).reshape(-1, 3)
    k = np.arange(len(vertices)).reshape(len(along), -1)
    turn = np.roll(k, -1, axis=1)
    quads = np.stack([k[:-1], k[1:], turn[1:], turn[:-1]], axis=-1).reshape(-1, 4)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    caps = [np.stack([np.full(22, k[row, 0]), k[row, 1:-1], k[row, 2:]], axis=1)[:, order] for row, order in CAPS]
    return vertices, np.concatenate([triangles, *caps])


CAPS = ((0, [0, 1, 2]), (-1, [0, 2, 1]))


@pytest.fixture(scope="module")
def scan(face, tube, marks):
    """Both as one scan, without the skin behind the tube, which nothing shows."""
    vertices, triangles = face
    low, high = tube[0].min(axis=0) - 1.0, tube[0].max(axis=0) + 1.0
    across = [0, 2]
    behind = ((vertices[:, across] > low[across]) & (vertices[:, across] < high[across])).all(axis=1)
    behind &= vertices[:, 1] < marks["ch_r"][1]
    triangles = triangles[~behind[triangles].all(axis=1)]
    vertices = np.concatenate([vertices, tube[0]])
    return Surface(vertices, np.concatenate([triangles, tube[1] + len(face[0])]), smooth=2.0)


def in_tube(points, tube):
    """(k,) bool: which of ``points`` lie on the tube."""
    return Surface(*tube).closest(points).distance < 1e-6


def test_a_tube_is_left_out_and_the_face_is_not(reference, marks, scan, tube):
    look = finish(first_look(reference, scan, marks))
    kept = in_tube(look.target.corners.mean(axis=1), tube)
    area = Surface(*tube).area.sum()
    assert look.target.area[kept].sum() < 0.2 * area  # the back of it, which lies on the lip
    skin = ~in_tube(scan.corners.mean(axis=1), tube)
    lost = scan.area[skin].sum() - look.target.area[~kept].sum()
    assert lost < 150.0  # mm² of skin just beside it
    assert look.left_out["held_by_lips"] == pytest.approx(scan.area.sum() - look.target.area.sum())


def test_skin_behind_it_is_where_the_other_side_says(reference, marks, scan, face):
    look = finish(first_look(reference, scan, marks))
    patch = look.filled.triangles[len(look.target.triangles) :]
    assert len(patch) > 0 and len(look.hidden) > 0
    places = look.filled.vertices[np.unique(patch)]
    assert Surface(*face).closest(places).distance.max() < 1.0
    assert places[:, 0].mean() < -3.0  # to the subject's right, where the tube hangs


def test_a_face_with_nothing_in_its_mouth_is_kept_whole(reference, marks, face):
    whole = Surface(*face, smooth=2.0)
    look = finish(first_look(reference, whole, marks))
    assert look.target is whole and look.filled is whole and look.left_out["held_by_lips"] == 0


def test_a_scan_that_is_inside_out_is_turned_before_anything_is_said_of_it(reference, marks, face):
    vertices, triangles = face
    look = finish(first_look(reference, Surface(vertices, triangles[:, ::-1], smooth=2.0), marks))
    np.testing.assert_allclose(look.target.face_normals, Surface(*face).face_normals, atol=1e-12)
    assert look.filled is look.target and not any(look.left_out.values())


def test_who_wants_to_keep_it_does(reference, marks, scan):
    look = finish(first_look(reference, scan, marks, leave_out=("depth_jumps", "flat_ends", "hair")))
    assert look.target is scan and look.filled is scan and look.left_out["held_by_lips"] == 0


def test_it_alone_is_left_out_where_only_that_is_wanted(reference, marks, scan):
    every, alone = (finish(first_look(reference, scan, marks, leave_out=out)) for out in (NO_SKIN, ["held_by_lips"]))
    assert alone.left_out["held_by_lips"] == every.left_out["held_by_lips"] > 500 and alone.left_out["hair"] == 0


def test_the_head_has_no_tube_and_says_so(reference, marks, scan, face, tube):
    mesh = Mesh.from_triangles(scan.vertices, scan.triangles)
    built = finish(build.build_head(reference, mesh, marks, detail=0))
    truth = Surface(*face)
    rows, _ = smoother(reference.skin.faces, len(reference.skin.vertices))
    outside = built.head.groups["face"] > 0.5
    outside &= built.head.groups["inner"] < 0.5
    drawn = (rows @ built.head.skin.vertices)[: len(outside)][outside]
    assert truth.closest(drawn).distance.max() < 2.0
    assert built.fit["left_out_mm2"]["held_by_lips"] > 500 and built.fit["left_out_mm2"]["flat_ends"] == 0
    assert "left out: what the lips hold;" in built.fit["sentence"]
    behind = np.linalg.norm(built.head.skin.vertices - (marks["sto"] + [-ASIDE, 0, -12]), axis=1) < 3
    assert behind.any() and built.attributes["fitted"][behind & outside].max() == 0
    assert np.isnan(built.attributes["distance_mm"][behind & outside]).all()


def test_parted_lips_are_told_where_their_landmarks_are_not_given(reference, marks, face):
    """An open mouth whose lower lip nobody marked is known to be open all the same."""
    posed = plainly_posed(reference, jaw_open=0.35)
    places = {n: p for n, p in posed.landmark_positions().items() if n in SKIN}
    rows, quads = smoother(posed.skin.faces, len(posed.skin.vertices))
    vertices = rows @ posed.skin.vertices
    inner = rows @ reference.groups["inner"] > 0.5
    triangles = Mesh(vertices, quads).triangles
    scan = Surface(vertices, triangles[~inner[triangles].any(axis=1)], smooth=2.0)
    given = {n: p for n, p in places.items() if n not in ("li", "ls", "sto")}
    look = finish(first_look(reference, scan, given))
    assert set(look.lips) == set(MARKS)
    assert parted_lips(reference, scan, given) is None
    found = parted_lips(reference, scan, given, look.lips)
    upper, lower = found.edges.reshape(2, -1, 3)
    assert np.linalg.norm(upper - lower, axis=1).max() > 6
    # Where the lower lip hangs below the straight ways from its middle to the corners, those end within the gap.
    middle, thin = np.abs(upper[:, 0]).argmin(), np.array([0.0, 0.0, 1.0])
    at_edges = look.lips | {"ls": upper[middle] + thin, "li": lower[middle] - thin}
    again = parted_lips(reference, scan, given, at_edges)
    np.testing.assert_allclose(again.edges.reshape(2, -1, 3)[1][:, 2].min(), lower[:, 2].min(), atol=1.0)
    assert parted_lips(reference, scan, given | at_edges) is None  # lips that are not known to be apart
    assert finish(first_look(reference, Surface(*face, smooth=2.0), marks)).lips is None


def test_lips_that_a_breathing_tube_holds_a_little_apart_are_closed(shared, reference):
    """They are 3.8 mm apart there; lips that nothing shows to be apart would count as closed with that."""
    scan = clean_scan(read_ply(shared / "ct_headsq" / "skin.ply"))[0]
    sure = finish(find_landmarks(scan, reference)).sure()
    fit = finish(build.build_head(reference, scan, sure, detail=0, found=set(sure))).fit
    assert fit["left_out_mm2"]["held_by_lips"] > 500
    assert fit["relaxed"] is not None and fit["relaxed"]["jaw_degrees"] > 2


def test_a_tube_alone_is_left_out_where_only_that_is_wanted(shared, reference):
    """The scan's flat ends are fitted then, and all there is of the face, its lips where they are."""
    scan = clean_scan(read_ply(shared / "ct_headsq" / "skin_outer.ply"))[0]
    sure = finish(find_landmarks(scan, reference)).sure()
    work = build.build_head(reference, scan, sure, detail=0, relax="never", leave_out="held_by_lips", found=set(sure))
    fit = finish(work).fit
    left = fit["left_out_mm2"]
    assert left["held_by_lips"] > 500 and left["depth_jumps"] == left["flat_ends"] == left["hair"] == 0
    assert fit["mean_mm"] < 0.2 and fit["p95_mm"] < 0.6 and fit["coverage"] > 0.95
