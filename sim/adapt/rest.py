# SPDX-License-Identifier: GPL-3.0-or-later
"""How the parts of the reference head lie to each other: what following a warped skin needs to know, found once."""

from functools import cached_property, lru_cache

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..anatomy.head import Head
from ..mesh import edges
from ..mesh_subdivision import drawn
from . import bone
from .eyeballs import lid_contact
from .lid_contact import LidContact
from .met_lids import LidSlit
from .openings import rims, touching_lids
from .refine import scattered, thinned
from .skin_cover import SkinCover
from .skin_groups import group
from .smooth_system import laplacian
from .thin_plate_spline import System, ThinPlateSpline
from .untangle import sharp

BONES = ("skull", "mandible")
TEETH = ("teeth_upper", "teeth_lower")
SHUT = 8  # pairs of vertices of lids that lie on each other, from which on an eye is shut
MEET = 4.0  # mm: lips that close at rest lie on each other
COARSE = 14.0  # mm between centres of the warps, away from lids and lips
#: Parts that carry what lies between the surfaces, and mm between the points of each that do.
GAPS = (("skull", 18.0), ("mandible", 12.0), ("eye_l", 7.0), ("eye_r", 7.0), ("teeth_upper", 8.0), ("teeth_lower", 8.0))
BUSY = ("lip_upper", "lip_lower") + tuple(f"{x}_{s}" for x in ("lid_upper", "lid_lower", "nostril") for s in ("l", "r"))


@lru_cache(maxsize=2)
def rest_of(reference: Head) -> "Rest":
    """The `Rest` of a head, made once."""
    return Rest(reference)


class Rest:
    """A reference head and what is known of it.

    Attributes
    ----------
    head : the reference
    inner, rim (n,) bool : skin that no scanner sees; the skin at its edge that is seen
    outer (t, 3) : triangles of the skin that are seen
    energy, link (n, n) : bending energy of a displacement of the skin, and its neighbours
    folds : pairs of neighbouring triangles that turn back on each other
    lip_rim (k,) : vertices of the rim that are lips
    lip_pairs (k, 2) : vertices of upper and lower lip that lie on each other, each the other's nearest
    seen_pairs (k, 2) : those of them on the rim
    organs : ``eye_l``, ``eye_r``, ``mouth``, ``nostrils`` -> rows of the inner skin that belong to them
    behind (n,) int : how many edges behind the rim a vertex of the inner skin lies, 0 for what is seen
    needs : bone -> (k,) mm of tissue that must remain over each of its vertices
    from_teeth : bone -> (k,) mm from each of its vertices to the nearest tooth or gum
    """

    def __init__(self, reference: Head):
        self.head = reference
        skin = reference.skin
        n = len(skin.vertices)
        self.inner = group(reference, "inner") > 0.5
        self.rim = rims(reference)
        self.outer = skin.triangles[~self.inner[skin.triangles].any(axis=1)]
        bend = laplacian(skin.vertices, skin.faces)
        self.energy = (bend.T @ bend).tocsr()
        a, b = edges(skin.faces).T
        self.link = coo_matrix((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, a])), shape=(n, n)).tocsr()
        self.folds = frozenset(map(tuple, sharp(drawn(skin.faces, skin.vertices), skin.triangles).tolist()))
        lips = np.maximum(group(reference, "lip_upper"), group(reference, "lip_lower")) > 0.5
        self.lip_rim = np.flatnonzero(self.rim & lips)
        self.lip_pairs = self._lip_pairs()
        self.seen_pairs = self.lip_pairs[self.rim[self.lip_pairs].all(axis=1)]
        self.organs, self.behind = self._organs()
        cover = SkinCover(skin, group(reference, "inner"), bone.LINING)
        self.needs = {name: bone.least_depth(cover.depth(reference.parts[name].vertices)) for name in BONES}
        teeth = cKDTree(np.concatenate([reference.parts[name].vertices for name in TEETH]))
        self.from_teeth = {name: teeth.query(reference.parts[name].vertices)[0] for name in BONES}
        seen = np.flatnonzero(~self.inner)
        even = seen[scattered(skin.vertices[seen], COARSE)]
        self._even, self._space = even, System(skin.vertices[even], 1.0)
        busy = np.zeros(n, dtype=bool)
        for name in BUSY:
            busy |= group(reference, name) > 0.3
        far = seen[~busy[seen]]
        self._pick = {"skin": np.concatenate([seen[busy[seen]], far[scattered(skin.vertices[far], COARSE)]])}
        for name, gap in GAPS:
            self._pick[name] = scattered(reference.parts[name].vertices, gap)
        source = np.concatenate([reference.parts[name].vertices[pick] for name, pick in self._pick.items()])
        self._keep = thinned(source, 0.2)
        self._between = System(source[self._keep], 0.05)

    def space(self, skin) -> ThinPlateSpline:
        """The warp of space that takes the reference's seen skin to ``skin`` (n, 3) mm, a little smoothed."""
        return self._space.solve(skin[self._even])

    def between(self, parts, skin) -> ThinPlateSpline:
        """The warp for what lies between the surfaces: seen skin (n, 3), bone, eyeballs and teeth all carry it.

        parts : name -> (k, 3) mm
        """
        target = [(skin if name == "skin" else parts[name])[pick] for name, pick in self._pick.items()]
        return self._between.solve(np.concatenate(target)[self._keep])

    def lids(self, side: str) -> np.ndarray:
        """(n,) weights of both lids of the eye ``side``."""
        return np.maximum(group(self.head, f"lid_upper_{side}"), group(self.head, f"lid_lower_{side}"))

    @cached_property
    def nostrils(self) -> tuple[np.ndarray, ...]:
        """The rows of the lining of each nostril, left and right; none where the skin has no such lining."""
        rows = self.organs["nostrils"]
        left = self.head.skin.vertices[rows, 0] > 0
        return tuple(side for side in (rows[left], rows[~left]) if len(side))

    @cached_property
    def contacts(self) -> dict[str, LidContact]:
        """Side -> how the lids of that eye are brought to lie on an eyeball."""
        return {side: lid_contact(self, side) for side in "lr"}

    @cached_property
    def slits(self) -> dict[str, LidSlit]:
        """Side -> the slit between its lids, of the eyes that are shut."""
        return {side: LidSlit(self, side) for side in "lr" if len(touching_lids(self.head, self.rim, side)) >= SHUT}

    @cached_property
    def at_iris(self) -> dict[str, tuple[np.ndarray, ...]]:
        """Side -> per lid (k,) vertices of its margin above or below the iris of that eye: of both lids, upper first, or of the
        lower one if the eye is shut."""
        out = {}
        for eye, side in zip(self.head.eyes, "lr", strict=True):
            across = np.cross(eye.gaze, [0, 0, 1.0])
            off = np.abs((self.head.skin.vertices - eye.centre) @ across) / np.linalg.norm(across)
            near = self.rim & (off < eye.iris_radius)
            lids = ("lower",) if side in self.slits else ("upper", "lower")
            rows = tuple(np.flatnonzero(near & (group(self.head, f"lid_{lid}_{side}") > 0.5)) for lid in lids)
            out[side] = rows if all(map(len, rows)) else ()
        return out

    def _lip_pairs(self):
        skin = self.head.skin.vertices
        upper, lower = (
            np.flatnonzero((self.rim | self.inner) & (group(self.head, f"lip_{x}") > 0.5)) for x in ("upper", "lower")
        )
        if len(upper) == 0 or len(lower) == 0:
            return np.zeros((0, 2), dtype=int)
        distance, there = cKDTree(skin[lower]).query(skin[upper])
        back = cKDTree(skin[upper]).query(skin[lower])[1]
        mutual = (back[there] == np.arange(len(upper))) & (distance > 0) & (distance < MEET)
        return np.stack([upper[mutual], lower[there[mutual]]], axis=1)

    def _organs(self):
        rows = np.flatnonzero(self.inner)
        count, label = connected_components(self.link[rows][:, rows], directed=False)
        organs = {"eye_l": [], "eye_r": [], "mouth": [], "nostrils": []}
        for k in range(count):
            part = rows[label == k]
            if group(self.head, "mouth_bag")[part].max() > 0.5:
                name = "mouth"
            else:
                name = next((f"eye_{s}" for s in "lr" if self.lids(s)[part].max() > 0.3), "nostrils")
            organs[name].append(part)
        behind = np.zeros(len(self.inner), dtype=int)
        front = ~self.inner
        step = 0
        while not front.all():
            step += 1
            grown = front | (self.link @ front.astype(float) > 0)
            if (grown == front).all():
                break
            behind[grown & ~front] = step
            front = grown
        return {n: np.sort(np.concatenate(p)) if p else np.zeros(0, int) for n, p in organs.items()}, behind
