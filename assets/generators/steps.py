# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers in steps: the last bits differ from one processor's linear algebra to another's, so none are kept.

What is built on such numbers makes many choices (which triangle is nearest, what is inside): they must be the same.
"""

from dataclasses import fields, is_dataclass, replace

import numpy as np

from ...sim.mesh import Mesh

#: Digits of a millimetre that are kept.
DIGITS = 5


def rounded(mesh: Mesh) -> Mesh:
    """``mesh`` with positions in steps of 10 nm and texture coordinates in millionths."""
    uv = None if mesh.uv is None else np.round(mesh.uv.astype(float), 6).astype(np.float32)
    return replace(mesh, vertices=np.round(mesh.vertices, DIGITS), uv=uv)


def stepped(value):
    """Numbers, arrays, dictionaries or dataclasses of them, in steps of 10 nm (or a hundred-thousandth)."""
    if isinstance(value, dict):
        return {name: stepped(item) for name, item in value.items()}
    if isinstance(value, tuple):
        return tuple(stepped(item) for item in value)
    if is_dataclass(value):
        return replace(value, **{f.name: stepped(getattr(value, f.name)) for f in fields(value)})
    return np.round(value, DIGITS)
