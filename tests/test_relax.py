# SPDX-License-Identifier: GPL-3.0-or-later
"""Relaxed faces: a smile with an open mouth becomes the same person's neutral face; closed mouths are left alone."""

import json

import numpy as np
import pytest

from headshop.sim.acting.pose import Pose, control
from headshop.sim.adapt.build import build_head
from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.landmarks import read_landmarks
from headshop.sim.adapt.rest import rest_of
from headshop.sim.adapt.skin_fit import fit_skin, landmark_rows
from headshop.sim.errors import InputError
from headshop.sim.mesh import Mesh, vertex_normals
from headshop.sim.mesh_subdivision import drawn, smoother
from headshop.sim.progress import finish
from headshop.sim.relax import relaxed as relaxing
from headshop.sim.relax.bunching import fleshed
from headshop.sim.relax.choice import kept_open, neutral_of, require_choice
from headshop.sim.relax.close_lips import corners_smoothed
from headshop.sim.relax.explain import explain
from headshop.sim.relax.mouth_gap import bridged_depths, depths, first_and_last_edge, lip_edges
from headshop.sim.relax.relaxed import relaxed
from headshop.sim.relax.responses import MUSCLES, UNPAIRED, responses
from headshop.sim.relax.smile import lifted, told_of_smile
from headshop.sim.relax.unlike import MIRROR, unlike
from headshop.sim.relax.upper_teeth import end_of_teeth, incisal_edge, told_of_stomion
from headshop.sim.scan.clean import clean_scan
from headshop.sim.scan.individual import draw_field
from headshop.sim.scan.ply import read_ply
from headshop.sim.tissue.solver import solve

SMILE = {
    f"{name}_{side}": value
    for name, value in {"zygomaticus_major": 1.0, "zygomaticus_minor": 0.5, "risorius": 0.6}.items()
    for side in "lr"
}
CORNERS = ("ch_l", "ch_r")
#: Opening of the jaw and contractions of muscles, on both sides, of faces that do not smile.
FACES = {
    "a shout": (0.6, {"depressor_labii_inferioris": 0.5}),
    "bared teeth": (0.05, {"levator_labii_superioris": 0.9, "depressor_labii_inferioris": 0.9}),
    "disgust": (0.08, {"levator_labii_alaeque_nasi": 1.0, "levator_labii_superioris": 0.7}),
    "a funnel": (0.2, {"orbicularis_oris": 0.9}),
}


@pytest.fixture(scope="module")
def people(reference, reference_model):
    """Three random people: (neutral skin, the same with an open smile), cages (n, 3) mm; muscles do it all at once."""
    start = reference.skin.vertices
    asked = control(reference_model, Pose(SMILE, jaw_open=0.2))
    smile = solve(reference_model, asked, max_iterations=150).state.skin - start
    smile = fleshed(reference, smile, 0.2)
    marks = reference.landmark_positions()
    neutral = [start + draw_field(marks, np.random.default_rng(seed))(start) for seed in (3, 4, 5)]
    return [(skin, skin + smile) for skin in neutral]


def marks_on(reference, cage):
    return reference.landmarks.on({"skin": drawn(reference.skin.faces, cage)})


def gap(reference, cage):
    upper, lower = rest_of(reference).lip_pairs.T
    return np.linalg.norm(cage[upper] - cage[lower], axis=1).max()


def away(reference, cage, truth):
    """(k,) mm from the face outside the mouth's region to the true neutral face."""
    start = reference.skin.vertices
    seen = (reference.groups["face"] > 0.5) & (reference.groups["inner"] < 0.5)
    far = np.linalg.norm(start - reference.landmark_positions()["sto"], axis=1) > 45
    surface = Surface(drawn(reference.skin.faces, truth), reference.skin.triangles)
    return surface.closest(drawn(reference.skin.faces, cage)[seen & far], 20.0).distance


def scan_of(reference, cage):
    """A scan of a skin: the surface drawn, without what no scanner sees."""
    rows, quads = smoother(reference.skin.faces, len(cage))
    hidden = (rows @ np.asarray(reference.groups["inner"], dtype=float)) > 0.3
    triangles = np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])
    return Mesh.from_triangles(rows @ cage, triangles[~hidden[triangles].any(axis=1)])


def test_an_open_smile_becomes_neutral(reference, people):
    for neutral, smiling in people:
        assert gap(reference, smiling) > 8
        result = relaxed(reference, smiling, np.ones(len(smiling)))
        assert gap(reference, result.skin) < 0.3
        truth, found, before = (marks_on(reference, cage) for cage in (neutral, result.skin, smiling))
        for corner in CORNERS:
            assert np.linalg.norm(before[corner] - truth[corner]) > 6
            assert np.linalg.norm(found[corner] - truth[corner]) < 3.2
        assert np.percentile(away(reference, result.skin, neutral), 95) < 1.5
        assert 2 < result.report["jaw_degrees"] < 11
        assert next(iter(result.report["muscles"])).startswith("zygomaticus_major")


def test_a_broad_smile_is_taken_for_one(reference, people):
    table = responses()
    pull = {"zygomaticus_major": 1.1, "zygomaticus_minor": 0.4, "risorius": 1.0, "levator_anguli_oris": 0.4}
    smile = table.jaw_at(0.2) + sum(
        value * table.fields[table.names.index(f"{name}_{side}")] for name, value in pull.items() for side in "lr"
    )
    for neutral, _ in people:
        result = relaxed(reference, neutral + smile, np.ones(len(neutral)))
        truth, found = (marks_on(reference, cage) for cage in (neutral, result.skin))
        assert result.report["smiles"]
        assert max(np.linalg.norm(found[corner] - truth[corner]) for corner in CORNERS) < 2.5


@pytest.mark.parametrize(("lift", "smiles"), [(0.1, False), (0.5, True)])
def test_corners_that_are_hardly_lifted_are_no_smile_however_well_one_would_explain_the_face(
    reference, people, monkeypatch, lift, smiles
):
    monkeypatch.setattr(relaxing, "lifted", lambda *_: np.full(2, lift))
    assert relaxed(reference, people[0][1], np.ones(len(people[0][1]))).report["smiles"] is smiles


def test_an_open_mouth_without_a_smile_is_taken_for_none(reference, people):
    opened = responses().jaw_at(0.3)
    for neutral, _ in people:
        result = relaxed(reference, neutral + opened, np.ones(len(neutral)))
        truth, found = (marks_on(reference, cage) for cage in (neutral, result.skin))
        assert not result.report["smiles"]
        assert max(np.linalg.norm(found[corner] - truth[corner]) for corner in CORNERS) < 2


@pytest.mark.parametrize(("opening", "pull"), FACES.values(), ids=FACES)
def test_faces_that_do_not_smile_are_taken_for_none_whatever_the_person(reference, people, opening, pull):
    """Corners that are a person's own 5 mm higher, and wider apart, were a smile's once the jaw was open."""
    table = responses()
    moved = table.jaw_at(opening) + sum(
        value * table.fields[k]
        for name, value in pull.items()
        for k, of in enumerate(table.names)
        if of.startswith(name)
    )
    marks = reference.landmark_positions()
    bumps = [np.exp(-((reference.skin.vertices - marks[c]) ** 2).sum(axis=1) / (2 * 18.0**2)) for c in CORNERS]
    high = sum(bump[:, None] * np.array([side * 3.0, 0, 5]) for side, bump in zip((1, -1), bumps, strict=True))
    for neutral, _ in people:
        result = relaxed(reference, neutral + high + moved, np.ones(len(neutral)))
        truth, found = (marks_on(reference, cage) for cage in (neutral + high, result.skin))
        assert not result.report["smiles"], result.report
        assert max(np.linalg.norm(found[corner] - truth[corner]) for corner in CORNERS) < 5.5
        assert np.percentile(away(reference, result.skin, neutral + high), 95) < 2.0


def test_corners_that_lie_deep_stay_so_when_the_jaw_alone_was_open(reference, people):
    marks = reference.landmark_positions()
    bumps = sum(np.exp(-((reference.skin.vertices - marks[c]) ** 2).sum(axis=1) / (2 * 15.0**2)) for c in CORNERS)
    for neutral, _ in people:
        deep = neutral + 6.0 * bumps[:, None] * [0, 1, 0]
        result = relaxed(reference, deep + responses().jaw_at(0.3), np.ones(len(deep)))
        truth, found = (marks_on(reference, cage) for cage in (deep, result.skin))
        assert not result.report["smiles"]
        assert max(np.linalg.norm(found[corner] - truth[corner]) for corner in CORNERS) < 2


def test_what_is_told_of_smiles_is_heeded(reference):
    as_drawn = smoother(reference.skin.faces, len(reference.skin.vertices))[0][: len(reference.skin.vertices)]
    told = told_of_smile(reference, responses(), as_drawn, rest_of(reference).lip_pairs[0, 0], 0.2)
    assert told.moves[0] == pytest.approx(told.moves[1] * [-1, 1, 1]) and 5 < told.moves[0, 0] < 8
    assert 5 < told.moves[0, 1] < 15
    wings = told.moves[3:5]
    assert wings[0] == pytest.approx(wings[1] * [-1, 1, 1]) and 2 < wings[0, 0] < 3
    table, count = responses(), 3
    noise, people = np.full(count, 1.0), 9 * np.eye(3 * count)
    rows = landmark_rows(reference.landmarks, ["ch_l", "ch_r", "n"], as_drawn.shape[0]) @ as_drawn
    offsets = np.array([[4.0, 5, 4], [-4, 5, 4], [0, 0, 0]])
    given = (table, reference.skin.vertices, reference.jaw, rows.tocsr(), offsets, people, noise)
    without, heeded = (explain(*given, told=what) for what in (None, told))
    far, near = (np.abs((told.rows @ found.displacement - told.moves)[0, [0, 2]]).max() for found in (without, heeded))
    assert lifted(told, table, heeded).min() > 0.24 and near < 0.7 * far
    base = [abs((told.rows @ found.displacement)[5, 2]) for found in (without, heeded)]
    assert base[1] < base[0] < 1  # of the nose
    stronger = told_of_smile(reference, table, as_drawn, rest_of(reference).lip_pairs[0, 0], 0.2, lifts=(1.3, 1.3))
    assert np.all(np.abs(stronger.moves[0]) > np.abs(told.moves[0])) and stronger.moves[2, 2] > told.moves[2, 2]


def test_a_smile_of_one_side_is_told_of_there(reference, people, monkeypatch):
    table = responses()
    as_drawn = smoother(reference.skin.faces, len(reference.skin.vertices))[0][: len(reference.skin.vertices)]
    told = told_of_smile(reference, table, as_drawn, rest_of(reference).lip_pairs[0, 0], 0.0, lifts=(1.2, 0.2))
    assert np.all(np.abs(told.moves[0]) > 3 * np.abs(told.moves[1]))
    pull = {"zygomaticus_major": 1.2, "risorius": 0.8, "levator_anguli_oris": 0.4}
    smile = table.jaw_at(0.15) + sum(
        value * share * table.fields[table.names.index(f"{name}_{side}")]
        for name, value in pull.items()
        for side, share in (("l", 1.0), ("r", 0.3))
    )
    off = {}
    for way in ("sides", "even"):
        if way == "even":
            monkeypatch.setattr(relaxing, "lifted", lambda *given: np.full(2, lifted(*given).mean()))
        results = [relaxed(reference, neutral + smile, np.ones(len(neutral))) for neutral, _ in people]
        assert all(result.report["smiles"] for result in results)
        pairs = [
            (marks_on(reference, r.skin), marks_on(reference, neutral))
            for r, (neutral, _) in zip(results, people, strict=True)
        ]
        off[way] = {c: np.mean([np.linalg.norm(found[c] - truth[c]) for found, truth in pairs]) for c in CORNERS}
    assert off["sides"]["ch_r"] < off["even"]["ch_r"] - 0.5 and max(off["sides"].values()) < 5, off


def test_what_an_expression_folds_beside_the_mouth_goes_and_the_corners_stay(reference):
    rest, start = rest_of(reference), reference.skin.vertices
    corner = reference.landmark_positions()["ch_l"]

    def bump(at):
        """A bump outward, 2 mm high and 3 mm wide, on the skin nearest to ``at`` (3,) mm."""
        seen = np.flatnonzero(~rest.inner)
        there = start[seen[np.linalg.norm(start[seen] - at, axis=1).argmin()]]
        return 2 * np.exp(-((start - there) ** 2).sum(axis=1) / (2 * 3.0**2)) * ~rest.inner

    def left(field):
        """How high it is after smoothing, of what it was; and that skin, (n, 3) mm."""
        out = corners_smoothed(rest, start + field[:, None] * normals, np.eye(3))
        return ((out - start) * normals).sum(axis=1)[field.argmax()] / field.max(), out

    normals = vertex_normals(start, reference.skin.triangles)
    near, smooth = left(bump(corner + [8, 4, 0]))
    assert near < 0.5
    assert left(bump(corner + [28, 25, 0]))[0] > 0.9
    before, after = (marks_on(reference, cage) for cage in (start, smooth))
    assert np.linalg.norm(before["ch_l"] - after["ch_l"]) < 0.2
    np.testing.assert_allclose(corners_smoothed(rest, start, np.eye(3)), start, atol=1e-6)


def test_the_same_head_elsewhere_relaxes_to_the_same(reference, people):
    _, smiling = people[0]
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    here = relaxed(reference, smiling, np.ones(len(smiling))).skin
    there = relaxed(reference, 1.1 * smiling @ turn.T + [300.0, 5, -70], np.ones(len(smiling))).skin
    np.testing.assert_allclose(there, 1.1 * here @ turn.T + [300.0, 5, -70], atol=1e-5)


def test_a_neutral_face_is_hardly_changed(reference, people):
    for neutral, _ in people:
        result = relaxed(reference, neutral, np.ones(len(neutral)))
        before, after = (marks_on(reference, cage) for cage in (neutral, result.skin))
        assert max(np.linalg.norm(before[name] - after[name]) for name in CORNERS) < 3.5
        assert np.percentile(away(reference, result.skin, neutral), 95) < 1.0
        assert result.report["jaw_degrees"] < 2


def test_each_lip_is_fitted_to_its_own(reference, people):
    neutral, smiling = people[0]
    scan = scan_of(reference, smiling)
    given = marks_on(reference, smiling)
    fit = finish(fit_skin(reference, Surface(scan.vertices, scan.triangles), given))
    assert fit.reference is not fit.lips_closed and fit.lips_closed is reference
    rest = rest_of(reference)
    upper, lower = rest.lip_pairs[rest.rim[rest.lip_pairs].all(axis=1)].T
    opened, truth = (np.linalg.norm(cage[upper] - cage[lower], axis=1) for cage in (fit.cage, smiling))
    assert truth.max() > 8 and np.abs(opened - truth).max() < 3.5
    neutral_again = neutral_of(fit, "auto")
    assert gap(reference, neutral_again.skin) < 0.3
    opened = kept_open(reference, reference, fit.cage, neutral_again.jaw)
    np.testing.assert_array_equal(opened.skin.vertices[~rest.inner], fit.cage[~rest.inner])
    assert opened.jaw.incisor[2] < reference.jaw.incisor[2] - 3
    np.testing.assert_array_equal(opened.parts["skull"].vertices, reference.parts["skull"].vertices)
    found, truth = marks_on(reference, neutral_again.skin), marks_on(reference, neutral)
    assert max(np.linalg.norm(found[name] - truth[name]) for name in CORNERS) < 4


def test_closed_lips_are_left_alone_unless_asked(reference, people):
    neutral, _ = people[1]
    scan = scan_of(reference, neutral)
    fit = finish(fit_skin(reference, Surface(scan.vertices, scan.triangles), marks_on(reference, neutral)))
    assert fit.reference is reference
    assert neutral_of(fit, "auto") is None and neutral_of(fit, "never") is None
    assert neutral_of(fit, "always") is not None


def test_a_smile_with_closed_lips_is_said_to_be_one(reference, reference_model, people):
    """It is left alone, as a person may look like that; asked to, it is taken away."""
    smile = solve(reference_model, control(reference_model, Pose(SMILE)), max_iterations=150).state.skin
    neutral, _ = people[1]
    smiling = neutral + fleshed(reference, smile - reference.skin.vertices)
    marks = marks_on(reference, smiling)
    assert marks["ch_l"][2] - marks_on(reference, neutral)["ch_l"][2] > 4
    for relax, asked in (("auto", False), ("always", True)):
        built = finish(build_head(reference, scan_of(reference, smiling), marks, detail=0, relax=relax))
        assert (built.fit["advice"] is None) == asked and (built.fit["relaxed"] is not None) == asked
    found, truth = marks_on(reference, built.head.skin.vertices), marks_on(reference, neutral)
    assert max(np.linalg.norm(found[name] - truth[name]) for name in CORNERS) < 4
    built = finish(build_head(reference, scan_of(reference, neutral), marks_on(reference, neutral), detail=0))
    assert built.fit["advice"] is None and built.fit["relaxed"] is None


def test_edges_of_lips():
    lip, teeth = np.zeros(10), np.full(10, 6.0)
    hole = np.full(4, np.nan)
    assert first_and_last_edge(np.concatenate([lip, teeth, lip]), 2) == ((9, False), (20, False))
    assert first_and_last_edge(np.concatenate([lip, hole, teeth, hole, lip]), 2) == ((9, True), (28, True))
    assert first_and_last_edge(np.concatenate([lip, hole[:1], lip]), 2) is None  # a speck
    crease = np.concatenate([lip, [0.5, 1.5, 2.5, 1.5, 0.5], lip])
    assert first_and_last_edge(crease, 2) is None


@pytest.mark.parametrize("inside", [False, True])
def test_missing_triangles_are_no_gap_between_lips(inside):
    """Nor do they show the inside of the mouth."""
    side = np.arange(-30, 31.0)
    x, z = np.meshgrid(side, side, indexing="ij")
    sheet = np.stack([x, 0.02 * x**2, z], axis=-1).reshape(-1, 3)
    i = np.arange(x.size).reshape(x.shape)
    cells = np.stack([i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]], axis=-1).reshape(-1, 4)
    triangles = np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])
    slit = (np.abs(sheet[triangles][:, :, 2]) < 4).any(axis=1)
    there = np.random.default_rng(4).random(len(triangles)) > 0.15
    scan, forward = Surface(sheet, triangles[there & ~slit]), np.array([0, -1.0, 0])
    scan = scan.beside(sheet + [0, 12.0, 0], triangles) if inside else scan
    rays = np.random.default_rng(5).uniform([-20, -5, -20], [20, -5, 20], (2000, 3))
    found, plain = (see(scan, rays, forward) - 5 - 0.02 * rays[:, 0] ** 2 for see in (bridged_depths, depths))
    over, between = np.abs(rays[:, 2]) > 5.5, np.abs(rays[:, 2]) < 2.5
    assert (np.abs(found[over]) < 0.5).mean() > 0.98 > 0.9 > (np.abs(plain[over]) < 0.5).mean()
    np.testing.assert_allclose(found[between], 12.0 if inside else np.nan, atol=0.1)


def _sheets(*sides):
    """A `Surface` of upright sheets, each from x to x, at y, from z to z."""
    corners = [[[x, y, z] for x, z in zip((a, b, b, a), (c, c, d, d), strict=True)] for (a, b), y, (c, d) in sides]
    triangles = [[[4 * k, 4 * k + 1, 4 * k + 2], [4 * k, 4 * k + 2, 4 * k + 3]] for k in range(len(sides))]
    return Surface(np.array(np.concatenate(corners), dtype=float), np.concatenate(triangles))


@pytest.mark.parametrize("teeth", [False, True])
def test_teeth_that_touch_the_lower_lip_are_no_part_of_it(teeth):
    """Of a smile: nothing but a slit is between them, and here and there not even that; the lips are far apart."""
    lips = [((-40, 40), 0, (20, 4)), ((-40, 40), 4, (-5, -20))]
    crowns = [((9 * k - 4, 9 * k + 4), 4.8, (1, -4.6)) for k in range(-2, 3)]
    target = _sheets(*lips, *crowns, ((5.5, 6.5), 4.6, (-4, -6))) if teeth else _sheets(*lips)
    given = {"ls": [0, 0, 9], "li": [0, 4, -10], "ch_l": [30, 2, 0], "ch_r": [-30, 2, 0]}
    given = {name: np.array(place, dtype=float) for name, place in given.items()}
    edges = lip_edges(target, given, np.array([0, -1.0, 0]), np.linspace(-0.25, 0.25, 11))
    np.testing.assert_allclose(edges[:, :, 2], np.tile([4.0, -5.0], (11, 1)), atol=1.3)


def test_the_mouths_inside_is_no_lip():
    sheets = [((-10, 10), 0, (1, -5)), ((-30, 30), 20, (-2, -14)), ((-30, 30), 0, (-15, -25))]
    target = _sheets(*sheets)
    given = {"ls": [0, 0, 0], "li": [0, 0, -20], "ch_l": [40, 0, -10], "ch_r": [-40, 0, -10]}
    given = {name: np.array(place, dtype=float) for name, place in given.items()}
    edges = lip_edges(target, given, np.array([0, -1.0, 0]), np.array([0.0, 0.1, 0.4]))
    np.testing.assert_allclose(edges[:2, :, 1], 0, atol=1e-9)
    assert np.isnan(edges[2]).all()  # no upper lip was scanned there, but what lies behind it


def test_the_end_of_the_upper_teeth():
    lip, teeth, hole = np.zeros(10), np.full(12, 5.0), np.full(6, np.nan)
    seen = np.concatenate([lip, hole[:2], teeth, hole, hole, lip])
    assert end_of_teeth(seen, 0.5) == 23
    assert end_of_teeth(np.concatenate([lip, hole, teeth[:4], hole, hole, lip]), 0.5) == 19  # little of them
    assert end_of_teeth(np.concatenate([lip, hole[:2], teeth, lip]), 0.5) is None  # they rest on the lower lip
    assert end_of_teeth(np.concatenate([lip, hole, hole, hole, teeth, hole, lip]), 0.5) is None  # lower teeth
    assert end_of_teeth(np.concatenate([lip, hole, lip]), 0.5) is None


def test_teeth_in_an_open_smile_tell_where_lips_meet(reference, people):
    smiling = reference.skin.vertices + np.subtract(*people[0][::-1])
    lower = np.array([0.0, 0.0, -3.0])
    skin, teeth = scan_of(reference, smiling), reference.parts["teeth_upper"]
    both = np.concatenate([skin.vertices, teeth.vertices + lower])
    target = Surface(both, np.concatenate([skin.triangles, teeth.triangles + len(skin.vertices)]))
    edge = incisal_edge(target, marks_on(reference, smiling), np.array([0, -1.0, 0]))
    meet = told_of_stomion(reference, edge)
    assert meet[1:] == pytest.approx(lower[1:], abs=1.2)
    everywhere = np.ones(len(smiling))
    without, told = (relaxed(reference, smiling, everywhere, teeth=seen) for seen in ((), edge))
    assert told.report["upper_teeth_seen"] and not without.report["upper_teeth_seen"]
    shift = marks_on(reference, told.skin)["sto"] - marks_on(reference, without.skin)["sto"]
    assert shift[2] < -0.5


def test_what_people_do_otherwise_is_even_and_small_on_the_chin(reference):
    table, vertices = responses(), reference.skin.vertices
    pick = [table.names.index(f"zygomaticus_major_{side}") for side in "lr"]
    other = unlike(table, table.fields[pick], vertices, reference.jaw, 0.2, np.array([0.8, 0.8]))
    rows = landmark_rows(reference.landmarks, ["ch_l", "ch_r", "pg", "n"], len(vertices))
    found = other.covariance(rows)
    np.testing.assert_allclose(found, found.T, atol=1e-9)
    assert np.linalg.eigvalsh(found).min() > -1e-6
    deviation = np.sqrt(np.diag(found)).reshape(-1, 3)
    assert deviation[0].min() > 2 and deviation[2].max() < 0.3 * np.linalg.norm(rows @ table.jaw_at(0.2), axis=1)[2]
    assert deviation[3].max() < 0.1
    both = found[:3, 3:6] / np.outer(deviation[0], deviation[1]) * MIRROR
    assert np.diag(both).min() > 0.5


def test_responses_are_of_both_sides_alike(reference):
    table = responses()
    assert len(table.names) == 2 * len(MUSCLES) - len(UNPAIRED)
    left, right = (table.fields[table.names.index(f"zygomaticus_major_{side}")] for side in "lr")
    marks = reference.landmarks
    assert marks.on({"skin": left})["ch_l"] == pytest.approx(marks.on({"skin": right})["ch_r"] * [-1, 1, 1], abs=0.2)
    assert marks.on({"skin": left})["ch_l"][2] > 2  # a smile lifts the corner
    np.testing.assert_allclose(table.jaw_at(0.2), table.jaw[1])
    assert not table.jaw_at(0.0).any()


def test_an_unknown_choice_is_refused():
    require_choice("auto")
    with pytest.raises(InputError, match="sometimes"):
        require_choice("sometimes")


@pytest.mark.parametrize("name", ["s1", "s2"])
def test_smiling_subjects(shared, reference, name):
    folder = shared / "ict" / "examples"
    if not (folder / f"{name}_smile_scan.ply").is_file():
        pytest.skip(f"no {name}_smile in {folder}")
    smile, neutral = (
        json.loads((folder / f"{name}{kind}_truth.json").read_text(encoding="utf-8")) for kind in ("_smile", "")
    )
    move = np.array(smile["pose_model_to_scan"]) @ np.linalg.inv(neutral["pose_model_to_scan"])
    truth = {k: move[:3, :3] @ p + move[:3, 3] for k, p in neutral["landmarks"].items()}
    scan, _ = clean_scan(read_ply(folder / f"{name}_smile_scan.ply"))
    given = read_landmarks(folder / f"{name}_smile_truth.json")
    fit = finish(fit_skin(reference, Surface(scan.vertices, scan.triangles, smooth=2.0), given))
    result = neutral_of(fit, "auto")
    assert gap(reference, result.skin) < 0.3
    found = marks_on(reference, result.skin)
    assert max(np.linalg.norm(found[corner] - truth[corner]) for corner in CORNERS) < 2.5
    nose = {name: abs(found[name] - truth[name])[2] for name in ("sn", "al_l", "al_r")}
    assert max(nose.values()) < 1.2, nose  # a smile hardly lifts it
    surface = read_ply(folder / f"{name}_truth.ply")
    surface = Surface(surface.vertices @ move[:3, :3].T + move[:3, 3], surface.triangles)
    seen = (reference.groups["face"] > 0.5) & (reference.groups["inner"] < 0.5)
    far = np.linalg.norm(reference.skin.vertices - reference.landmark_positions()["sto"], axis=1) > 45
    distance = surface.closest(drawn(reference.skin.faces, result.skin)[seen & far], 20.0).distance
    assert distance.mean() < 0.3 and np.percentile(distance, 95) < 1.0
    assert result.report["smiles"]
