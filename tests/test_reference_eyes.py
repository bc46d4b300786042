# SPDX-License-Identifier: GPL-3.0-or-later
"""Eyes and lids of the reference head: sizes, the gap between lid and ball, lids that close, irises of any size."""

import json
from dataclasses import replace

import numpy as np
import pytest

from headshop.assets.generators.eye_frame import eye_frames
from headshop.assets.generators.eyes import make_eyes
from headshop.assets.generators.skin import make_skin
from headshop.assets.generators.skin_layout import skin_layout
from headshop.sim.acting.plain_posing import plainly_posed
from headshop.sim.adapt.eyeballs import with_orbit
from headshop.sim.adapt.rest import Rest
from headshop.sim.anatomy.eyeball import BALL, eye_of_size, reach, turned_eye
from headshop.sim.anatomy.head import MATERIALS, Eye
from headshop.sim.anatomy.storage import anatomy_document, head_from_document, load_head
from headshop.sim.errors import InputError
from headshop.sim.health.cuts import smooth_skin
from headshop.sim.mesh_piercing import piercings
from headshop.sim.mesh_subdivision import limit
from headshop.sim.tissue.eye_surface import gaze_direction, gaze_rotation

#: Columns of the eye rings between the lacrimal lake and the outer corner.
ON_BALL = [*range(5, 14), *range(15, 24)]
GAZES = [(0.0, 0.0), (0.0, -0.43), (0.0, 0.35), (0.55, 0.0), (-0.55, 0.0)]


@pytest.fixture(scope="module")
def head():
    """The reference with the skin and the eyes that the generators make now."""
    skin = make_skin()
    meshes, eyes = make_eyes(skin.mesh, skin.groups, skin.landmarks.on({"skin": skin.mesh.vertices}))
    old = load_head()
    parts = {**old.parts, "skin": skin.mesh, "eye_l": meshes[0], "eye_r": meshes[1]}
    return replace(old, parts=parts, groups=skin.groups, landmarks=skin.landmarks, eyes=eyes)


@pytest.fixture(scope="module")
def layout():
    return skin_layout()


@pytest.fixture(scope="module")
def smooth(layout):
    return limit(layout.faces, layout.count)


def clearance(points, eye, gaze=(0.0, 0.0)):
    """(k,) mm from the eyeball's surface, cornea included, to points outside it."""
    away = points - eye.centre
    far = np.linalg.norm(away, axis=1)
    angle = np.arccos(np.clip(away @ gaze_direction(eye, np.array(gaze)) / far, -1, 1))
    return far - reach(eye, angle)


def test_sizes_are_an_adults(head):
    eye, mesh = head.eyes[0], head.parts["eye_l"]
    assert eye.radius == 12 and eye.iris_radius == pytest.approx(5.85) and 1.5 < eye.pupil_radius < 2.5
    kind = {name: np.unique(mesh.faces[mesh.material == k]) for k, name in enumerate(MATERIALS["eye_l"])}
    away = mesh.vertices - eye.centre
    front = away @ eye.gaze
    cornea = kind["cornea"][kind["cornea"] >= 0]
    assert 0.8 < front[cornea].max() - eye.radius < 1.7
    assert 2.8 < front[cornea].max() - front[kind["iris"][kind["iris"] >= 0]].mean() < 3.6
    far = np.linalg.norm(away[:BALL], axis=1)
    angle = np.arccos(np.clip(front[:BALL] / far, -1, 1))
    assert (far <= reach(eye, angle) + 0.12).all()


def test_lids_lie_on_the_ball(head, layout, smooth):
    eye = eye_frames(head.skin.vertices)[0]
    for points in (head.skin.vertices, smooth @ head.skin.vertices):
        gap = clearance(points[layout.rings["eye_l"][6]], eye)
        assert 0.05 < gap[ON_BALL].min() and gap[ON_BALL].max() < 0.5
        every = np.unique(np.r_[layout.rings["eye_l"].ravel(), layout.patches["eye_l"].ravel()])
        assert clearance(points[every], eye).min() > 0.02


def test_neither_cage_nor_drawn_lids_cut_the_eye(head):
    eye = head.parts["eye_l"]
    for skin in (head.skin, smooth_skin(head.skin)):
        assert len(piercings(skin.vertices, skin.triangles, eye.vertices, eye.triangles)) == 0
        pushed = eye.vertices - [0, 0.6, 0]
        assert len(piercings(skin.vertices, skin.triangles, pushed, eye.triangles)) > 10


def test_lids_settle_on_a_larger_eyeball(head, layout, smooth):
    """Of an eye pushed 0.5 mm forward and 3 % larger: lids move onto it, and nothing but the lids moves."""
    eye = head.eyes[0]
    larger = replace(eye, centre=eye.centre - [0, 0.5, 0], radius=1.03 * eye.radius, iris_radius=1.03 * eye.iris_radius)
    contact = Rest(head).contacts["l"]
    assert np.array_equal(contact.settled(head.skin.vertices, eye), head.skin.vertices)
    skin = contact.settled(head.skin.vertices, larger)
    for points in (skin, smooth @ skin):
        gap = clearance(points[layout.rings["eye_l"][6]], larger)[ON_BALL]
        assert gap.min() > 0.02 and gap.max() < 0.5
    fine = smooth_skin(head.skin.moved(skin)).vertices
    assert clearance(fine[np.linalg.norm(fine - larger.centre, axis=1) < 14], larger).min() > 0
    moved = np.linalg.norm(skin - head.skin.vertices, axis=1)
    lids = np.maximum(head.groups["lid_upper_l"], head.groups["lid_lower_l"])
    assert moved[(lids == 0) & (head.groups["inner"] < 0.5)].max() == 0 and moved.max() < 2.5


def test_lids_come_to_lie_on_the_ball_without_a_jump(head):
    """A vertex that begins to lie between the corners of the eye is drawn to the ball the more, the farther it is in."""
    eye = head.eyes[0]
    contact = Rest(head).contacts["l"]
    off = (
        head.skin.vertices
        - 1.5 * eye.gaze * (np.maximum(head.groups["lid_upper_l"], head.groups["lid_lower_l"]))[:, None]
    )
    off = head.skin.vertices + (head.skin.vertices - off)
    gaps = []
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        near = np.full(len(contact.edge), share)
        gaps.append(clearance(contact.settled(off, eye, near)[contact.edge], eye).max())
    assert (np.diff(gaps) < 0.01).all() and gaps[0] > gaps[-1]
    assert max(-np.diff(gaps)) < 0.6 * (gaps[0] - gaps[-1])


def test_the_orbit_goes_with_the_eye(head):
    eye, shift = head.eyes[0], np.array([0.4, 0.0, 1.5])
    bone = head.parts["skull"].vertices
    went = with_orbit(bone, replace(eye, centre=eye.centre + shift), shift) - bone
    off = np.linalg.norm(bone - eye.centre, axis=1)
    assert np.abs(went[off < 17] - shift).max() < 1e-9 and np.abs(went[off > 34]).max() == 0


def test_half_shut_lids_are_an_arc(head, layout, smooth):
    edge = (smooth @ plainly_posed(head, blink=0.5).skin.vertices)[layout.rings["eye_l"][6]]
    a, middle, b = edge[[22, 20, 17]]
    chord = a + (b - a) * (middle[0] - a[0]) / (b[0] - a[0])
    assert middle[2] - chord[2] > 0.35


def test_lids_frame_the_iris_as_in_life(head, layout, smooth):
    edge = (smooth @ head.skin.vertices)[layout.rings["eye_l"][6]] - head.eyes[0].centre
    upper, lower = edge[[19, 20, 21], 2].max(), edge[[7, 8, 9], 2].min()
    assert 0.8 < head.eyes[0].iris_radius - upper < 2.2  # the upper lid covers 1 to 2 mm
    assert -0.6 < lower + head.eyes[0].iris_radius < 0.8  # the lower one touches
    marks = head.landmark_positions()
    assert 26.5 < np.linalg.norm(marks["en_l"] - marks["ex_l"]) < 30.5
    assert 0.8 < marks["ex_l"][2] - marks["en_l"][2] < 3


@pytest.mark.parametrize("blink", [0.25, 0.5, 0.75, 1.0])
def test_closing_lids_stay_off_the_ball(head, layout, smooth, blink):
    posed = plainly_posed(head, blink=blink)
    ring = layout.rings["eye_l"]
    for points in (posed.skin.vertices, smooth @ posed.skin.vertices):
        gap = clearance(points[ring[6]], head.eyes[0])[ON_BALL]
        assert gap.min() > -0.03 and gap.max() < 0.55
        assert clearance(points[ring[2:6].ravel()], head.eyes[0]).min() > 0.5
    assert clearance(posed.skin.vertices[ring.ravel()], head.eyes[0]).min() > -0.03


@pytest.mark.parametrize("gaze", GAZES)
def test_shut_lids_meet_without_crossing(head, layout, gaze):
    """Seen along the gaze at rest no eye shows between them; and the edges do not pass each other."""
    posed = plainly_posed(head, blink=1.0, gaze=gaze)
    opening = fissure(posed, head.eyes[0], layout)
    assert -(0.1 if gaze == GAZES[0] else 0.15) < opening.min() and opening.max() < 0.1
    assert fissure(head, head.eyes[0], layout).max() > 9


def fissure(head, eye, layout):
    """(k,) mm between the limit surfaces of the edges of the lids, between the corners; negative where they cross."""
    from headshop.sim.mesh_subdivision import subdivision

    ring = layout.rings["eye_l"]
    operator, quads, _ = subdivision(layout.faces, layout.count, 2)
    points = limit(quads, operator.shape[0]) @ (operator @ head.skin.vertices)
    marks = head.landmark_positions()
    axis = marks["ex_l"] - marks["en_l"]
    axis /= np.linalg.norm(axis)
    forward = eye.gaze - (eye.gaze @ axis) * axis
    forward /= np.linalg.norm(forward)
    up = np.cross(axis, forward) * np.sign(np.cross(axis, forward)[2])
    local = (points - eye.centre) @ np.stack([axis, forward, up]).T
    angle = np.arctan2(local[:, 2], local[:, 1])
    # which of the fine vertices descend from faces between the outer edge and the inner edge
    weight = operator.tocsr()
    band = np.zeros(layout.count)
    band[ring[5:7].ravel()] = 1
    lid = {"upper": np.zeros(layout.count), "lower": np.zeros(layout.count)}
    lid["upper"][ring[4:8][:, [*range(15, 24), 0, 1]].ravel()] = 1
    lid["lower"][ring[4:8][:, 3:14].ravel()] = 1
    level = {}
    stations = np.linspace(-11, 9, 41)
    for name, pick in (("upper", np.minimum), ("lower", np.maximum)):
        rows = np.flatnonzero((weight @ (band * lid[name]) > 0.35) & (local[:, 1] > 0))
        best = np.full(len(stations), np.inf if name == "upper" else -np.inf)
        for k, station in enumerate(stations):
            near = rows[np.abs(local[rows, 0] - station) < 0.45]
            if len(near):
                best[k] = pick.reduce(angle[near])
        level[name] = best
    known = np.isfinite(level["upper"]) & np.isfinite(level["lower"])
    assert known.sum() > 35
    reach_of = np.sqrt(np.maximum(eye.radius**2 - stations**2, 25))
    return ((level["upper"] - level["lower"]) * reach_of)[known]


def test_shut_lids_meet_in_the_lower_third(head):
    rest, shut = head.landmark_positions(), plainly_posed(head, blink=1.0).landmark_positions()
    line = (shut["ps_l"][2] + shut["pi_l"][2]) / 2
    share = (line - rest["pi_l"][2]) / (rest["ps_l"][2] - rest["pi_l"][2])
    assert 0.02 < share < 0.33


def test_lids_follow_a_vertical_gaze(head):
    rest = head.landmark_positions()
    down, up = (plainly_posed(head, gaze=(0, g)).landmark_positions() for g in (-0.43, 0.3))
    assert down["ps_l"][2] < rest["ps_l"][2] - 3 and up["ps_l"][2] > rest["ps_l"][2] + 1
    assert down["pi_l"][2] < rest["pi_l"][2] - 0.5


def test_iris_and_pupil_take_any_size(head):
    eye, mesh = head.eyes[0], head.parts["eye_l"]
    np.testing.assert_allclose(eye_of_size(mesh.vertices, eye), mesh.vertices, atol=1e-4)

    def measured(eye, vertices, name, pick):
        rows = np.unique(mesh.faces[mesh.material == MATERIALS["eye_l"].index(name)])
        away = vertices[rows[rows >= 0]] - eye.centre
        return pick(np.linalg.norm(away - (away @ eye.gaze)[:, None] * eye.gaze, axis=1))

    sizes = np.linspace(1.0, 4.0, 7)
    pupils = [measured(eye, eye_of_size(mesh.vertices, replace(eye, pupil_radius=s)), "pupil", np.max) for s in sizes]
    np.testing.assert_allclose(pupils, sizes, atol=1e-6)
    sizes = np.linspace(5.0, 6.6, 5)
    irises = [measured(eye, eye_of_size(mesh.vertices, replace(eye, iris_radius=s)), "iris", np.max) for s in sizes]
    assert (np.diff(irises) > 0.3).all() and np.abs(irises - sizes).max() < 0.15
    # a turned and moved eye is the same eye
    turn = gaze_rotation(np.array([0.3, -0.2]))
    turned = replace(eye, gaze=turn @ eye.gaze, pupil_radius=3.0)
    there = turned_eye(eye_of_size(mesh.vertices, replace(eye, pupil_radius=3.0)), eye.centre, turn)
    np.testing.assert_allclose(eye_of_size(turned_eye(mesh.vertices, eye.centre, turn), turned), there, atol=1e-4)
    for wrong in (replace(eye, pupil_radius=0.2), replace(eye, pupil_radius=5.5), replace(eye, iris_radius=9.0)):
        with pytest.raises(InputError):
            eye_of_size(mesh.vertices, wrong)
    with pytest.raises(InputError):
        eye_of_size(mesh.vertices[:900], eye)


def test_sizes_are_kept_in_files(head):
    wide = replace(head, eyes=tuple(replace(e, pupil_radius=3.5) for e in head.eyes))
    document = json.loads(json.dumps(anatomy_document(wide)))
    assert head_from_document(wide.parts, wide.groups, document).eyes[0].pupil_radius == 3.5
    for eye in document["eyes"]:
        del eye["iris_radius"], eye["pupil_radius"]
    assert head_from_document(wide.parts, wide.groups, document).eyes[1].iris_radius == pytest.approx(5.85)
    assert Eye(np.zeros(3), 10.0, np.array([0, -1.0, 0])).iris_radius == pytest.approx(4.875)


def test_the_caruncle_sits_in_the_corner_and_stays_there(head):
    mesh, eye = head.parts["eye_l"], head.eyes[0]
    rows = np.unique(mesh.faces[mesh.material == MATERIALS["eye_l"].index("caruncle")])
    rows = rows[rows >= 0]
    assert rows.min() == BALL and len(rows) == len(mesh.vertices) - BALL
    corner = head.landmark_positions()["en_l"]
    assert np.linalg.norm(mesh.vertices[rows].mean(axis=0) - corner) < 6
    assert clearance(mesh.vertices[rows], eye).min() > 0.1
    posed = plainly_posed(head, gaze=(0.5, 0.0)).parts["eye_l"].vertices
    np.testing.assert_array_equal(posed[rows], mesh.vertices[rows])
    assert np.abs(posed[:BALL] - mesh.vertices[:BALL]).max() > 4


def test_both_eyes_are_one_mirrored(head, layout):
    np.testing.assert_allclose(head.parts["eye_l"].vertices * [-1, 1, 1], head.parts["eye_r"].vertices, atol=1e-9)
    shut = plainly_posed(head, blink=1.0).skin.vertices
    np.testing.assert_allclose(shut[layout.mirror], shut * [-1, 1, 1], atol=1e-6)
