# SPDX-License-Identifier: GPL-3.0-or-later
"""Simulate jaw and muscles one by one on the reference head: ``assets/tables/expression_responses.npz``.

Where it is known how people's skin moves (`sim.relax.movement`), the table holds the mean of that and the simulation.

``python -m headshop.assets.generators.make_expression_responses`` after the reference head or the tissue has changed.
"""

import io
import sys

import numpy as np

from ...sim.acting.expressions import expressions
from ...sim.acting.pose import Pose, control
from ...sim.adapt.skin_fit import landmark_rows
from ...sim.anatomy.storage import REFERENCE, load_head, write_atomically
from ...sim.relax.bunching import fleshed
from ...sim.relax.movement import BY_LIPS, BY_MUSCLE, RAISED, measured, of_left, with_measured
from ...sim.relax.responses import MUSCLES, OPENINGS, TABLE, UNPAIRED, both_sides, mirrored_vertices
from ...sim.tissue.model import build_model
from ...sim.tissue.solver import rest_state, solve

ITERATIONS = 300
BROW = "orbicularis_oculi_orbital"  # what raises cheeks is its lower half, which acts alone; its upper lowers brows
PARTED = 0.5  # opening of the jaw at which the lips' points are told apart
STILL = 0.02  # mm: what moves less stays, so that the table packs well


def main(argv: list[str]) -> int:
    """Write the table anew, or to the file named."""
    head = load_head(REFERENCE)
    model = build_model(head)
    rest = rest_state(model).skin

    def moved(pose):
        field = solve(model, control(model, pose), max_iterations=ITERATIONS).state.skin - rest
        field = fleshed(head, field, pose.jaw_open)
        field[np.linalg.norm(field, axis=1) < STILL] = 0
        return field

    jaw = [moved(Pose(jaw_open=opening)) for opening in OPENINGS]
    muscles = [moved(Pose({name if name in UNPAIRED else f"{name}_l": 1.0})) for name in MUSCLES]
    muscles[MUSCLES.index(BROW)] *= below_eyes(head)[:, None]
    mirror = mirrored_vertices(head.skin.vertices)
    known = measured(head, head.skin.vertices + jaw[OPENINGS.index(PARTED)])
    joy = expressions()["joy"].muscles
    names, fields = both_sides(muscles, mirror)
    smile = sum(
        joy.get(name, 0.0) * field for name, field in zip(names, fields, strict=True) if not name.startswith(BROW)
    )
    raised = of_left(head, known["AU6"]) * below_eyes(head)[:, None] * RAISED / joy[f"{BROW}_l"]
    muscles[MUSCLES.index(BROW)] = with_measured(head, muscles[MUSCLES.index(BROW)], raised)
    for name, unit in BY_MUSCLE.items():
        k = MUSCLES.index(name)
        muscles[k] = with_measured(head, muscles[k], of_left(head, known[unit]))
    for unit, names in BY_LIPS.items():
        upper, lower = (MUSCLES.index(name) for name in names)
        way = known[unit] if names[0] in UNPAIRED else of_left(head, known[unit])
        share = share_of(muscles[upper], muscles[lower])[:, None]
        muscles[upper] = with_measured(head, muscles[upper], share * way)
        muscles[lower] = with_measured(head, muscles[lower], (1 - share) * way)
    chin = landmark_rows(head.landmarks, ["gn"], len(rest))
    as_far = [np.linalg.norm(chin @ field) / np.linalg.norm(chin @ known["AU27"]) for field in jaw]
    jaw = [with_measured(head, field, share * known["AU27"]) for field, share in zip(jaw, as_far, strict=True)]
    stream = io.BytesIO()
    np.savez_compressed(
        stream,
        jaw=np.array(jaw, dtype=np.float16),
        fields=np.array(muscles, dtype=np.float16),
        smile=np.array(with_measured(head, smile, known["AU12"]) - smile, dtype=np.float16),
        mirror=mirror,
    )
    write_atomically(argv[0] if argv else TABLE, stream.getvalue())
    return 0


def share_of(one, other) -> np.ndarray:
    """(n,) share that ``one`` of two muscles has in what both do, of how far either moves the skin (n, 3) mm."""
    first, second = (np.linalg.norm(field, axis=1) + STILL for field in (one, other))
    return first / (first + second)


def below_eyes(head) -> np.ndarray:
    """(n,) 1 on the skin below the outer corners of the eyes, 0 from half the eye's width above them on."""
    marks = head.landmark_positions()
    rise = (head.skin.vertices[:, 2] - marks["ex_l"][2]) / (np.linalg.norm(marks["ex_l"] - marks["en_l"]) / 2)
    return 1 - np.clip(rise, 0, 1)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
