# SPDX-License-Identifier: GPL-3.0-or-later
"""Which picture gives a material its colour: found by following the links that colour comes along, into groups too."""

import bpy

#: Inputs of shaders that colour comes in by, what is lit before what glows by itself.
_LIT, _GLOWING = ("Base Color", "Color"), ("Emission Color", "Emission", "Emissive Color")
_OF_NUMBERS = ("VALUE", "VECTOR")


def image_of(material: bpy.types.Material) -> bpy.types.Image | None:
    """The picture that gives ``material``'s surface its colour; None: there is none.

    Colour may come through shaders that are mixed or glow, through nodes that change it, and through groups of any depth. Of
    several pictures it is the first: what is mixed before what is mixed into it, what is lit before what glows. Masks,
    distortions, opacity and pictures of numbers are no colour.
    """
    tree = material.node_tree
    if tree is None:
        return None
    outputs = [node for node in tree.nodes if node.type == "OUTPUT_MATERIAL"]
    outputs.sort(key=lambda node: node.is_active_output)
    # what is still to be looked at, the first last: an input, and the groups that it is in
    ahead, seen = [(node.inputs["Surface"], ()) for node in outputs], set()
    while ahead:
        target, within = ahead.pop()
        for link in target.links:
            if link.is_muted:
                continue
            node, source = link.from_node, link.from_socket
            if (node, source.identifier, within) in seen:
                continue
            seen.add((node, source.identifier, within))
            if _is_picture(node, source):
                return node.image
            ahead.extend(reversed(_behind(node, source, within)))
    return None


def _is_picture(node, source) -> bool:
    if node.type != "TEX_IMAGE" or node.mute or node.image is None or source.type != "RGBA":
        return False
    return not node.image.colorspace_settings.is_data


def _behind(node, source, within) -> list:
    """The inputs that the colour of an output, ``source`` of ``node``, comes from, the likeliest first, each with the groups
    that it is in: those ``within`` which the node is, from the outermost."""
    if node.mute:
        return [(link.from_socket, within) for link in node.internal_links]
    if node.type == "GROUP":
        ends = [end for end in node.node_tree.nodes if end.type == "GROUP_OUTPUT" and end.is_active_output]
        return [(one, (*within, node)) for end in ends for one in _same(end.inputs, source)]
    if node.type == "GROUP_INPUT":
        return [(one, within[:-1]) for one in _same(within[-1].inputs, source)] if within else []
    return [(one, within) for one in _colours(node)]


def _same(sockets, source) -> list:
    return [one for one in sockets if one.identifier == source.identifier]


def _colours(node) -> list:
    """The inputs of a node, no group, whose colours its output shows."""
    inputs = [one for one in node.inputs if one.enabled]
    if any(out.type == "SHADER" for out in node.outputs):
        mixed = [one for one in inputs if one.type == "SHADER"]
        own = [one for names in (_LIT, _GLOWING) for one in inputs if one.name in names and _glows(node, one)]
        return _of_mixed(node, inputs, mixed) + own
    if node.type.startswith("TEX_"):
        return []
    colours = [one for one in inputs if one.type in ("RGBA", "SHADER")]
    if node.type in ("MIX", "MIX_RGB"):
        return _of_mixed(node, inputs, colours)
    # without any it makes a colour of numbers, as of those of its channels
    return colours or [one for one in inputs if one.type in _OF_NUMBERS]


def _glows(node, socket) -> bool:
    """Whether a shader's input is seen: light of no strength is not."""
    strength = next((one for one in node.inputs if one.name == "Emission Strength"), None)
    return socket.name not in _GLOWING or strength is None or strength.is_linked or strength.default_value > 0


def _of_mixed(node, inputs, mixed) -> list:
    """Those of two inputs ``mixed`` that are seen: a constant factor may leave one out."""
    share = next((one for one in inputs if one.name in ("Fac", "Factor") and one.type == "VALUE"), None)
    if share is None or share.is_linked or len(mixed) != 2:
        return mixed
    if share.default_value <= 0:
        return mixed[:1]
    replaced = share.default_value >= 1 and getattr(node, "blend_type", "MIX") == "MIX"
    return mixed[1:] if replaced else mixed
