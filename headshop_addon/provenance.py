# SPDX-License-Identifier: GPL-3.0-or-later
"""What made a head, and how long it took: the ``versions`` and ``seconds`` of a report."""

import platform
import time
import tomllib
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np
import scipy


@contextmanager
def timed(seconds: dict, stage: str):
    """Add the seconds spent inside to ``seconds[stage]``."""
    start = time.perf_counter()
    try:
        yield
    finally:
        seconds[stage] = round(seconds.get(stage, 0.0) + time.perf_counter() - start, 3)


def versions() -> dict[str, str]:
    """What made a head: versions of Head Shop, Blender, Python, numpy and scipy."""
    return {
        "headshop": own_version(),
        "blender": bpy.app.version_string,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
    }


def own_version() -> str:
    """The version in the extension's manifest."""
    manifest = Path(__file__).resolve().parents[1] / "blender_manifest.toml"
    return tomllib.loads(manifest.read_text(encoding="utf-8"))["version"]
