# SPDX-License-Identifier: GPL-3.0-or-later
"""What the skin material reads from the mesh: resting place, colour and masks per vertex."""

import bpy
import numpy as np
from scipy.sparse import coo_matrix, diags, identity
from scipy.sparse.linalg import spsolve

from ..sim.mesh import Mesh, edges
from ..sim.scan.colour_space import LUMINANCE
from .skin_material import BROW, COLOUR, MASK, REST

#: Linear sRGB albedo of fair skin where the scan says nothing (type II; estimate between published spectra).
ALBEDO = np.array([0.56, 0.365, 0.275])

#: group -> (amount at full weight, factors on red, green, blue). Blood is nearer the surface where skin is thin.
TINTS = {
    "cheek": (0.9, (1.00, 0.80, 0.78)),
    "nose": (0.8, (1.00, 0.80, 0.76)),
    "ear": (0.9, (1.02, 0.74, 0.70)),
    "nostril": (0.7, (0.92, 0.66, 0.60)),
    "chin": (0.5, (1.00, 0.88, 0.86)),
    "forehead": (0.5, (1.00, 0.98, 0.93)),
    "lid_upper": (0.8, (0.90, 0.82, 0.84)),
    "lid_lower": (0.8, (0.90, 0.80, 0.82)),
    "neck": (0.6, (0.95, 0.94, 0.93)),
    "scalp": (0.7, (0.93, 0.95, 0.97)),
    "jaw": (0.25, (0.94, 0.95, 0.98)),
}
HOME = 40.0  # mm from where its colour was seen to where skin has less than half of that and more of the usual tone
TONE = (0.4, 0.8)  # shares of the skin that are darker than the usual tone, from and to
SHINE = {"nose": 1.0, "forehead": 0.7, "chin": 0.5, "lid_upper": 0.4, "cheek": 0.15}


def adjacency(mesh: Mesh):
    """(n, n) sparse symmetric matrix, 1 where two vertices share an edge."""
    pairs = edges(mesh.faces)
    n = len(mesh.vertices)
    link = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n)).tocsr()
    return link + link.T


def smoothed(values: np.ndarray, link, rounds: int = 2) -> np.ndarray:
    """Values (n, …) averaged with their neighbours."""
    degree = np.maximum(np.asarray(link.sum(axis=1)).ravel(), 1.0)
    average = diags(0.5 / degree) @ link + 0.5 * identity(link.shape[0])
    for _ in range(rounds):
        values = average @ values
    return values


def spread(colour: np.ndarray, confidence: np.ndarray, link, area: np.ndarray, reach: float = 1e-3) -> np.ndarray:
    """Colours (n, 3) kept where the confidence (n,) is 1 and filled over the surface where it is 0, smoothly and, farther in
    than `HOME`, with the tone of most of the skin: shade and reflections at the edge of what was seen go no farther.

    Solves (C + reach (L + A / HOME²)) x = C v with the graph's Laplacian L, which is a membrane pinned at the known values and,
    by the ``area`` (n,) mm² of each vertex, held by springs where there are none.
    """
    degree = np.asarray(link.sum(axis=1)).ravel()
    pinned = diags(confidence + 1e-9)  # a whisper that keeps a part without any data from being singular
    held = diags((1 - confidence) * area / HOME**2)
    system = (pinned + reach * (diags(degree) - link + held)).tocsc()
    tone = tone_of(colour, confidence)
    return np.column_stack([spsolve(system, pinned @ (c - t)) + t for c, t in zip(colour.T, tone, strict=True)])


def tone_of(colour: np.ndarray, confidence: np.ndarray) -> np.ndarray:
    """(3,) what most of the skin looks like, of colours (n, 3) with a confidence (n,) 0..1: the mean of those that are rather
    bright, as brows and shade darken more of it than gloss brightens."""
    known = colour[confidence > 0.5] if (confidence > 0.5).any() else colour
    bright = known @ LUMINANCE
    low, high = np.quantile(bright, TONE)
    return known[(bright >= low) & (bright <= high)].mean(axis=0)


def group(groups: dict[str, np.ndarray], name: str, count: int) -> np.ndarray:
    """(n,) weights of a group, of both sides where it has two; zero where there is none."""
    found = [groups[n] for n in (name, name + "_l", name + "_r") if n in groups]
    return np.clip(np.sum(found, axis=0), 0, 1) if found else np.zeros(count)


def masks(groups: dict[str, np.ndarray], link) -> np.ndarray:
    """(n, 4) lips, wet insides, shine, and 1; 0..1."""
    n = link.shape[0]
    bag = group(groups, "mouth_bag", n)
    lips = np.maximum(group(groups, "lip_upper", n), group(groups, "lip_lower", n))
    shine = np.max([amount * group(groups, name, n) for name, amount in SHINE.items()], axis=0)
    # lid backs come to light in a blink: they stay skin
    inside = np.maximum(bag, 0.6 * group(groups, "inner", n) * group(groups, "nostril", n))
    return np.clip(np.column_stack([lips, inside, smoothed(shine, link, 3), np.ones(n)]), 0, 1)


def brow_coordinates(place: np.ndarray, at: dict[str, np.ndarray]) -> np.ndarray:
    """(n, 3) for each vertex: 0..1 along the nearer brow from nose to tail, mm above its middle line, 0.

    Smooth over the surface, so a material can draw single hairs on a coarse mesh.

    place : (n, 3) mm in the head's axes; at : skin landmark -> (3,) mm in the same axes
    """
    left = place[:, 0] >= (at["en_l"] + at["en_r"])[0] / 2
    out = np.zeros((len(place), 3))
    for side, chosen in (("_l", left), ("_r", ~left)):
        sign = 1.0 if side == "_l" else -1.0
        inner, outer, top = at["en" + side], at["ex" + side], at["sci" + side]
        start, stop = sign * inner[0] - 1.0, sign * outer[0] + 7.0
        along = (sign * place[chosen, 0] - start) / (stop - start)
        # rises to two thirds of its length, then falls; `sci` is the top of the brow's hair
        arch = (
            top[2]
            - 4.0
            - 4.5 * np.clip(1 - along / 0.66, 0, 1) ** 1.5
            - 5.5 * np.clip((along - 0.66) / 0.34, 0, 2) ** 1.6
        )
        above = place[chosen, 2] - arch
        # not on the back of the head, nor anywhere far off
        above[place[chosen, 1] > outer[1] + 25.0] = 60.0
        out[chosen, 0], out[chosen, 1] = along, np.clip(above, -60, 60)
    return out


def painted(groups: dict[str, np.ndarray], link) -> np.ndarray:
    """(n, 3) linear albedo where the scan has no colour: redder cheeks, nose and ears, darker lids."""
    n = link.shape[0]
    colour = np.tile(ALBEDO, (n, 1))
    for name, (amount, factors) in TINTS.items():
        weight = amount * smoothed(group(groups, name, n), link, 4)[:, None]
        colour *= 1 - weight + weight * np.array(factors)
    return colour


def blotched(colour: np.ndarray, place: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Linear colour (n, 3) with blood and melanin unevenly spread: slow red and brown blotches."""
    red, brown = mottle(place, rng, 26.0), mottle(place, rng, 60.0)
    return colour * np.exp(0.035 * red[:, None] * [0.3, -1.0, -0.9] - 0.03 * brown[:, None] * [0.7, 1.0, 1.2])


def write_vectors(data: bpy.types.Mesh, name: str, values: np.ndarray) -> None:
    """Set a per-vertex vector (n, 3) or linear colour (n, 4) attribute."""
    kind, field = ("FLOAT_VECTOR", "vector") if values.shape[1] == 3 else ("FLOAT_COLOR", "color")
    attribute = data.attributes.get(name)
    if attribute is not None and (attribute.data_type, attribute.domain) != (kind, "POINT"):
        data.attributes.remove(attribute)
        attribute = None
    if attribute is None:
        attribute = data.attributes.new(name, kind, "POINT")
    attribute.data.foreach_set(field, np.ascontiguousarray(values, dtype=np.float32).ravel())


def mottle(place: np.ndarray, rng: np.random.Generator, size: float = 22.0) -> np.ndarray:
    """(n,) slow random field of unit spread over positions (n, 3) mm; ``size`` mm is the size of its blotches."""
    waves = rng.standard_normal((40, 3)) * (2 * np.pi / size / np.sqrt(3))
    return np.sqrt(2 / 40) * np.cos(place @ waves.T + rng.uniform(0, 2 * np.pi, 40)).sum(axis=1)


def paint_skin(skin, mesh: Mesh, groups: dict[str, np.ndarray], place: np.ndarray, at: dict[str, np.ndarray]) -> None:
    """Write resting place, colour and masks to the skin's mesh.

    place : (n, 3) mm, the rest positions in the head's own axes; at : its landmarks, (3,) mm in the same axes
    """
    link = adjacency(mesh)
    write_vectors(skin.data, BROW, brow_coordinates(place, at))
    write_vectors(skin.data, REST, place)
    write_vectors(skin.data, MASK, masks(groups, link))
    colour = blotched(painted(groups, link), place, np.random.default_rng(1))
    write_vectors(skin.data, COLOUR, np.column_stack([colour, np.ones(len(place))]))
