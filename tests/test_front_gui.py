# SPDX-License-Identifier: GPL-3.0-or-later
"""The tour of tests/gui in a real Blender window on a virtual screen; pictures land in out/gui.

It takes some minutes, so it runs when asked for: HEADSHOP_BLENDER_GUI=/path/to/blender-gui names the script that opens
Blender on a virtual screen.
"""

import importlib.util
import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def blender_gui() -> str:
    """The script that opens Blender on a virtual screen."""
    if "HEADSHOP_BLENDER_GUI" not in os.environ:
        pytest.skip("set HEADSHOP_BLENDER_GUI=/path/to/blender-gui to test in a real window (takes minutes)")
    tool = Path(os.environ["HEADSHOP_BLENDER_GUI"]).resolve()
    try:
        ready = subprocess.run([tool, "blender", "--version"], cwd=ROOT, capture_output=True, timeout=120)
    except (OSError, subprocess.TimeoutExpired) as error:
        pytest.skip(f"{tool} does not run here: {error}")
    if ready.returncode:
        pytest.skip(f"{tool} is not set up here: {ready.stderr.decode().strip()}")
    return str(tool)


def test_an_artist_can_go_all_the_way_with_mouse_and_keyboard(blender, blender_gui, tmp_path):
    spec = importlib.util.spec_from_file_location("build_extension", ROOT / "packaging" / "build_extension.py")
    packaging = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(packaging)
    (path,) = packaging.build(tmp_path, [])
    pictures, settings = ROOT / "out" / "gui", tmp_path / "settings"
    pictures.mkdir(parents=True, exist_ok=True)
    settings.mkdir()
    for name in ("question", "answer"):
        (pictures / name).unlink(missing_ok=True)
    environment = os.environ | {
        "HEADSHOP_GUI": str(pictures),
        "BLENDER_USER_RESOURCES": str(settings),
        "BLENDER_GUI_HOME": str(tmp_path),
    }

    def run(*arguments, timeout):
        command = [blender_gui, *arguments]
        done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=timeout)
        assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-6000:]
        return done.stdout

    run("blender", "--command", "extension", "install-file", "-r", "user_default", "-e", str(path), timeout=120)
    script, session = ROOT / "tests" / "gui" / "tour.py", ROOT / "tests" / "gui" / "session.py"
    said = run("run", "--timeout", "1500", "--drive", str(script), "--", "--python", str(session), timeout=1560)
    assert "done" in said
