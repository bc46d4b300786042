# SPDX-License-Identifier: GPL-3.0-or-later
"""The main job on the command line: a damaged scan to a head, its expressions, a performance, an engine's copy."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from headshop.headshop_addon.command_line import main
from headshop.headshop_addon.plain_files import FILES
from headshop.sim.acting import expressions
from headshop.sim.adapt.landmarks import write_landmarks
from headshop.sim.anatomy.seen_skin import seen_skin
from headshop.sim.scan.ply import read_ply, write_ply

SHAPE = {"model", "peak_mm", "volume_drift", "penetration_mm", "converged"}
SHAPE |= {"residual", "energy", "volume_drift_of", "penetration_of", "inverted_prisms"}


@pytest.fixture(scope="module")
def folder(blender, reference, tmp_path_factory):
    """A scan in metres, Y up, with three NaN vertices and a doubled face; landmarks along its axes; a performance."""
    folder = tmp_path_factory.mktemp("path")
    skin = reference.skin
    vertices = skin.vertices[:, [0, 2, 1]] * [1, 1, -1]
    vertices[:3] = np.nan
    faces = np.concatenate([skin.triangles, skin.triangles[-1:]])
    write_ply(folder / "scan.ply", type(skin).from_triangles(vertices / 1000, faces))
    points = {n: p[[0, 2, 1]] * [1, 1, -1] for n, p in reference.landmark_positions().items()}
    write_landmarks(folder / "marks.json", {n: points[n] for n in _GIVEN})
    performance = {"format": "headshop-performance/1", "fps": 25, "channels": {"jaw_open": [[0, 0], [0.12, 0.4]]}}
    (folder / "acting.json").write_text(json.dumps(performance))
    return folder


_GIVEN = "prn ex_l ex_r en_l en_r ch_l ch_r gn n sn t_l t_r ls li sto go_l go_r zy_l zy_r ps_l ps_r pi_l pi_r".split()


def run(*arguments):
    assert main([str(argument) for argument in arguments]) == 0


@pytest.fixture(scope="module")
def built(folder):
    run(
        "build",
        folder / "scan.ply",
        "--landmarks",
        folder / "marks.json",
        "-o",
        folder / "head.blend",
        "--export",
        folder,
    )
    return folder


def test_build(built, reference):
    report = json.loads((built / "report.json").read_text())
    assert {"vertices", "triangles", "components", "unit_scale"} <= report["scan"].keys()
    assert report["scan"]["unit_scale"] == 1000 and report["scan"]["up"] == "+Y"
    assert report["scan"]["nonfinite_vertices"] == 3 and report["scan"]["duplicate_faces"] == 1
    assert {"mean_mm", "p95_mm", "max_mm", "coverage", "landmark_mean_mm"} <= report["fit"].keys()
    assert report["fit"]["mean_mm"] < 0.5 and report["fit"]["coverage"] > 0.9
    assert {"muscles", "skull_penetrations", "tissue_thickness_mm"} <= report["anatomy"].keys()
    assert report["anatomy"]["skull_penetrations"] == 0
    assert report["seconds"].keys() == {"read", "clean", "fit", "place"}
    assert {"headshop", "blender", "python", "numpy", "scipy"} <= report["versions"].keys()
    assert report["landmarks_missing"] == [n for n in reference.landmarks.names if n not in _GIVEN]
    skin = read_ply(built / "skin.ply").vertices
    assert np.median(np.linalg.norm(skin - seen_skin(reference).vertices, axis=1)) < 1.3
    names = {path.name for path in built.iterdir()}
    assert "shapes.npz" not in names and not any(name.startswith(".") or name.endswith("blend1") for name in names)


def test_every_key_of_the_report_is_documented(built):
    text = (Path(__file__).resolve().parents[1] / "docs" / "report.md").read_text()
    report = json.loads((built / "report.json").read_text())
    names = [*report, *FILES]
    for block in ("scan", "fit", "anatomy", "seconds", "versions"):
        names += report[block]
    names += [name for block in ("left_out_mm2", "detail") for name in report["fit"][block]]
    assert [name for name in names if f"`{name}`" not in text] == []


def test_bake_after_saving_and_export(built, monkeypatch):
    two = {name: pose for name, pose in expressions.expressions().items() if name in ("smile", "frown")}
    monkeypatch.setattr(expressions, "expressions", lambda: two)
    before = (built / "head.blend").read_bytes()
    run("bake", built / "head.blend", "--set", "expressions", "-o", built / "baked.blend", "--export", built / "plain")
    assert (built / "head.blend").read_bytes() == before
    report = json.loads((built / "plain" / "report.json").read_text())
    assert report["shapes"].keys() == two.keys()
    assert all(shape.keys() == SHAPE for shape in report["shapes"].values())
    assert report["shapes"]["smile"]["peak_mm"] > 5
    with np.load(built / "plain" / "shapes.npz") as shapes:
        assert shapes["names"].tolist() == list(two)
        peaks = np.linalg.norm(shapes["deltas"], axis=2).max(axis=1)
        np.testing.assert_allclose(peaks, [report["shapes"][name]["peak_mm"] for name in two], rtol=1e-3)
    run("export", built / "baked.blend", "-o", built / "engine.glb")
    assert (built / "engine.glb").read_bytes()[:4] == b"glTF"


def test_performance(bpy, built):
    run("bake", built / "head.blend", "--performance", built / "acting.json", "-o", built / "acting.blend")
    bpy.ops.wm.open_mainfile(filepath=str(built / "acting.blend"))
    scene = bpy.context.scene
    assert (scene.render.fps, scene.frame_start, scene.frame_end) == (25, 1, 4)
    keys = bpy.data.objects["scan Mandible"].data.shape_keys
    scene.frame_set(4)
    assert abs(keys.key_blocks["Performance_01"].value) > 0.9


def test_it_is_a_program(built):
    """The same as a process of its own: the sentence of a wrong request, and silence where there is nothing to say."""
    command = [sys.executable, "-m", "headshop", "bake", str(built / "head.blend"), "--set", "facs"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "") and done.stderr.count("\n") == 1
    command = [
        sys.executable,
        "-m",
        "headshop",
        "export",
        str(built / "head.blend"),
        "-o",
        str(built / "a.glb"),
        "--quiet",
    ]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr


def test_the_file_opens_on_the_head(bpy, built):
    bpy.ops.wm.open_mainfile(filepath=str(built / "head.blend"))
    areas = [area for screen in bpy.data.screens for area in screen.areas if area.type == "VIEW_3D"]
    assert areas and all(area.spaces.active.region_3d.view_distance < 1.5 for area in areas)
    assert bpy.context.scene.camera is not None


@pytest.mark.parametrize(
    ("module", "function", "name"), [("contact_sheet", "render_sheet", "a.png"), ("movie", "render_movie", "a.mp4")]
)
def test_render_writes_what_the_name_says(built, monkeypatch, capfd, module, function, name):
    """Which renderer is called with what; the renderers have tests of their own."""
    from importlib import import_module

    from headshop.sim.progress import Progress

    def renderer(skin, path):
        yield Progress(0.5, "Rendering")
        assert skin.name == "scan Skin" and not (built / name).exists()
        path.write_bytes(b"a picture")

    monkeypatch.setattr(import_module(f"headshop.headshop_addon.{module}"), function, renderer)
    capfd.readouterr()
    run("render", built / "head.blend", "-o", built / name)
    assert (built / name).read_bytes() == b"a picture"
    assert capfd.readouterr() == (f"{built / name}\n", "")
