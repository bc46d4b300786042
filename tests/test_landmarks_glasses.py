# SPDX-License-Identifier: GPL-3.0-or-later
"""Glasses are told from the face, lenses that a scanner sees too, and the skin behind them is invented."""

import json
from dataclasses import replace

import numpy as np
import pytest

from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.scan_surface import NO_SKIN
from headshop.sim.anatomy.landmark_names import SKIN
from headshop.sim.landmarks.expression import fit_expression
from headshop.sim.landmarks.find import find_landmarks
from headshop.sim.landmarks.first_look import first_look
from headshop.sim.landmarks.glasses import fit_without_glasses, glasses_seen
from headshop.sim.landmarks.looking import run
from headshop.sim.landmarks.pose_search import Pose
from headshop.sim.landmarks.shape_fit import fit_shape
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.mesh import Mesh
from headshop.sim.mesh_subdivision import smoother
from headshop.sim.progress import finish
from headshop.sim.scan.clean import clean_scan
from headshop.sim.scan.individual import individual
from headshop.sim.scan.ply import read_ply

WIDE, HIGH, RADIUS, GAP = 25.0, 18.0, 2.0, 18.0  # mm: half of a frame and of its thickness, to it from the eyes
AROUND, ALONG = 10, 64


def _outside(head):
    """The outside of a head as it is drawn: (vertices, triangles)."""
    rows, quads = smoother(head.skin.faces, len(head.skin.vertices))
    inner = rows @ head.groups["inner"] > 0.5
    triangles = Mesh(rows @ head.skin.vertices, quads).triangles
    return rows @ head.skin.vertices, triangles[~inner[triangles].any(axis=1)]


@pytest.fixture(scope="module")
def face(reference):
    return _outside(reference)


@pytest.fixture(scope="module")
def marks(reference):
    return {n: p for n, p in reference.landmark_positions().items() if n in SKIN}


def _outline(marks, side, gap=GAP):
    """(k, 3) mm: the middle of a frame ``gap`` mm before the eye on that ``side``."""
    angle = np.linspace(0, 2 * np.pi, ALONG, endpoint=False)
    middle = (marks[f"en_{side}"] + marks[f"ex_{side}"]) / 2 + [0.0, -gap, -2.0]
    return middle + np.stack([WIDE * np.cos(angle), 0 * angle, HIGH * np.sin(angle)], axis=1)


def _frame(marks, side, gap=GAP):
    """A ring about that eye: vertices (n, 3) mm, triangles (m, 3), wound outward."""
    line, angle = _outline(marks, side, gap), np.linspace(0, 2 * np.pi, AROUND, endpoint=False)
    out = line - line.mean(axis=0)
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    across = np.cos(angle)[:, None, None] * out + np.sin(angle)[:, None, None] * [0.0, -1.0, 0.0]
    k = np.arange(AROUND * ALONG).reshape(AROUND, ALONG)
    a, b, c, d = k, np.roll(k, -1, axis=0), np.roll(k, (-1, -1), axis=(0, 1)), np.roll(k, -1, axis=1)
    triangles = np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    vertices = (line + RADIUS * across).reshape(-1, 3)
    return vertices, _outward(vertices, triangles, line[triangles[:, 0] % ALONG])


def _lens(marks, side, gap=GAP):
    """What fills that ring, a little domed."""
    line = _outline(marks, side, gap)
    rings = np.linspace(1, 0, 12)[:-1, None, None]
    dome = (1 - rings**2) * [0.0, -2.0, 0.0]
    vertices = (line.mean(axis=0) + rings * (line - line.mean(axis=0)) + dome).reshape(-1, 3)
    k = np.arange(len(vertices)).reshape(-1, ALONG)
    a, b, c, d = k[:-1], k[1:], np.roll(k[1:], -1, axis=1), np.roll(k[:-1], -1, axis=1)
    triangles = np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    return vertices, _outward(vertices, triangles, line.mean(axis=0) + [0.0, 20.0, 0.0])


def _outward(vertices, triangles, middle):
    corner = vertices[triangles]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    out = np.einsum("ij,ij->i", normal, corner.mean(axis=1) - middle).sum() > 0
    return triangles if out else triangles[:, ::-1]


def _joined(*meshes):
    """One mesh of several, vertices and triangles."""
    before = np.cumsum([len(vertices) for vertices, _ in meshes]) - [len(vertices) for vertices, _ in meshes]
    triangles = [triangles + count for (_, triangles), count in zip(meshes, before, strict=True)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(triangles)


@pytest.fixture(scope="module")
def frames(marks):
    return _joined(*(_frame(marks, side) for side in "lr"))


@pytest.fixture(scope="module")
def sunglasses(frames, marks):
    return _joined(frames, *(_lens(marks, side) for side in "lr"))


@pytest.fixture(scope="module")
def behind(face, marks):
    return _unhidden(face, marks)


def _unhidden(face, marks):
    """A face without the skin that lenses hide."""
    vertices, triangles = face
    hidden = np.zeros(len(vertices), dtype=bool)
    for side in "lr":
        x, y, z = (vertices - _outline(marks, side).mean(axis=0)).T
        hidden |= ((x / WIDE) ** 2 + (z / HIGH) ** 2 < 1) & (np.abs(y) < 40)
    return vertices, triangles[~hidden[triangles].any(axis=1)]


def _in_sunglasses(face, marks, gap):
    """A face with glasses on, as one mesh: vertices and triangles."""
    things = [made(marks, side, gap) for made in (_frame, _lens) for side in "lr"]
    return _joined(_unhidden(face, marks), *things)


def _share(surface, thing):
    """mm² of ``surface`` that lie on the ``thing``, of all of that."""
    on = Surface(*thing).closest(surface.corners.mean(axis=1)).distance < 1e-6
    return surface.area[on].sum() / Surface(*thing).area.sum()


def _stands_off(surface, thing, face):
    """mm by which what ``surface`` shows of the ``thing`` stands off the ``face`` at most."""
    at = surface.corners.mean(axis=1)
    at = at[Surface(*thing).closest(at).distance < 1e-6]
    return Surface(*face).closest(at).distance.max(initial=0.0)


def test_frames_are_left_out_and_the_eyes_behind_them_are_not(reference, face, frames, marks):
    scan = Surface(*_joined(face, frames), smooth=2.0)
    look = finish(first_look(reference, scan, marks))
    assert _share(look.target, frames) < 0.3 and _stands_off(look.target, frames, face) < 4.0  # beside the nose
    assert _share(look.target, face) > 0.97
    assert look.left_out["glasses"] == pytest.approx(scan.area.sum() - look.target.area.sum())


def test_lenses_are_left_out_and_skin_is_invented_behind_them(reference, face, behind, sunglasses, marks):
    scan = Surface(*_joined(behind, sunglasses), smooth=2.0)
    look = finish(first_look(reference, scan, marks))
    assert _share(look.target, sunglasses) < 0.1 and _stands_off(look.target, sunglasses, face) < 4.0
    assert _share(look.target, behind) > 0.97
    lost = np.setdiff1d(face[1].ravel(), behind[1].ravel())
    assert np.percentile(look.filled.closest(face[0][lost]).distance, 90) < 3.0
    assert np.percentile(look.target.closest(face[0][lost]).distance, 50) > 5.0
    assert len(look.hidden) > 100


def test_whoever_wants_to_keep_them_does(reference, behind, sunglasses, marks):
    scan = Surface(*_joined(behind, sunglasses), smooth=2.0)
    look = finish(first_look(reference, scan, marks, tuple(set(NO_SKIN) - {"glasses"})))
    assert look.left_out["glasses"] == 0.0 and _share(look.target, sunglasses) > 0.99


def test_landmarks_of_a_face_in_sunglasses(reference, behind, sunglasses, marks):
    found = finish(find_landmarks(Mesh.from_triangles(*_joined(behind, sunglasses)), reference))
    off = {name: np.linalg.norm(place - marks[name]) for name, place in found.positions.items()}
    assert np.mean([off[name] for name in "prn sn n al_l al_r ch_l ch_r gn".split()]) < 2.0
    eyes = [f"{name}_{side}" for name in ("en", "ex", "ps", "pi") for side in "lr"]
    assert max(off[name] for name in eyes if name in off) < 5.0, {name: off[name] for name in eyes if name in off}
    assert not set(eyes) & set(found.sure())


def test_lids_that_nothing_shows_are_as_open_as_usual(reference):
    """Lenses near the lids draw the skin about them, and nothing else would keep it from opening the eyes."""
    somebody = individual(reference, np.random.default_rng(1))
    marks, face = somebody.landmark_positions(), _outside(somebody)
    space, scan = shape_space(reference), Surface(*_in_sunglasses(face, marks, 12.0), smooth=2.0)
    fit = finish(_as_work(fit_shape(space, scan, Pose(1.0, np.eye(3), np.zeros(3), 0.0))))
    fit, telling = finish(_as_work(fit_without_glasses(space, scan, fit)))
    assert telling is not None
    for shut in space.shut.values():
        assert abs(fit.coefficients @ shut / (shut @ shut)) < 0.15
    bare = scan.without(glasses_seen(space, telling, scan))
    _, shown = finish(_as_work(fit_expression(space, bare, fit)))
    assert not shown.shut


def _as_work(generator):
    """Work of what yields fractions."""
    return run(generator, 0.0, 1.0, "Looking")


def test_one_lens_or_a_bare_face_is_no_pair_of_glasses(reference, face, marks, laid):
    space = shape_space(reference)
    fit = laid(space, space.points)
    eyepatch = _joined(face, _frame(marks, "l"), _lens(marks, "l"))
    for scan in (face, eyepatch):
        same, telling = finish(_as_work(fit_without_glasses(space, Surface(*scan, smooth=2.0), fit)))
        assert same is fit and telling is None


def test_glasses_with_too_little_of_a_face_beside_them_are_not_told(reference, face, frames, marks, laid):
    vertices, triangles = face
    middle = (marks["en_l"] + marks["en_r"]) / 2
    near = (np.linalg.norm(vertices - middle, axis=1) < 40)[triangles].all(axis=1)
    scan = Surface(*_joined((vertices, triangles[near]), frames), smooth=2.0)
    space = shape_space(reference)
    fit = laid(space, space.points)
    assert finish(_as_work(fit_without_glasses(space, scan, fit))) == (fit, None)


def test_a_head_of_any_size(reference, face, frames, laid):
    space, size = shape_space(reference), 0.8
    fit = laid(space, size * space.points)
    fit = replace(fit, pose=replace(fit.pose, scale=size))
    vertices, triangles = _joined(face, frames)
    scan = Surface(size * vertices, triangles, smooth=2.0)
    _, telling = finish(_as_work(fit_without_glasses(space, scan, fit)))
    left = scan.without(glasses_seen(space, telling, scan))
    assert _stands_off(left, (size * frames[0], frames[1]), (size * face[0], face[1])) < 4.0 * size


@pytest.mark.parametrize("name", ["lps_infinite", "menpo_james", "fran_cyberware"])
def test_people_without_glasses_wear_none(reference, shared, name):
    scan, _ = clean_scan(read_ply(shared / "scans" / f"{name}.ply"))
    known = json.loads((shared / "scans" / f"{name}.landmarks.json").read_text())["landmarks"]
    known = {n: np.array(p) for n, p in known.items()}
    look = finish(first_look(reference, Surface(scan.vertices, scan.triangles, 2.0), known))
    assert look.left_out["glasses"] == 0.0
