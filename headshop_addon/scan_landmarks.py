# SPDX-License-Identifier: GPL-3.0-or-later
"""Landmarks kept on a scan object: read, place, forget, and let the rest follow those that were placed.

Positions are stored in the scan object's own space (metres, like its mesh) and handed out in mm. Those handed out are where
the mesh is now; those stored are brought there before anything is written (`mesh_follow`).
"""

import numpy as np

from ..sim.anatomy.landmark_names import SKIN
from . import mesh_follow
from .bridge import METRES

#: The order in which they are asked for: first what fixes place, size and tilt, then what shapes the face most.
ORDER = (
    *("prn", "ex_r", "ex_l", "ch_r", "ch_l", "gn", "n", "en_r", "en_l", "sn", "t_r", "t_l", "ls", "li", "sto", "pg"),
    *("al_r", "al_l", "sl", "g", "zy_r", "zy_l", "go_r", "go_l", "sci_r", "sci_l", "ps_r", "ps_l", "pi_r", "pi_l"),
    *("or_r", "or_l", "cph_r", "cph_l", "tr", "ft_r", "ft_l", "v", "op", "eu_r", "eu_l", "sa_r", "sa_l"),
    *("sba_r", "sba_l", "pra_r", "pra_l", "pa_r", "pa_l", "obs_r", "obs_l", "obi_r", "obi_l", "os_r", "os_l"),
    *("ac_r", "ac_l", "sbal_r", "sbal_l", "se"),
)
#: Landmarks needed before the others can follow, and before a head can be built.
ENOUGH_TO_FOLLOW = 3
ENOUGH_TO_BUILD = 4


def entries(scan) -> dict:
    """Landmark name -> its property on the scan; makes those that are not there yet and brings them to where the mesh is."""
    mesh_follow.settle(scan)
    stored = scan.headshop.landmarks
    if len(stored) != len(SKIN):
        known = {item.name: (tuple(item.co), item.state) for item in stored}
        stored.clear()
        for name in SKIN:
            item = stored.add()
            item.name = name
            item.co, item.state = known.get(name, ((0.0, 0.0, 0.0), "MISSING"))
    return {item.name: item for item in stored}


def positions(scan, *states: str) -> dict[str, np.ndarray]:
    """Landmark -> (3,) mm of those in the given states; without any, of the placed ones."""
    states = states or ("PLACED",)
    return _places(scan, {i.name: i.co for i in scan.headshop.landmarks if i.state in states})


def _places(scan, stored: dict) -> dict[str, np.ndarray]:
    """Name -> (3,) mm, where the mesh is now, of what is stored (3,) in the scan's own space."""
    gone = mesh_follow.change(scan)
    return {name: mesh_follow.moved(gone, np.array(co, dtype=float) / METRES) for name, co in stored.items()}


def put(scan, name: str, position, state: str = "PLACED") -> None:
    """Set one landmark, position (3,) in mm."""
    item = entries(scan)[name]
    item.co = np.asarray(position, dtype=float) * METRES
    item.state = state


def forget(scan, *names: str) -> None:
    """Take back the landmarks named, or all of them."""
    for name, item in entries(scan).items():
        if not names or name in names:
            item.state, item.confidence, item.mid_air = "MISSING", 0.0, False


def leave_out(scan, name: str) -> None:
    """Let a landmark count for nothing where a head is built; where the others let expect it is shown."""
    forget(scan, name)
    follow(scan)


def replace(scan, placed: dict, confidence: dict | None = None) -> None:
    """Forget all landmarks, place the given ones (mm) and let the others follow.

    confidence : name -> 0..1, of those among them that were found, not placed
    """
    forget(scan)
    for name, position in placed.items():
        there = (confidence or {}).get(name, 0.0)
        put(scan, name, position, "FOUND" if there else "PLACED")
        item = entries(scan)[name]
        item.found, item.confidence = item.co, there
    follow(scan)


def follow(scan) -> None:
    """Carry the landmarks that were not placed over from the reference head (Kähler 2002, 6.1).

    With fewer than three placed, or where these lie on a line, there is nothing to follow: the others become missing.
    """
    given = positions(scan)
    _follow_found(scan, given)
    given = to_build(scan)
    everything = _completed(given) if len(given) >= ENOUGH_TO_FOLLOW and not _on_a_line(given) else {}
    for name, item in entries(scan).items():
        if item.state not in ("PLACED", "FOUND"):
            item.state = "DERIVED" if name in everything else "MISSING"
            if name in everything:
                item.co = np.asarray(everything[name]) * METRES


def take_found(scan, found) -> None:
    """Store `sim.landmarks.find.FoundLandmarks`; those placed by hand stay and the found ones follow them."""
    for name, item in entries(scan).items():
        there = name in found.positions
        item.confidence = found.confidence[name] if there else 0.0
        item.mid_air = name in found.mid_air
        if there:
            item.found = np.asarray(found.positions[name]) * METRES
        if item.state != "PLACED":
            item.state = "FOUND" if there else "MISSING"
            item.co = item.found
    follow(scan)


def found(scan) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    """Where landmarks were found (mm) before any correction, and how surely, 0..1."""
    items = [item for item in scan.headshop.landmarks if item.confidence > 0]
    return _places(scan, {i.name: i.found for i in items}), {i.name: i.confidence for i in items}


def in_mid_air(scan) -> set[str]:
    """Found landmarks, not placed by hand, that lie where the scan shows nothing."""
    return {i.name for i in scan.headshop.landmarks if i.state == "FOUND" and i.mid_air}


def to_build(scan) -> dict[str, np.ndarray]:
    """Landmark -> (3,) mm of those that a head is built from: the placed, and the found ones that are sure enough."""
    from ..sim.landmarks.sure import SURE

    sure = {i.name for i in scan.headshop.landmarks if i.confidence >= SURE and not i.mid_air}
    return {n: p for n, p in positions(scan, "FOUND").items() if n in sure} | positions(scan)


def nobody_placed(scan) -> dict[str, float]:
    """Those of `to_build` that were found, not placed by hand: name -> confidence, 0..1."""
    used = to_build(scan)
    return {i.name: i.confidence for i in scan.headshop.landmarks if i.state == "FOUND" and i.name in used}


def _follow_found(scan, placed) -> None:
    from ..sim.landmarks.correction import follow_corrections

    positions_found, confidence = found(scan)
    if positions_found:
        moved = follow_corrections(positions_found, confidence, placed)
        for name, item in entries(scan).items():
            if item.state == "FOUND" and name in moved:
                item.co = moved[name] * METRES


def _completed(given: dict) -> dict:
    from ..sim.adapt.completion import complete_landmarks
    from ..sim.anatomy.storage import reference_head

    return complete_landmarks(reference_head(), given)


def _on_a_line(given: dict) -> bool:
    """Whether the points leave open how the head is turned about a line (thinner than a twentieth of its length)."""
    points = np.array(list(given.values()))
    extent = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(extent[1] < 0.05 * extent[0])


def most_useful(scan) -> list[str]:
    """Found landmarks that were not corrected, the one first whose correction helps most.

    Those in mid-air come last: there is nothing to click.
    """
    from ..sim.landmarks.correction import most_useful as ranked

    positions_found, confidence = found(scan)
    names = ranked(positions_found, confidence, positions(scan)) if positions_found else []
    return sorted(names, key=in_mid_air(scan).__contains__)


def snapshot(scan) -> tuple:
    """All landmarks as they are, for `restore`."""
    return tuple((i.name, tuple(i.co), i.state, i.confidence, i.mid_air) for i in entries(scan).values())


def restore(scan, taken: tuple) -> None:
    """Put back what `snapshot` took."""
    stored = entries(scan)
    for name, co, state, confidence, mid_air in taken:
        item = stored[name]
        item.co, item.state, item.confidence, item.mid_air = co, state, confidence, mid_air


def next_to_place(scan, skipped=(), chosen: str | None = None) -> str | None:
    """The landmark to ask for next: the chosen one, the one whose correction helps most, or the first in `ORDER`.

    Those placed or skipped are not asked for again.
    """
    stored = entries(scan)
    if chosen is not None:
        return chosen
    if useful := most_useful(scan):
        return next((n for n in useful if n not in skipped), None)
    return next((n for n in ORDER if stored[n].state != "PLACED" and n not in skipped), None)
