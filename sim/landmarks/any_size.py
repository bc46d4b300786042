# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces in scans of no known unit: looked for at every size that a person's may have, then brought to that of most people."""

from dataclasses import replace

from ..adapt.closest import Surface
from ..adapt.scan_surface import NORMALS
from ..anatomy.head import Head
from ..mesh import Mesh
from ..progress import Work, portion
from ..scan.face_match import surface_samples
from ..scan.units import SMALLEST, is_human, sizes_to_try
from .infant import infant_space
from .looking import lies, looked
from .looks import ANY_SIZE, PLAIN, THOROUGH, WHOLE
from .shape_space import ShapeSpace
from .verdict import ODD, judged, share_of

FURTHER = 2  # sizes at which a face is looked for again if it was not seen at first


def face_of_any_size(mesh: Mesh, reference: Head, space: ShapeSpace, template, unit_scales, or_infant) -> Work:
    """Work returning what a quick look sees of a face in a scan that none of ``unit_scales``, mm per unit, makes a person's: mm
    per unit with which it is as large as most, or None, and mm per unit to look at more closely, likeliest first.

    Only what is plainly a whole face counts, because more is tried than where the unit is known: nine heads were .8 to
    3.3 bad with likenesses of .73 and more, babies 5.4; 25 animals, machine parts and other things 11 and more, in a
    longer look.
    """
    scales = sizes_to_try(surface_samples(mesh))
    seen = yield from portion(looked(ANY_SIZE, mesh, reference, space, template, scales, 0.9), 0.0, 0.9)
    seen.sort(key=lambda t: t[0])
    closer = list(dict.fromkeys(scale for _, scale, *_ in seen))[:FURTHER]
    for result in seen:
        verdict, scale, fit, _, space = result
        if verdict.doubtful or verdict.likeness < PLAIN or verdict.bad > ODD or share_of(space, fit) < WHOLE:
            continue
        for unit in unit_scales:
            size = lies(space, fit).scale * unit / scale
            if (yield from portion(of_human_size(reference, result, size, or_infant), 0.9, 1.0)):
                return None, closer
        return of_most(result), closer
    return None, closer


def of_human_size(reference: Head, result, size: float, or_infant) -> Work:
    """Work returning whether a head of ``size``, of the reference's, is a person's, if ``result``, one of those of `looked`, is
    its face; ``or_infant`` : Work of a result returning another if that, an infant's, is so many times as bad or less.

    A head as small as a baby's is one if it is no worse as a baby's of most babies' size than as a grown one of theirs:
    MakeHuman's babies are .86 to .91 times as bad so, grown heads .94 to 1.4.
    """
    *_, fit, _, space = result
    if space.of_infants or is_human(size) or not is_human(size, SMALLEST):
        return is_human(size, SMALLEST)
    own = lies(space, fit).scale
    grown = resized(reference, result, space.size / own)
    baby = resized(reference, result, infant_space(reference, space).size / own)
    rival = (grown[0], *baby[1:])
    return (yield from or_infant(rival, 1.0)) is not rival


def resized(reference: Head, result, factor: float):
    """``result``, one of those of `looked`, as it were if the scan were ``factor`` times as large."""
    _, scale, fit, target, space = result
    pose = replace(fit.pose, scale=factor * fit.pose.scale, shift=factor * fit.pose.shift)
    fit = replace(fit, points=factor * fit.points, distance=factor * fit.distance, pose=pose)
    verdict = judged(reference, space, fit, THOROUGH.relief)
    return verdict, factor * scale, fit, Surface(factor * target.vertices, target.triangles, NORMALS), space


def of_most(result) -> float:
    """mm per unit with which the head of ``result``, one of those of `looked`, is as large as most heads are."""
    _, scale, fit, _, space = result
    return float(scale * space.size / lies(space, fit).scale)
