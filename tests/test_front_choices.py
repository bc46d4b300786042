# SPDX-License-Identifier: GPL-3.0-or-later
"""What is chosen in the Build panel or on the command line is what a head is built with."""

import pytest

from headshop.headshop_addon.command_line import main
from headshop.sim.adapt import build
from headshop.sim.adapt.landmarks import write_landmarks
from headshop.sim.adapt.scan_surface import NO_SKIN, to_leave_out
from headshop.sim.errors import InputError
from headshop.sim.progress import Progress, finish
from headshop.sim.scan.ply import write_ply


@pytest.fixture
def asked(blender, monkeypatch):
    """The choices that builds were asked for, the first of which is as far as they get."""
    from headshop.headshop_addon import pipeline

    out = []

    def build_head(reference, scan, landmarks, detail, relax, leave_out, found):
        out.append((relax, leave_out, set(found)))
        yield Progress(0.0, "Asked")
        raise InputError("That is enough.")

    monkeypatch.setattr(pipeline, "build_head", build_head)
    return out


def test_choices_of_the_panel(addon, asked, reference):
    from headshop.headshop_addon import bridge, scan_landmarks, scan_objects

    scan = bridge.mesh_to_object(reference.skin, "Scan")
    addon.context.scene.collection.objects.link(scan)
    scan_landmarks.replace(scan, reference.landmark_positions())
    settings = addon.context.scene.headshop
    assert settings.no_skin == {name.upper() for name in NO_SKIN}
    every = settings.no_skin
    for relax, no_skin in (
        ("AUTO", every),
        ("NEVER", {"HAIR"}),
        ("AUTO", {"FLAT_ENDS", "HELD_BY_LIPS"}),
        ("AUTO", set()),
    ):
        settings.relax, settings.no_skin = relax, no_skin
        with pytest.raises(InputError, match="enough"):
            finish(scan_objects.build(addon.context, scan))
        asked_relax, leave_out, found = asked.pop()
        assert (asked_relax, found) == (relax.lower(), set())
        assert to_leave_out(leave_out) == {name.lower() for name in no_skin}


def test_choices_on_the_command_line(asked, reference, tmp_path):
    scan, landmarks = tmp_path / "scan.ply", tmp_path / "landmarks.json"
    write_ply(scan, reference.skin)
    write_landmarks(landmarks, reference.landmark_positions())
    for words, wanted in (
        ([], ("auto", "auto")),
        (["--relax", "always"], ("always", "auto")),
        (["--leave-out", "never"], ("auto", "never")),
        (["--leave-out", "hair,flat_ends"], ("auto", "hair,flat_ends")),
    ):
        paths = [str(scan), "--landmarks", str(landmarks), "-o", str(tmp_path / "head.blend")]
        assert main(["build", "--quiet", *paths, *words]) == 2
        assert asked.pop() == (*wanted, set())


def test_the_terminal_says_what_else_could_be_done(blender, reference, tmp_path, capsys, monkeypatch):
    scan, landmarks = tmp_path / "scan.ply", tmp_path / "landmarks.json"
    write_ply(scan, reference.skin)
    write_landmarks(landmarks, reference.landmark_positions())
    paths = [str(scan), "--landmarks", str(landmarks), "-o", str(tmp_path / "head.blend"), "--detail", "0"]
    for smiles, lines in ((False, 1), (True, 2)):
        monkeypatch.setattr(build, "smiles_closed", lambda fit, smiles=smiles: smiles)
        assert main(["build", *paths]) == 0
        said = capsys.readouterr().out.strip().splitlines()[-lines:]
        assert ": Fitted " in said[0] and ("--relax always" in said[-1]) == smiles


def test_what_is_unknown_cannot_be_left_out(asked, reference, tmp_path, capsys):
    write_ply(tmp_path / "scan.ply", reference.skin)
    words = ["--leave-out", "hair,tubes", "-o", str(tmp_path / "head.blend")]
    assert main(["build", "--quiet", str(tmp_path / "scan.ply"), *words]) == 2
    said = capsys.readouterr().err.strip()
    assert "'tubes'" in said and all(name in said for name in ("auto", "never", *NO_SKIN)) and "\n" not in said
    assert not asked and not (tmp_path / "head.blend").exists()


def test_landmarks_that_nobody_placed_are_told_from_the_others(addon, asked, reference, tmp_path):
    from headshop.headshop_addon import bridge, scan_landmarks, scan_objects
    from headshop.sim.landmarks.find import FoundLandmarks

    places = reference.landmark_positions()
    confidence = dict.fromkeys(places, 0.8) | {"v": 0.1}
    scan = bridge.mesh_to_object(reference.skin, "Scan")
    addon.context.scene.collection.objects.link(scan)
    scan_landmarks.take_found(scan, FoundLandmarks(places, confidence, ("op",), ()))
    scan_landmarks.put(scan, "prn", places["prn"] + [0, 0, 1])
    with pytest.raises(InputError, match="enough"):
        finish(scan_objects.build(addon.context, scan))
    assert asked.pop()[2] == set(places) - {"prn", "v", "op"}
    # The same from a file of the scan's landmarks, in the window and on the command line.
    path, mesh = tmp_path / "landmarks.json", tmp_path / "scan.ply"
    scan_objects.save_landmarks(scan, path)
    scan_landmarks.forget(scan)
    scan_objects.load_landmarks(scan, path)
    assert set(scan_landmarks.nobody_placed(scan)) == set(places) - {"prn", "v", "op"}
    assert set(scan_landmarks.positions(scan)) == {"prn"}
    write_ply(mesh, reference.skin)
    assert main(["build", "--quiet", str(mesh), "--landmarks", str(path), "-o", str(tmp_path / "head.blend")]) == 2
    assert asked.pop()[2] == set(places) - {"prn", "v", "op"}
