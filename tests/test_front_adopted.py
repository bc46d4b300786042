# SPDX-License-Identifier: GPL-3.0-or-later
"""An object in the scene becomes the scan as the viewport shows it: with modifiers, shape keys, its scale, mirrored or not."""

import json
from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

from headshop.sim.health.topology import volume
from headshop.sim.point_cloud.splats import COLOURS, OPACITY, SCALES, TURNS


@pytest.fixture
def original(addon, skin_object):
    """The reference's skin as an object, selected and active."""
    obj = skin_object("Raw")
    addon.context.view_layer.objects.active = obj
    obj.select_set(True)
    return obj


@pytest.fixture
def adopted(addon, monkeypatch):
    """``adopted()`` -> the scan that the active object becomes, which is upright as it is."""
    from headshop.headshop_addon import pipeline
    from headshop.sim.progress import Progress
    from headshop.sim.scan.orientation import Orientation

    def upright(mesh, *_, **__):
        yield Progress(0.5, "")
        return Orientation("m", 1000.0, "+Z", "-Y", np.eye(3), True, "As it is.")

    def make():
        assert addon.ops.headshop.choose_scan() == {"FINISHED"}
        return addon.context.scene.headshop.scan

    monkeypatch.setattr(pipeline, "detecting", upright)
    return make


def _world(obj):
    """(n, 3) m: where the viewport shows its vertices."""
    import bpy

    bpy.context.view_layer.update()
    shown = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    points = np.empty(3 * len(shown.data.vertices), np.float32)
    shown.data.vertices.foreach_get("co", points)
    matrix = np.array(shown.matrix_world)
    return points.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]


def _same_places(one, other):
    from scipy.spatial import cKDTree

    return max(cKDTree(one).query(other)[0].max(), cKDTree(other).query(one)[0].max()) < 1e-5


def _own(obj):
    from headshop.headshop_addon import bridge

    return bridge.object_to_mesh(obj)


def test_modifiers_and_shape_keys_count_as_shown(original, adopted):
    original.shape_key_add(name="Basis")
    key = original.shape_key_add(name="Longer")
    for point in key.data[:500]:
        point.co.z += 0.02
    key.value = 0.5
    original.modifiers.new("Cut", "DECIMATE").ratio = 0.5
    hidden = original.modifiers.new("Hidden", "SUBSURF")
    hidden.show_viewport = False
    shown, count = _world(original), len(original.data.polygons)
    scan = adopted()
    assert len(scan.data.polygons) < 1.2 * count and not scan.modifiers
    assert _same_places(_world(scan), shown)
    assert len(original.data.polygons) == count and len(original.modifiers) == 2


def test_what_is_selected_is_one_scan(original, adopted, addon, reference):
    """As an importer leaves it: a part of the head is active, the empty above it selected too; a light counts for nothing."""
    from headshop.headshop_addon import bridge

    eye = bridge.mesh_to_object(reference.parts["eye_l"], "Eye")
    cloud = addon.data.objects.new("Loose", addon.data.meshes.new("Loose"))
    cloud.data.from_pydata([(9, 9, 9), (8, 8, 8)], [], [])
    above = addon.data.objects.new("Root", None)
    light = addon.data.objects.new("Light", addon.data.lights.new("Light", "POINT"))
    for obj in (eye, cloud, above, light):
        addon.context.scene.collection.objects.link(obj)
        obj.select_set(True)
    above.scale, above.rotation_euler = (2, 2, 2), (0.1, 0.2, 0.3)
    eye.parent = original.parent = above
    eye.scale, eye.location = (1.5, -1, 1), (0.1, 0, 0)
    addon.context.view_layer.objects.active = eye
    shown = np.concatenate([_world(original), _world(eye)])
    scan = adopted()
    assert scan.name == "Eye Scan" and _same_places(_world(scan), shown)
    assert original.hide_get() and eye.hide_get() and cloud.hide_get() and not light.hide_get()


def test_without_a_selection_the_active_object_is_the_scan(original, adopted, addon):
    original.select_set(False)
    other = addon.data.objects.new("Root", None)
    addon.context.scene.collection.objects.link(other)
    other.select_set(True)
    assert adopted().name == "Raw Scan"
    assert not addon.ops.headshop.choose_scan.poll()  # it is chosen already


def test_a_scale_of_its_own_in_each_direction_is_the_scans_shape(original, adopted, reference):
    original.scale, original.rotation_euler, original.location = (1.0, 1.1, 1.3), (0.2, 0.5, -0.4), (1, 2, 3)
    shown = _world(original)
    scan = adopted()
    assert _same_places(_world(scan), shown)
    sizes = np.linalg.svd(np.array(scan.matrix_world)[:3, :3])[1]
    assert np.ptp(sizes) < 1e-5 and sizes[0] == pytest.approx((1.1 * 1.3) ** (1 / 3), rel=1e-5)
    tall = np.ptp(_own(scan).vertices, axis=0) / np.ptp(reference.skin.vertices, axis=0)
    assert tall[2] / tall[0] == pytest.approx(1.3, rel=1e-3)


def test_a_mirrored_object_is_another_person_and_not_inside_out(original, adopted, reference):
    original.scale, original.rotation_euler = (-2.0, 2.0, 2.0), (0.2, 0.5, -0.4)
    shown = _world(original)
    scan = adopted()
    assert _same_places(_world(scan), shown)
    matrix = np.array(scan.matrix_world)[:3, :3]
    assert np.linalg.det(matrix) == pytest.approx(8, rel=1e-5) and np.allclose(
        matrix @ matrix.T, 4 * np.eye(3), atol=1e-5
    )
    mesh = _own(scan)
    assert np.sign(volume(mesh)) == np.sign(volume(reference.skin)) != 0


def test_an_object_that_is_turned_and_larger_keeps_its_own_space(original, adopted, reference):
    original.scale, original.rotation_euler, original.location = (3, 3, 3), (0.2, 0.5, -0.4), (1, 2, 3)
    _world(original)
    scan = adopted()
    np.testing.assert_allclose(np.array(scan.matrix_world), np.array(original.matrix_world), atol=1e-5)
    np.testing.assert_allclose(_own(scan).vertices, reference.skin.vertices, atol=1e-4)


def test_splats_that_were_imported_as_points_are_splats(addon, adopted):
    """Blender keeps their numbers as attributes of vertices, in the file's own unit."""
    from headshop.headshop_addon import heads

    rng = np.random.default_rng(1)
    middles = rng.normal(size=(4000, 3))
    middles *= 0.1 / np.linalg.norm(middles, axis=1)[:, None]
    data = addon.data.meshes.new("Splats")
    data.from_pydata(middles.tolist(), [], [])
    known = {"opacity": 3.0, "rot_0": 1.0, "f_dc_0": 1.0, "f_dc_1": -1.0}
    for name in (*COLOURS, OPACITY, *SCALES, *TURNS):
        value = np.log(0.003) if name.startswith("scale") else known.get(name, 0.0)
        data.attributes.new(name, "FLOAT", "POINT").data.foreach_set("value", np.full(len(middles), value, np.float32))
    obj = addon.data.objects.new("Splats", data)
    addon.context.scene.collection.objects.link(obj)
    addon.context.view_layer.objects.active = obj
    scan = adopted()
    off = np.abs(np.linalg.norm(_own(scan).vertices, axis=1) - 100)
    assert np.median(off) < 0.5 and np.quantile(off, 0.9) < 3  # what stands across the surface reaches out of it
    assert json.loads(scan[heads.REPORT])["scan"]["points"] > 2 * len(middles)
    assert _own(scan).colour.mean(axis=0) == pytest.approx([0.782, 0.218, 0.5], abs=0.01)


def test_what_is_scaled_to_nothing_is_refused(addon, original):
    original.scale = (1, 1, 0)
    with pytest.raises(
        RuntimeError, match="Raw has a scale of 0 in some direction: give it another scale, or apply it"
    ):
        addon.ops.headshop.choose_scan()
    assert addon.context.scene.headshop.scan is None and not original.hide_get()


@pytest.mark.parametrize(
    "unit, scale", [("mm", 1.0), ("mm", 0.001), ("mm", 0.01), ("cm", 1.0), ("m", 3.0), ("dm", 0.1), ("none", 0.05)]
)
def test_the_unit_is_told_by_what_is_shown_or_else_by_the_numbers(addon, original, reference, unit, scale):
    """Importers put the numbers of a file as metres, and artists scale what comes in or not: a head is as large as it was."""
    from headshop.headshop_addon import heads

    # The last: a head of 7 inches, if its numbers were inches.
    factor = {"mm": 1000.0, "cm": 100.0, "dm": 10.0, "m": 1.0, "none": 20.0}[unit]
    original.data.vertices.foreach_set("co", (reference.skin.vertices * 1e-3 * factor).astype(np.float32).ravel())
    original.scale, original.rotation_euler, original.location = (scale,) * 3, (0.0, 0.0, np.pi / 2), (1, 2, 3)
    shown = _world(original)
    assert addon.ops.headshop.choose_scan() == {"FINISHED"}
    scan = addon.context.scene.headshop.scan
    facts = json.loads(scan[heads.REPORT])["scan"]
    assert facts["unit"] in ("mm", "cm", "m") and facts["certain"]
    extent = np.ptp(reference.skin.vertices, axis=0)
    assert np.ptp(_own(scan).vertices, axis=0) == pytest.approx(extent, rel=1e-4)
    assert np.abs(_world(scan) - shown).max() < 1e-5 * np.abs(shown).max()


def test_another_scan_is_chosen_with_its_landmarks(addon, scan_object, skin_object, reference):
    """The one that was chosen was deleted: what else there is can be chosen again, and its landmarks with it."""
    from headshop.headshop_addon import active, heads, scan_landmarks

    scan_object[heads.PART] = "scan"
    scan_landmarks.replace(scan_object, reference.landmark_positions())
    addon.context.scene.headshop.scan = None
    assert active.scan(addon.context) is None and active.scans(addon.context) == [scan_object]
    addon.context.view_layer.objects.active = scan_object
    scan_object.select_set(True)
    scan_object.select_set(False)
    assert not addon.ops.headshop.choose_scan.poll()
    scan_object.select_set(True)
    assert addon.ops.headshop.choose_scan.poll() and addon.ops.headshop.choose_scan() == {"FINISHED"}
    assert active.scan(addon.context) == scan_object and not scan_object.hide_get()
    assert len(scan_landmarks.positions(scan_object)) == len(reference.landmark_positions())
    assert not addon.ops.headshop.choose_scan.poll() and len(active.scans(addon.context)) == 1


def test_the_field_offers_the_scans_and_heads_of_this_scene(addon, skin_object, reference):
    from headshop.headshop_addon import heads, properties

    settings, mesh, scan = addon.context.scene.headshop, skin_object("Mesh"), skin_object("Scan")
    scan[heads.PART] = "scan"
    skin = next(filter(heads.is_skin, heads.create_head(reference, "Ref").objects))
    offered = [
        [obj for obj in addon.data.objects if poll(settings, obj)]
        for poll in (properties._is_scan, properties._is_skin)
    ]
    assert mesh in list(addon.data.objects) and offered == [[scan], [skin]]
    other = addon.data.scenes.new("Other").headshop
    assert not any(properties._is_scan(other, obj) or properties._is_skin(other, obj) for obj in addon.data.objects)


def test_every_view_of_a_quad_view_comes_close_to_a_scan(blender, monkeypatch):
    from headshop.headshop_addon import scan_objects

    seen = []
    view3d = SimpleNamespace(view_axis=lambda **_: None, view_selected=lambda **how: seen.append(how))
    pretended = SimpleNamespace(app=SimpleNamespace(background=False), ops=SimpleNamespace(view3d=view3d))
    monkeypatch.setattr(scan_objects, "bpy", pretended)
    area = SimpleNamespace(type="VIEW_3D", regions=[SimpleNamespace(type="WINDOW")])
    scan_objects.look_at(SimpleNamespace(area=area, temp_override=lambda **_: nullcontext()))
    assert seen == [{"use_all_regions": True}]
