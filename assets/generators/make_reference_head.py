# SPDX-License-Identifier: GPL-3.0-or-later
"""Make ``assets/reference_head.npz`` anew: ``python -m headshop.assets.generators.make_reference_head [FILE]``.

The skin comes first; bone, eyes, teeth, tongue and muscles are grown under it. Same code, same bytes: see `steps`.
"""

import sys

from ...sim.anatomy.head import Head
from ...sim.anatomy.storage import REFERENCE, save_head
from ...sim.progress import finish
from .anatomy import make_anatomy
from .skin import make_skin
from .steps import rounded, stepped


def make_reference_head() -> Head:
    """The reference head, mm, in its standard posture (origin midway between the tragia, Frankfurt horizontal)."""
    skin = make_skin()
    mesh, groups = rounded(skin.mesh), stepped(skin.groups)
    anatomy = finish(make_anatomy(mesh, groups, stepped(skin.landmarks.on({"skin": mesh.vertices}))))
    return Head(
        parts={"skin": mesh, **anatomy.parts},
        groups=groups,
        landmarks=skin.landmarks,
        skull_landmarks=anatomy.skull_landmarks,
        feature_mesh=skin.feature_mesh,
        muscles=anatomy.muscles,
        jaw=anatomy.jaw,
        eyes=anatomy.eyes,
    )


def main(argv: list[str]) -> int:
    """Write the reference head to the file named, or in its place in the package."""
    save_head(make_reference_head(), argv[0] if argv else REFERENCE)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
