# SPDX-License-Identifier: GPL-3.0-or-later
"""Displacement and normal map in the skin's material: two nodes, of which one works at a time.

The normal map shades, on Eevee and Cycles alike, and costs next to nothing. The displacement moves the rendered mesh
itself (and bumps what is finer): silhouettes show it too. Both at once would count the same relief twice.
"""

from typing import NamedTuple

import bpy

from ..sim.detail.detail_map import DEEPEST
from .shader_nodes import Graph, socket

NORMAL_NODE, DISPLACEMENT_NODE, UV_NODE = "Head Shop Normal Map", "Head Shop Displacement", "Head Shop UV"
UV_MAP = "UVMap"
METRES = 0.001


class DetailImages(NamedTuple):
    """A head's two images on the skin's first UV map."""

    displacement: bpy.types.Image
    normal: bpy.types.Image


def detail_normal(graph: Graph, detail: DetailImages):
    """The normal that the normal map gives, as an output."""
    place = graph.node("UVMap", uv_map=UV_MAP, name=UV_NODE).outputs[0]
    image = graph.node(
        "TexImage", {"Vector": place}, image=detail.normal, extension="EXTEND", name=f"{NORMAL_NODE} Image"
    )
    node = graph.node(
        "NormalMap", {"Color": socket(image.outputs, "Color")}, space="TANGENT", uv_map=UV_MAP, name=NORMAL_NODE
    )
    return node.outputs[0]


def add_displacement(graph: Graph, detail: DetailImages) -> None:
    """The node that displaces, ready to be linked to the material's output."""
    image = graph.node("TexImage", image=detail.displacement, extension="EXTEND", name=f"{DISPLACEMENT_NODE} Image")
    image.interpolation = "Cubic"  # linear would show the texels in the bump
    graph.tree.links.new(graph.tree.nodes[UV_NODE].outputs[0], socket(image.inputs, "Vector"))
    inputs = {"Height": socket(image.outputs, "Color"), "Midlevel": 0.5, "Scale": 2 * DEEPEST * METRES}
    graph.node("Displacement", inputs, space="OBJECT", name=DISPLACEMENT_NODE)


def refresh_detail(material: bpy.types.Material, detail: DetailImages) -> None:
    """Show these images where the material has our nodes; an artist's own material stays as it is."""
    nodes = material.node_tree.nodes
    for name, image in ((NORMAL_NODE, detail.normal), (DISPLACEMENT_NODE, detail.displacement)):
        if f"{name} Image" in nodes:
            nodes[f"{name} Image"].image = image


def use_detail(material: bpy.types.Material, mode: str) -> None:
    """Let the detail work as ``NONE``, ``NORMAL`` or ``DISPLACEMENT`` in a material that has our nodes."""
    tree = material.node_tree
    if tree is None or NORMAL_NODE not in tree.nodes or DISPLACEMENT_NODE not in tree.nodes:
        return
    socket(tree.nodes[NORMAL_NODE].inputs, "Strength").default_value = float(mode == "NORMAL")
    source = tree.nodes[DISPLACEMENT_NODE].outputs[0]
    for link in list(source.links):
        tree.links.remove(link)
    output = tree.get_output_node("ALL")
    if mode == "DISPLACEMENT" and output is not None:
        tree.links.new(source, socket(output.inputs, "Displacement"))
    material.displacement_method = "BOTH" if mode == "DISPLACEMENT" else "BUMP"
