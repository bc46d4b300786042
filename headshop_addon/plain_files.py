# SPDX-License-Identifier: GPL-3.0-or-later
"""The plain files of an export folder: their names, and those of them that are JSON."""

import json

from ..sim.anatomy.head import Head
from ..sim.anatomy.storage import write_atomically

#: Everything an export folder may hold; ``shapes.npz`` only once something was baked, ``performance.npz`` only once a
#: performance was, the maps only of a head that has them, ``skin_as_scanned.ply`` only where an expression was taken away.
FILES = (
    *("skin.ply", "skin_as_scanned.ply", "skull.ply", "mandible.ply"),
    *("landmarks.json", "skull_landmarks.json", "muscles.json", "report.json"),
    *("shapes.npz", "performance.npz", "displacement.png", "normal.png"),
)


def muscles_document(head: Head) -> dict:
    """Muscle name -> {type, origin, points, width}: its fixed end, its middle line from there on, its width; mm."""
    return {
        m.name: {
            "type": m.kind,
            "origin": m.path[0].round(4).tolist(),
            "points": m.path.round(4).tolist(),
            "width": float(m.width),
        }
        for m in head.muscles
    }


def write_json(path, document) -> None:
    """Write JSON, whole or not at all."""
    write_atomically(path, (json.dumps(document, indent=1) + "\n").encode())
