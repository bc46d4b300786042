# SPDX-License-Identifier: GPL-3.0-or-later
"""What a terminal sees: nothing of Blender's chatter, a bar only where it can be drawn, Ctrl-C at a good moment."""

import functools
import io
import os
import signal
import subprocess
import sys

import pytest

from headshop.headshop_addon.command_line import _interruptible, main, parser
from headshop.headshop_addon.progress_bar import progress_bar
from headshop.headshop_addon.quiet import quiet
from headshop.sim.landmarks.find import FoundLandmarks
from headshop.sim.progress import Progress, finish
from headshop.sim.scan.ply import write_ply


def test_quiet_holds_back_what_is_printed(capfd):
    with quiet() as printed:
        print("from Python")
        os.write(1, b"from C\n")
        assert "from Python" in printed() and "from C" in printed()
    print("after")
    out, err = capfd.readouterr()
    assert (out, err) == ("after\n", "")


def test_quiet_does_not_swallow_errors(capfd):
    with pytest.raises(RuntimeError, match="why"), quiet():
        raise RuntimeError("why")
    print("after")
    assert capfd.readouterr().out == "after\n"


def test_ctrl_c_waits_until_blender_is_done():
    done = []
    with pytest.raises(KeyboardInterrupt), quiet():
        os.kill(os.getpid(), signal.SIGINT)
        done.append("the call went to its end")
    assert done and signal.getsignal(signal.SIGINT) is signal.default_int_handler


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_the_bar_is_drawn_on_terminals_only(monkeypatch):
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with progress_bar() as show:
        assert show is None
    monkeypatch.setattr(sys, "stderr", Terminal())
    with progress_bar() as show:
        show(Progress(0.5, "Simulating joy"))
    drawn = sys.stderr.getvalue()
    assert "50%" in drawn and "Simulating joy" in drawn and drawn.endswith("\r\x1b[K")
    with progress_bar(wanted=False) as show:
        assert show is None


def test_help_and_version(blender, capfd):
    assert main(["--help"]) == 0
    assert {"build", "landmarks", "bake", "render", "export", "sample"} <= set(capfd.readouterr().out.split())
    assert main(["--version"]) == 0
    assert capfd.readouterr().out.startswith("headshop 0.")


def test_our_own_fault_is_status_1_and_a_sentence(capfd, monkeypatch, tmp_path):
    from headshop.headshop_addon import commands

    def broken(options):
        raise ZeroDivisionError("by nothing")

    monkeypatch.setattr(commands, "sample", broken)
    assert main(["sample", "-o", str(tmp_path)]) == 1
    err = capfd.readouterr().err
    assert "ZeroDivisionError" in err and err.count("\n") == 1
    assert main(["sample", "-o", str(tmp_path), "--debug"]) == 1
    assert "Traceback" in capfd.readouterr().err


def test_the_sample_needs_no_blender(reference, tmp_path, monkeypatch, capfd):
    from headshop.sim.scan import sample

    monkeypatch.setitem(sys.modules, "bpy", None)
    monkeypatch.setattr(sample, "make_sample", functools.partial(sample.make_sample, levels=1))  # coarse and quick
    assert main(["sample", "-o", str(tmp_path / "s")]) == 0
    assert sorted(path.name for path in (tmp_path / "s").iterdir()) == ["landmarks.json", "scan.ply", "truth.ply"]
    assert "scan.ply" in capfd.readouterr().out


def test_names_that_the_terminal_cannot_show_are_printed_escaped(reference, tmp_path, monkeypatch):
    from headshop.sim.scan import sample

    monkeypatch.setattr(sample, "make_sample", functools.partial(sample.make_sample, levels=1))
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(io.BytesIO(), encoding="cp1252"))
    assert main(["sample", "-o", str(tmp_path / "скан")]) == 0
    assert b"\\u0441" in sys.stdout.buffer.getvalue()


def test_whoever_reads_may_go(blender):
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run([sys.executable, "-m", "headshop", "--version"], stdout=write, stderr=subprocess.PIPE)
    os.close(write)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.skipif(os.name != "posix", reason="closes streams as shells there do")
def test_closed_streams_get_nothing_of_blenders_chatter(bpy, reference, tmp_path):
    """With stdout closed, stderr got what the exporter says, and a file that took its place would have, too."""
    from headshop.headshop_addon import heads

    heads.create_head(reference, "Fran")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "head.blend"), copy=True)
    command = f'"$0" -m headshop export {tmp_path / "head.blend"} -o {tmp_path / "head.glb"}'
    for closed, printed in ((">&-", b""), ("<&- 2>&-", b"0 shapes\n"), (">&- 2>&-", b"")):
        done = subprocess.run(["sh", "-c", f"{command} {closed}", sys.executable], capture_output=True)
        assert done.returncode == 0 and done.stdout.endswith(printed) and done.stderr == b"", (closed, done)
        assert bool(done.stdout) == bool(printed)
        assert (tmp_path / "head.glb").read_bytes()[:4] == b"glTF"


def test_a_tilde_that_the_shell_left_means_the_home_folder():
    """``--export=~/plain`` made a folder called ~."""
    asked = parser().parse_args(["bake", "~/head.blend", "-o", "./~", "--export=~/plain"])
    assert [asked.head, asked.output, asked.export] == [*map(os.path.expanduser, ("~/head.blend", "./~", "~/plain"))]
    assert "~" not in asked.export + asked.head and asked.output == "./~"


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="has no terminals that hang up")
def test_under_nohup_the_terminal_may_be_closed(blender, tmp_path):
    ran = []

    def work():
        signal.raise_signal(signal.SIGHUP)
        ran.append(True)

    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with _interruptible(ran):
            work()
    finally:
        signal.signal(signal.SIGHUP, before)
    assert ran == [True]


def test_nothing_that_takes_long_is_imported_before_ctrl_c_is_quiet():
    code = "import sys, headshop.headshop_addon.command_line; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


@pytest.mark.parametrize("text", ["z", "+Z", "Z"])
def test_axes_may_be_written_as_the_report_does(text):
    assert parser().parse_args(["landmarks", "a.ply", "-o", "a.json", "--up", text]).up == "Z"


@pytest.mark.parametrize(("up", "doubt"), [("Z", False), ("-Z", True)])
def test_doubtful_axes_are_told(bpy, reference, tmp_path, monkeypatch, capfd, up, doubt):
    from headshop.headshop_addon import pipeline

    def found(mesh, **options):
        yield Progress(0.5, "")
        places = reference.landmark_positions()
        return FoundLandmarks(places, dict.fromkeys(places, 0.9), (), ())

    monkeypatch.setattr(pipeline, "find_landmarks", found)
    write_ply(tmp_path / "scan.ply", reference.skin)
    assert main(["landmarks", str(tmp_path / "scan.ply"), "-o", str(tmp_path / "found.json"), f"--up={up}"]) == 0
    out = capfd.readouterr().out
    assert ("by the landmarks that were found the head is turned by 180 degrees" in out) == doubt
    assert out.count("\n") == 1 + doubt


@pytest.mark.parametrize("bad", [2.0, 12.0])
def test_what_is_unlike_faces_is_told(bpy, reference, tmp_path, monkeypatch, capfd, bad):
    """A headset, of which the lower edges passed for a face, became a head without a word."""
    from headshop.headshop_addon import heads, pipeline

    def found(mesh, **options):
        yield Progress(0.5, "")
        places = reference.landmark_positions()
        return FoundLandmarks(places, dict.fromkeys(places, 0.9), (), (), 1.0, bad)

    def built(scan, landmarks, name, **options):
        yield Progress(0.5, "")
        heads.create_head(reference, name)
        return heads.find_heads()[0], {"fit": {"advice": "And this."}}

    monkeypatch.setattr(pipeline, "find_landmarks", found)
    monkeypatch.setattr(pipeline, "build", built)
    scan = tmp_path / "scan.ply"
    write_ply(scan, reference.skin)
    assert main(["landmarks", str(scan), "-o", str(tmp_path / "found.json")]) == 0
    assert ("unlike most faces" in capfd.readouterr().out) == (bad > 7)
    skin, report = finish(pipeline.build_alone(scan, "Fran"))
    assert ("unlike most faces" in report["fit"]["advice"]) == (bad > 7)
    assert report["fit"]["advice"].endswith("And this.") and heads.read_report(skin) in ({}, report)
    assert bool(heads.read_report(skin)) == (bad > 7)
