# SPDX-License-Identifier: GPL-3.0-or-later
"""Our materials as engines understand them: one Principled BSDF each, of numbers and pictures.

Exporters make nothing of procedural nodes, or worse: a mixture of shaders becomes opaque metal. So colours that vary
are baked where a part has a place for them, on its UV map or around the gaze of an eye, and are constant elsewhere.
"""

from contextlib import contextmanager

import bpy

from . import bridge
from .colour_bake import bake_colour, base_colour
from .detail_images import images_of
from .detail_nodes import UV_MAP, DetailImages, detail_normal
from .eye_materials import EYE
from .shader_nodes import Graph, socket

OURS, CORNEA = "Head Shop ", "Head Shop Cornea"
ATTRIBUTES = "headshop_"  # what our materials read from the mesh begins with this
SKIN_SIZE, EYE_SIZE = 1024, 512  # pixels; a skin's own picture may have more
#: Iris radii from the middle of an eye's picture to its border: the back of the eye lies just within.
REACH = 3.0
ROUGHNESS = 0.5  # where a material's own varies
#: Colour, opacity and roughness of a clear film. Engines that blend draw little of it but its highlight.
FILM = (0.02, 0.02, 0.02), 0.08, 0.03


@contextmanager
def plain_materials(skin: bpy.types.Object, scene: bpy.types.Scene, copies: dict[str, bpy.types.Object]):
    """While it lasts, ``copies`` (part -> object of ``scene``) wear plain materials with the names of their own.

    What an artist made himself is copied as it is, so whatever the copies wear may be changed.

    Raises
    ------
    InputError : Cycles is switched off.
    """
    worn = {obj: list(obj.data.materials) for obj in copies.values()}
    names = {material: material.name for each in worn.values() for material in each if material is not None}
    plain, pictures = {}, {}
    try:
        for material, name in names.items():
            if material.library is None:
                material.name = name + " (original)"
        for part, obj in copies.items():
            varying = [index for index, material in enumerate(worn[obj]) if _varies(material)]
            uv_map, picture = _uv_map(obj), None
            detail = images_of(skin) if part == "skin" else None
            if varying and uv_map is not None:
                # both eyes wear the same materials, and so the same picture
                kind = tuple(worn[obj][index] for index in varying)
                if kind not in pictures:
                    size = _size(kind, detail or ()) if part == "skin" else EYE_SIZE
                    pictures[kind] = bake_colour(scene, obj, uv_map, varying, f"{obj.name} Colour", size)
                picture = pictures[kind]
            for index, material in enumerate(worn[obj]):
                if material is not None:
                    key = material, picture if index in varying else None
                    if key not in plain:
                        plain[key] = _plain(*key, uv_map, detail)
                        plain[key].name = names[material]
                    obj.data.materials[index] = plain[key]
            bridge.remove_attributes(obj.data, ATTRIBUTES)  # engines would tint the pictures with them
        yield
    finally:
        bpy.data.batch_remove([*plain.values(), *pictures.values()])
        for material, name in names.items():
            if material.library is None:
                material.name = name


def _is_ours(material: bpy.types.Material | None) -> bool:
    return material is not None and material.name.startswith(OURS)


def _varies(material: bpy.types.Material | None) -> bool:
    """Whether it is ours and its base colour is made by nodes."""
    colour = base_colour(material) if _is_ours(material) else None
    return colour is not None and colour.is_linked


def _uv_map(obj: bpy.types.Object) -> str | None:
    """The UV map for an object's picture, laid out around the gaze if it is an eye; None if there is no place for one."""
    layers = obj.data.uv_layers
    if len(layers):
        return UV_MAP if UV_MAP in layers else next(layer.name for layer in layers if layer.active_render)
    place = bridge.read_vectors(obj.data, EYE)
    if place is None:
        return None
    bridge.add_uv(obj.data, UV_MAP, (0.5 + place[:, :2] / (2 * REACH)).clip(0, 1))
    return UV_MAP


def _size(materials, detail) -> int:
    """Pixels enough for the largest picture in the materials, those of the ``detail`` left out."""
    nodes = [node for material in materials for node in material.node_tree.nodes if node.type == "TEX_IMAGE"]
    pictures = [node.image for node in nodes if node.image is not None and node.image not in detail]
    return max([SKIN_SIZE, *(max(picture.size) for picture in pictures)])


def _plain(
    material: bpy.types.Material, picture: bpy.types.Image | None, uv_map: str | None, detail: DetailImages | None
) -> bpy.types.Material:
    if not _is_ours(material) or (base_colour(material) is None and not material.name.startswith(CORNEA)):
        return material.copy()
    plain = bpy.data.materials.new(material.name)
    plain.diffuse_color = material.diffuse_color
    graph = Graph(plain)
    if material.name.startswith(CORNEA):
        colour, opacity, rough = FILM
        inputs = {"Base Color": colour, "Alpha": opacity, "Roughness": rough}
        plain.surface_render_method = "BLENDED"
    else:
        own = base_colour(material)
        rough = socket(own.node.inputs, "Roughness")
        inputs = {
            "Base Color": tuple(material.diffuse_color if own.is_linked else own.default_value),
            "Roughness": ROUGHNESS if rough.is_linked else rough.default_value,
        }
        if picture is not None:
            place = graph.node("UVMap", uv_map=uv_map).outputs[0]
            image = graph.node("TexImage", {"Vector": place}, image=picture, extension="EXTEND")
            inputs["Base Color"] = socket(image.outputs, "Color")
        if detail is not None:
            inputs["Normal"] = detail_normal(graph, detail)
    graph.surface(graph.node("BsdfPrincipled", inputs).outputs[0])
    return plain
