# SPDX-License-Identifier: GPL-3.0-or-later
"""What a mesh's materials show as base colour, baked into a picture on its UV map, as engines want it."""

import bpy

from ..sim.errors import InputError
from .quiet import quiet
from .shader_nodes import node_tree, socket

MARGIN = 8  # pixels painted beyond the border of what is seen, for coarser copies of the picture
SAMPLES = 4  # a texel: what is baked glows by itself and has no noise


def base_colour(material: bpy.types.Material) -> bpy.types.NodeSocket | None:
    """The base colour of the Principled BSDF that a material shows; None if it shows another shader."""
    output = material.node_tree.get_output_node("ALL") if material.node_tree is not None else None
    links = socket(output.inputs, "Surface").links if output is not None else ()
    if not links or links[0].from_node.type != "BSDF_PRINCIPLED":
        return None
    return socket(links[0].from_node.inputs, "Base Color")


def bake_colour(
    scene: bpy.types.Scene, obj: bpy.types.Object, uv_map: str, slots, name: str, size: int
) -> bpy.types.Image:
    """A packed picture of ``size`` x ``size`` pixels: the base colours of the faces in the material ``slots`` (indices).

    obj : an object of ``scene``, which becomes one that Cycles renders; its materials are the same afterwards

    Raises
    ------
    InputError : Cycles is switched off.
    """
    try:
        scene.render.engine = "CYCLES"
    except TypeError:
        raise InputError("Blender's Cycles add-on is off: switch it on in Preferences, Add-ons.") from None
    scene.cycles.device, scene.cycles.samples = "CPU", SAMPLES
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    image = bpy.data.images.new(name, size, size, alpha=False)
    aside = bpy.data.images.new(f"{name} aside", 4, 4)  # every face must be baked to somewhere
    worn, glowing = list(obj.data.materials), []
    try:
        for index, material in enumerate(worn):
            glowing.append(_glowing(material, image if index in slots else aside))
            obj.data.materials[index] = glowing[-1]
        _bake(scene, obj, uv_map)
        image.pack()
        image.filepath_raw = f"//{bpy.path.clean_name(name)}.png"  # exporters take the name of a file from here
    except BaseException:
        bpy.data.images.remove(image)
        raise
    finally:
        for index, material in enumerate(worn):
            obj.data.materials[index] = material
        bpy.data.batch_remove([*glowing, aside])
    return image


def _glowing(material: bpy.types.Material | None, target: bpy.types.Image) -> bpy.types.Material:
    """A copy of a material that glows in its base colour and is baked into ``target``."""
    copy = bpy.data.materials.new("Head Shop glowing") if material is None else material.copy()
    tree = node_tree(copy)
    colour = base_colour(copy)
    if colour is not None and colour.links:
        glow = tree.nodes.new("ShaderNodeEmission")
        tree.links.new(colour.links[0].from_socket, glow.inputs[0])
        tree.links.new(glow.outputs[0], socket(tree.get_output_node("ALL").inputs, "Surface"))
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = target
    tree.nodes.active = node  # it is how Blender is told what to bake into
    return copy


def _bake(scene, obj, uv_map: str) -> None:
    layer = scene.view_layers[0]
    only = {"object": obj, "active_object": obj, "selected_objects": [obj], "selected_editable_objects": [obj]}
    with quiet(), bpy.context.temp_override(scene=scene, view_layer=layer, **only):
        layer.update()
        bpy.ops.object.bake(type="EMIT", margin=MARGIN, margin_type="EXTEND", use_clear=False, uv_layer=uv_map)
