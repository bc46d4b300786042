# SPDX-License-Identifier: GPL-3.0-or-later
"""Engine-ready copies: exact names, no modifiers, the scene untouched; plain files that say what the head is."""

import json
import subprocess
import sys

import numpy as np
import pytest

from headshop.sim.acting.plain_posing import plainly_posed
from headshop.sim.adapt.landmarks import read_landmarks
from headshop.sim.adapt.untangle import sharp
from headshop.sim.anatomy.seen_skin import behind_lids
from headshop.sim.mesh_piercing import self_piercings
from headshop.sim.mesh_subdivision import drawn
from headshop.sim.scan.ply import read_ply

SHAPES = ("joy", "mouthSmileLeft")


@pytest.fixture
def skin(bpy, reference):
    """A head with two baked shapes, one of the artist's own, and the live pose."""
    from headshop.headshop_addon import bridge, heads, shape_keys

    heads.create_head(reference, "Fran")
    skin = heads.find_heads()[0]
    rng = np.random.default_rng(3)
    shapes = {
        name: {part: rng.normal(size=reference.parts[part].vertices.shape) for part in ("skin", "tongue")}
        for name in SHAPES
    }
    shape_keys.write_shapes(skin, shapes, {name: {"peak_mm": 1.0} for name in SHAPES})
    bridge.ensure_shape_key(skin, "sculpted")
    bridge.ensure_shape_key(skin, "Live")
    heads.write_report(skin, {"fit": {"mean_mm": 0.1}, "landmarks_missing": ["v"]})
    return skin


def everything(bpy):
    blocks = [*bpy.data.objects, *bpy.data.meshes, *bpy.data.scenes, *bpy.data.shape_keys, *bpy.data.actions]
    return sorted((block.id_type, block.name) for block in blocks)


@pytest.mark.parametrize("extension", ["glb", "fbx", "usdc"])
def test_an_engine_gets_exact_names_and_no_modifiers(bpy, skin, tmp_path, extension, reference):
    from headshop.headshop_addon.export import PARTS, export_head

    before = everything(bpy)
    path = tmp_path / f"fran.{extension}"
    assert export_head(skin, path) == [*SHAPES, "sculpted"]
    assert everything(bpy) == before and [p.name for p in tmp_path.iterdir()] == [path.name]
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    reader = {
        "glb": lambda: bpy.ops.import_scene.gltf(filepath=str(path)),
        "fbx": lambda: bpy.ops.wm.fbx_import(filepath=str(path)),
        "usdc": lambda: bpy.ops.wm.usd_import(filepath=str(path)),
    }
    reader[extension]()
    found = {
        o.name.replace("_", " ").removesuffix(".001"): o
        for o in bpy.data.objects
        if o.type == "MESH" and len(o.data.polygons)
    }
    assert len(found) == len(PARTS)
    copy, tongue = found["Fran Skin"], found["Fran Tongue"]
    assert copy.data.shape_keys.key_blocks.keys()[1:] == [*SHAPES, "sculpted"]
    assert tongue.data.shape_keys.key_blocks.keys()[1:] == list(SHAPES)
    assert len(copy.data.polygons) in (len(reference.skin.faces), len(reference.skin.triangles))
    bpy.context.view_layer.update()
    box = np.array([copy.matrix_world @ v.co for v in copy.data.vertices]) * 1000
    np.testing.assert_allclose(box.min(axis=0), reference.skin.vertices.min(axis=0), atol=0.01)


def test_plain_files(bpy, skin, tmp_path, reference):
    from headshop.headshop_addon.plain_export import write_plain
    from headshop.headshop_addon.plain_files import FILES

    write_plain(skin, tmp_path)
    absent = {"skin_as_scanned.ply", "displacement.png", "normal.png", "performance.npz"}  # not fitted, does not act
    assert {p.name for p in tmp_path.iterdir()} == set(FILES) - absent
    on_surface = drawn(reference.skin.faces, reference.skin.vertices)
    for part in ("skull", "mandible"):
        mesh = read_ply(tmp_path / f"{part}.ply")
        np.testing.assert_allclose(mesh.vertices, reference.parts[part].vertices, atol=1e-3)
        np.testing.assert_array_equal(mesh.triangles, reference.parts[part].triangles)
    seen = read_ply(tmp_path / "skin.ply")
    off = np.linalg.norm(seen.vertices[: len(on_surface)] - on_surface, axis=1)
    hidden = behind_lids(reference, "l") | behind_lids(reference, "r")
    assert off[~hidden].max() < 0.5 and np.median(off[~hidden]) < 1e-3 and off[hidden].min() > 0.5
    assert len(seen.triangles) == 4 * len(reference.skin.triangles)
    assert len(sharp(seen.vertices, seen.triangles)) == len(self_piercings(seen.vertices, seen.triangles)) == 0
    landmarks = read_landmarks(tmp_path / "landmarks.json")
    assert len(landmarks) == 59 and "v" not in landmarks
    bony = json.loads((tmp_path / "skull_landmarks.json").read_text())["landmarks"]
    assert len(bony) == 22
    np.testing.assert_allclose(bony["rhi"], reference.skull_landmark_positions()["rhi"], atol=1e-3)
    muscles = json.loads((tmp_path / "muscles.json").read_text())
    assert muscles.keys() == {muscle.name for muscle in reference.muscles}
    assert muscles["zygomaticus_major_l"].keys() == {"type", "origin", "points", "width"}
    assert json.loads((tmp_path / "report.json").read_text())["fit"] == {"mean_mm": 0.1}
    with np.load(tmp_path / "shapes.npz") as shapes:
        assert shapes["names"].tolist() == list(SHAPES)
        assert shapes["deltas"].shape == (2, *reference.skin.vertices.shape)
        np.testing.assert_allclose(shapes["basis"], on_surface, atol=1e-3)
        assert np.abs(shapes["deltas"]).max() > 1 and shapes["triangles"].max() < len(shapes["basis"])


def test_a_relaxed_face_is_written_as_it_was_scanned_too(bpy, skin, tmp_path, reference):
    from headshop.headshop_addon import shape_keys
    from headshop.headshop_addon.plain_export import write_plain

    open_mouth = plainly_posed(reference, jaw_open=0.5).skin.vertices
    shape_keys.keep_as_scanned(skin, open_mouth)
    write_plain(skin, tmp_path)
    neutral, scanned = (read_ply(tmp_path / f"{name}.ply") for name in ("skin", "skin_as_scanned"))
    np.testing.assert_array_equal(scanned.triangles, neutral.triangles)
    shut, parted = (reference.landmarks.on({"skin": mesh.vertices[: len(open_mouth)]}) for mesh in (neutral, scanned))
    assert np.linalg.norm(shut["ls"] - shut["li"]) + 8 < np.linalg.norm(parted["ls"] - parted["li"])
    np.testing.assert_allclose(parted["n"], shut["n"], atol=0.01)
    on_surface = drawn(reference.skin.faces, open_mouth)
    assert np.median(np.linalg.norm(scanned.vertices[: len(on_surface)] - on_surface, axis=1)) < 1e-3


def test_no_shapes_file_before_a_bake(bpy, reference, tmp_path):
    from headshop.headshop_addon import heads
    from headshop.headshop_addon.plain_export import write_plain

    heads.create_head(reference, "Fran")
    write_plain(heads.find_heads()[0], tmp_path)
    assert "shapes.npz" not in [p.name for p in tmp_path.iterdir()]


def test_a_performance_is_one_clip_that_moves_all_parts(bpy, skin, tmp_path, reference):
    """An engine plays one clip: with a clip a part, eyes, teeth and tongue would stand still."""
    import struct

    from headshop.headshop_addon import performance
    from headshop.headshop_addon.export import export_head
    from headshop.sim.acting.principal import principal_shapes

    motion = {part: np.zeros((3, *reference.parts[part].vertices.shape)) for part in ("skin", "tongue", "eye_l")}
    for each in motion.values():
        each[2] = 1.0
    frames = np.arange(1, 4)
    performance.write_performance(
        skin, {p: principal_shapes(m, 0.001) for p, m in motion.items()}, frames, "Performance"
    )
    export_head(skin, tmp_path / "fran.glb")
    data = (tmp_path / "fran.glb").read_bytes()
    (size,) = struct.unpack("<I", data[12:16])
    clips = json.loads(data[20 : 20 + size])["animations"]
    assert [len(clip["channels"]) for clip in clips] == [3]


@pytest.mark.parametrize("extension", [".glb", ".fbx", ".usdc", ".usdz"])
def test_a_full_disk_is_a_sentence_and_leaves_no_half(blender, skin, bpy, tmp_path, extension):
    """It was the exporters' traceback, and half a USDC file passed for a whole one."""
    pytest.importorskip("resource")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "head.blend"), copy=True)
    code = """
import resource, signal, sys
from headshop.headshop_addon.command_line import main

signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (400000, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))
sys.exit(main(sys.argv[1:]))
"""
    out = tmp_path / "made" / f"head{extension}"
    command = [sys.executable, "-c", code, "export", str(tmp_path / "head.blend"), "-o", str(out)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 2, done
    assert "disk full" in done.stderr and done.stderr.count("\n") == 1 and len(done.stderr) < 200
    assert not out.parent.exists()
