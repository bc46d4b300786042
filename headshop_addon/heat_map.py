# SPDX-License-Identifier: GPL-3.0-or-later
"""What was fitted and how well, as colours on the skin: blue inside the scan, red outside, grey where it was invented.

The colours live in an attribute of the mesh; a material of its own shows them in place of the skin's, by linking the
object's slots to itself: the mesh keeps its materials, and turning the heat map off brings them back.
"""

import bpy
import numpy as np

from ..sim.adapt.fit_colour import fit_colours
from . import bridge
from .shader_nodes import Graph, socket

ATTRIBUTE, MATERIAL = "headshop_fit", "Head Shop Fit"
BEFORE = "headshop_fit_before"  # what the object's own slots held, and which colour attribute was active
_SOLID, _PLAIN = "VERTEX", "MATERIAL"


def has_fit(skin: bpy.types.Object) -> bool:
    """Whether the head knows how well it was fitted."""
    return "distance_mm" in skin.data.attributes and "fitted" in skin.data.attributes


def measured(skin: bpy.types.Object) -> tuple[np.ndarray, np.ndarray]:
    """The skin's distance (n,) mm from the scan, positive outside, NaN where there is none, and fitted (n,) 0..1."""
    data = skin.data
    return bridge.read_attribute(data, "distance_mm").astype(float), bridge.read_attribute(data, "fitted").astype(float)


def paint(skin: bpy.types.Object, limit: float) -> None:
    """Write the colours for a scale that ends at ``limit`` mm."""
    bridge.write_colour(skin.data, fit_colours(*measured(skin), limit), ATTRIBUTE)
    skin.data.update()


def show(skin: bpy.types.Object, on: bool, limit: float) -> None:
    """Show the heat map in place of the skin's materials, or take it away; nothing else about the head changes."""
    if not has_fit(skin):
        return
    if on:
        _put_on(skin, limit)
    elif BEFORE in skin:
        _take_off(skin)


def _put_on(skin, limit):
    if BEFORE not in skin:
        active = skin.data.color_attributes.active_color
        slots = [slot.material if slot.link == "OBJECT" else None for slot in skin.material_slots]
        skin[BEFORE] = {
            "active": active.name if active is not None else "",
            "linked": [slot.link == "OBJECT" for slot in skin.material_slots],
            **{str(k): material for k, material in enumerate(slots) if material is not None},
        }
    paint(skin, limit)
    skin.data.color_attributes.active_color = skin.data.color_attributes[ATTRIBUTE]
    for slot in skin.material_slots:
        slot.link = "OBJECT"
        slot.material = fit_material()


def _take_off(skin):
    before = skin[BEFORE]
    for k, (slot, linked) in enumerate(zip(skin.material_slots, before["linked"], strict=False)):
        slot.material = before.get(str(k))
        slot.link = "OBJECT" if linked else "DATA"
    attributes = skin.data.color_attributes
    if ATTRIBUTE in attributes:
        attributes.remove(attributes[ATTRIBUTE])
    if before["active"] in attributes:
        attributes.active_color = attributes[before["active"]]
    del skin[BEFORE]


def fit_material() -> bpy.types.Material:
    """The material that shows the colours, half of it shaded so that the face can be recognised."""
    material = bpy.data.materials.get(MATERIAL)
    if material is None:
        material = bpy.data.materials.new(MATERIAL)
        graph = Graph(material)
        colour = graph.attribute(ATTRIBUTE, "Color")
        glow = graph.node("Emission", {"Color": colour, "Strength": 0.55}).outputs[0]
        shade = graph.node("BsdfDiffuse", {"Color": colour}).outputs[0]
        graph.surface(socket(graph.node("AddShader", {0: glow, 1: shade}).outputs, 0))
    return material


def solid_views(on: bool) -> None:
    """Let solid viewports of this window manager show colour attributes, or materials again."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                shading = area.spaces.active.shading
                if on and shading.color_type == _PLAIN:
                    shading.color_type = _SOLID
                elif not on and shading.color_type == _SOLID:
                    shading.color_type = _PLAIN
