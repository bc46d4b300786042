# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials of what lies under the skin, bone, muscle, enamel, gum and tongue, and of the scan."""

import bpy

from .shader_nodes import Graph, socket

FIBRE = "headshop_fibre"
REST = "headshop_rest"


def anatomy_material(kind: str) -> bpy.types.Material:
    """The material ``bone``, ``muscle``, ``enamel``, ``gum``, ``tongue`` or ``scan``, made if the file has none."""
    name = "Head Shop " + kind.title()
    material = bpy.data.materials.get(name)
    if material is None:
        material = bpy.data.materials.new(name)
        write, colour = _KINDS[kind]
        write(Graph(material))
        material.diffuse_color = (*colour, 1.0)
    return material


def scan_material(attribute: str) -> bpy.types.Material:
    """A dull material that shows a scan's own vertex colours; the inside of the surface is dark."""
    name = f"Head Shop Scan {attribute}"
    material = bpy.data.materials.get(name)
    if material is None:
        material = bpy.data.materials.new(name)
        graph = Graph(material)
        _clay(graph, graph.attribute(attribute, "Color"))
    return material


def _principled(graph: Graph, method: str | None = None, **inputs) -> None:
    shader = graph.node("BsdfPrincipled", {name.replace("_", " "): value for name, value in inputs.items()})
    if method:
        shader.subsurface_method = method
    graph.surface(shader.outputs[0])


def _bone(graph: Graph) -> None:
    rest = graph.attribute(REST)
    stain = graph.noise(rest, 0.045, 4.0, 0.6)
    grain = graph.noise(rest, 0.55, 4.0, 0.65)
    colour = graph.ramp(stain, [(0.25, (0.50, 0.40, 0.27)), (0.5, (0.66, 0.57, 0.43)), (0.75, (0.74, 0.67, 0.54))])
    colour = graph.mix(graph.smooth(grain, 0.3, 0.55, 0.30, 0.0), colour, (0.34, 0.25, 0.16))
    _principled(
        graph,
        "BURLEY",
        Base_Color=colour,
        Roughness=graph.smooth(stain, 0.3, 0.7, 0.62, 0.46),
        Subsurface_Weight=0.5,
        Subsurface_Radius=(1.0, 0.7, 0.45),
        Subsurface_Scale=0.0016,
        Normal=graph.bump(grain, 0.0005, 0.55),
    )


def _muscle(graph: Graph) -> None:
    """Red bellies of fine fibres; both ends pale into tendon."""
    along, across, rough = graph.separate(graph.attribute(FIBRE))
    # Strands in mm: fine across the belly, slow along it.
    strands = graph.combine(graph.math("MULTIPLY", along, 3.0), across, graph.math("MULTIPLY", rough, 0.35))
    coarse = graph.noise(strands, 0.55, 2.0, 0.5)
    fine = graph.noise(strands, 1.7, 2.0, 0.6)
    fibre = graph.math("ADD", graph.math("MULTIPLY", coarse, 0.6), graph.math("MULTIPLY", fine, 0.4))
    red = graph.ramp(
        fibre,
        [
            (0.30, (0.13, 0.014, 0.012)),
            (0.48, (0.30, 0.040, 0.032)),
            (0.62, (0.42, 0.085, 0.065)),
            (0.75, (0.52, 0.20, 0.16)),
        ],
    )
    end = graph.math("ABSOLUTE", graph.math("SUBTRACT", along, 0.5))  # 0 in the belly, 0.5 at both ends
    frayed = graph.math("ADD", end, graph.smooth(coarse, 0.3, 0.7, -0.05, 0.05))
    tendon = graph.smooth(frayed, 0.36, 0.49, 0.0, 0.8)
    colour = graph.mix(tendon, red, (0.62, 0.50, 0.42))
    _principled(
        graph,
        "BURLEY",
        Base_Color=colour,
        Roughness=graph.smooth(fibre, 0.3, 0.7, 0.34, 0.52),
        Subsurface_Weight=0.35,
        Subsurface_Radius=(1.0, 0.3, 0.2),
        Subsurface_Scale=0.0014,
        Coat_Weight=0.22,
        Coat_Roughness=0.28,
        Normal=graph.bump(fibre, 0.0009, 0.8),
    )


def _enamel(graph: Graph) -> None:
    rest = graph.attribute(REST)
    tint = graph.noise(rest, 0.12, 2.0, 0.5)
    _principled(
        graph,
        "BURLEY",
        Base_Color=graph.ramp(tint, [(0.3, (0.66, 0.58, 0.45)), (0.7, (0.76, 0.70, 0.58))]),
        Roughness=0.24,
        IOR=1.6,
        Subsurface_Weight=0.6,
        Subsurface_Radius=(1.0, 0.8, 0.6),
        Subsurface_Scale=0.0012,
        Coat_Weight=0.3,
        Coat_Roughness=0.08,
    )


def _wet_flesh(graph: Graph, dark, light, grain_scale: float, roughness: float) -> None:
    rest = graph.attribute(REST)
    grain = graph.noise(rest, grain_scale, 3.0, 0.6)
    _principled(
        graph,
        "BURLEY",
        Base_Color=graph.ramp(graph.noise(rest, 0.2, 3.0, 0.6), [(0.3, dark), (0.7, light)]),
        Roughness=roughness,
        Subsurface_Weight=0.8,
        Subsurface_Radius=(1.0, 0.35, 0.25),
        Subsurface_Scale=0.002,
        Coat_Weight=0.45,
        Coat_Roughness=0.16,
        Normal=graph.bump(grain, 0.0003, 0.7),
    )


def _gum(graph: Graph) -> None:
    _wet_flesh(graph, (0.36, 0.115, 0.105), (0.47, 0.185, 0.165), 0.8, 0.36)


def _tongue(graph: Graph) -> None:
    _wet_flesh(graph, (0.34, 0.125, 0.115), (0.46, 0.22, 0.20), 1.3, 0.44)


def _clay(graph: Graph, colour) -> None:
    geometry = graph.node("NewGeometry")
    inside = socket(geometry.outputs, "Backfacing")
    shader = graph.node(
        "BsdfPrincipled",
        {"Base Color": graph.mix(inside, colour, (0.03, 0.032, 0.036)), "Roughness": 0.62, "Specular IOR Level": 0.3},
    )
    graph.surface(shader.outputs[0])


_KINDS = {
    "bone": (_bone, (0.66, 0.57, 0.43)),
    "muscle": (_muscle, (0.32, 0.05, 0.04)),
    "enamel": (_enamel, (0.75, 0.69, 0.57)),
    "gum": (_gum, (0.42, 0.15, 0.135)),
    "tongue": (_tongue, (0.42, 0.18, 0.16)),
    "scan": (lambda graph: _clay(graph, (0.42, 0.44, 0.47)), (0.42, 0.44, 0.47)),
}
