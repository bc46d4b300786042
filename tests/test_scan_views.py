# SPDX-License-Identifier: GPL-3.0-or-later
"""Overlapping views that nobody fused are laid onto each other; what only lies near a skin is none."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from headshop.sim.adapt.closest import Surface
from headshop.sim.mesh import Mesh, vertex_normals
from headshop.sim.mesh_subdivision import smoother
from headshop.sim.progress import finish
from headshop.sim.scan.clean import clean_scan
from headshop.sim.scan.joined import joined
from headshop.sim.scan.scanner import VirtualScanner
from headshop.sim.scan.views import TWICE

#: mm and degrees: how well the views of `views` are registered.
OFF, TURNED = 0.5, 0.4


@pytest.fixture(scope="module")
def outside(reference):
    """What can be seen of the reference's skin, smooth, as triangles."""
    rows, quads = smoother(reference.skin.faces, len(reference.skin.vertices))
    inner = rows @ reference.groups["inner"] > 0.5
    skin = Mesh(rows @ reference.skin.vertices, quads)
    return Mesh.from_triangles(skin.vertices, skin.triangles[~inner[skin.triangles].any(axis=1)])


@pytest.fixture(scope="module")
def views(outside):
    """What a scanner sees of it from three sides, each view a mesh of its own, moved by about a millimetre."""
    rng = np.random.default_rng(4)
    device = VirtualScanner(pixel=2.0, noise=0.05, ripple=0.0, registration=0.0, specks=0.0, overlap=None)
    seen = [
        finish(replace(device, views=(place,)).scan(outside, rng)) for place in ((0.0, 4.0), (40.0, 1.0), (-40.0, 1.0))
    ]
    turns = [Rotation.from_rotvec(np.radians(TURNED) * rng.standard_normal(3)).as_matrix() for _ in seen]
    return [v.moved(v.vertices @ t.T + OFF * rng.standard_normal(3)) for v, t in zip(seen, turns, strict=True)]


def _gaps(mesh, label=None):
    """(k,) mm from vertices of each large piece to another one that faces the same way, not at its border."""
    from headshop.sim.scan.clean import components

    label = components(mesh.triangles, len(mesh.vertices))[1]
    large = np.flatnonzero(np.bincount(label) > 300)
    normals = vertex_normals(mesh.vertices, mesh.triangles)
    gaps = []
    for one in large:
        at = np.flatnonzero(label == one)
        for other in large[large != one]:
            near = Surface(mesh.vertices, mesh.triangles[label[mesh.triangles[:, 0]] == other])
            hit = near.closest(mesh.vertices[at], 4.0)
            alike = np.einsum("ij,ij->i", hit.normals, normals[at]) > 0.8
            gaps.append(hit.distance[hit.found & ~hit.border & alike])
    return np.concatenate(gaps)


def test_views_are_laid_onto_each_other(views, outside):
    raw = joined(views)
    scan, counts = clean_scan(raw)
    before, after = _gaps(raw), _gaps(scan)
    assert counts["sheets"] >= 3
    assert counts["sheets_apart"] == pytest.approx(np.median(before), rel=0.35)
    assert np.percentile(before, 95) > 1.2 and np.percentile(after, 95) < 0.15
    # The scan has the shape of what was scanned, wherever it is: better than any of the views as they lay together.
    surface = Surface(outside.vertices, outside.triangles)
    places = scan.vertices[::5]
    for _ in range(25):
        hit = surface.closest(places, 8.0)
        turn, _ = Rotation.align_vectors(
            hit.points[hit.found] - hit.points[hit.found].mean(axis=0),
            places[hit.found] - places[hit.found].mean(axis=0),
        )
        places = turn.apply(places - places[hit.found].mean(axis=0)) + hit.points[hit.found].mean(axis=0)
    hit = surface.closest(places, 8.0)
    assert hit.found.all() and np.percentile(hit.distance, 95) < 0.25


def test_what_is_seen_twice_is_kept_once(views):
    raw = joined(views)
    scan, counts = clean_scan(raw)
    area, whole = (Surface(m.vertices, m.triangles).area.sum() for m in (scan, raw))
    seen = Surface(scan.vertices, scan.triangles)
    assert area < 0.8 * whole
    assert counts["triangles"] == len(scan.triangles) and counts["vertices"] == len(scan.vertices)
    # Nothing is lost: where there was a view there still is one.
    hit = seen.closest(raw.vertices[::7], 6.0)
    assert hit.found.mean() > 0.999 and np.percentile(hit.distance, 99) < 3.5
    again, _ = clean_scan(scan)
    assert Surface(again.vertices, again.triangles).area.sum() > 0.9 * area
    assert np.percentile(seen.closest(again.vertices).distance, 99) < 0.1


def test_views_that_fit_are_kept_once_too(outside):
    half = outside.triangles[outside.vertices[outside.triangles[:, 0], 2] > -60]
    twice = joined([outside, Mesh.from_triangles(outside.vertices + 1e-3, half)])
    scan, counts = clean_scan(twice)
    assert counts["sheets"] == 2 and len(scan.triangles) < len(outside.triangles) + 0.45 * len(half)
    assert abs(scan.vertices[:, None] - outside.vertices[None, :1]).min() < 1e-2


def test_what_shows_most_stays_where_it_is(outside):
    """Landmarks of a file were picked on the scan as it came: a patch goes to the head, not the head to the patch."""
    face = outside.vertices[outside.triangles].mean(axis=1)[:, 1] < -30
    patch = Mesh.from_triangles(outside.vertices + [1.2, 0.8, 0.0], outside.triangles[face])
    scan, counts = clean_scan(joined([outside, patch]))
    assert counts["sheets"] == 2
    back = scan.vertices[:, 1] > 30
    off = Surface(outside.vertices, outside.triangles).closest(scan.vertices[back]).distance
    assert back.sum() > 500 and off.max() < 0.45


def test_a_seam_is_no_step(outside):
    """Two that differ in shape: where the one ends they are the other, and become it little by little."""
    rows, quads = smoother(Mesh.from_triangles(outside.vertices, outside.triangles).faces, len(outside.vertices))
    fine = Mesh.from_triangles(rows @ outside.vertices, Mesh(rows @ outside.vertices, quads).triangles)
    low = fine.vertices[fine.triangles].mean(axis=1)[:, 2] < 40
    wavy = fine.vertices + np.sin(fine.vertices[:, [2]] / 25) * np.cos(fine.vertices[:, [0]] / 25) * [0.0, 0.8, 0.0]
    scan, counts = clean_scan(joined([fine, Mesh.from_triangles(wavy, fine.triangles[~low])]))
    assert counts["sheets"] == 2
    edges = scan.vertices[scan.triangles]
    gone = edges - Surface(fine.vertices, fine.triangles).closest(scan.vertices).points[scan.triangles]
    bent = np.linalg.norm(gone - np.roll(gone, 1, axis=1), axis=2) / np.linalg.norm(
        edges - np.roll(edges, 1, axis=1), axis=2
    )
    middle = edges.mean(axis=1)
    forehead = (abs(middle[:, 2] - 40) < 10) & (middle[:, 1] < -20)
    assert np.linalg.norm(gone, axis=2)[forehead].max() > 0.2 and bent[forehead].max() < 0.22


@pytest.mark.parametrize("unit", [1e-3, 1 / 25.4, 40.0])
def test_views_in_any_unit(views, unit):
    raw = joined(views)
    scan, counts = clean_scan(raw.moved(raw.vertices * unit))
    told, facts = clean_scan(raw)
    assert counts["sheets"] >= 3 and counts["sheets_apart"] == pytest.approx(unit * facts["sheets_apart"], rel=1e-3)
    np.testing.assert_allclose(scan.vertices / unit, told.vertices, atol=0.02)


def test_colours_stay_with_what_they_are_of(views):
    coloured = [replace(v, colour=np.full((len(v.vertices), 3), (k + 1) / 4, np.float32)) for k, v in enumerate(views)]
    scan, _ = clean_scan(joined(coloured))
    assert len(scan.colour) == len(scan.vertices) and set(np.unique(scan.colour)) == {0.25, 0.5, 0.75}
    # The view that looks at a side shows that side.
    left, right = scan.vertices[:, 0] > 55, scan.vertices[:, 0] < -55
    assert (scan.colour[left, 0] == 0.5).mean() > 0.75 and (scan.colour[right, 0] == 0.75).mean() > 0.75


def test_pictures_stay_with_what_they_are_of(views):
    """Of each view a picture of one grey; on every triangle is that of its view."""
    shown = [
        replace(
            v,
            uv=np.full((len(v.faces), 4, 2), 0.5, np.float32),
            material=np.zeros(len(v.faces), np.int16),
            pictures=(np.full((2, 2, 3), 60 * (k + 1), np.uint8),),
        )
        for k, v in enumerate(views)
    ]
    scan, _ = clean_scan(joined(shown))
    assert len(scan.uv) == len(scan.material) == len(scan.faces)
    grey = np.array([picture[0, 0, 0] for picture in scan.pictures])[scan.material] / 255
    np.testing.assert_allclose(scan.colour[scan.triangles][:, :, 0], np.repeat(grey[:, None], 3, axis=1), atol=0.01)


def test_a_lump_in_one_view_does_not_push_it_aside(outside):
    """Hair that blew about between two shots: what else the views show tells how they lie."""
    face = outside.vertices[outside.triangles].mean(axis=1)[:, 1] < -20
    lump = np.exp(-(np.linalg.norm(outside.vertices - [0, -80, 60], axis=1)[:, None] ** 2) / (2 * 22.0**2))
    other = Mesh.from_triangles(outside.vertices + [0.6, 0.6, 0.0] + lump * [0.0, -3.5, 0.0], outside.triangles[face])
    scan, counts = clean_scan(joined([outside, other]))
    assert counts["sheets"] == 2
    chin = (scan.vertices[:, 2] < -55) & (scan.vertices[:, 1] < -50)
    off = Surface(outside.vertices, outside.triangles).closest(scan.vertices[chin]).distance
    assert chin.sum() > 200 and np.percentile(off, 95) < 0.3


def test_views_beside_each_other_stay(views, outside):
    """Less than `TWICE` of all is seen twice: seams, as fused scans have them."""
    x = outside.vertices[outside.triangles].mean(axis=1)[:, 0]
    halves = [Mesh.from_triangles(outside.vertices, outside.triangles[some]) for some in (x > -6, x < 6)]
    strip = Surface(outside.vertices, outside.triangles[abs(x) < 6]).area.sum()
    raw = joined([halves[0], halves[1].moved(halves[1].vertices + [0.0, 0.3, 0.0])])
    assert 2 * strip < TWICE * Surface(raw.vertices, raw.triangles).area.sum()
    scan, counts = clean_scan(raw)
    assert counts["sheets"] == 0
    np.testing.assert_allclose(np.sort(scan.vertices, axis=0), np.sort(raw.vertices[np.unique(raw.triangles)], axis=0))


@pytest.mark.parametrize("where, least", [("hair", 3.0), ("shirt", 3.0), ("hair", 6.0)])
def test_hair_and_clothes_are_no_views(outside, where, least):
    """A cap of hair on the head, a shirt on neck and shoulders: so many mm above the skin, more or less."""
    points, normals = outside.vertices, vertex_normals(outside.vertices, outside.triangles)
    far = least * (1 + 0.3 * np.sin(points[:, 0] / 9) * np.cos(points[:, 2] / 11))
    covered = points[:, 2] > 40 if where == "hair" else points[:, 2] < -60
    shell = Mesh.from_triangles(
        points + far[:, None] * normals, outside.triangles[covered[outside.triangles].all(axis=1)]
    )
    scan, counts = clean_scan(joined([outside, shell]))
    assert counts["sheets"] == 0 and counts["triangles"] == len(outside.triangles) + len(shell.triangles)


def test_clothes_on_somebody_from_head_to_foot_are_no_views(outside):
    """A body, which a head and what is drawn out of it stand for here, and a shirt 3 mm above it."""
    drawn_out = outside.vertices * [1.0, 1.0, 6.0]
    shirt = outside.triangles[(outside.vertices[:, 2] < 0)[outside.triangles].all(axis=1)]
    clothes = Mesh.from_triangles(drawn_out + 3 * vertex_normals(drawn_out, outside.triangles), shirt)
    scan, counts = clean_scan(joined([outside.moved(drawn_out), clothes]))
    assert counts["sheets"] == 0 and counts["triangles"] == len(outside.triangles) + len(shirt)


def test_a_skull_in_its_skin_is_no_view(reference):
    scan, counts = clean_scan(joined([reference.skin, reference.parts["skull"]]))
    assert counts["sheets"] == 0 and counts["components"] == 2


def test_the_window_tells_of_views(addon, views, tmp_path):
    from headshop.headshop_addon import heads, pipeline
    from headshop.headshop_addon.scan_objects import resize, summary
    from headshop.sim.scan.ply import write_ply

    raw = joined(views)
    write_ply(tmp_path / "raw.ply", raw.moved(raw.vertices / 10))
    scan = finish(pipeline.load_scan(tmp_path / "raw.ply", unit="cm"))
    obj = pipeline.add_scan(scan, "Raw")
    facts = json.loads(obj[heads.REPORT])["scan"]
    assert facts["sheets"] >= 3 and 0.4 < facts["sheets_apart_mm"] < 1.5 and "sheets_apart" not in facts
    assert "sheets laid onto each other" in summary(obj)
    resize(obj, 2.0)
    assert json.loads(obj[heads.REPORT])["scan"]["sheets_apart_mm"] == pytest.approx(2 * facts["sheets_apart_mm"])
