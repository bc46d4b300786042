# SPDX-License-Identifier: GPL-3.0-or-later
"""The zips: what is in them, and that Blender installs and runs them."""

import hashlib
import importlib.util
import json
import os
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
#: What may stand at the top of a zip; everything else of the repository stays at home.
ALLOWED = {
    *("blender_manifest.toml", "LICENSE", "__init__.py", "__main__.py"),
    *("assets", "headshop_addon", "operators", "panels", "sim", "wheels"),
}
#: The largest zip without wheels, in bytes: data of the product, no more.
LIGHT = 12e6


@pytest.fixture(scope="session")
def packaging():
    """packaging/build_extension.py as a module."""
    spec = importlib.util.spec_from_file_location("build_extension", ROOT / "packaging" / "build_extension.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def light_zip(blender, packaging, tmp_path_factory) -> Path:
    """The zip without wheels, built by Blender's own builder."""
    (path,) = packaging.build(tmp_path_factory.mktemp("zips"), [])
    return path


def _top(path: Path) -> set[str]:
    return {name.partition("/")[0] for name in zipfile.ZipFile(path).namelist()}


def test_the_zip_holds_the_product_and_nothing_else(light_zip):
    assert light_zip.name == f"headshop-{_manifest()['version']}-nowheels.zip"
    assert _top(light_zip) == ALLOWED - {"wheels"}
    names = zipfile.ZipFile(light_zip).namelist()
    assert "assets/reference_head.npz" in names and "operators/build_head.py" in names
    assert not [name for name in names if "__pycache__" in name or name.endswith((".pyc", ".blend1", ".whl", ".zip"))]
    assert light_zip.stat().st_size < LIGHT


def _manifest() -> dict:
    return tomllib.loads((ROOT / "blender_manifest.toml").read_text())


def test_the_manifest_agrees_with_the_package_and_names_no_wheels():
    manifest = _manifest()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert manifest["id"] == "headshop" and manifest["schema_version"] == "1.0.0"
    assert manifest["version"] == project["version"]
    assert manifest["license"] == ["SPDX:GPL-3.0-or-later"] and project["license"] == "GPL-3.0-or-later"
    assert manifest["blender_version_min"] == "4.5.0"
    assert set(manifest["permissions"]) == {"files"}, "nothing here needs the network or the camera"
    assert "wheels" not in manifest, "a checkout must work without wheels"


def test_the_lock_covers_every_platform_and_python(packaging):
    names, needed = set(packaging.read_lock()), set()
    for requirement in packaging.REQUIREMENTS:
        start = requirement.replace("==", "-") + "-"
        for python in packaging.PYTHONS:
            tag = "cp" + python.replace(".", "")
            for tags in packaging.PLATFORMS.values():
                fit = {n for n in names if n.startswith(start + tag) and any(t in n for t in tags)}
                fit |= {n for n in names if n.startswith(start + "py3-none-any")}
                assert len(fit) == 1, (requirement, python, tags)
                needed |= fit
    assert names == needed
    assert all(len(digest) == 64 for digest in packaging.read_lock().values())


def test_a_wheel_that_is_not_the_locked_one_is_refused(packaging, tmp_path, monkeypatch):
    monkeypatch.setattr(packaging, "WHEELS", tmp_path)
    monkeypatch.setattr(packaging, "read_lock", lambda: {"a.whl": hashlib.sha256(b"right").hexdigest()})
    (tmp_path / "a.whl").write_bytes(b"wrong")
    with pytest.raises(SystemExit, match="sha256"):
        packaging.locked_wheels()
    (tmp_path / "a.whl").write_bytes(b"right")
    assert packaging.locked_wheels() == [tmp_path / "a.whl"]


_INSTALL = """
import json, sys
for folder in sys.argv[2:]:
    sys.path.insert(0, folder)
import bpy
bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
assert bpy.ops.extensions.package_install_files(
    repo="user_default", filepath=sys.argv[1], enable_on_install=True) == {"FINISHED"}
import scipy
from bl_ext.user_default.headshop.headshop_addon import bridge, dependencies, heads
from bl_ext.user_default.headshop.sim.anatomy.storage import load_head
heads.create_head(load_head(), "Ref")
skin = heads.find_heads()[0]
repacked = sorted(bpy.ops.headshop.repack_uv()) if dependencies.available("xatlas") else []
skin.headshop.muscles.corrugator_l = 0.3
moved = abs(bridge.read_positions(skin, "Live") - bridge.read_positions(skin)).max()
bpy.ops.preferences.addon_disable(module="bl_ext.user_default.headshop")
print("RESULT " + json.dumps({
    "scipy": [scipy.__version__, scipy.__file__],
    "repacked": repacked,
    "moved_mm": float(moved),
    "left": [n for n in [*dir(bpy.types), *sys.modules] if n.startswith(("HEADSHOP", "bl_ext.user_default.h"))],
    "property": hasattr(bpy.types.Object, "headshop"),
}))
"""


def _install(path: Path, settings: Path, *python_path) -> dict:
    """Install a zip in a process of its own, use it, disable it."""
    environment = os.environ | {"BLENDER_USER_RESOURCES": str(settings)}
    command = [sys.executable, "-c", _INSTALL, str(path), *map(str, python_path)]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, cwd=settings, timeout=300)
    results = [line for line in done.stdout.splitlines() if line.startswith("RESULT ")]
    assert results, done.stdout + done.stderr
    return json.loads(results[0].removeprefix("RESULT "))


def test_blender_installs_the_light_zip_runs_it_and_forgets_it(light_zip, tmp_path):
    result = _install(light_zip, tmp_path)
    assert result["moved_mm"] > 0.1
    assert result["left"] == [] and result["property"] is False


def test_blender_installs_the_zip_with_wheels_and_computes_with_them(blender, packaging, tmp_path):
    wheels = [packaging.WHEELS / name for name in packaging.read_lock() if "manylinux" in name or "-any." in name]
    if sys.platform != "linux" or not all(wheel.is_file() for wheel in wheels):
        pytest.skip("the wheels for this platform are not downloaded: run make extension")
    (path,) = packaging.build(tmp_path / "zips", wheels, ["linux-x64"])
    assert _top(path) == ALLOWED
    inside = {Path(name).name for name in zipfile.ZipFile(path).namelist() if name.endswith(".whl")}
    assert inside == {wheel.name for wheel in wheels}
    settings = tmp_path / "settings"
    settings.mkdir()
    _install(path, settings)
    (unpacked,) = (settings / "extensions" / ".local" / "lib").glob("python*/site-packages")
    result = _install(path, settings, unpacked)  # now with the bundled libraries before the environment's
    assert result["scipy"][0] == "1.15.3" and result["scipy"][1].startswith(str(unpacked))
    assert result["moved_mm"] > 0.1 and result["repacked"] == ["FINISHED"]
