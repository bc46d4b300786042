# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials, the attributes they read, the scan's colours, and the portrait frame."""

import numpy as np
import pytest

from headshop.sim.acting.plain_posing import plainly_posed
from headshop.sim.anatomy.head import MATERIALS


@pytest.fixture
def skin(bpy, reference):
    """The skin of a head that has no materials yet."""
    from headshop.headshop_addon import heads

    heads.create_head(reference, "Ada")
    (skin,) = heads.find_heads()
    return skin


def test_every_slot_is_filled_and_dressing_twice_adds_nothing(bpy, skin, reference):
    from headshop.headshop_addon import heads, materials

    materials.dress_head(skin)
    objects = [*heads.parts_of(skin).values(), *heads.muscles_of(skin).values()]
    assert all(slot is not None for obj in objects for slot in obj.data.materials)
    for part, obj in heads.parts_of(skin).items():
        names = [slot.name.removeprefix("Head Shop ").lower() for slot in obj.data.materials]
        assert names == list(MATERIALS[part])
    once = {kind: len(getattr(bpy.data, kind)) for kind in ("materials", "images", "node_groups")}
    attributes = {obj.name: sorted(a.name for a in obj.data.attributes) for obj in objects}
    materials.dress_head(skin)
    heads.create_head(reference, "Grace")
    materials.dress_head(next(each for each in heads.find_heads() if each != skin))
    assert {kind: len(getattr(bpy.data, kind)) for kind in once} == once
    assert {obj.name: sorted(a.name for a in obj.data.attributes) for obj in objects} == attributes


def test_an_artists_material_stays(bpy, skin):
    from headshop.headshop_addon import materials

    own = bpy.data.materials.new("Marble")
    skin.data.materials[0] = own
    materials.dress_head(skin)
    assert skin.data.materials[0] == own


def test_eye_coordinates_end_at_the_iris(reference):
    pytest.importorskip("bpy")
    from headshop.headshop_addon.materials import eye_coordinates

    mesh, eye = reference.parts["eye_l"], reference.eyes[0]
    place = eye_coordinates(mesh, eye, np.array([0.0, 0.0, 1.0]))
    radius = np.linalg.norm(place[:, :2], axis=1)
    iris = np.unique(mesh.faces[mesh.material == MATERIALS["eye_l"].index("iris")])
    assert radius[iris[iris >= 0]].max() == pytest.approx(1.0, abs=1e-3)
    assert 0.15 < place[0, 2] < 0.6
    back = (mesh.vertices - eye.centre) @ eye.gaze < -0.8 * eye.radius
    assert radius[back].min() > 1.5


def test_fibre_coordinates_run_from_origin_to_insertion(reference):
    pytest.importorskip("bpy")
    from headshop.headshop_addon.materials import fibre_coordinates

    muscle = next(m for m in reference.muscles if m.kind == "linear" and not m.ring)
    along = fibre_coordinates(muscle)[:, 0]
    assert along.min() < 0.1 and along.max() > 0.9
    to_origin = np.linalg.norm(muscle.shape.vertices - muscle.path[0], axis=1)
    assert np.corrcoef(along, to_origin)[0, 1] > 0.9


def test_brow_coordinates_mirror(reference):
    pytest.importorskip("bpy")
    from headshop.headshop_addon.skin_paint import brow_coordinates

    at = reference.landmark_positions()
    points = np.array([at["sci_l"], at["sci_r"], at["g"] + [0.5, 0, 0], at["pg"] + [0.5, 0, 0]])
    found = brow_coordinates(points, at)
    assert 0 < found[0, 0] < 1 and abs(found[0, 1] - 4) < 3
    np.testing.assert_allclose(found[0], found[1], atol=0.2)
    assert found[2, 0] < 0.05 and found[3, 1] < -20


def _coloured_scan(reference):
    """The skin in front of the tragia as a scan: red on the subject's left, blue on the right."""
    from headshop.sim.mesh import Mesh
    from headshop.sim.scan.colour_space import to_srgb

    skin = reference.skin
    seen = skin.vertices[:, 1] < reference.landmark_positions()["t_l"][1]
    triangles = skin.triangles[seen[skin.triangles].all(axis=1)]
    linear = np.where(skin.vertices[:, :1] > 0, (0.4, 0.1, 0.1), (0.1, 0.1, 0.4))
    return Mesh.from_triangles(skin.vertices, triangles, colour=to_srgb(linear).astype(np.float32))


@pytest.fixture
def made_of(bpy, reference, monkeypatch):
    """``made_of(scan, name)`` -> the skin, with a small image, of a head that was made of a mesh."""
    from headshop.headshop_addon import bridge, heads, scan_colour

    monkeypatch.setattr(scan_colour, "SIZE", 96)

    def make(scan, name="Ada"):
        obj = bridge.mesh_to_object(scan, name + " Scan")
        bpy.context.scene.collection.objects.link(obj)
        heads.create_head(reference, name, obj)
        (skin,) = (head for head in heads.find_heads() if head.name.startswith(name))
        return skin

    return make


def _painted(skin):
    """The image that a skin's material shows, and its pixels (k, 4)."""
    (image,) = (node.image for node in skin.data.materials[0].node_tree.nodes if node.type == "TEX_IMAGE")
    pixels = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(pixels)
    return image, pixels.reshape(-1, 4)


def test_the_scans_colours_arrive_and_spread_where_it_has_none(reference):
    pytest.importorskip("bpy")
    from headshop.headshop_addon.scan_colour import ScanColour, vertex_colour

    skin, inner = reference.skin, reference.groups["inner"]
    colour, gain = vertex_colour(skin, ScanColour(_coloured_scan(reference)), inner)
    assert colour.shape == skin.vertices.shape and np.isfinite(colour).all() and np.isfinite(gain).all()
    at = reference.landmark_positions()
    nearest = {n: np.argmin(((skin.vertices - at[n]) ** 2).sum(axis=1)) for n in ("zy_l", "zy_r", "op")}
    assert colour[nearest["zy_l"], 0] > 0.3 > 0.2 > colour[nearest["zy_l"], 2]
    assert colour[nearest["zy_r"], 2] > 0.3 > 0.2 > colour[nearest["zy_r"], 0]
    assert 0.05 < colour[nearest["op"]].min() and colour[nearest["op"]].max() < 0.45


def test_shade_under_the_chin_does_not_go_down_the_neck(reference):
    """Where it was seen it stays, its light evened; the neck, which was not, has the face's tone on its lower half."""
    from headshop.headshop_addon.scan_colour import ScanColour, vertex_colour
    from headshop.sim.mesh import Mesh
    from headshop.sim.scan.colour_space import to_srgb

    skin, at = reference.skin, reference.landmark_positions()
    below = at["gn"][2] - skin.vertices[:, 2]
    shade = (below > -5) & (np.abs(skin.vertices[:, 0]) < 60)
    linear = np.where(shade[:, None], 0.2, 1.0) * np.array([0.4, 0.25, 0.2])
    seen = (skin.vertices[:, 1] < at["t_l"][1]) & (below < 15)
    triangles = skin.triangles[seen[skin.triangles].all(axis=1)]
    scan = Mesh.from_triangles(skin.vertices, triangles, colour=to_srgb(linear).astype(np.float32))
    colour, _ = vertex_colour(skin, ScanColour(scan), reference.groups["inner"])
    outer = reference.groups["inner"] < 0.5
    assert colour[outer & seen & shade & (below < 5), 0].mean() < 0.12
    neck = outer & (below > 60)
    assert neck.sum() > 50 and colour[neck, 0].min() > 0.25
    np.testing.assert_allclose(
        colour[neck].mean(axis=0) / colour[neck].mean(), np.array([0.4, 0.25, 0.2]) * 3 / 0.85, rtol=1e-3
    )


def test_hair_does_not_stain_the_skin_below(reference):
    from headshop.headshop_addon.scan_colour import ScanColour, unseen_skin, vertex_colour
    from headshop.sim.scan.colour_space import to_linear, to_srgb

    skin, scalp = reference.skin, reference.groups["scalp"] > 0.5
    scan = _coloured_scan(reference)
    linear = to_linear(scan.colour)
    linear[scalp] = 0.01  # hair
    scan = scan.__class__.from_triangles(scan.vertices, scan.triangles, colour=to_srgb(linear).astype(np.float32))
    inner = reference.groups["inner"]
    dark, _ = vertex_colour(skin, ScanColour(scan), inner)
    skinny, _ = vertex_colour(skin, ScanColour(scan), unseen_skin(skin, inner, scalp))
    front = scalp & (skin.vertices[:, 1] < -40)
    assert dark[front].max(axis=1).mean() < 0.08
    assert skinny[front].max(axis=1).min() > 0.2


def test_what_is_not_trusted_gives_no_colour_and_does_not_hold_what_is_spread(reference):
    """Red on the left; of the right, which is blue, one vertex in three is stained and not trusted."""
    from headshop.headshop_addon.scan_colour import ScanColour, vertex_colour
    from headshop.sim.mesh import vertex_normals

    skin, source = reference.skin, ScanColour(_coloured_scan(reference))
    normals = vertex_normals(skin.vertices, skin.triangles)
    plain, sure = source.at(skin.vertices, normals)
    stained = (np.arange(len(source.points)) % 3 == 0) & (source.points[:, 0] < 0)
    source.colour = np.where(stained[:, None], (0.0, 0.9, 0.0), source.colour)
    source.trust = np.where(stained, 0.0, 1.0)
    colour, confidence = source.at(skin.vertices, normals)
    np.testing.assert_allclose(colour[sure > 0, 1], 0.1 * (colour[sure > 0].sum(axis=1) > 0), atol=1e-6)
    left = skin.vertices[:, 0] > 10
    np.testing.assert_array_equal(colour[left], plain[left])
    np.testing.assert_array_equal(confidence[left], sure[left])
    assert confidence[(skin.vertices[:, 0] < -10) & (sure > 0.9)].min() < 0.05
    spread, _ = vertex_colour(skin, source, reference.groups["inner"])
    assert spread[:, 1].max() < 0.15
    source.trust = np.where(source.points[:, 0] < 0, 0.4, 1.0)  # it is likelier something else
    source.colour = np.where(source.points[:, :1] < 0, (0.0, 0.9, 0.0), source.colour)
    spread, _ = vertex_colour(skin, source, reference.groups["inner"])
    assert spread[skin.vertices[:, 0] < -10, 1].max() < 0.15


def test_a_head_is_dressed_in_what_shows_skin(reference, made_of, monkeypatch):
    from headshop.headshop_addon import bridge, materials

    scan = _coloured_scan(reference)
    before = scan.triangles[(scan.vertices[:, 1] < 0)[scan.triangles].all(axis=1)]
    skin = made_of(scan.from_triangles(scan.vertices, before, colour=scan.colour))
    bridge.write_attribute(skin.data, "hidden", reference.groups["scalp"] > 0.5)
    bridge.write_attribute(skin.data, "clothed", reference.groups["neck"] > 0.5)
    asked, ended = [], []

    def shown(points, colour, mesh, groups, landmarks, eyes, hidden, ends, clothed):
        covered = int(hidden.sum()), int(clothed.sum())
        asked.append((len(mesh.vertices), len(groups["face"]), len(landmarks) > 50, len(eyes), *covered))
        ended.append(ends)
        return (points[:, 0] < 0).astype(float)

    monkeypatch.setattr(materials, "shown_skin", shown)
    materials.dress_head(skin)
    count = len(reference.skin.vertices)
    covered = (int((reference.groups[name] > 0.5).sum()) for name in ("scalp", "neck"))
    assert asked == [(count, count, True, 2, *covered)]
    assert len(ended[0]) > 50
    assert (np.abs(ended[0][:, 1]) < 15).mean() > 0.5  # where it was cut; the rest, lids and lips
    _, pixels = _painted(skin)
    assert (pixels[:, 0] > pixels[:, 2] + 0.2).mean() < 0.02  # red, which is on the left


def test_a_speck_beside_the_skin_leaves_no_spot(reference):
    pytest.importorskip("bpy")
    from headshop.headshop_addon.scan_colour import ScanColour
    from headshop.sim.mesh import Mesh, vertex_normals

    scan, place = _coloured_scan(reference), reference.landmark_positions()["zy_l"]
    nearest = np.argmin(((scan.vertices - place) ** 2).sum(axis=1))
    normal = vertex_normals(scan.vertices, scan.triangles)[nearest]
    side = np.cross(normal, [0, 0, 1.0])
    asked = scan.vertices[nearest] + 2 * normal
    speck = asked + np.array([np.zeros(3), side, np.cross(normal, side)])
    dirty = Mesh.from_triangles(
        np.concatenate([scan.vertices, speck]),
        np.concatenate([scan.triangles, [len(scan.vertices) + np.arange(3)]]),
        colour=np.concatenate([scan.colour, np.zeros((3, 3), np.float32)]),
    )
    clean, found = (ScanColour(mesh).at(asked[None], normal[None])[0] for mesh in (scan, dirty))
    np.testing.assert_allclose(found, clean, atol=1e-6)
    assert clean[0, 0] > 0.3


def test_a_scan_elsewhere_gives_no_colour(reference):
    pytest.importorskip("bpy")
    from headshop.headshop_addon.scan_colour import ScanColour, vertex_colour

    scan = _coloured_scan(reference)
    far = scan.moved(scan.vertices + [500.0, 0, 0])
    assert vertex_colour(reference.skin, ScanColour(far), reference.groups["inner"]) is None


def test_a_scan_wound_inside_out_gives_the_same_colours(reference, made_of):
    from headshop.headshop_addon import materials
    from headshop.sim.mesh import Mesh

    scan, found = _coloured_scan(reference), []
    for name, triangles in (("Ada", scan.triangles), ("Bea", scan.triangles[:, ::-1])):
        skin = made_of(Mesh.from_triangles(scan.vertices, triangles, colour=scan.colour), name)
        materials.dress_head(skin)
        found.append(_painted(skin)[1])
    np.testing.assert_allclose(*found, atol=0.02)


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_scan_wound_inside_out_is_shown_outside_out(bpy, skin, reference, mirrored):
    """The inside of a scan is drawn dark."""
    from headshop.headshop_addon import bridge, heads
    from headshop.headshop_addon.studio import Model, studio
    from headshop.sim.mesh import Mesh

    scan, outward = reference.skin, []
    for triangles in (scan.triangles, scan.triangles[:, ::-1]):
        flip = [-1.0, 1.0, 1.0] if mirrored else [1.0, 1.0, 1.0]
        obj = bridge.mesh_to_object(Mesh.from_triangles(scan.vertices * flip, triangles), "Scan")
        obj.scale = flip
        bpy.context.scene.collection.objects.link(obj)
        skin[heads.SCAN] = obj
        with studio(skin) as (scene, frame):
            Model(scene, skin, frame)
            (copy,) = bpy.data.collections["Head Shop Studio scan"].objects
            normals = np.array([v.normal[:] for v in copy.data.vertices])
            outward.append(normals)
        bpy.data.objects.remove(obj)
    np.testing.assert_allclose(*outward, atol=1e-3)


def test_a_coloured_scan_gives_the_head_a_skin_of_its_own(bpy, reference, made_of):
    from headshop.headshop_addon import bridge, materials

    skin = made_of(_coloured_scan(reference))
    materials.dress_head(skin)
    material, (image, pixels) = skin.data.materials[0], _painted(skin)
    assert image.packed_file is not None, "the colours must travel with the file"
    assert (pixels[:, 0] > pixels[:, 2] + 0.2).mean() > 0.15 and (pixels[:, 2] > pixels[:, 0] + 0.2).mean() > 0.15
    images = len(bpy.data.images)
    red, nothing = reference.skin.vertices[:, 0] > 0, np.zeros(len(reference.skin.vertices), dtype=bool)
    for hidden, clothed in ((red, nothing), (nothing, red)):  # as if hair, or clothing, covered all that is red
        bridge.write_attribute(skin.data, "hidden", hidden)
        bridge.write_attribute(skin.data, "clothed", clothed)
        materials.dress_head(skin)
        assert len(bpy.data.images) == images and skin.data.materials[0] == material
        _, pixels = _painted(skin)
        assert (pixels[:, 0] > pixels[:, 2] + 0.2).mean() < 0.03


def test_a_relaxed_face_has_the_colours_of_the_one_that_was_scanned(reference, made_of):
    from headshop.headshop_addon import materials, shape_keys
    from headshop.headshop_addon.skin_material import COLOUR
    from headshop.sim.mesh import Mesh

    lips = np.maximum(reference.groups["lip_upper"], reference.groups["lip_lower"])
    seen = (reference.groups["face"] > 0.5) & (reference.groups["inner"] < 0.5)
    scanned = plainly_posed(reference, jaw_open=0.8).skin
    painted = np.where(lips[:, None] > 0.5, (0.8, 0.1, 0.1), (0.1, 0.1, 0.8)).astype(np.float32)
    shown = scanned.triangles[seen[scanned.triangles].all(axis=1)]
    skin = made_of(Mesh.from_triangles(scanned.vertices, shown, colour=painted))
    shape_keys.keep_as_scanned(skin, scanned.vertices)
    materials.dress_head(skin)
    colour = np.empty(4 * len(lips), dtype=np.float32)
    skin.data.attributes[COLOUR].data.foreach_get("color", colour)
    red, _, blue, _ = colour.reshape(-1, 4).T
    assert (red > 2 * blue)[seen & (lips > 0.9)].mean() > 0.9  # not what lies where the lips are closed now
    assert (red > blue)[seen & (lips < 0.01)].mean() < 0.01  # as a chin where the lower lip was
    assert skin.data.shape_keys.key_blocks[shape_keys.SCANNED].value == 0


def test_the_portrait_turns_with_the_head(bpy, skin, reference):
    from mathutils import Matrix

    from headshop.headshop_addon.stage import portrait, set_stage

    upright = portrait(skin)
    np.testing.assert_allclose(upright.left, (1, 0, 0), atol=0.02)
    np.testing.assert_allclose(np.cross(upright.left, upright.back), upright.up, atol=1e-6)
    assert 0.15 < upright.height < 0.3
    turn = Matrix.Rotation(1.0, 4, "X") @ Matrix.Rotation(2.0, 4, "Z")
    skin.matrix_world = Matrix.Translation((0.3, 0.2, 0.1)) @ turn
    lying = set_stage(bpy.context.scene, skin, width=40, height=48)
    np.testing.assert_allclose(lying.left, np.array(turn.to_3x3()) @ upright.left, atol=1e-5)
    bpy.context.view_layer.update()
    # the camera sees the face's middle near the middle of the picture, upright
    from bpy_extras.object_utils import world_to_camera_view
    from mathutils import Vector

    camera = bpy.context.scene.camera
    up, down = (
        world_to_camera_view(bpy.context.scene, camera, Vector(lying.centre + s * 0.1 * lying.up)) for s in (1, -1)
    )
    assert abs(up.x - 0.5) < 0.1 and up.y > 0.6 and down.y < 0.55


def test_staging_twice_leaves_one_stage(bpy, skin):
    from headshop.headshop_addon.stage import set_stage

    set_stage(bpy.context.scene, skin)
    objects = len(bpy.data.objects)
    set_stage(bpy.context.scene, skin, yaw=-20.0)
    assert len(bpy.data.objects) == objects
    assert bpy.context.scene.camera.name in bpy.context.scene.objects


def test_the_iris_takes_the_scans_colour_only_where_an_eye_was_seen(reference):
    pytest.importorskip("bpy")
    from headshop.sim.mesh import Mesh
    from headshop.sim.scan.colour_space import to_srgb
    from headshop.sim.scan.iris_colour import iris_colour

    skin = reference.skin.vertices
    eyes = [reference.parts[part].vertices for part in ("eye_l", "eye_r")]
    vertices = np.concatenate([skin, *eyes])
    tone = np.tile((0.4, 0.25, 0.18), (len(vertices), 1))

    def scan(eye_colour):
        colour = tone.copy()
        colour[len(skin) :] = eye_colour
        return Mesh(vertices, np.zeros((0, 4), np.int32), colour=to_srgb(colour))

    blue = iris_colour(scan((0.05, 0.08, 0.14)), reference.eyes)
    np.testing.assert_allclose(blue / blue[2], (0.05 / 0.14, 0.08 / 0.14, 1.0), atol=0.02)
    brown = iris_colour(scan((0.05, 0.03, 0.02)), reference.eyes)
    assert brown is not None and brown[0] > brown[2]
    assert iris_colour(scan((0.38, 0.24, 0.17)), reference.eyes) is None
