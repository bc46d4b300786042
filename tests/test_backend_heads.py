# SPDX-License-Identifier: GPL-3.0-or-later
"""A head in a .blend is whole: it is read back as it was written, after saving, appending and linking too."""

import numpy as np
import pytest

from headshop.sim.anatomy.head import PARTS
from headshop.sim.anatomy.storage import anatomy_document
from headshop.sim.errors import InputError


@pytest.fixture
def heads(bpy):
    from headshop.headshop_addon import heads

    return heads


@pytest.fixture
def skin(heads, reference):
    heads.create_head(reference, "Fran", attributes={"fitted": np.ones(len(reference.skin.vertices), bool)})
    return heads.find_heads()[0]


def same(a, b):
    """Two heads agree to what single precision in metres leaves."""
    for part in PARTS:
        np.testing.assert_allclose(a.parts[part].vertices, b.parts[part].vertices, atol=1e-4)
        np.testing.assert_array_equal(a.parts[part].faces, b.parts[part].faces)
        material = 0 if b.parts[part].material is None else b.parts[part].material
        assert (a.parts[part].material == material).all()
        if a.parts[part].uv is not None:
            np.testing.assert_allclose(a.parts[part].uv, b.parts[part].uv, atol=1e-5)
    assert a.groups.keys() == b.groups.keys()
    for name in a.groups:
        np.testing.assert_allclose(a.groups[name], b.groups[name], atol=1e-6)
    assert anatomy_document(a) == anatomy_document(b)


def test_a_head_is_ordinary_objects(bpy, heads, skin, reference):
    assert skin.name == "Fran Skin" and heads.head_name(skin) == "Fran"
    assert heads.head_collection(skin).name == "Fran"
    assert set(heads.parts_of(skin)) == set(PARTS)
    assert set(heads.muscles_of(skin)) == {muscle.name for muscle in reference.muscles}
    muscles = bpy.data.collections["Fran Muscles"]
    assert len(muscles.objects) == len(reference.muscles) and muscles.hide_render, (
        "they would come through a face that acts"
    )
    modifier = skin.modifiers[0]
    assert (modifier.type, modifier.levels, modifier.render_levels) == ("SUBSURF", 1, 2)
    assert all(polygon.use_smooth for polygon in skin.data.polygons)
    assert len(skin.data.attributes["fitted"].data) == len(skin.data.vertices)


def test_it_is_read_back_as_it_was(heads, skin, reference):
    same(heads.read_head(skin), reference)


def test_where_the_artist_puts_it_does_not_matter(bpy, heads, skin, reference):
    skin.location, skin.rotation_euler, skin.scale = (1, 2, 3), (0.1, 0.2, 0.3), (2, 2, 2)
    skin.vertex_groups.new(name="my own group")
    skin.shape_key_add(name="Basis")
    skin.shape_key_add(name="my own key").value = 1.0
    bpy.context.view_layer.update()
    same(heads.read_head(skin), reference)


def test_a_part_moved_on_the_head_counts(heads, skin, reference):
    heads.parts_of(skin)["eye_l"].location.y = -0.002
    moved = heads.read_head(skin).parts["eye_l"].vertices - reference.parts["eye_l"].vertices
    np.testing.assert_allclose(moved, np.tile([0, -2, 0], (len(moved), 1)), atol=1e-3)


def test_two_heads_stand_apart(heads, skin, reference):
    heads.create_head(reference, "Fran")
    names = [heads.head_name(each) for each in heads.find_heads()]
    assert names == ["Fran", "Fran.001"]
    assert not set(heads.parts_of(skin).values()) & set(heads.parts_of(heads.find_heads()[1]).values())


def test_the_one_head_of_a_file(bpy, heads, skin, reference):
    assert heads.only_head() == skin
    heads.create_head(reference, "Fran")
    assert heads.only_head(name="Fran.001") == heads.find_heads()[1]
    for name, words in ((None, "several heads"), ("Joe", "no head 'Joe'")):
        with pytest.raises(InputError, match=words):
            heads.only_head(name=name)
    assert heads.skin_of(heads.parts_of(skin)["tongue"]) == skin and heads.skin_of(None) is None


def test_saving_and_loading(bpy, heads, skin, reference, tmp_path):
    heads.write_report(skin, {"fit": {"mean_mm": 0.1}})
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "head.blend"), copy=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "head.blend"))
    skin = heads.find_heads()[0]
    same(heads.read_head(skin), reference)
    assert heads.read_report(skin) == {"fit": {"mean_mm": 0.1}}


@pytest.mark.parametrize("link", [False, True])
@pytest.mark.parametrize("what", ["collections", "objects"])
def test_appending_and_linking(bpy, heads, skin, reference, tmp_path, link, what):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "head.blend"), copy=True)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(tmp_path / "head.blend"), link=link) as (_, wanted):
        setattr(wanted, what, ["Fran" if what == "collections" else "Fran Skin"])
    if what == "collections":
        bpy.context.scene.collection.children.link(bpy.data.collections["Fran"])
    else:
        bpy.context.scene.collection.objects.link(bpy.data.objects["Fran Skin"])
    skin = heads.find_heads()[0]
    same(heads.read_head(skin), reference)
    assert set(heads.muscles_of(skin)) == {muscle.name for muscle in reference.muscles}


def test_a_lost_part_is_named(bpy, heads, skin):
    bpy.data.objects.remove(heads.parts_of(skin)["tongue"])
    with pytest.raises(InputError, match="tongue"):
        heads.read_head(skin)


def test_a_changed_mesh_is_named(heads, skin):
    skin.data.vertices.add(1)
    with pytest.raises(InputError, match="Fran Skin"):
        heads.read_head(skin)


def test_what_is_no_head(bpy, heads):
    with pytest.raises(InputError, match="not the skin"):
        heads.read_head(bpy.data.objects.new("cube", bpy.data.meshes.new("cube")))
    with pytest.raises(InputError, match="not the skin"):
        heads.read_head(None)
