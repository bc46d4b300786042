# SPDX-License-Identifier: GPL-3.0-or-later
"""Scans with pictures on them, as photogrammetry and phones deliver them, in every format that holds any."""

from dataclasses import replace

import numpy as np
import pytest

from headshop.sim.mesh import Mesh, vertex_normals
from headshop.sim.scan.texture import has_pictures, vertex_colours

WIDE, HIGH = 64, 32  # of the picture


def _sheet():
    """A bulging sheet of 3 mm triangles, its picture, and the colour (k, 3) at places (k, 2) 0..1 on it: red grows to the
    right and green upward."""
    u, v = np.meshgrid(np.linspace(0, 1, 24), np.linspace(0, 1, 20))
    points = np.stack([70 * u, 20 * np.sin(3 * u) * np.sin(3 * v), 60 * v], axis=-1).reshape(-1, 3)
    corner = np.arange(480).reshape(20, 24)
    faces = np.stack([corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]], axis=-1).reshape(-1, 4)
    uv = np.stack([u, v], axis=-1).reshape(-1, 2)[faces].astype(np.float32)
    x, y = (np.arange(WIDE) + 0.5) / WIDE, (np.arange(HIGH) + 0.5) / HIGH
    picture = np.zeros((HIGH, WIDE, 3), np.uint8)
    picture[..., 0], picture[..., 1], picture[..., 2] = np.rint(255 * x), np.rint(255 * y[:, None]), 80
    material = np.zeros(len(faces), np.int16)
    return Mesh(points, faces.astype(np.int32), uv=uv, material=material, pictures=(picture,))


@pytest.fixture
def sheet(bpy, tmp_path):
    """The object of `_sheet` in the scene; its picture lies in a file."""
    from headshop.headshop_addon import bridge, scan_texture

    mesh = _sheet()
    obj = bridge.mesh_to_object(mesh, "sheet")
    scan_texture.put_pictures(obj, mesh)
    image = scan_texture.image_of(obj.data.materials[0])
    image.filepath_raw, image.file_format = str(tmp_path / "skin.png"), "PNG"
    image.save()
    image.unpack(method="REMOVE")
    bpy.context.scene.collection.objects.link(obj)
    return obj


_WRITERS = {
    ".obj": lambda bpy, path: bpy.ops.wm.obj_export(filepath=path, forward_axis="Y", up_axis="Z"),
    ".glb": lambda bpy, path: bpy.ops.export_scene.gltf(filepath=path, export_format="GLB"),
    ".usdc": lambda bpy, path: bpy.ops.wm.usd_export(filepath=path),
    ".fbx": lambda bpy, path: bpy.ops.export_scene.fbx(filepath=path, path_mode="COPY", embed_textures=True),
}


def _check(scan, up=2, right=0, metres=True):
    """The colour of each vertex is that of its place."""
    size = 1000 if metres else 1
    wanted = np.stack([scan.vertices[:, right] * size / 70, scan.vertices[:, up] * size / 60], axis=1)
    inner = ((wanted > 0.04) & (wanted < 0.96)).all(axis=1)
    assert inner.sum() > 300
    np.testing.assert_allclose(scan.colour[inner, :2], wanted[inner], atol=0.03)
    np.testing.assert_allclose(scan.colour[inner, 2], 80 / 255, atol=0.01)


@pytest.mark.parametrize("extension", _WRITERS)
def test_a_picture_comes_in_with_the_scan(bpy, tmp_path, sheet, extension):
    from headshop.headshop_addon import scan_import

    path = str(tmp_path / f"scan{extension}")
    _WRITERS[extension](bpy, path)
    before = scan_import.datablocks()
    scan = scan_import.read_scan(path)
    assert scan_import.datablocks() == before
    assert has_pictures(scan) and scan.pictures[0].shape == (HIGH, WIDE, 3)
    _check(scan, up=1 if extension == ".glb" else 2)


def test_a_picture_of_an_unlit_material_comes_in_as_well(bpy, tmp_path, sheet):
    """As phones write them: without a surface shader."""
    from headshop.headshop_addon import scan_import, scan_texture
    from headshop.headshop_addon.shader_nodes import Graph

    (material,) = sheet.data.materials
    image, graph = scan_texture.image_of(material), Graph(material)
    light = graph.node("Background", {"Color": graph.node("TexImage", image=image).outputs["Color"]})
    graph.node("OutputMaterial", {"Surface": light.outputs[0]})
    bpy.ops.export_scene.gltf(filepath=str(tmp_path / "unlit.glb"), export_format="GLB")
    scan = scan_import.read_scan(tmp_path / "unlit.glb")
    assert has_pictures(scan)
    _check(scan, up=1)


@pytest.fixture
def ply(tmp_path, write_rows):
    """``ply(name, number)`` -> path of `_sheet` as a PLY that shows the picture ``name``; ``number``: its
    last faces show a second one."""

    def make(name, number=False):
        mesh = _sheet()
        faces = (
            np.concatenate([mesh.faces[:9, [0, 1, 2]], mesh.faces[:9, [0, 2, 3]]]).tolist() + mesh.faces[9:].tolist()
        )
        at = np.stack([mesh.vertices[:, 0] / 70, mesh.vertices[:, 2] / 60], axis=1)
        rows = [[corners, at[corners].ravel().tolist(), int(k > 410)] for k, corners in enumerate(faces)]
        properties = ["list uchar int vertex_indices", "list uchar float texcoord", "uchar texnumber"]
        if not number:
            properties, rows = properties[:2], [row[:2] for row in rows]
        elements = {"vertex": (["float x", "float y", "float z"], mesh.vertices.tolist()), "face": (properties, rows)}
        names = [name, "other.png"] if number else [name]
        path = tmp_path / "scan.ply"
        return write_rows(path, "binary_little_endian", elements, [f"TextureFile {each}" for each in names])

    return make


@pytest.mark.parametrize("name", ["skin.png", "C:\\scans\\export\\skin.png", "elsewhere/skin.png"])
def test_a_picture_beside_a_ply_comes_in_with_it(bpy, sheet, ply, name):
    from headshop.headshop_addon import scan_import

    before = scan_import.datablocks()
    scan = scan_import.read_scan(ply(name))
    assert scan_import.datablocks() == before
    assert [picture.shape for picture in scan.pictures] == [(HIGH, WIDE, 3)]
    _check(scan, metres=False)


def test_a_picture_in_a_folder_beside_a_ply_counts_before_one_beside_it(bpy, tmp_path, sheet, ply):
    from headshop.headshop_addon import scan_import

    (tmp_path / "maps").mkdir()
    (tmp_path / "skin.png").rename(tmp_path / "maps" / "skin.png")
    for _ in range(2):
        _check(scan_import.read_scan(ply("maps\\skin.png")), metres=False)
        (tmp_path / "skin.png").write_bytes(b"Another one.")


def test_a_ply_shows_its_pictures_by_number(bpy, tmp_path, sheet, ply):
    from headshop.headshop_addon import scan_import

    image = bpy.data.images.new("other", 2, 2)
    image.generated_color = 0, 0, 1, 1
    image.filepath_raw, image.file_format = str(tmp_path / "other.png"), "PNG"
    image.save()
    scan = scan_import.read_scan(ply("skin.png", number=True))
    assert len(scan.pictures) == 2
    low, high = scan.vertices[:, 2] < 52, scan.vertices[:, 2] > 59
    np.testing.assert_allclose(scan.colour[high], np.tile([0, 0, 1], (high.sum(), 1)), atol=0.01)
    _check(Mesh(scan.vertices[low], scan.faces[:0], colour=scan.colour[low]), metres=False)
    path = tmp_path / "scan.ply"
    path.write_bytes(path.read_bytes().replace(b"comment TextureFile other.png\n", b""))
    assert scan_import.read_scan(path).pictures[1:] == (None,)  # for the faces of a picture that is not named
    (tmp_path / "other.png").unlink()
    scan = scan_import.read_scan(ply("skin.png", number=True))
    assert scan.pictures[1] is None and (scan.colour[high] == 1).all()


@pytest.mark.parametrize("kind", ["gone", "a letter", "a folder", "cut off", "no name", "a long name"])
def test_a_ply_whose_picture_cannot_be_read_comes_in_without_colours(bpy, tmp_path, sheet, ply, kind):
    from headshop.headshop_addon import scan_import

    picture = tmp_path / "picture.png"
    if kind == "a letter":
        picture.write_bytes(b"Dear scanner, this is a letter.")
    elif kind == "a folder":
        picture.mkdir()
    elif kind == "cut off":
        picture.write_bytes((tmp_path / "skin.png").read_bytes()[:40])
    before = scan_import.datablocks()
    scan = scan_import.read_scan(ply({"no name": "\0.png", "a long name": "a" * 300}.get(kind, picture.name)))
    assert not has_pictures(scan) and scan.colour is None and len(scan.faces) > 400
    assert scan_import.datablocks() == before


def test_a_normal_map_is_no_colour(bpy, sheet):
    from headshop.headshop_addon import bridge, scan_texture

    image = scan_texture.image_of(sheet.data.materials[0])
    image.colorspace_settings.name = "Non-Color"
    assert scan_texture.image_of(sheet.data.materials[0]) is None
    assert not has_pictures(scan_texture.with_pictures(bridge.object_to_mesh(sheet), sheet))


def test_a_scan_whose_picture_is_missing_comes_in_without_colours(bpy, tmp_path, sheet):
    from headshop.headshop_addon import scan_import

    _WRITERS[".obj"](bpy, str(tmp_path / "scan.obj"))
    material = tmp_path / "scan.mtl"
    material.write_text(material.read_text().replace("skin.png", "gone.png"))
    scan = scan_import.read_scan(tmp_path / "scan.obj")
    assert not has_pictures(scan) and scan.colour is None and len(scan.faces) > 400


def test_objects_with_and_without_pictures_are_joined(bpy, tmp_path, sheet):
    from headshop.headshop_addon import bridge, scan_import

    plain = _sheet()
    other = bridge.mesh_to_object(Mesh(plain.vertices + [200, 0, 0], plain.faces), "plain")
    bpy.context.scene.collection.objects.link(other)
    _WRITERS[".glb"](bpy, str(tmp_path / "two.glb"))
    scan = scan_import.read_scan(tmp_path / "two.glb")
    far = scan.vertices[:, 0] > 0.15
    assert (scan.colour[far] == 1).all() and far.sum() > 300
    near = ~far
    _check(Mesh(scan.vertices[near], scan.faces[:0], colour=scan.colour[near]), up=1)


def test_larger_pictures_are_made_smaller_and_the_artists_own_stays(bpy, sheet, monkeypatch):
    from headshop.headshop_addon import bridge, scan_texture

    monkeypatch.setattr(scan_texture, "LARGEST", 16)
    image = scan_texture.image_of(sheet.data.materials[0])
    before = len(bpy.data.images)
    read = scan_texture.with_pictures(bridge.object_to_mesh(sheet), sheet)
    assert read.pictures[0].shape == (8, 16, 3) and tuple(image.size) == (WIDE, HIGH)
    assert len(bpy.data.images) == before


def test_a_scan_in_the_scene_shows_its_picture_and_keeps_it_in_the_file(bpy, tmp_path):
    from headshop.headshop_addon import bridge, pipeline, scan_texture
    from headshop.sim.progress import finish

    scan = finish(pipeline.prepare_scan(_sheet(), unit="mm", up="+Z"))
    obj = pipeline.add_scan(scan, "sheet")
    path = str(tmp_path / "scan.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    obj = bpy.data.objects["sheet"]
    read = scan_texture.with_pictures(bridge.object_to_mesh(obj), obj)
    np.testing.assert_array_equal(read.pictures[0], _sheet().pictures[0])
    np.testing.assert_allclose(read.uv[:, :3], scan.mesh.uv[:, :3], atol=1e-6)


def test_an_adopted_object_keeps_its_picture(addon, sheet):
    from headshop.headshop_addon import bridge, scan_objects, scan_texture
    from headshop.sim.progress import finish

    sheet.scale = (2.0, 2.0, 2.0)  # as large as a face may be
    addon.context.view_layer.update()
    obj = finish(scan_objects.adopt(addon.context, [sheet]))
    mesh = scan_texture.with_pictures(bridge.object_to_mesh(obj), obj)
    assert has_pictures(mesh) and mesh.colour is not None


def test_a_picture_that_a_modifier_brings_counts(addon, sheet):
    from headshop.headshop_addon import shown_objects

    bpy = addon
    material = sheet.data.materials[0]
    sheet.data.materials[0] = bpy.data.materials.new("Plain")
    nodes = bpy.data.node_groups.new("Dressed", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        nodes.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    start, end = nodes.nodes.new("NodeGroupInput"), nodes.nodes.new("NodeGroupOutput")
    dress = nodes.nodes.new("GeometryNodeSetMaterial")
    dress.inputs["Material"].default_value = material
    nodes.links.new(start.outputs[0], dress.inputs["Geometry"])
    nodes.links.new(dress.outputs[0], end.inputs[0])
    assert not has_pictures(shown_objects.as_one(bpy.context, [sheet])[0])
    sheet.modifiers.new("Dressed", "NODES").node_group = nodes
    mesh, _ = shown_objects.as_one(bpy.context, [sheet])
    np.testing.assert_array_equal(mesh.pictures[mesh.material[0]], _sheet().pictures[0])


def test_a_head_is_dressed_in_the_pictures_of_its_scan(bpy, reference, monkeypatch):
    from headshop.headshop_addon import bridge, heads, materials, scan_texture

    mesh = _sheet()
    scan = bridge.mesh_to_object(replace(mesh, colour=vertex_colours(mesh)), "scan")
    scan_texture.put_pictures(scan, mesh)
    bpy.context.scene.collection.objects.link(scan)
    collection = heads.create_head(reference, "Head", scan)
    asked = []

    def stop(seen, about):
        asked.append(seen)
        raise LookupError

    monkeypatch.setattr(materials, "ScanColour", stop)
    with pytest.raises(LookupError):
        materials.dress_head(next(obj for obj in collection.objects if heads.is_skin(obj)))
    assert has_pictures(asked[0])


def test_a_scan_with_a_picture_that_lies_elsewhere_colours_nothing(reference):
    """As one that was dragged aside to compare it."""
    from headshop.headshop_addon.scan_colour import ScanColour, vertex_colour

    scan = replace(_sheet(), vertices=_sheet().vertices + [900.0, 0, 0], colour=vertex_colours(_sheet()))
    seen = ScanColour(scan, reference.skin.vertices)
    assert len(seen.points) == len(scan.vertices) == len(seen.trust)
    assert vertex_colour(reference.skin, seen, reference.groups["inner"]) is None


def test_skin_shows_what_a_picture_shows_between_the_vertices_of_a_scan():
    """A line 1.5 mm wide on triangles of 20 mm, none of whose vertices lies on it."""
    from headshop.headshop_addon.scan_colour import LARGE, SIZE, ScanColour

    side = np.arange(6.0) * 20
    points = np.stack([*np.meshgrid(side, side), np.zeros((6, 6))], axis=-1).reshape(-1, 3)
    corner = np.arange(36).reshape(6, 6)
    faces = np.stack([corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]], axis=-1).reshape(-1, 4)
    uv = (points[faces][:, :, :2] / 100).astype(np.float32)
    picture = np.full((400, 400, 3), 200, np.uint8)
    picture[:, 197:203] = 20
    scan = Mesh(points, faces.astype(np.int32), uv=uv, material=np.zeros(25, np.int16), pictures=(picture,))
    scan = replace(scan, colour=np.full((36, 3), 200 / 255, np.float32))
    asked = np.array([[50.0, 33, 0], [47, 33, 0], [53, 33, 0]])
    up = np.tile([0.0, 0, 1], (3, 1))
    fine = ScanColour(scan, np.array([[30.0, 20, -1], [60, 60, 1]]))
    colour, confidence = fine.at(asked, up)
    assert (confidence == 1).all()
    assert colour[0].max() < 0.05 and colour[1:].min() > 0.5
    assert np.ptp(fine.scan.vertices[:, 0]) < 90  # no more of it than is near
    assert fine.size == LARGE > SIZE
    assert (vertex_normals(points, scan.triangles)[:, 2] == 1).all()
