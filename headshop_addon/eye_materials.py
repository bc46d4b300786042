# SPDX-License-Identifier: GPL-3.0-or-later
"""The eye's materials. All but the caruncle's read the attribute ``headshop_eye`` (`dress` in `materials.py` writes
it): across the gaze, in iris radii, with the radius of the pupil as the third number, so they turn with the eye."""

import bpy

from .shader_nodes import Graph, socket

EYE, IRIS = "headshop_eye", "headshop_iris"

#: Linear colour of an iris whose own is not known: grey-green.
IRIS_COLOUR = (0.12, 0.135, 0.105)


def eye_material(kind: str) -> bpy.types.Material:
    """The material ``sclera``, ``iris``, ``pupil``, ``cornea`` or ``caruncle``, made if the file has none."""
    name = "Head Shop " + kind.title()
    material = bpy.data.materials.get(name)
    if material is None:
        material = bpy.data.materials.new(name)
        make = {"sclera": _sclera, "iris": _iris, "pupil": _pupil, "cornea": _cornea, "caruncle": _caruncle}
        make[kind](Graph(material))
        if kind == "cornea":
            material.surface_render_method = "BLENDED"  # for Eevee: clear, not grainy
        material.diffuse_color = {
            "sclera": (0.85, 0.82, 0.78, 1.0),
            "iris": (0.20, 0.24, 0.22, 1.0),
            "pupil": (0.0, 0.0, 0.0, 1.0),
            "cornea": (1.0, 1.0, 1.0, 0.05),
            "caruncle": (0.68, 0.36, 0.33, 1.0),
        }[kind]
    return material


def _polar(graph: Graph):
    """Radius in iris radii, a vector (cos, sin, 0) of the angle, and the pupil's radius."""
    place = graph.attribute(EYE)
    x, y, pupil = graph.separate(place)
    flat = graph.combine(x, y)
    return graph.vector("LENGTH", flat), graph.vector("NORMALIZE", flat), pupil


def _wet(graph: Graph, colour, rough: float, depth, film) -> None:
    """Flesh under a film of tears. depth : subsurface weight, radius, scale (m); film : weight, roughness."""
    shader = graph.node(
        "BsdfPrincipled",
        {
            "Base Color": colour,
            "Roughness": rough,
            "Subsurface Weight": depth[0],
            "Subsurface Radius": depth[1],
            "Subsurface Scale": depth[2],
            "Coat Weight": film[0],
            "Coat Roughness": film[1],
            "Coat IOR": 1.34,
        },
        subsurface_method="BURLEY",
    )
    graph.surface(shader.outputs[0])


def _sclera(graph: Graph) -> None:
    radius, angle, _ = _polar(graph)
    # Veins run towards the iris and thin out before it: noise that is fine around the eye and slow along it.
    around = graph.vector(
        "ADD", graph.vector("SCALE", angle, 7.0), graph.combine(z=graph.math("MULTIPLY", radius, 1.7))
    )
    ridge = graph.math("ABSOLUTE", graph.math("SUBTRACT", graph.noise(around, 1.4, 4.0, 0.62), 0.5))
    vein = graph.math("MULTIPLY", graph.smooth(ridge, 0.0, 0.028, 1.0, 0.0), graph.smooth(radius, 1.15, 2.1, 0.0, 0.36))
    white = graph.mix(graph.smooth(radius, 1.2, 2.4), (0.80, 0.775, 0.74), (0.74, 0.60, 0.55))
    colour = graph.mix(vein, white, (0.50, 0.10, 0.08))
    colour = graph.mix(graph.smooth(radius, 0.98, 1.13, 0.75, 0.0), colour, (0.20, 0.185, 0.18))  # the limbus is soft
    _wet(graph, colour, rough=0.35, depth=(0.5, (1.0, 0.6, 0.45), 0.0015), film=(0.9, 0.07))


def _iris(graph: Graph) -> None:
    radius, angle, pupil = _polar(graph)
    # 0 at the pupil, 1 at the limbus
    along = graph.node("MapRange", {"Value": radius, "From Min": pupil, "From Max": 1.0}).outputs[0]
    fibres = graph.vector("ADD", graph.vector("SCALE", angle, 9.0), graph.combine(z=graph.math("MULTIPLY", along, 1.3)))
    streak = graph.noise(fibres, 1.7, 4.0, 0.68)
    crypts = graph.noise(graph.vector("ADD", graph.vector("SCALE", angle, 2.2), graph.combine(z=along)), 2.2, 2.0, 0.5)
    # The collarette, a frilled ring a third of the way out, is where the inner colour ends.
    frill = graph.math("ADD", along, graph.smooth(streak, 0.3, 0.7, -0.10, 0.10))
    own = graph.attribute(IRIS, "Color")
    warm = graph.mix(0.5, own, (0.24, 0.125, 0.05))
    colour = graph.mix(graph.smooth(frill, 0.12, 0.45), warm, own)
    colour = graph.mix(
        1.0, colour, graph.ramp(streak, [(0.30, (0.42, 0.42, 0.42)), (0.68, (1.7, 1.7, 1.7))]), "MULTIPLY"
    )
    colour = graph.mix(graph.smooth(crypts, 0.50, 0.66, 0.0, 0.35), colour, (0.05, 0.045, 0.04))
    colour = graph.mix(graph.smooth(along, 0.60, 0.97, 0.0, 0.95), colour, (0.012, 0.014, 0.016))  # limbal ring
    colour = graph.mix(graph.smooth(along, 0.0, 0.07, 0.85, 0.0), colour, (0.01, 0.008, 0.006))  # ruff of the pupil
    # Light gathers in the iris through the cornea; a trace of emission stands for it.
    shader = graph.node(
        "BsdfPrincipled",
        {
            "Base Color": colour,
            "Roughness": 0.55,
            "Specular IOR Level": 0.1,
            "Emission Color": colour,
            "Emission Strength": 0.10,
        },
    )
    graph.surface(shader.outputs[0])


def _pupil(graph: Graph) -> None:
    inputs = {"Base Color": (0.002, 0.002, 0.002, 1.0), "Roughness": 1.0, "Specular IOR Level": 0.0}
    graph.surface(graph.node("BsdfPrincipled", inputs).outputs[0])


def _caruncle(graph: Graph) -> None:
    """Wet pink flesh."""
    _wet(graph, (0.56, 0.22, 0.19, 1.0), rough=0.4, depth=(0.6, (1.0, 0.35, 0.25), 0.0012), film=(0.8, 0.1))


def _cornea(graph: Graph) -> None:
    """A clear film: what it does not mirror passes straight through, so it costs no noise and casts no shadow."""
    clear = graph.node("BsdfTransparent").outputs[0]
    mirror = graph.node("BsdfAnisotropic", {"Roughness": 0.03}).outputs[0]
    facing = graph.node("Fresnel", {"IOR": 1.376}).outputs[0]
    # a tear film mirrors a little more than the bare surface; the back of a face mirrors nothing
    geometry = graph.node("NewGeometry")
    front = graph.math("SUBTRACT", 1.0, socket(geometry.outputs, "Backfacing"))
    # at its rim it passes into the white and has no edge of its own
    radius, _, _ = _polar(graph)
    inside = graph.math("MULTIPLY", front, graph.smooth(radius, 0.90, 0.99, 1.0, 0.0))
    amount = graph.math("MULTIPLY", graph.math("MULTIPLY", facing, 1.5, clamp=True), inside)
    graph.surface(graph.node("MixShader", {0: amount, 1: clear, 2: mirror}).outputs[0])
