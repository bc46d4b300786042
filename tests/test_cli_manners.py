# SPDX-License-Identifier: GPL-3.0-or-later
"""What a terminal sees: nothing of Blender's chatter, a bar only where it can be drawn, Ctrl-C at a good moment."""

import functools
import io
import os
import signal
import sys

import pytest

from headshop.headshop_addon.command_line import main
from headshop.headshop_addon.progress_bar import progress_bar
from headshop.headshop_addon.quiet import quiet
from headshop.sim.progress import Progress


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
