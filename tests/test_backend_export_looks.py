# SPDX-License-Identifier: GPL-3.0-or-later
"""An engine's copy looks like the head: plain materials whose pictures arrive, and a .blend that is as before."""

import json

import numpy as np
import pytest

from headshop.sim.detail.detail_map import DetailMaps
from headshop.sim.errors import InputError

KINDS = ["glb", "fbx", "usdc", "usdz"]


@pytest.fixture
def skin(bpy, reference, monkeypatch):
    """A head with all its materials and a normal map; its pictures are small."""
    from headshop.headshop_addon import detail_images, heads, materials, plain_materials

    monkeypatch.setattr(plain_materials, "SKIN_SIZE", 128)
    monkeypatch.setattr(plain_materials, "EYE_SIZE", 128)
    heads.create_head(reference, "Fran")
    (skin,) = heads.find_heads()
    normal = np.tile(np.float32([0.6, 0, 0.8]), (256, 256, 1))
    detail_images.write_images(skin, DetailMaps(np.zeros((256, 256), np.float32), normal, {}))
    materials.dress_head(skin)
    return skin


def export(skin, path):
    from headshop.headshop_addon.export import export_head

    export_head(skin, path)
    return path


def read_again(bpy, path):
    """Material (without its prefix) -> its one Principled BSDF, of a file read into an empty scene."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    reader = {
        ".glb": bpy.ops.import_scene.gltf,
        ".fbx": bpy.ops.wm.fbx_import,
        ".usdc": bpy.ops.wm.usd_import,
        ".usdz": bpy.ops.wm.usd_import,
    }
    reader[path.suffix](filepath=str(path))
    worn = {m for obj in bpy.data.objects if obj.type == "MESH" for m in obj.data.materials}
    shaders = {}
    for material in worn:
        (shader,) = [node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED"]
        shaders[material.name.replace("_", " ").removeprefix("Head Shop ")] = shader
    return shaders


def colour(shader):
    """(4,) the base colour, or (h, w, 4) its picture in display values."""
    entry = shader.inputs["Base Color"]
    return np.array(entry.default_value) if not entry.is_linked else pixels(entry.links[0].from_node.image)


def pixels(image):
    found = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(found)
    assert image.has_data
    return found.reshape(image.size[1], image.size[0], 4)


def everything(bpy):
    kinds = (bpy.data.materials, bpy.data.images, bpy.data.objects, bpy.data.meshes, bpy.data.scenes)
    return sorted((block.id_type, block.name, block.users) for kind in kinds for block in kind)


@pytest.mark.parametrize("kind", KINDS)
def test_what_an_engine_reads_looks_like_the_head(bpy, skin, tmp_path, kind):
    shaders = read_again(bpy, export(skin, tmp_path / f"fran.{kind}"))
    assert shaders.keys() == {"Caruncle", "Cornea", "Enamel", "Gum", "Iris", "Pupil", "Sclera", "Skin Fran", "Tongue"}
    for shader in shaders.values():
        assert not any(
            shader.inputs[n].is_linked or shader.inputs[n].default_value for n in ("Metallic", "Coat Weight")
        )
        assert not shader.inputs["Specular IOR Level"].is_linked
    face = colour(shaders["Skin Fran"])
    assert face.shape == (128, 128, 4)  # colours need not be as fine as the relief
    middle = face[len(face) // 2, face.shape[1] // 2]
    assert middle[0] > middle[1] > middle[2] > 0.2 and face[..., :3].std() > 0.05
    (link,) = shaders["Skin Fran"].inputs["Normal"].links
    (link,) = link.from_node.inputs["Color"].links
    assert pixels(link.from_node.image)[..., 0].mean() > 0.75
    eye = colour(shaders["Iris"])
    np.testing.assert_array_equal(colour(shaders["Sclera"]), eye)
    size = len(eye)
    iris, white = eye[size // 2, size // 2 + size // 8, :3], eye[size // 2, size // 2 + size // 4, :3]
    assert iris.max() < 0.55 < white.min()
    assert colour(shaders["Pupil"])[:3].max() < 0.01
    film = shaders["Cornea"].inputs["Alpha"]
    clear = pixels(film.links[0].from_node.image)[..., 3] if film.is_linked else np.array(film.default_value)
    assert 0 < clear.min() and clear.max() < 0.2 and not shaders["Cornea"].inputs["Transmission Weight"].default_value
    others = [shader for name, shader in shaders.items() if name != "Cornea"]
    assert all(
        s.inputs["Alpha"].default_value == 1 and not s.inputs["Transmission Weight"].default_value for s in others
    )
    assert colour(shaders["Enamel"])[:3].min() > 0.5
    for wet in ("Gum", "Tongue", "Caruncle"):
        assert colour(shaders[wet])[0] > 1.5 * colour(shaders[wet])[1:3].max()


def test_the_pictures_lie_on_the_eyes_as_their_materials_do(bpy, skin, tmp_path):
    """Where the iris ends on the mesh it ends in the picture."""
    read_again(bpy, export(skin, tmp_path / "fran.glb"))
    eye = next(obj for obj in bpy.data.objects if obj.name == "Fran Eye Left")
    mesh = eye.data
    kinds = [material.name for material in mesh.materials]
    uv = np.array([corner.uv for corner in mesh.uv_layers[0].data])
    of = {name: [c for p in mesh.polygons if kinds[p.material_index] == name for c in p.loop_indices] for name in kinds}
    radius = {name: np.linalg.norm(uv[corners] - 0.5, axis=1) for name, corners in of.items()}
    assert radius["Head Shop Iris"].max() == pytest.approx(radius["Head Shop Sclera"].min(), abs=0.02)
    assert 0 < radius["Head Shop Iris"].min() < radius["Head Shop Iris"].max() < 0.25


def test_gltf_knows_the_cornea_as_clear_and_nothing_that_tints(bpy, skin, tmp_path):
    data = export(skin, tmp_path / "fran.glb").read_bytes()
    document = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    modes = {material["name"]: material.get("alphaMode", "OPAQUE") for material in document["materials"]}
    assert [name for name, mode in modes.items() if mode != "OPAQUE"] == ["Head Shop Cornea"]
    assert modes["Head Shop Cornea"] == "BLEND"
    assert not any("extensions" in material for material in document["materials"])
    attributes = {name for mesh in document["meshes"] for part in mesh["primitives"] for name in part["attributes"]}
    assert attributes == {"POSITION", "NORMAL", "TEXCOORD_0"}


@pytest.mark.parametrize("kind", KINDS)
def test_the_head_is_the_same_after_an_export(bpy, skin, tmp_path, kind):
    from headshop.headshop_addon import heads

    def looks():
        meshes = [obj.data for obj in heads.parts_of(skin).values()]
        worn = [[material.name for material in mesh.materials] for mesh in meshes]
        layers = [(len(mesh.uv_layers), sorted(a.name for a in mesh.attributes)) for mesh in meshes]
        nodes = {m.name: sorted(node.name for node in m.node_tree.nodes) for m in bpy.data.materials}
        return everything(bpy), worn, layers, nodes

    before = looks()
    export(skin, tmp_path / f"fran.{kind}")
    assert looks() == before
    files = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*")}
    pictures = ("Fran_Skin_Colour", "Fran_Eye_Left_Colour", "Fran_Normal", "Head_Shop_Cornea_Opacity")
    beside = {"fran_textures", *(f"fran_textures/{name}.png" for name in pictures)} if kind == "usdc" else set()
    assert files == {f"fran.{kind}", *beside}


def test_what_an_artist_made_himself_goes_along(bpy, skin, tmp_path):
    from headshop.headshop_addon.shader_nodes import Graph

    picture = bpy.data.images.new("Marble 1/2", 8, 8)
    picture.pixels.foreach_set(np.tile(np.float32([0, 1, 0, 1]), 64))
    picture.pack()
    marble = bpy.data.materials.new("Marble")
    graph = Graph(marble)
    node = graph.node("TexImage", image=picture)
    shader = graph.node("BsdfPrincipled", {"Base Color": node.outputs["Color"], "Metallic": 1.0})
    graph.surface(shader.outputs[0])
    skin.data.materials[0] = marble
    path = export(skin, tmp_path / "fran.usdc")
    assert node.image == picture and skin.data.materials[0] == marble and marble.name == "Marble"
    found = read_again(bpy, path)["Marble"]
    np.testing.assert_allclose(colour(found)[0, 0], [0, 1, 0, 1], atol=0.01)
    assert found.inputs["Metallic"].default_value == 1.0


def test_the_command_line_brings_the_pictures_along(bpy, skin, tmp_path):
    from headshop.headshop_addon.command_line import main

    blend = tmp_path / "fran.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend), copy=True)
    assert main(["export", str(blend), "-o", str(tmp_path / "new" / "fran.usdc"), "--quiet"]) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fran.blend", "new"]
    shaders = read_again(bpy, tmp_path / "new" / "fran.usdc")
    assert colour(shaders["Skin Fran"]).std() > 0.05 and colour(shaders["Iris"]).std() > 0.05


@pytest.mark.parametrize("kind", KINDS)
def test_an_interrupted_export_leaves_nothing(bpy, skin, tmp_path, monkeypatch, kind):
    from headshop.headshop_addon import export_formats

    before = everything(bpy)

    def interrupted(path, animated):
        with open(path, "wb") as file:
            file.write(b"half")
        raise KeyboardInterrupt

    monkeypatch.setitem(export_formats._WRITERS, f".{kind}", interrupted)
    with pytest.raises(KeyboardInterrupt):
        export(skin, tmp_path / f"fran.{kind}")
    assert list(tmp_path.iterdir()) == [] and everything(bpy) == before


def test_without_cycles_it_says_what_to_do(bpy, skin, tmp_path):
    import addon_utils

    before = everything(bpy)
    addon_utils.disable("cycles")
    try:
        with pytest.raises(InputError, match="Cycles add-on is off"):
            export(skin, tmp_path / "fran.glb")
    finally:
        addon_utils.enable("cycles")
    assert list(tmp_path.iterdir()) == [] and everything(bpy) == before


def test_a_picture_of_colours_is_as_fine_as_the_skins_own_and_not_as_its_relief(bpy):
    from headshop.headshop_addon import plain_materials
    from headshop.headshop_addon.shader_nodes import Graph

    def of(side):
        return bpy.data.images.new("picture", side, 8)

    material, fine, relief = bpy.data.materials.new("Head Shop Skin"), of(2000), of(4000)
    graph = Graph(material)
    graph.node("TexImage", image=relief)
    assert plain_materials._size([material], (relief,)) == plain_materials.SKIN_SIZE
    graph.node("TexImage", image=fine)
    assert plain_materials._size([material], (relief,)) == 2000
