# SPDX-License-Identifier: GPL-3.0-or-later
"""A head's response rig from the head alone: sample, fit, and measure on poses that were no samples."""

import numpy as np

from ..anatomy.head import Head
from ..progress import Progress, Work, portion
from ..tissue.model import build_model
from .accuracy import KINDS, measured
from .fit import fit_rig
from .mirror import opposite_vertices
from .rig import Rig
from .sampling import COUNTS, drawn_poses, sampled, single_poses


def build_rig(head: Head, care: str = "normal", seed: int = 0, unseen: int = 2) -> Work:
    """The `Rig` of ``head`` and what `accuracy.measured` says of it on ``unseen`` poses of each kind and on the expressions
    (0: nothing).

    care : of `sampling.COUNTS`
    """
    yield Progress(0.0, "Building the tissue")
    model = build_model(head)
    names = model.muscle_names
    poses = drawn_poses(names, COUNTS[care], np.random.default_rng(seed))
    border = 0.75 if unseen else 0.83
    samples = yield from portion(sampled(model, poses), 0.01, border)
    rig: Rig = yield from portion(
        fit_rig(model, samples, len(single_poses(names)), opposite_vertices(head)), border, border + 0.17
    )
    report = {}
    if unseen:
        report = yield from portion(measured(rig, model, (*KINDS, "expressions"), unseen), border + 0.17, 1.0)
    return rig, report
