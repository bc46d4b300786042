# SPDX-License-Identifier: GPL-3.0-or-later
"""Build the Blender extension: ``dist/headshop-<version>-<platform>.zip`` with wheels, and one zip without.

    python packaging/build_extension.py                 all zips
    python packaging/build_extension.py --no-wheels     only the zip without wheels (nothing is downloaded)
    python packaging/build_extension.py --write-lock    download and write wheels.lock anew

The wheels come from the package index, are checked against ``wheels.lock`` and kept in ``wheels/``. The zips are made
by Blender's own extension builder, which the ``bpy`` wheel contains and which runs without Blender.
"""

import argparse
import hashlib
import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LOCK = Path(__file__).resolve().with_name("wheels.lock")
WHEELS = ROOT / "wheels"
REQUIREMENTS = ("scipy==1.15.3", "threadpoolctl==3.8.0", "xatlas==0.0.11")
PYTHONS = ("3.11", "3.13")
#: Blender's name of a platform -> wheel platform tags its oldest supported systems accept.
PLATFORMS = {
    "linux-x64": ("manylinux_2_17_x86_64", "manylinux2014_x86_64", "manylinux_2_28_x86_64"),
    "windows-x64": ("win_amd64",),
    "macos-x64": ("macosx_10_13_x86_64", "macosx_10_14_x86_64", "macosx_11_0_x86_64"),
    "macos-arm64": ("macosx_11_0_arm64", "macosx_12_0_arm64"),
}


def builder() -> Path:
    """Blender's extension builder inside the installed bpy wheel; $HEADSHOP_BLENDER_EXT overrides."""
    if override := os.environ.get("HEADSHOP_BLENDER_EXT"):
        return Path(override)
    spec = importlib.util.find_spec("bpy")
    if spec is None:
        sys.exit("build_extension: the builder is part of bpy: run this with the Python of an environment that has bpy")
    found = sorted(Path(spec.origin).parent.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py"))
    if not found:
        sys.exit(f"build_extension: no blender_ext.py under {Path(spec.origin).parent}")
    return found[-1]


def read_lock() -> dict[str, str]:
    """Wheel file name -> sha256."""
    lines = (line.split() for line in LOCK.read_text().splitlines() if line and not line.startswith("#"))
    return {name: digest for digest, name in lines}


def sha256(path: Path) -> str:
    """Hexadecimal digest of a file."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def download(folder: Path) -> None:
    """Fetch every wanted wheel into ``folder`` with pip, for all Pythons and platforms."""
    for python in PYTHONS:
        for platform, tags in PLATFORMS.items():
            print(f"downloading wheels for Python {python} on {platform}", flush=True)
            command = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps"]
            command += ["--only-binary=:all:", "--implementation", "cp", "--python-version", python]
            command += [part for tag in tags for part in ("--platform", tag)]
            subprocess.run([*command, "--dest", str(folder), *REQUIREMENTS], check=True)


def locked_wheels() -> list[Path]:
    """The wheels of the lock file, downloaded where needed and checked."""
    lock = read_lock()
    WHEELS.mkdir(exist_ok=True)
    if any(not (WHEELS / name).is_file() for name in lock):
        download(WHEELS)
    for name, digest in lock.items():
        if not (WHEELS / name).is_file():
            sys.exit(
                f"build_extension: pip did not find {name} of wheels.lock: run with --write-lock and review the change"
            )
        if sha256(WHEELS / name) != digest:
            sys.exit(
                f"build_extension: {WHEELS / name} is not the file of wheels.lock (sha256 differs): delete it and retry"
            )
    return [WHEELS / name for name in lock]


def write_lock() -> None:
    """Download all wheels anew and write their digests."""
    with tempfile.TemporaryDirectory() as folder:
        download(Path(folder))
        wheels = sorted(Path(folder).glob("*.whl"))
        LOCK.write_text(
            "# sha256 and file name of every bundled wheel; written by build_extension.py --write-lock\n"
            + "".join(f"{sha256(wheel)}  {wheel.name}\n" for wheel in wheels)
        )
        WHEELS.mkdir(exist_ok=True)
        for wheel in wheels:
            shutil.copy(wheel, WHEELS / wheel.name)
    print(f"{LOCK}: {len(wheels)} wheels")


def stage(folder: Path, wheels: list[Path], platforms=tuple(PLATFORMS)) -> Path:
    """A copy of the checkout in ``folder``, its manifest naming ``wheels`` if there are any.

    What git ignores is left behind, so environments and outputs never reach a zip; without git (a source archive) the
    manifest's exclude patterns decide alone.
    """
    source = folder / "headshop"
    listed = subprocess.run(
        ["git", "-C", str(ROOT), "ls-files", "-coz", "--exclude-standard"], capture_output=True, text=True
    )
    if listed.returncode == 0 and listed.stdout:
        for name in filter(None, listed.stdout.split("\0")):
            if (ROOT / name).is_file():
                (source / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, source / name)
    else:
        ignored = shutil.ignore_patterns(".*", "dist", "build", "out", "wheels", "__pycache__", "*.egg-info")
        shutil.copytree(ROOT, source, ignore=ignored)
    if wheels:
        (source / "wheels").mkdir()
        for wheel in wheels:
            shutil.copy(wheel, source / "wheels" / wheel.name)
        manifest = source / "blender_manifest.toml"
        names = ",\n".join(f'    "./wheels/{wheel.name}"' for wheel in wheels)
        supported = ", ".join(f'"{name}"' for name in platforms)
        head, separator, tail = manifest.read_text().partition("\n[permissions]")
        manifest.write_text(f"{head}\nplatforms = [{supported}]\nwheels = [\n{names},\n]\n{separator}{tail}")
    return source


def build(destination: Path, wheels: list[Path], platforms=tuple(PLATFORMS)) -> list[Path]:
    """Run Blender's builder; the zips appear in ``destination`` only when all of them are complete."""
    version = tomllib.loads((ROOT / "blender_manifest.toml").read_text())["version"]
    with tempfile.TemporaryDirectory() as folder:
        source, out = stage(Path(folder), wheels, platforms), Path(folder) / "out"
        out.mkdir()
        command = [sys.executable, str(builder()), "build", "--source-dir", str(source)]
        if wheels:
            command += ["--output-dir", str(out), "--split-platforms"]
        else:
            command += ["--output-filepath", str(out / f"headshop-{version}-nowheels.zip")]
        result = subprocess.run(command, capture_output=True, text=True)
        if result.returncode:
            sys.exit(f"build_extension: Blender's builder failed:\n{result.stdout}{result.stderr}")
        destination.mkdir(parents=True, exist_ok=True)
        made = []
        for path in sorted(out.glob("*.zip")):
            shutil.move(path, destination / path.name)
            made.append(destination / path.name)
    return made


def main(argv=None) -> int:
    """Command line of this script."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "dist", help="folder for the zips (dist)")
    parser.add_argument("--no-wheels", action="store_true", help="only the zip without wheels")
    parser.add_argument("--write-lock", action="store_true", help="download the wheels and write wheels.lock")
    arguments = parser.parse_args(argv)
    if arguments.write_lock:
        write_lock()
        return 0
    made = build(arguments.output, [])
    if not arguments.no_wheels:
        made += build(arguments.output, locked_wheels())
    for path in made:
        print(f"{path}  {path.stat().st_size / 1e6:.1f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
