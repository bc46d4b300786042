# SPDX-License-Identifier: GPL-3.0-or-later
"""The files an engine-ready copy can be written to, and what stands beside them."""

from pathlib import Path

#: glTF and FBX hold their pictures, and so does USD's packed form; USD's other form refers to files beside it.
KINDS = (".glb", ".fbx", ".usdc", ".usdz")


def textures_folder(path) -> str | None:
    """Name of the folder beside an engine file that holds its pictures; None for kinds that hold them themselves."""
    path = Path(path)
    return f"{path.stem}_textures" if path.suffix.lower() == ".usdc" else None
