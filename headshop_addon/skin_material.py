# SPDX-License-Identifier: GPL-3.0-or-later
"""The skin's material: scattering, lips, wet insides, brows, pores, and the scan's colour where there is any.

It reads attributes of the mesh (`skin_paint.py` writes them), so one material serves every head in the file; only a
head with images of its own needs its own.

Sources: scattering lengths 3.7, 1.4, 0.7 mm from the measured coefficients of Jensen, Marschner, Levoy, Hanrahan 2001
(skin1); refractive index 1.4; furrows 0.3 to 0.5 mm apart; roughness by region is our estimate.
"""

import bpy

from .detail_nodes import DetailImages, add_displacement, detail_normal, refresh_detail
from .shader_nodes import Graph, socket

REST, COLOUR, MASK, BROW = "headshop_rest", "headshop_colour", "headshop_mask", "headshop_brow"
COLOUR_NODE = "Head Shop Colour"
RADIUS, SCALE_M = (1.0, 0.37, 0.19), 0.0037


def skin_material(
    name: str = "Head Shop Skin", image: bpy.types.Image | None = None, detail: DetailImages | None = None
) -> bpy.types.Material:
    """The skin material of that name, made if the file has none.

    image : a colour image on the skin's UV map, in place of the per-vertex colour
    detail : the head's displacement and normal map
    """
    material = bpy.data.materials.get(name)
    if material is None:
        material = bpy.data.materials.new(name)
        _write(Graph(material), image, detail)
        material.diffuse_color = (0.58, 0.38, 0.29, 1.0)
    else:
        nodes = material.node_tree.nodes
        if image is not None and COLOUR_NODE in nodes:
            nodes[COLOUR_NODE].image = image
        if detail is not None:
            refresh_detail(material, detail)
    return material


def _write(graph: Graph, image, detail) -> None:
    rest = graph.attribute(REST)  # mm, so that texture moves with the skin
    if image is None:
        base = graph.attribute(COLOUR, "Color")
    else:
        base = socket(graph.node("TexImage", image=image, extension="EXTEND", name=COLOUR_NODE).outputs, "Color")
    mask = graph.node("Attribute", attribute_name=MASK)
    lips, wet, shine = graph.separate(socket(mask.outputs, "Vector"))

    # One noise serves colour and relief: evaluating noise is most of what skin costs to render. Furrows and pores are
    # about half a millimetre across; on the lips the pattern is drawn out into upright grooves.
    drawn = graph.node(
        "Mix", {"Factor_Float": lips, "A_Vector": (1.0, 1.0, 1.0), "B_Vector": (1.3, 0.5, 0.3)}, data_type="VECTOR"
    )
    grain = graph.noise(graph.vector("MULTIPLY", rest, socket(drawn.outputs, "Result_Vector")), 0.85, 1.5, 0.72)

    colour = graph.mix(
        graph.smooth(grain, 0.38, 0.72, 0.0, 0.22), base, graph.mix(1.0, base, (0.90, 0.70, 0.64), "MULTIPLY")
    )
    if image is None:
        colour = _paint_brows(graph, colour)
    lip = graph.smooth(graph.math("ADD", lips, graph.smooth(grain, 0.3, 0.7, -0.08, 0.08)), 0.30, 0.72)
    lip_tint = graph.mix(1.0, colour, (0.80, 0.50, 0.50) if image is None else (0.97, 0.88, 0.88), "MULTIPLY")
    colour = graph.mix(lip, colour, lip_tint)
    colour = graph.mix(wet, colour, (0.30, 0.075, 0.065))

    roughness = graph.math("SUBTRACT", 0.52, graph.math("MULTIPLY", shine, 0.12))
    roughness = graph.math("ADD", roughness, graph.smooth(grain, 0.3, 0.7, -0.06, 0.06))
    roughness = graph.math("SUBTRACT", roughness, graph.math("MULTIPLY", lip, 0.14))
    roughness = graph.math("SUBTRACT", roughness, graph.math("MULTIPLY", wet, 0.22))
    sebum = graph.math("ADD", graph.math("MULTIPLY", shine, 0.10), graph.math("MULTIPLY", wet, 0.6))
    gloss = graph.math("ADD", 0.46, graph.math("MULTIPLY", lip, 0.2))
    coat = graph.math("ADD", 0.05, sebum)
    if image is not None:
        # what the scan saw darker than any skin is hair, a cap, a collar: dull
        brightness = graph.vector("DOT_PRODUCT", base, (0.2126, 0.7152, 0.0722))
        skin = graph.math("MAXIMUM", graph.smooth(brightness, 0.015, 0.065), wet)
        gloss, coat = (graph.math("MULTIPLY", value, skin) for value in (gloss, coat))
        roughness = graph.math("ADD", roughness, graph.smooth(skin, 0.0, 1.0, 0.3, 0.0))
    shader = graph.node(
        "BsdfPrincipled",
        {
            "Base Color": colour,
            "Roughness": roughness,
            "IOR": 1.4,
            "Specular IOR Level": gloss,
            "Subsurface Weight": 1.0,
            "Subsurface Radius": RADIUS,
            "Subsurface Scale": SCALE_M,
            # a thin film of sebum: the second, sharper lobe of skin's reflection
            "Coat Weight": coat,
            "Coat Roughness": 0.28,
            "Coat IOR": 1.4,
            "Normal": graph.bump(grain, 0.00035, 0.7, None if detail is None else detail_normal(graph, detail)),
        },
        subsurface_method="BURLEY",
    )
    graph.surface(shader.outputs[0])
    if detail is not None:
        add_displacement(graph, detail)


def _paint_brows(graph: Graph, colour):
    """Short hairs along each brow: noise drawn out along it, thinning towards the brow's edges and its tail."""
    along, above, _ = graph.separate(graph.attribute(BROW))
    # half the brow's thickness, mm: 4 near the nose, nothing at the tail
    taper = graph.ramp(
        along, [(0.0, (0.0,) * 3), (0.05, (0.55,) * 3), (0.3, (1.0,) * 3), (0.62, (0.72,) * 3), (1.0, (0.0,) * 3)]
    )
    half = graph.math("MULTIPLY", taper, 4.2)
    edge = graph.math(
        "SUBTRACT", 1.0, graph.math("DIVIDE", graph.math("ABSOLUTE", above), graph.math("ADD", half, 0.01))
    )
    # hairs stand up near the nose and lie down towards the tail
    lie = graph.math("MULTIPLY_ADD", along, 55.0, graph.math("MULTIPLY", above, -0.55))
    hairs = graph.noise(
        graph.combine(graph.math("MULTIPLY", lie, 0.9), graph.math("MULTIPLY", above, 0.55)), 1.25, 1.0, 0.6
    )
    cover = graph.smooth(graph.math("ADD", edge, graph.smooth(hairs, 0.3, 0.7, -0.55, 0.35)), 0.05, 0.75, 0.0, 0.86)
    return graph.mix(cover, colour, (0.055, 0.034, 0.024))
