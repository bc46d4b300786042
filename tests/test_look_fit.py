# SPDX-License-Identifier: GPL-3.0-or-later
"""The heat map and the detail maps in Blender: switched on and off without a trace, saved, wired, exported."""

import numpy as np
import pytest

from headshop.sim.adapt.fit_colour import INVENTED, SCALE, fit_colours


def test_the_scale_diverges_and_the_invented_is_grey():
    distance = np.array([-0.5, 0.0, 0.5, np.nan, 2.0, 0.5])
    colours = fit_colours(distance, np.array([1, 1, 1, 1, 1, 0.0]), 0.5)
    np.testing.assert_allclose(colours, [SCALE[0], SCALE[2], SCALE[4], INVENTED, SCALE[4], INVENTED], atol=1e-6)
    finer = fit_colours(distance, np.ones(6), 2.0)
    assert not np.allclose(finer[2], SCALE[4]) and np.allclose(finer[4], SCALE[4])


@pytest.fixture
def skin(addon, reference):
    """A head that was fitted (on the left half alone), with materials and flat detail maps."""
    from headshop.headshop_addon import detail_images, heads, materials
    from headshop.sim.detail.detail_map import DetailMaps

    x = reference.skin.vertices[:, 0]
    attributes = {
        "fitted": (x > 0).astype(np.float32),
        "distance_mm": np.where(x > 0, 0.25, np.nan).astype(np.float32),
    }
    heads.create_head(reference, "Ada", attributes=attributes)
    (skin,) = heads.find_heads()
    height = np.linspace(-1, 1, 32 * 32, dtype=np.float32).reshape(32, 32)
    normal = np.tile(np.array([0.6, 0, 0.8], dtype=np.float32), (32, 32, 1))
    detail_images.write_images(skin, DetailMaps(height, normal, {}))
    materials.dress_head(skin)
    return skin


def _state(skin):
    slots = [(slot.link, slot.material.name) for slot in skin.material_slots]
    active = skin.data.color_attributes.active_color
    names = sorted(a.name for a in skin.data.attributes)
    keys = sorted(set(skin.keys()) - {"headshop"})  # settings are among them up to Blender 4.5
    return slots, names, active and active.name, [m.name for m in skin.data.materials], keys


def test_the_heat_map_comes_and_goes_without_a_trace(addon, skin):
    before = _state(skin)
    skin.headshop.show_fit = True
    attribute = skin.data.color_attributes.active_color
    assert attribute.name == "headshop_fit" and skin.material_slots[0].material.name == "Head Shop Fit"
    assert [m.name for m in skin.data.materials] == before[3], "the mesh keeps its own materials"
    colour = np.empty(len(attribute.data) * 4, dtype=np.float32)
    attribute.data.foreach_get("color_srgb", colour)
    left = np.array([v.co.x > 0 for v in skin.data.vertices])
    colour = colour.reshape(-1, 4)[:, :3]
    np.testing.assert_allclose(colour[~left], np.tile(INVENTED, ((~left).sum(), 1)), atol=0.01)
    np.testing.assert_allclose(colour[left], np.tile(SCALE[3], (left.sum(), 1)), atol=0.01)
    skin.headshop.fit_range = 0.25
    attribute.data.foreach_get("color_srgb", flat := np.empty(len(attribute.data) * 4, dtype=np.float32))
    np.testing.assert_allclose(flat.reshape(-1, 4)[left, :3], np.tile(SCALE[4], (left.sum(), 1)), atol=0.01)
    skin.headshop.show_fit = False
    assert _state(skin) == before


def test_an_override_of_the_artists_comes_back(addon, skin):
    marble = addon.data.materials.new("Marble")
    skin.material_slots[0].link, skin.material_slots[0].material = "OBJECT", marble
    skin.headshop.show_fit = True
    skin.headshop.show_fit = False
    assert (skin.material_slots[0].link, skin.material_slots[0].material) == ("OBJECT", marble)


def test_the_heat_map_is_saved_and_can_be_taken_off_later(addon, skin, tmp_path):
    before = _state(skin)
    skin.headshop.show_fit = True
    addon.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    addon.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    skin = addon.data.objects["Ada Skin"]
    assert skin.headshop.show_fit and skin.material_slots[0].material.name == "Head Shop Fit"
    skin.headshop.show_fit = False
    assert _state(skin) == before


def test_a_head_without_a_fit_has_no_heat_map(addon, reference):
    from headshop.headshop_addon import heads

    heads.create_head(reference, "Bea")
    (skin,) = heads.find_heads()
    skin.headshop.show_fit = True
    assert skin.data.color_attributes.get("headshop_fit") is None and skin.material_slots[0].link == "DATA"


def test_the_maps_are_packed_16_bit_and_keep_their_values(addon, skin, tmp_path):
    from headshop.headshop_addon import detail_images

    detail = detail_images.images_of(skin)
    for image in detail:
        assert image.packed_file is not None and image.colorspace_settings.name == "Non-Color" and image.is_float
        assert image.filepath_raw.startswith("//"), "no temporary file is asked for"
    addon.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    addon.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    skin = addon.data.objects["Ada Skin"]
    displacement, normal = detail_images.images_of(skin)
    pixels = np.empty(32 * 32 * 4, dtype=np.float32)
    displacement.pixels.foreach_get(pixels)
    np.testing.assert_allclose(pixels[::4] * 4 - 2, np.linspace(-1, 1, 32 * 32), atol=1e-3)  # row 0 is at v = 0
    normal.pixels.foreach_get(pixels)
    np.testing.assert_allclose(pixels.reshape(-1, 4)[:, :3] * 2 - 1, np.tile([0.6, 0, 0.8], (32 * 32, 1)), atol=1e-3)
    detail_images.write_files(skin, tmp_path)
    for name in ("displacement.png", "normal.png"):
        header = (tmp_path / name).read_bytes()[:26]
        assert header[:8] == b"\x89PNG\r\n\x1a\n" and header[24] == 16
    assert len([i for i in addon.data.images if i.users]) == 2


def test_one_of_the_two_maps_works_at_a_time(addon, skin):
    tree = skin.data.materials[0].node_tree
    strength = next(i for i in tree.nodes["Head Shop Normal Map"].inputs if i.name == "Strength")
    output = next(i for i in tree.get_output_node("ALL").inputs if i.name == "Displacement")

    def working():
        return strength.default_value, output.is_linked, skin.data.materials[0].displacement_method

    assert working() == (1.0, False, "BUMP")
    skin.headshop.detail = "DISPLACEMENT"
    assert working() == (0.0, True, "BOTH")
    node = tree.nodes["Head Shop Displacement"]
    scale = next(i for i in node.inputs if i.name == "Scale").default_value
    middle = next(i for i in node.inputs if i.name == "Midlevel").default_value
    assert (scale, middle) == pytest.approx((0.004, 0.5))
    skin.headshop.detail = "NONE"
    assert working() == (0.0, False, "BUMP")
    skin.headshop.detail = "NORMAL"
    assert working() == (1.0, False, "BUMP")


def test_new_maps_take_the_place_of_old_ones(addon, skin):
    from headshop.headshop_addon import detail_images, materials
    from headshop.sim.detail.detail_map import DetailMaps

    count = len(addon.data.images)
    flat = DetailMaps(np.zeros((16, 16), np.float32), np.tile(np.float32([0, 0, 1]), (16, 16, 1)), {})
    detail = detail_images.write_images(skin, flat)
    materials.dress_head(skin)
    assert len(addon.data.images) == count
    nodes = skin.data.materials[0].node_tree.nodes
    assert nodes["Head Shop Normal Map Image"].image == detail.normal and tuple(detail.normal.size) == (16, 16)
    assert nodes["Head Shop Displacement Image"].image == detail.displacement


def test_the_heat_map_as_a_picture(addon, skin, reference, tmp_path, capfd):
    from headshop.headshop_addon import heads, pictures
    from headshop.headshop_addon.command_line import main
    from headshop.headshop_addon.heat_sheet import FOOT, HEAD, HEIGHT, WIDTH, render_fit
    from headshop.sim.errors import InputError
    from headshop.sim.progress import finish

    steps = []
    finish(render_fit(skin, tmp_path / "fit.png", limit=0.25), steps.append)
    page = pictures.read_picture(tmp_path / "fit.png")
    assert page.shape[:2] == (HEAD + HEIGHT + FOOT, 3 * WIDTH) and len(steps) == 4
    front = page[HEAD : HEAD + HEIGHT, WIDTH : 2 * WIDTH, :3]
    red = (front[..., 0] > front[..., 2] + 0.15).mean(axis=0)
    assert red[WIDTH // 2 :].sum() > 20 * red[: WIDTH // 2].sum(), "the subject's left is outside by the whole scale"
    heads.create_head(reference, "Bea")
    bare = next(obj for obj in heads.find_heads() if obj != skin)
    with pytest.raises(InputError, match="was not fitted"):
        finish(render_fit(bare, tmp_path / "none.png"))
    assert not (tmp_path / "none.png").exists()
    (tmp_path / "a.blend").write_bytes(b"anything")
    assert main(["render", str(tmp_path / "a.blend"), "--fit", "-o", str(tmp_path / "a.mp4")]) == 2
    assert "must end in .png" in capfd.readouterr().err


def test_a_cancelled_build_leaves_the_file_as_it_was(addon, reference):
    """Closed while the head is being dressed, after its objects were made."""
    from headshop.headshop_addon import bridge, heads, pipeline, scan_import
    from headshop.headshop_addon.scan_objects import _upright
    from headshop.sim.adapt import build as engine
    from headshop.sim.progress import Progress

    scan_object = bridge.mesh_to_object(reference.skin, "Scan")
    addon.context.scene.collection.objects.link(scan_object)

    def built(*_):
        yield Progress(0.5, "Fitting")
        return engine.BuildResult(reference, {}, {}, ())

    before, monkey = scan_import.datablocks(), pipeline.build_head
    try:
        pipeline.build_head = built
        work = pipeline.build(pipeline.Scan(reference.skin, _upright()), {}, "Ada", scan_object)
        while next(work).label != "Painting the skin":
            pass
        assert scan_import.datablocks() != before and scan_object.hide_render
        work.close()
    finally:
        pipeline.build_head = monkey
    assert scan_import.datablocks() == before and not scan_object.hide_render
    assert not heads.find_heads()
