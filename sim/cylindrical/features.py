# SPDX-License-Identifier: GPL-3.0-or-later
"""The feature search in the Laplacian field of a range map (Lee, Terzopoulos and Waters 1995, section 2.2, steps 1 to 6).

Each feature of the generic map is looked for around where the generic head has it, by the pattern of creases and edges
around it, and springs between neighbouring features (step 7) weigh what is found against how faces are arranged.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.signal import correlate
from scipy.spatial import cKDTree

from ..adapt.completion import complete_positions
from ..anatomy.head import Head
from ..anatomy.landmark_names import SKIN, mirrored
from ..mesh import Mesh
from ..progress import Progress, Work, portion
from .canonical import Canonical, canonical, drawn_skin, generic
from .grid_mesh import to_mesh
from .laplacian import second_differences
from .pose import Pose, find_pose
from .range_map import RangeMap

#: Smoothing of the fields, mm: lids and lips are told by the fine one, chin and brows by the coarse.
SCALES = (2.2, 5.0)
#: Reach of the search in each round, texels; half the size of the pattern around a feature by its kind, texels.
REACHES = (11, 8)
SMALL, BROAD = 7, 13
BROAD_MARKS = {"g", "pg", "gn"} | {f"{n}_{s}" for n in ("or", "os", "sci") for s in "lr"}
EAR_MARKS = {f"{n}_{s}" for n in ("t", "sa", "sba", "pra", "pa", "obs", "obi") for s in "lr"}
#: Features that no crease or edge tells: they go where the springs pull them.
VAGUE = {"v", "op", "tr"} | {f"{n}_{s}" for n in ("eu", "ft", "zy", "go") for s in "lr"}
#: How much of its spring ties a feature to its mirror image.
TWIN = 0.1
#: Texels within which features shift alike at first, and the likeness lost per texel squared of that shift.
GROUP, FAR = 20.0, 0.0008
#: Size of a generic feature arrangement that holds against stretching, mm.
STIFF = 12.0
#: How far the search and the expected place may be off, mm: see `_in_depth`.
STRAY, DEEP = 1.5, 4.0
#: Features of the midline that must lie between two others: the contours of lips and chin (steps 2 to 4).
BETWEEN = (("sn", "sto", "sl"), ("sn", "ls", "sto"), ("sto", "li", "sl"), ("sl", "pg", "gn"))
#: mm within which a feature that was carried over is put on the data.
NEAR = 15.0


@dataclass(frozen=True, eq=False)
class Features:
    """What was found of a face. All in the scan's place, mm.

    positions : landmark name -> (3,)
    confidence : landmark name -> 0..1
    in_void : names that lie where the map has no data (relaxed surface)
    pose : how the generic head lies on the scan
    maps : the scan's canonical maps; rows, columns : (k,) where the named landmarks (``names``) are in them
    """

    names: tuple[str, ...]
    rows: np.ndarray
    columns: np.ndarray
    positions: dict[str, np.ndarray]
    confidence: dict[str, float]
    in_void: tuple[str, ...]
    pose: Pose
    maps: Canonical


def find_features(range_map: RangeMap, reference: Head, pose: Pose | None = None, within: float = np.pi) -> Work:
    """Work returning the `Features` of the face in ``range_map``, its nose looked for ``within`` rad of longitude 0.

    Raises
    ------
    InputError : nothing in the map stands out as a nose does.
    """
    yield Progress(0.0, "Looking for the nose")
    pose = pose or find_pose(range_map, reference, within)
    return (yield from portion(search_features(to_mesh(range_map), reference, pose), 0.15, 1.0))


def search_features(mesh: Mesh, reference: Head, pose: Pose) -> Work:
    """Work returning the `Features` of the face of ``mesh`` (mm, turned any way), which is at ``pose`` or nearly so."""
    yield Progress(0.0, "Relaxing the voids")
    maps, pattern = canonical(mesh, reference, pose), generic(reference)
    at = reference.landmark_positions()
    names = tuple(name for name in SKIN if name in at)
    home = np.array([at[n] for n in names])
    yield Progress(0.5, "Looking for features")
    places, void, sure = _search(maps, pattern, names, pattern.full.texels(home), pose.apply(home), REACHES[0])
    for reach in REACHES[1:]:
        yield Progress(0.7, "Looking again")
        # the generic head made like the subject as far as it is known by now: what is left to find is less
        matrix, shift = stretched(pose, home, places, sure)
        pattern = canonical(drawn_skin(reference, lambda p, a=matrix, t=shift: p @ a.T + t), reference, pose)
        ahead = home @ matrix.T + shift
        places, void, sure = _search(maps, pattern, names, maps.full.texels(ahead), ahead, reach)
    places = _in_order(maps, names, home, places)
    places, rows, columns = _carried(maps, at, names, places, sure, void)
    confidence = {n: float(c) * (0.3 if v else 1.0) for n, c, v in zip(names, sure, void, strict=True)}
    in_void = tuple(n for n, v in zip(names, void, strict=True) if v)
    return Features(names, rows, columns, dict(zip(names, places, strict=True)), confidence, in_void, pose, maps)


def _search(maps: Canonical, pattern: Canonical, names, texels, ahead, reach):
    """One round: places (k, 3) mm, whether relaxed there (k,), how sure (k,); the generic head's ``texels`` are known."""
    rows, columns, _ = texels
    told = np.array([name not in VAGUE for name in names])
    score = _responses(maps, pattern, names, rows, columns, reach)
    move, sure = _settle(names, rows, columns, score)
    found = np.column_stack([rows, columns]) + np.where(told[:, None], move, 0)
    places, void = _in_depth(maps, found, ahead)
    return places, void, np.where(told, sure, 0.1)


def stretched(pose: Pose, home: np.ndarray, places: np.ndarray, sure: np.ndarray):
    """The affine map from the generic head to the scan that agrees with the features found: (3, 3) and (3,).

    Heads differ in height, width and depth; more than that is not asked of what was found, lest a feature in the wrong
    place makes a generic head that confirms it. Robust: a feature far from the others' agreement loses its say.
    """
    centre = home.mean(axis=0)
    base = np.column_stack([home - centre, np.ones(len(home))])
    start = np.vstack([pose.scale * pose.rotation.T, pose.apply(centre[None])])
    weight = sure.copy()
    for _ in range(6):
        left = (base * weight[:, None]).T @ base + weight.sum() * np.diag([STIFF**2] * 3 + [1e-6])
        rest = places - base @ start
        change = np.linalg.solve(left, (base * weight[:, None]).T @ rest)
        off = np.linalg.norm(rest - base @ change, axis=1)
        weight = sure / (1 + (off / 5.0) ** 2) ** 2
    matrix = start + change
    return matrix[:3].T, matrix[3] - matrix[:3].T @ centre


def _in_order(maps: Canonical, names, home, places):
    """Places (k, 3) with the middle of the lips and chin between what is above and below it, as on the generic head."""
    rows, columns, _ = maps.full.texels(places)
    at = {n: k for k, n in enumerate(names)}
    for upper, middle, lower in BETWEEN:
        a, b, c = at[upper], at[middle], at[lower]
        share = (home[b, 2] - home[a, 2]) / (home[c, 2] - home[a, 2])
        found = (rows[b] - rows[a]) / max(rows[c] - rows[a], 1e-6)
        if not 0.1 < found < 0.9:
            rows[b] = rows[a] + share * (rows[c] - rows[a])
            columns[b] = columns[a] + share * (columns[c] - columns[a])
            places = places.copy()
            places[b] = maps.full.place(rows[b], columns[b])
    return places


def _carried(maps: Canonical, home: dict, names, places, sure, void):
    """Places (k, 3) with the vague features carried over from the others (Kähler et al. 2002, 6.1) onto the data near by.

    Returns them with their rows and columns (k,).
    """
    given = {n: p for n, p, c, v in zip(names, places, sure, void, strict=True) if n not in VAGUE and c > 0.3 and not v}
    if len(given) >= 6:
        whole = complete_positions({n: home[n] for n in names}, given)
        data = maps.raw.points()[maps.raw.valid]
        vague = [k for k, n in enumerate(names) if n in VAGUE]
        places = places.copy()
        places[vague] = [whole[names[k]] for k in vague]
        distance, nearest = cKDTree(data).query(places[vague])
        near = distance < NEAR
        places[np.array(vague)[near]] = data[nearest[near]]
    rows, columns, _ = maps.full.texels(places)
    return places, rows, columns


def _in_depth(maps: Canonical, found: np.ndarray, ahead: np.ndarray):
    """Positions (k, 3) mm on the surface at texels ``found`` (k, 2), and whether it is relaxed there (k,).

    Where the surface is steep, as beside the nose, half a texel is several millimetres of depth: of the texels close by
    the one is taken whose place agrees with where the feature is expected, ``ahead`` (k, 3) mm.
    """
    step = np.arange(-4, 5) * 0.5
    di, dj = (x.ravel() for x in np.meshgrid(step, step, indexing="ij"))
    rows, columns = found[:, :1] + di, found[:, 1:] + dj
    known = maps.raw.sample(rows, columns)
    relaxed = maps.full.sample(rows, columns)
    any_data = np.isfinite(known[:, len(di) // 2])
    radius = np.where(any_data[:, None], known, relaxed)
    points = maps.full.place(rows, columns, radius)
    off = np.linalg.norm(points - ahead[:, None], axis=2)
    cost = (di**2 + dj**2) * 1.5**2 / STRAY**2 + (off / DEEP) ** 2
    best = np.where(np.isfinite(cost), cost, np.inf).argmin(axis=1)
    k = np.arange(len(found))
    return points[k, best], ~any_data


def fields(maps: Canonical) -> np.ndarray:
    """(h, w, 4) the second differences along longitude and height at the two `SCALES`, evened out by their root."""
    layers = []
    for scale in SCALES:
        for second in second_differences(maps.full, scale):
            curve = second * scale  # without unit; creases of a fine scale are sharper
            layers.append(np.sign(curve) * np.sqrt(np.abs(curve)))
    return np.stack(layers, axis=-1)


def _responses(maps: Canonical, pattern: Canonical, names, rows, columns, reach) -> np.ndarray:
    """(k, s, s) likeness in -1..1 of the subject's field to the generic's around each feature, per shift in texels."""
    mine, theirs = fields(maps), fields(pattern)
    trust = np.where(maps.raw.valid, 1.0, 0.12)
    trust_generic = np.where(pattern.raw.valid, 1.0, 0.0)
    s = 2 * reach + 1
    out = np.zeros((len(names), s, s))
    h, w = maps.full.shape
    for k, name in enumerate(names):
        if name in VAGUE:
            continue
        half = BROAD if name in BROAD_MARKS or name in EAR_MARKS else SMALL
        i0, j0 = int(round(rows[k])), int(round(columns[k]))
        d = np.arange(-half, half + 1)
        window = np.exp(-0.5 * (d[:, None] ** 2 + d**2) / (0.55 * half) ** 2)
        i, j = np.clip(i0 + d, 0, h - 1), np.mod(j0 + d, w)
        ours = theirs[np.ix_(i, j)]
        window = window * trust_generic[np.ix_(i, j)]
        big = np.arange(-half - reach, half + reach + 1)
        i, j = np.clip(i0 + big, 0, h - 1), np.mod(j0 + big, w)
        around, there = mine[np.ix_(i, j)], trust[np.ix_(i, j)]
        cross = correlate(around * there[..., None], ours * window[..., None], "valid", "fft")[..., 0]
        own = correlate((around**2).sum(axis=2) * there, window, "valid", "fft")
        other, weight = (correlate(there, x, "valid", "fft") for x in (window * (ours**2).sum(axis=2), window))
        like = cross / np.sqrt(np.maximum(own * other, 1e-12))
        out[k] = like * weight / max(window.sum(), 1e-9)
    return out


def _settle(names, rows, columns, score, sweeps: int = 24):
    """The shift (k, 2) texels of each feature that balances likeness and springs, and how sure it is (k,) 0..1.

    The springs are loosened step by step: first all go together, at the end each near to where it looks best. A feature
    and its counterpart on the other side are tied as mirror images.
    """
    place = np.column_stack([rows, columns])
    apart = np.linalg.norm(place[:, None] - place[None], axis=2)
    pull = np.exp(-0.5 * (apart / 14.0) ** 2) + 0.02
    np.fill_diagonal(pull, 0)
    strength = np.where([n in VAGUE for n in names], 0.05, 1.0) * np.maximum(score.max(axis=(1, 2)), 0.05)
    pull = pull * strength[None]
    pull /= pull.sum(axis=1, keepdims=True)
    index = {n: k for k, n in enumerate(names)}
    other = np.array([index.get(mirrored(n), index[n]) for n in names])
    reach = score.shape[1] // 2
    d = np.arange(-reach, reach + 1)
    di, dj = np.meshgrid(d, d, indexing="ij")
    # To begin with, where each feature and its neighbours together look best when all are shifted alike.
    among = np.exp(-0.5 * (apart / GROUP) ** 2) * strength[None]
    together = np.einsum("kj,jxy->kxy", among / among.sum(axis=1, keepdims=True), gaussian_filter(score, (0, 1.5, 1.5)))
    at = (together - FAR * (di**2 + dj**2)).reshape(len(names), -1).argmax(axis=1)
    move = np.column_stack([di.ravel()[at], dj.ravel()[at]]).astype(float)
    best = np.zeros(len(names))
    for sweep in range(sweeps):
        tie = 0.02 * (0.1 ** (sweep / (sweeps - 1)))  # likeness lost per texel squared off the neighbours' mean
        base = _affine(place, move, strength)
        goal = base + pull @ (move - base)
        goal = (1 - TWIN) * goal + TWIN * move[other] * [1.0, -1.0]
        cost = score - tie * ((di - goal[:, :1, None]) ** 2 + (dj - goal[:, 1:, None]) ** 2)
        at = cost.reshape(len(names), -1).argmax(axis=1)
        fresh = np.column_stack([di.ravel()[at], dj.ravel()[at]]).astype(float)
        fresh += _finer(cost, at)
        vague = score.max(axis=(1, 2)) <= 0
        fresh[vague] = goal[vague]
        move, best = fresh, score.reshape(len(names), -1)[np.arange(len(names)), at]
    return move, np.clip(best, 0.1, 1.0)


def _affine(place, move, weight):
    """(k, 2) the affine part of the shifts: heads differ in height and width."""
    base = np.column_stack([place - place.mean(axis=0), np.full(len(place), 30.0)])
    matrix = (base * weight[:, None]).T @ base + np.diag([3e3, 3e3, 30.0])
    return base @ np.linalg.solve(matrix, (base * weight[:, None]).T @ move)


def _finer(cost, at):
    """(k, 2) shift of the top of a parabola through the best value and its neighbours, within half a texel."""
    s = cost.shape[1]
    i, j = np.divmod(at, s)
    i, j = np.clip(i, 1, s - 2), np.clip(j, 1, s - 2)
    k = np.arange(len(at))
    out = np.zeros((len(at), 2))
    for axis, (low, high) in enumerate(
        ((cost[k, i - 1, j], cost[k, i + 1, j]), (cost[k, i, j - 1], cost[k, i, j + 1]))
    ):
        bend = low + high - 2 * cost[k, i, j]
        out[:, axis] = np.where(bend < -1e-9, (low - high) / np.where(bend < -1e-9, 2 * bend, 1), 0).clip(-0.5, 0.5)
    return out
