# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact of what is drawn: the limit surface of lips, cheeks' lining and lids with teeth, eyeballs and the other lip.

Each is a point between nodes against a plane (`planes.Planes`, its rows). As with all contacts here, a point that is
nearer than it should be at rest may stay so: the neutral face is exactly the scan.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..anatomy.head import Head
from .arch import Arch, wall_planes
from .drawn_lips import FINE, MANY, Lips, build_lips, lip_contacts
from .drawn_samples import SPACING, Samples, drawn_samples, planes_of
from .eye_surface import eyeball_radius
from .flesh import Flesh, build_flesh
from .gingiva import attached
from .planes import Planes
from .solids import Solid, build_solid
from .structures import Layers, Lids

#: mm that is kept from teeth and eyeball where there is that much at rest; mm within which there is contact.
CLEAR, REACH = 0.15, 1.2
#: mm between points of cheeks, lining and lids; skin that far from an eyeball may come to lie on it as the lid is drawn out.
WIDE, DRAPED = 2.4, 5.0
#: mm between the points of lips and lining at which what is left of teeth in them is looked for.
CLOSE = 1.2
#: mm round fascia at rest in which there is bone for it to slide over, as that of the lips does over the chin.
FAR_OVER_BONE = 16.0
#: mm that fascia is kept off bone in the end: between its samples bone bulges.
OFF_BONE = 0.2


@dataclass(frozen=True, eq=False)
class Before:
    """Points that stay in front of something rigid by ``clearance`` (k,) mm; ``of`` is an `Arch` or one eye's `Lids`."""

    of: Any
    points: Samples
    clearance: np.ndarray

    @cached_property
    def of_lids(self):
        """(k, v) sparse: the share that the lids' own vertices have in the points."""
        return self.points.rows[:, self.of.column].tocsr()


@dataclass(frozen=True, eq=False)
class Within:
    """A `Solid`, its ``points`` (k, `Samples` of the skin or columns of fascia) that stay out of it, and the mm (k,) in
    front of it that they keep, no more than they have at rest (within it: less than 0)."""

    solid: Solid
    points: Any
    kept: np.ndarray


def _within(mesh, lower, points, places, spacing, reach, off=0.0) -> Within:
    solid = build_solid(mesh, lower, places, spacing, reach)
    kept = np.full(len(places), off)
    rows, _, height, _ = solid.planes(places, np.eye(3), np.zeros(3))
    kept[rows] = np.minimum(height, off)
    return Within(solid, points, kept)


@dataclass(frozen=True, eq=False)
class DrawnSurfaces:
    """teeth, eyes: what may touch them; lips: the two; fine_teeth, fine_lips: the same more closely; flesh: both faces of
    lips and cheeks; rigid: part -> mesh of what is solid; nodes (3 n, 3) mm at rest; fascia: bone -> columns over it."""

    teeth: tuple[Before, ...]
    fine_teeth: tuple[Before, ...]
    eyes: tuple[Before, ...]
    lips: Lips
    fine_lips: Lips
    flesh: Flesh
    rigid: dict
    nodes: np.ndarray
    fascia: dict

    @cached_property
    def rows_of_teeth(self) -> tuple[Within, ...]:
        """Both rows of teeth with their gums as solids, made when they are first asked for."""
        rest = self.nodes[: len(self.nodes) // 3]
        return tuple(
            _within(
                self.rigid["teeth_lower" if before.of.lower else "teeth_upper"],
                before.of.lower,
                before.points,
                before.points.at(rest),
                0.5,
                8.0,
            )
            for before in self.fine_teeth
            if len(before.points)
        )

    @cached_property
    def bones(self) -> tuple[Within, ...]:
        """Skull and mandible as solids, for the fascia that stands on each."""
        n = len(self.nodes) // 3
        return tuple(
            _within(self.rigid[name], name == "mandible", column, self.nodes[n + column], 1.0, FAR_OVER_BONE, OFF_BONE)
            for name, column in self.fascia.items()
        )


def build_drawn(head: Head, layers: Layers, arches: tuple[Arch, ...], lids_of_both: tuple[Lids, ...]) -> DrawnSurfaces:
    """The points of ``head`` at which contact is looked for; only columns that are free to move have any."""
    skin, faces = head.skin.vertices, head.skin.faces
    n = len(skin)
    free = layers.free[:n]
    group = {k: np.asarray(head.groups.get(k, np.zeros(n)), float) for k in ("lip_upper", "lip_lower", "mouth_bag")}
    mouth = (np.max(list(group.values()), axis=0) > 0.05) & free
    held = attached(head)[0]
    teeth, fine_teeth = (_before_teeth(arches, drawn_samples(faces, skin, mouth, k), skin, held) for k in (WIDE, CLOSE))
    eyes = []
    for lids in lids_of_both:
        near = np.zeros(n, bool)
        near[lids.contact_column] = True
        near &= np.linalg.norm(skin - lids.eye.centre, axis=1) < lids.eye.radius + DRAPED
        seen = drawn_samples(faces, skin, near & free, WIDE)
        at = seen.at(skin)
        gap = np.linalg.norm(at - lids.eye.centre, axis=1) - eyeball_radius(lids, at, np.zeros(2))
        eyes.append(Before(lids, seen, np.minimum(gap, CLEAR)))
    rigid = {k: head.parts[k] for k in ("teeth_upper", "teeth_lower", "skull", "mandible") if k in head.parts}
    on_bone = layers.bony & free
    over = {"skull": layers.mandible <= 0.5, "mandible": layers.mandible > 0.5}
    fascia = {k: np.flatnonzero(on_bone & over[k]) for k in over if k in rigid and (on_bone & over[k]).any()}
    weights = group["lip_upper"], group["lip_lower"]
    lips = [build_lips(faces, skin, weights, free, *how) for how in ((SPACING, 1), (FINE, MANY))]
    inside = np.asarray(head.groups.get("inner", np.zeros(n))) > 0.5
    flesh = build_flesh(faces, skin, mouth, inside)
    return DrawnSurfaces(teeth, fine_teeth, tuple(eyes), *lips, flesh, rigid, layers.nodes, fascia)


def _before_teeth(arches, lining: Samples, skin, held) -> tuple[Before, ...]:
    """Those points of the ``lining`` that are in front of each row of teeth; held (n,): `attached`."""
    points, free = lining.at(skin), lining.rows @ held < 0.3
    out = []
    for arch in arches:
        far, wall = arch.before(points)
        # at any height: what stands in front of the row where it is highest is in front of it
        ahead = arch.crest(points)
        ahead = (ahead > 0.6 * arch.radius.max()) & (far > ahead - 1.5) & free
        gap = np.where(wall > 0, far - wall, np.inf)
        out.append(Before(arch, lining[ahead], np.minimum(gap[ahead], CLEAR)))
    return tuple(out)


def drawn_contacts(surfaces: DrawnSurfaces, skin, normals, rotation, translation, gaze_of, nearby=None) -> Planes:
    """All that the drawn surface of ``skin`` (n, 3) touches; normals (n, 3) of the cage; nearby : `Nearby`."""
    return planes_of(
        [
            *(eye_contacts(before, skin, gaze_of(before.of.side)) for before in surfaces.eyes),
            *(tooth_contacts(before, skin, rotation, translation, nearby) for before in surfaces.teeth),
            *lip_contacts(surfaces.lips, skin, normals),
        ],
        len(skin),
    )


def eye_contacts(before: Before, skin, gaze, most: float = CLEAR):
    """Lids against the eyeball with its cornea, turned by ``gaze`` (2,) rad, clear of it by ``most`` mm at most; a piece
    for `planes_of`."""
    lids = before.of
    rel = before.points.at(skin) - lids.eye.centre
    size = np.maximum(np.linalg.norm(rel, axis=1), 1e-9)
    near = np.flatnonzero(size < lids.profile.max() + CLEAR + REACH)
    need = eyeball_radius(lids, rel[near] + lids.eye.centre, gaze) + np.minimum(before.clearance[near], most)
    close = size[near] < need + REACH
    near, need = near[close], need[close]
    normal = rel[near] / size[near, None]
    return *before.points.along(near, normal), normal @ lids.eye.centre + need


def on_the_ball(before: Before, skin, goal, gaze, rounds: int = 6) -> np.ndarray:
    """(v, 3) mm: the lids' vertices at ``goal`` (v, 3), those of ``skin`` (n, 3) elsewhere, pushed out until what is drawn of
    them lies on the eyeball: where lids are to go, so that they need not be held off it."""
    lids, rows = before.of, before.points.rows
    own, out = before.of_lids, goal.copy()
    others = rows @ skin - own @ skin[lids.column]
    for _ in range(rounds):
        at = own @ out + others
        rel = at - lids.eye.centre
        size = np.maximum(np.linalg.norm(rel, axis=1), 1e-9)
        hit = np.maximum(eyeball_radius(lids, at, gaze) + before.clearance - size, 0)
        if hit.max(initial=0.0) < 0.02:
            break
        share = own.T @ np.column_stack([(hit / size)[:, None] * rel, hit > 0])
        out += 1.5 * share[:, :3] / np.maximum(share[:, 3:], 0.05)
    return out


def tooth_contacts(before: Before, skin, rotation, translation, nearby=None):
    """Lips and cheeks in front of a row of teeth; a piece for `planes_of`."""
    points = before.points.at(skin)
    keep, normal, missing = wall_planes(before.of, points, before.clearance, rotation, translation, REACH, nearby)
    level = np.einsum("ij,ij->i", points[keep], normal) + missing
    return *before.points.along(keep, normal), level
