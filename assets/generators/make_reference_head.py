# SPDX-License-Identifier: GPL-3.0-or-later
"""Make ``assets/reference_head.npz`` anew: ``python -m headshop.assets.generators.make_reference_head [FILE]``.

The skin comes first; bone, eyes, teeth, tongue and muscles are grown under it. Same code, same bytes: positions are
rounded so that the last bits, which differ from one processor's linear algebra to another's, are not kept.
"""

import sys
from dataclasses import replace

import numpy as np

from ...sim.anatomy.head import Head
from ...sim.anatomy.storage import REFERENCE, save_head
from ...sim.mesh import Mesh
from ...sim.progress import finish
from .anatomy import make_anatomy
from .skin import make_skin

#: Digits of a millimetre that are kept.
DIGITS = 5


def make_reference_head() -> Head:
    """The reference head, mm, in its standard posture (origin midway between the tragia, Frankfurt horizontal)."""
    skin = make_skin()
    landmarks = skin.landmarks.on({"skin": skin.mesh.vertices})
    anatomy = finish(make_anatomy(skin.mesh, skin.groups, landmarks))
    parts = {"skin": skin.mesh, **anatomy.parts}
    return Head(
        parts={name: rounded(mesh) for name, mesh in parts.items()},
        groups=skin.groups,
        landmarks=skin.landmarks,
        skull_landmarks=anatomy.skull_landmarks,
        feature_mesh=skin.feature_mesh,
        muscles=anatomy.muscles,
        jaw=anatomy.jaw,
        eyes=anatomy.eyes,
    )


def rounded(mesh: Mesh) -> Mesh:
    """``mesh`` with positions in steps of 10 nm and texture coordinates in millionths."""
    uv = None if mesh.uv is None else np.round(mesh.uv.astype(float), 6).astype(np.float32)
    return replace(mesh, vertices=np.round(mesh.vertices, DIGITS), uv=uv)


def main(argv: list[str]) -> int:
    """Write the reference head to the file named, or in its place in the package."""
    save_head(make_reference_head(), argv[0] if argv else REFERENCE)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
