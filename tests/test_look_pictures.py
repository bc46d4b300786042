# SPDX-License-Identifier: GPL-3.0-or-later
"""Sheet and film: what is written, and that nothing of the artist's is touched."""

import subprocess
import sys
import tempfile
import weakref

import numpy as np
import pytest

from headshop.sim.errors import InputError
from headshop.sim.progress import finish

TINY = {"tile": (40, 48), "samples": 1}


@pytest.fixture
def skin(bpy, reference):
    """The skin of a dressed head with two shape keys."""
    from headshop.headshop_addon import bridge, heads, materials

    heads.create_head(reference, "Ada")
    (skin,) = heads.find_heads()
    materials.dress_head(skin)
    skin.modifiers.clear()  # no need for a smooth surface at this size
    rest = bridge.read_positions(skin)
    chin = reference.landmark_positions()["pg"]
    near = np.exp(-((rest - chin) ** 2).sum(axis=1) / 40.0**2)[:, None]
    for name, move in {"joy": (0, -30, 0), "fear": (0, 0, -30)}.items():
        bridge.ensure_shape_key(skin, name)
        bridge.write_positions(skin, rest + near * np.array(move), name)
    return skin


def _state(bpy, skin):
    """All that a picture might disturb."""
    scene = bpy.context.scene
    kinds = ("scenes", "objects", "meshes", "collections", "lights", "cameras", "shape_keys", "materials", "actions")
    return {
        "counts": {kind: sorted(block.name for block in getattr(bpy.data, kind)) for kind in kinds},
        "scene": scene.name,
        "camera": scene.camera,
        "world": scene.world,
        "frame": scene.frame_current,
        "render": (scene.render.engine, scene.render.resolution_x, scene.render.filepath, scene.view_settings.look),
        "hidden": [(obj.name, obj.hide_render, obj.hide_viewport) for obj in bpy.data.objects],
        "keys": [(key.name, key.value, key.mute) for key in skin.data.shape_keys.key_blocks],
        "active": bpy.context.view_layer.objects.active,
    }


def _tile(page, row, column):
    """The middle of a picture on a page of `TINY` tiles, found by the page's own proportions."""
    width, height = TINY["tile"]
    unit = width * 4 / 1800
    gap, margin, head, section = (max(round(v * unit), 1) for v in (14, 52, 148, 62))
    strip = round(66 * unit)
    left = margin + column * (width + gap)
    top = head + (row + 1) * section + row * (height + strip + gap)
    return page[top + 4 : top + height - 14, left + 4 : left + width - 4, :3]


def test_the_sheet_shows_a_head_its_anatomy_and_each_key(bpy, skin, tmp_path):
    from headshop.headshop_addon.contact_sheet import render_sheet
    from headshop.headshop_addon.pictures import read_picture

    skin.data.shape_keys.key_blocks["fear"].value = 0.25
    before = _state(bpy, skin)
    path = tmp_path / "sheet.png"
    steps = []
    finish(render_sheet(skin, path, keys=["joy", "fear"], **TINY), steps.append)
    assert _state(bpy, skin) == before
    assert [file.name for file in tmp_path.iterdir()] == ["sheet.png"]
    fractions = [step.fraction for step in steps]
    assert fractions == sorted(fractions) and len(steps) >= 6

    page = read_picture(path)
    assert page.shape[1] > 4 * TINY["tile"][0] and page.shape[0] > 2 * TINY["tile"][1]
    anatomy = [_tile(page, 0, column) for column in range(4)]
    shapes = [_tile(page, 1, column) for column in range(3)]
    for picture in anatomy + shapes[:2]:
        assert picture.std() > 0.05, "a picture of nothing"
    assert shapes[2].std() < 0.02, "there are only two keys"
    pictures = anatomy + shapes[:2]
    for i, one in enumerate(pictures):
        for other in pictures[:i]:
            assert np.abs(one - other).mean() > 0.004, "two tiles show the same"


def test_no_renderer_outlives_the_scene_it_drew(bpy, skin):
    """It would keep a graph of the scene for a next frame, which Blender updates with the next thing that is deleted."""
    from headshop.headshop_addon.pictures import render_picture
    from headshop.headshop_addon.studio import studio

    seen = []

    class Renderer(bpy.types.RenderEngine):
        bl_idname, bl_label = "HEADSHOP_TEST", "Test"

        def render(self, graph):
            seen.append(weakref.ref(self))

    bpy.utils.register_class(Renderer)
    try:
        with studio(skin, width=32, height=32, samples=1) as (scene, _):
            scene.render.engine = "HEADSHOP_TEST"
            render_picture(scene)
            assert seen[0]() is not None, "it is kept from one picture to the next"
        assert seen[0]() is None
    finally:
        bpy.utils.unregister_class(Renderer)


def test_a_sheet_given_up_leaves_nothing(bpy, skin, tmp_path):
    from headshop.headshop_addon.contact_sheet import render_sheet

    before = _state(bpy, skin)
    work = render_sheet(skin, tmp_path / "sheet.png", keys=["joy"], **TINY)
    for _ in range(3):
        next(work)
    work.close()
    assert _state(bpy, skin) == before
    assert list(tmp_path.iterdir()) == []


def test_a_key_that_is_not_there_is_refused(bpy, skin, tmp_path):
    from headshop.headshop_addon.contact_sheet import render_sheet

    with pytest.raises(InputError, match="no shape key 'bliss'"):
        finish(render_sheet(skin, tmp_path / "sheet.png", keys=["bliss"], **TINY))
    assert list(tmp_path.iterdir()) == []


def test_the_page_grows_with_the_number_of_pictures():
    pytest.importorskip("bpy")
    from headshop.headshop_addon.contact_sheet import Tile, compose

    picture = np.full((60, 50, 3), 0.5, dtype=np.float32)
    few = compose("A", "b", [("c", [(Tile("t", "", ()), picture)] * 4)], 4)
    more = compose("A", "b", [("c", [(Tile("t", "", ()), picture)] * 9)], 4)
    assert more.shape[1] == few.shape[1] and more.shape[0] > few.shape[0] + 2 * 60
    assert np.isfinite(more).all() and more.min() >= 0 and more.max() <= 1


def test_the_film_has_every_frame_of_the_animation(bpy, skin, tmp_path):
    from headshop.headshop_addon.movie import render_movie

    key = skin.data.shape_keys.key_blocks["fear"]
    for frame, value in ((3, 0.0), (6, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)
    bpy.context.scene.frame_set(4)
    before = _state(bpy, skin)
    path = tmp_path / "smile.mp4"
    finish(render_movie(skin, path, size=(64, 72), samples=1))
    assert _state(bpy, skin) == before
    assert [file.name for file in tmp_path.iterdir()] == ["smile.mp4"]
    clip = bpy.data.movieclips.load(str(path))
    assert clip.frame_duration == 4
    assert tuple(clip.size) == (64, 72)
    assert clip.fps == pytest.approx(24)
    assert path.read_bytes()[4:8] == b"ftyp"
    start, end = _frames(bpy, path, (64, 72), (0, 3))
    chin = np.abs(start - end)[36:, 16:56].mean()
    forehead = np.abs(start - end)[8:26, 16:56].mean()
    assert chin > 0.01 and chin > 2 * forehead, "the chin drops, the forehead stays"


def _frames(bpy, path, size, numbers):
    """Frames of a film by number, as pictures (h, w, 3)."""
    from headshop.headshop_addon.pictures import read_picture, render_frame

    scene = bpy.data.scenes.new("Reading")
    scene.view_settings.view_transform = "Standard"
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    strip = scene.sequence_editor_create().strips.new_movie("film", str(path), channel=1, frame_start=1)
    assert strip.frame_duration > max(numbers)
    with tempfile.TemporaryDirectory() as folder:
        found = [read_picture(render_frame(scene, 1 + number, folder))[..., :3] for number in numbers]
    bpy.data.scenes.remove(scene)
    return found


def test_the_film_moves_and_keeps_its_colours(bpy, tmp_path):
    """Through the encoder and back: a bar moves over a plain ground."""
    from headshop.headshop_addon.movie import encode
    from headshop.headshop_addon.pictures import write_picture

    files = []
    for number in range(6):
        picture = np.full((48, 64, 4), (0.2, 0.4, 0.6, 1.0), dtype=np.float32)
        picture[:, 8 * number : 8 * number + 16, :3] = (0.8, 0.8, 0.8)
        files.append(tmp_path / f"{number}.png")
        write_picture(files[-1], picture)
    encode(files, tmp_path / "bar.mp4", (64, 48), 24)

    for number, seen in zip((0, 3, 5), _frames(bpy, tmp_path / "bar.mp4", (64, 48), (0, 3, 5)), strict=True):
        bar = seen[:, 8 * number + 4 : 8 * number + 12].mean(axis=(0, 1))
        ground = np.delete(seen, np.arange(max(8 * number - 6, 0), 8 * number + 22), axis=1).mean(axis=(0, 1))
        np.testing.assert_allclose(bar, 0.8, atol=0.05)
        np.testing.assert_allclose(ground, (0.2, 0.4, 0.6), atol=0.05)


def test_a_film_given_up_leaves_nothing(bpy, skin, tmp_path):
    from headshop.headshop_addon.movie import render_movie

    before = _state(bpy, skin)
    work = render_movie(skin, tmp_path / "smile.mp4", frames=(1, 5), size=(32, 32), samples=1)
    for _ in range(3):
        next(work)
    work.close()
    assert _state(bpy, skin) == before
    assert list(tmp_path.iterdir()) == []


def test_films_that_cannot_be_are_refused(bpy, skin, tmp_path):
    from headshop.headshop_addon.movie import render_movie

    with pytest.raises(InputError, match="bake a performance first"):
        finish(render_movie(skin, tmp_path / "smile.mp4"))
    with pytest.raises(InputError, match="even numbers"):
        finish(render_movie(skin, tmp_path / "smile.mp4", frames=(1, 2), size=(33, 32)))
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_leaves_no_half_of_a_picture_or_film(blender, tmp_path):
    """Blender says that it wrote them."""
    pytest.importorskip("resource")
    code = f"""
import resource, signal
from pathlib import Path
import bpy, numpy as np
from headshop.headshop_addon import movie, pictures, text_labels
from headshop.sim.errors import InputError

folder, noise = Path({str(tmp_path)!r}), np.random.default_rng(0)
frames = [folder / f"{{k:06d}}.png" for k in range(6)]
for frame in frames:
    pictures.write_picture(frame, noise.random((128, 128, 4)))
movie.encode(frames, folder / "whole.mp4", (128, 128), 24)
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (20000, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))
for write in (
    lambda: movie.encode(frames, folder / "half.mp4", (128, 128), 24),
    lambda: pictures.write_picture(folder / "half.png", noise.random((256, 256, 4))),
    lambda: text_labels.text_mask("What a full disk cuts off", 400.0),
    lambda: pictures.write_picture(folder / "nowhere" / "half.png", noise.random((256, 256, 4))),
):
    try:
        write()
    except InputError as error:
        assert "disk" in str(error)
    else:
        raise AssertionError
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_detail_of_a_head_with_a_long_name_is_packed(bpy, tmp_path):
    """The name of a file was made of it, which was too long."""
    from headshop.headshop_addon import detail_images
    from headshop.headshop_addon.pictures import write_picture

    write_picture(tmp_path / "flat.png", np.ones((4, 4, 4)))
    image = detail_images._packed("a/b" + 250 * "x" + " Normal", (tmp_path / "flat.png").read_bytes())
    assert image.packed_file is not None and image.filepath_raw.startswith("//a_bx")


def test_text_is_drawn_where_it_is_asked_for(bpy):
    from headshop.headshop_addon.text_labels import put_text, text_width

    page = np.zeros((40, 200, 4), dtype=np.float32)
    width = put_text(page, "Smile", 20, 30, 20, (1, 1, 1, 1))
    columns = np.flatnonzero(page[..., 0].max(axis=0) > 0.5)
    rows = np.flatnonzero(page[..., 0].max(axis=1) > 0.5)
    assert 18 <= columns.min() <= 24 and columns.max() <= 20 + width + 2
    assert 12 <= rows.min() <= 18 and 28 <= rows.max() <= 31
    assert text_width("Smile and smile", 20) > 1.8 * text_width("Smile", 20)
