# SPDX-License-Identifier: GPL-3.0-or-later
"""Whatever a user gives: exit status 2, one sentence on stderr that says what is wrong, no file left behind."""

import json
import os
import subprocess
import sys
import time

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from headshop.headshop_addon.command_line import main
from headshop.headshop_addon.quiet import ENDINGS
from headshop.sim.anatomy.head import Head
from headshop.sim.mesh import Mesh
from headshop.sim.scan.ply import write_ply


@pytest.fixture
def scan(tmp_path, reference: Head):
    """The reference head's own skin as a scan file in mm; its parent folder holds nothing else but landmarks."""
    path = tmp_path / "in" / "scan.ply"
    path.parent.mkdir()
    write_ply(path, reference.skin)
    return path


@pytest.fixture
def landmarks(tmp_path, scan, reference: Head):
    """A landmark file; call with changes to make a bad one."""

    def write(**change):
        points = {name: point.tolist() for name, point in reference.landmark_positions().items()}
        document = {"format": "headshop-landmarks/1", "units": "mm", "landmarks": points, "missing": []} | change
        path = scan.with_name("landmarks.json")
        path.write_text(json.dumps(document))
        return path

    return write


def fails(capfd, tmp_path, *arguments, status=2) -> str:
    """Run the program; check status, the single sentence and that no file appeared; returns the sentence."""
    before = sorted(tmp_path.rglob("*"))
    assert main([str(argument) for argument in arguments]) == status
    printed = capfd.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1 and printed.err.startswith("headshop"), printed.err
    assert "Traceback" not in printed.err and len(printed.err) < 400
    assert sorted(tmp_path.rglob("*")) == before
    return printed.err


def build(scan, landmarks, tmp_path):
    return (
        "build",
        scan,
        "--landmarks",
        landmarks,
        "-o",
        tmp_path / "made" / "head.blend",
        "--export",
        tmp_path / "plain",
    )


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["fly"], "fly"),
        (["build"], "SCAN"),
        (["build", "x.ply"], "--output"),
        (["bake", "x.blend", "--set", "all"], "all"),
        (["bake", "x.blend", "--set", "facs"], "invalid choice: 'facs'"),
        (["build", "", "-o", "x.blend"], "SCAN: the name is empty"),
        (["build", "x.ply", "-o", "x.blend", "--export", ""], "--export: the name is empty"),
        (["build", "x.ply", "-o", "x.blend", "--landmarks", ""], "--landmarks: the name is empty"),
        (["bake", "x.blend", "--set", "arkit", "-o", ""], "--output: the name is empty"),
        (["bake", "x.blend", "--performance", ""], "--performance: the name is empty"),
        (["sample", "-o", ""], "--output: the name is empty"),
        (["build", "\udcff.ply", "-o", "x.blend"], "SCAN: the name '\\udcff.ply' is no text in UTF-8"),
        (["build", "x.ply", "-o", "x.blend", "--name", "\udcff"], "--name: the name"),
        (["build", "x.ply", "-o", "x.blend", "--units", "miles"], "miles"),
        (["build", "x.ply", "-o", "x.blend", "--up", "w"], "choose from"),
        (["sample", "-o", "x", "--seed", "-1"], "whole number from 0"),
        (["sample", "-o", "x", "--seed", "one"], "whole number from 0"),
    ],
)
def test_a_wrong_command_is_one_sentence(capfd, tmp_path, arguments, word):
    assert word in fails(capfd, tmp_path, *arguments)


def test_no_scan_there(capfd, tmp_path, landmarks):
    assert "nowhere.ply" in fails(capfd, tmp_path, *build(tmp_path / "nowhere.ply", landmarks(), tmp_path))


def test_a_scan_or_head_that_is_no_file_or_cannot_be_read(capfd, tmp_path, monkeypatch):
    """A pipe was said not to be there, and the rest to be our fault."""
    monkeypatch.chdir(tmp_path)
    for command in (("landmarks", "-o", "a.json"), ("export", "-o", "a.glb")):
        assert "a folder" in fails(capfd, tmp_path, *command, ".")
        assert "x.ply is not there" in fails(capfd, tmp_path, *command, "x.ply")
        assert "is a pipe or a device" in fails(capfd, tmp_path, *command, os.devnull)
        assert "cannot be read (File name too long)" in fails(capfd, tmp_path, *command, "x" * 256)
    (tmp_path / "secret.blend").write_bytes(b"anything")
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    assert "cannot be read (Permission denied)" in fails(capfd, tmp_path, "export", "secret.blend", "-o", "a.glb")


def test_no_landmark_file_there(capfd, tmp_path, scan):
    assert "nowhere.json" in fails(capfd, tmp_path, *build(scan, tmp_path / "nowhere.json", tmp_path))


def test_a_scan_without_a_face(bpy, capfd, tmp_path, one_look):
    path = tmp_path / "ball.ply"
    rng = np.random.default_rng(0)
    points = rng.standard_normal((900, 3))
    points *= 110 / np.linalg.norm(points, axis=1, keepdims=True)
    write_ply(path, Mesh.from_triangles(points, ConvexHull(points).simplices))
    said = fails(capfd, tmp_path, "build", path, "-o", tmp_path / "head.blend")
    assert "No face" in said and "--units" not in said
    said = fails(capfd, tmp_path, "landmarks", path, "-o", tmp_path / "found.json", "--units", "mm")
    assert "No face" in said and "--units" in said


@pytest.mark.parametrize(
    ("name", "content", "word"),
    [
        ("scan.ply", b"", "empty"),
        ("scan.ply", b"This is a letter, not a scan.\n", "PLY"),
        ("scan.stl", b"This is a letter, not a scan.\n" * 9, "not an STL file"),
        ("scan.obj", b"This is a letter, not a scan.\n", "OBJ"),
        ("scan.glb", b"This is a letter, not a scan.\n", "GLB"),
        ("scan.fbx", b"This is a letter, not a scan.\n", "FBX"),
        ("scan.usdc", b"This is a letter, not a scan.\n", "USDC"),
        ("scan.docx", b"This is a letter, not a scan.\n", "PLY, OBJ, STL, GLB"),
    ],
)
def test_a_file_that_is_no_scan(bpy, capfd, tmp_path, scan, landmarks, name, content, word):
    bad = scan.with_name(name)
    bad.write_bytes(content)
    assert word in fails(capfd, tmp_path, *build(bad, landmarks(), tmp_path))


def test_a_truncated_scan(bpy, capfd, tmp_path, scan, landmarks):
    scan.write_bytes(scan.read_bytes()[:-5000])
    assert "truncated" in fails(capfd, tmp_path, *build(scan, landmarks(), tmp_path))


def test_a_scan_with_too_few_places_on_its_picture(bpy, capfd, tmp_path, write_rows, landmarks):
    faces = ["list uchar int vertex_indices", "list uchar float texcoord"], [([0, 1, 2], [0, 0, 1, 0])]
    elements = {"vertex": (["float x", "float y", "float z"], [(0, 0, 0), (9, 0, 0), (0, 0, 9)]), "face": faces}
    scan = write_rows(tmp_path / "textured.ply", "ascii", elements)
    assert "more or fewer corners" in fails(capfd, tmp_path, *build(scan, landmarks(), tmp_path))


def test_a_scan_of_one_triangle(bpy, capfd, tmp_path, scan, landmarks):
    write_ply(scan, Mesh.from_triangles([[0, 0, 0], [100, 0, 0], [0, 0, 100]], [[0, 1, 2]]))
    assert "1 triangle" in fails(capfd, tmp_path, *build(scan, landmarks(), tmp_path))


def test_three_landmarks(bpy, capfd, tmp_path, scan, landmarks):
    few = {"prn": [0, -100, 0], "t_l": [70, 0, 0], "t_r": [-70, 0, 0]}
    assert "3 landmarks" in fails(capfd, tmp_path, *build(scan, landmarks(landmarks=few), tmp_path))


def test_coplanar_landmarks(bpy, capfd, tmp_path, scan, landmarks, reference):
    flat = {name: [x, -90.0, z] for name, (x, _, z) in reference.landmark_positions().items() if name in _FRONT}
    assert "plane" in fails(capfd, tmp_path, *build(scan, landmarks(landmarks=flat), tmp_path))


_FRONT = ("prn", "ex_l", "ex_r", "ch_l", "ch_r", "gn")


def test_an_unknown_landmark(bpy, capfd, tmp_path, scan, landmarks, reference):
    points = {name: point.tolist() for name, point in reference.landmark_positions().items()}
    wrong = landmarks(landmarks=points | {"nose_tip": points["prn"]})
    assert "nose_tip" in fails(capfd, tmp_path, *build(scan, wrong, tmp_path))


def test_landmarks_in_metres(bpy, capfd, tmp_path, scan, landmarks, reference):
    points = {name: (point / 1000).tolist() for name, point in reference.landmark_positions().items()}
    assert "metres" in fails(capfd, tmp_path, *build(scan, landmarks(landmarks=points), tmp_path))


@pytest.mark.parametrize(("unit", "words"), [("cm", "correct the unit (--units)"), ("1e-300", "no head")])
def test_a_wrong_unit(bpy, capfd, tmp_path, scan, landmarks, unit, words):
    assert words in fails(capfd, tmp_path, *build(scan, landmarks(), tmp_path), "--units", unit)


@pytest.mark.parametrize("output", ["in/scan.ply/head.blend", "in", "head.txt"])
def test_an_output_that_cannot_be_written(capfd, tmp_path, scan, landmarks, output):
    given = landmarks()
    assert output.split("/")[-1].split(".")[0] in fails(
        capfd, tmp_path, "build", scan, "--landmarks", given, "-o", tmp_path / output
    )


def test_an_output_over_an_input(capfd, tmp_path, scan, landmarks):
    given = landmarks()
    build = ("build", scan, "--landmarks", given, "-o", tmp_path / "head.blend")
    assert "is an input" in fails(capfd, tmp_path, *build, "--export", given.parent)
    assert "is a file" in fails(capfd, tmp_path, *build, "--export", tmp_path / "head.blend")
    assert "is an input" in fails(capfd, tmp_path, "landmarks", given, "-o", given)


def test_a_blend_that_is_none(bpy, capfd, tmp_path):
    head = tmp_path / "head.blend"
    head.write_bytes(b"This is a letter.")
    assert "head.blend" in fails(capfd, tmp_path, "bake", head, "--set", "expressions")


def test_a_blend_without_a_head(bpy, capfd, tmp_path):
    head = tmp_path / "head.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(head), copy=True)
    capfd.readouterr()
    assert "no head" in fails(capfd, tmp_path, "bake", head, "--set", "expressions")


def test_nothing_to_bake(capfd, tmp_path):
    head = tmp_path / "head.blend"
    head.write_bytes(b"anything")
    assert "--set" in fails(capfd, tmp_path, "bake", head)
    assert "--performance" in fails(capfd, tmp_path, "bake", head, "--set", "arkit", "--dynamic")


@pytest.mark.parametrize("number", ENDINGS)
def test_ctrl_c_in_the_middle(blender, tmp_path, scan, landmarks, number):
    given = landmarks()
    before = sorted(tmp_path.rglob("*"))
    command = [sys.executable, "-m", "headshop", *map(str, build(scan, given, tmp_path))]
    blenders = tmp_path.with_name(tmp_path.name + " blender")
    blenders.mkdir()
    environment = os.environ | {"TMPDIR": str(blenders)}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)
    while process.poll() is None and sorted(tmp_path.rglob("*")) == before:
        time.sleep(0.02)  # until it has begun: its scratch folder is there
    time.sleep(0.3)
    process.send_signal(number)
    out, err = process.communicate(timeout=60)
    assert process.returncode == -number, (out, err)  # so that a shell's loop ends, too
    assert err == "headshop: Interrupted: nothing was written.\n"
    assert sorted(tmp_path.rglob("*")) == before and not list(blenders.iterdir())


def test_without_blender_there_is_a_sentence(tmp_path, scan, landmarks):
    code = (
        "import sys; sys.modules['bpy'] = None; from headshop.headshop_addon.command_line import main; sys.exit(main())"
    )
    command = [sys.executable, "-c", code, *map(str, build(scan, landmarks(), tmp_path))]
    before = sorted(tmp_path.rglob("*"))
    done = subprocess.run(command, capture_output=True, text=True, env=os.environ | {"PYTHONSAFEPATH": "1"})
    assert done.returncode == 2 and "pip install bpy" in done.stderr and done.stderr.count("\n") == 1
    assert sorted(tmp_path.rglob("*")) == before
