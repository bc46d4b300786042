# SPDX-License-Identifier: GPL-3.0-or-later
"""Scan and landmarks in, a whole head out (Kähler et al. 2002, section 6)."""

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np

from ..anatomy.head import Head, require_head
from ..anatomy.landmark_names import SKIN
from ..detail.detail_map import DetailMaps
from ..detail.maps import SIZE, detail_maps, require_size
from ..errors import InputError
from ..mesh import Mesh, require_surface
from ..mesh_subdivision import drawn, smoother
from ..progress import Progress, Work, portion
from ..relax.choice import kept_open, neutral_of, require_choice, smiles_closed
from .bone import depth_under
from .closest import Surface
from .fit_sentence import FITTED, MOST, SMILES_CLOSED, doubts, fit_sentence, fitted_shares, invented
from .follow import follow
from .gate import check_against_scan, check_arrangement, check_likeness, check_on_face, check_on_surface, doubted
from .landmarks import usable
from .rest import BONES, rest_of
from .scan_surface import near_head, to_leave_out, without_cuts, without_jumps
from .skin_fit import SkinFit, fit_skin
from .skin_groups import group
from .vestibules import vestibules

REACH = 20.0  # mm: bone deeper under the skin than this is not measured
POOR = 5.0  # mm: a mean distance in the face above which the fit is refused
LITTLE = 0.08  # share of the face that must have data
WITHIN = 1.0  # mm: skin counts as lying on the scan


@dataclass(frozen=True, eq=False)
class BuildResult:
    """What `build_head` returns.

    head : the fitted head, in the scan's own place (mm)
    fit : mean_mm, p95_mm, max_mm (skin to scan, where the face has data), coverage (share of the face with data),
        landmark_mean_mm (given landmarks, but for those on a beard, to the skin's own), the share ``within_1mm``, what was
        ``invented`` and the ``sentence`` that says all this; ``doubted_mm``, of landmarks picked where the face in the scan
        has them not, how far they are off; ``advice``, what else could be done, or None
    anatomy : muscles (count), skull_penetrations (bone vertices outside the skin), tissue_thickness_mm
    landmarks_missing : names of landmarks that were not given
    attributes : per skin vertex (n,) float32: ``fitted`` 0..1 (0: invented by the warp), ``distance_mm`` to the scan
        (positive outside, NaN where there is no data); and (n,) bool ``hidden``: scalp without data, and skin under hair,
        under a beard or behind what the lips hold; ``clothed``: skin under clothing
    detail : displacement and normal map of what is finer than the mesh; None if not asked for
    scanned : (n, 3) mm, the head's skin with the expression that it was scanned with; None where it was not relaxed
    """

    head: Head
    fit: dict
    anatomy: dict
    landmarks_missing: tuple[str, ...]
    attributes: dict[str, np.ndarray] = field(default_factory=dict)
    detail: DetailMaps | None = None
    scanned: np.ndarray | None = None


def build_head(
    reference: Head,
    scan: Mesh,
    landmarks: dict[str, np.ndarray],
    detail: int = SIZE,
    relax: str = "auto",
    leave_out: str = "auto",
    found: Collection[str] = (),
) -> Work:
    """Work returning the `BuildResult` for a scan (mm, any place) with four or more ``landmarks`` (name -> mm).

    detail : texels along a side of the detail maps; 0 for none
    relax : ``auto`` makes a face neutral whose lips are parted (`sim.relax`), ``always`` any, ``never`` none. The figures
        in ``fit`` are those of the face as scanned.
    leave_out : ``auto`` leaves out of the scan what is no skin, all of `scan_surface.NO_SKIN`, ``never`` nothing, names of
        these with commas between just those (`scan_surface.to_leave_out`)
    found : names of the landmarks that nobody picked: the skin is held to them more loosely

    Raises
    ------
    InputError : the reference is no head; the scan is no surface; the landmarks are no places, too few, do not form a
        face, or do not belong to this scan; or no good fit was found.
    """
    from ..landmarks.first_look import first_look

    require_head(reference)
    require_surface(scan)
    given = usable(landmarks, "The landmark set")
    require_choice(relax)
    require_size(detail)
    out = to_leave_out(leave_out)
    yield Progress(0.0, "Looking at the scan")
    whole = near_head(reference, scan, given)
    smooth = without_jumps(whole) if "depth_jumps" in out else whole
    target = without_cuts(smooth) if "flat_ends" in out else smooth
    yield Progress(0.05, "Judging the landmarks")
    check_against_scan(given, target)
    check_arrangement(reference.landmark_positions(), given, found)
    yield Progress(0.08, "Judging the landmarks")
    check_on_surface(given, target)
    look = yield from portion(first_look(reference, target, given, out, found, scan), 0.1, 0.3)
    picked = {n: p for n, p in given.items() if n not in found}
    check_on_face(picked, look.laid, target)
    fit = yield from portion(fit_skin(reference, look.filled, look.landmarks, look.lips, found, look.guessed), 0.3, 0.6)
    fit = look.seen_only(fit)
    yield Progress(0.6, "Judging the fit")
    refuse_poor(fit_report(reference, fit, given))
    check_likeness(fit.reference, fit.cage, fit.fitted.fitted)
    yield Progress(0.62, "Relaxing the face")
    neutral = neutral_of(fit, relax)
    skin = fit.cage if neutral is None else neutral.skin
    nostrils = vestibules(rest_of(fit.lips_closed), fit.cage, fit.target)
    followed = yield from portion(follow(fit.lips_closed, skin, fit.unseen, nostrils), 0.63, 0.85)
    yield Progress(0.85, "Checking the anatomy")
    head = followed.head
    scanned = head.skin.vertices + (fit.cage - skin)
    report = fit_report(reference, fit, {n: p for n, p in given.items() if n in look.landmarks}, scanned)
    shares = fitted_shares(head, fit.fitted.fitted)
    report["invented"] = invented(shares)
    jumps, ends = (float(before.area.sum() - after.area.sum()) for before, after in ((whole, smooth), (smooth, target)))
    report["left_out_mm2"] = {"depth_jumps": jumps, "flat_ends": ends} | look.left_out
    report["sentence"] = fit_sentence(report, report["invented"])
    if neutral is not None and relax == "never":
        head, neutral = kept_open(fit.lips_closed, head, scanned, neutral.jaw), None
    report["relaxed"] = None if neutral is None else neutral.report
    told = relax == "auto" and neutral is None and shares.get("lips", 1.0) > MOST  # lips that are seen tell of a smile
    report["doubted_mm"] = doubted({n: p for n, p in picked.items() if n in look.landmarks}, look.laid)
    smiles = SMILES_CLOSED if told and smiles_closed(fit) else ""
    report["advice"] = " ".join(filter(None, (doubts(report["doubted_mm"]), smiles))) or None
    yield Progress(0.87, "Checking the anatomy")
    anatomy = anatomy_report(head)
    missing = tuple(n for n in SKIN if n not in given)
    attributes = {
        "fitted": fit.fitted.fitted.astype(np.float32),
        "distance_mm": fit.fitted.distance.astype(np.float32),
        "hidden": fit.unseen | np.isin(np.arange(len(fit.cage)), look.hidden),
        "clothed": np.isin(np.arange(len(fit.cage)), look.clothed) & (fit.fitted.fitted < FITTED),
    }
    maps = None
    if detail and head.skin.uv is not None:
        maps = yield from portion(
            detail_maps(head.skin.moved(scanned), fit.target, group(head, "inner"), detail), 0.88, 1.0
        )
        report["detail"] = maps.report
    return BuildResult(head, report, anatomy, missing, attributes, maps, None if neutral is None else scanned)


def fit_report(reference: Head, fit: SkinFit, given, cage=None) -> dict:
    """Distances from the skin to the scan in the face, mm, where there is data; see `BuildResult`.

    They are those of the surface as drawn of ``cage`` (n, 3) mm, which is that of ``fit`` if none is given.
    """
    skin = reference.skin
    n = len(skin.vertices)
    rows, quads = smoother(skin.faces, n)
    face = (group(reference, "face") > 0.5) & (group(reference, "inner") <= 0.5)
    inside = np.where(skin.faces >= 0, face[skin.faces], True).all(axis=1)
    quads = quads[inside[quads.max(axis=1) - (rows.shape[0] - len(skin.faces))]]
    vertices = rows @ (fit.cage if cage is None else cage)
    corners = vertices[quads]
    area = np.linalg.norm(np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]), axis=1)
    found = fit.target.closest(corners.mean(axis=1), 10.0)
    data = found.found & ~found.border
    distance, weight = found.distance[data], area[data]
    marks = reference.landmarks.on({"skin": vertices[:n]})
    off = [float(np.linalg.norm(marks[n] - p)) for n, p in given.items() if n in marks]
    if len(distance) == 0:
        distance, weight = np.array([np.inf]), np.ones(1)
    order = np.argsort(distance)
    share = np.cumsum(weight[order]) / weight.sum()
    return {
        "mean_mm": float(np.average(distance, weights=weight)),
        "p95_mm": float(distance[order][np.searchsorted(share, 0.95)]),
        "max_mm": float(distance.max()),
        "coverage": float(area[data].sum() / area.sum()) if area.sum() else 0.0,
        "within_1mm": float(weight[distance <= WITHIN].sum() / weight.sum()),
        "landmark_mean_mm": float(np.mean(off)) if off else 0.0,
    }


def refuse_poor(report: dict) -> None:
    """Raise `InputError` for a fit that missed the scan."""
    if report["coverage"] < LITTLE:
        raise InputError(
            f"Only {report['coverage']:.0%} of the face lies near the scan: check that scan and landmarks belong "
            "together, and that the scan shows a face."
        )
    if report["mean_mm"] > POOR:
        raise InputError(
            f"The fitted skin lies {report['mean_mm']:.1f} mm from the scan on average: check the landmarks, above all "
            "their sides, or add more of them."
        )


def anatomy_report(head: Head) -> dict:
    """Count of muscles, bone vertices outside the skin, and the median tissue over the bone that faces the skin, mm."""
    surface = Surface(drawn(head.skin.faces, head.skin.vertices), head.skin.triangles)
    outside, thickness = 0, []
    for name in BONES:
        depth, _ = depth_under(head.parts[name].vertices, surface, REACH)
        outside += int((depth < -0.05).sum())
        thickness.append(depth[depth < REACH])
    thickness = np.concatenate(thickness) if thickness else np.zeros(0)
    return {
        "muscles": len(head.muscles),
        "skull_penetrations": outside,
        "tissue_thickness_mm": {
            "min": float(thickness.min()) if len(thickness) else None,
            "median": float(np.median(thickness)) if len(thickness) else None,
        },
    }
