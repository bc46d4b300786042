# SPDX-License-Identifier: GPL-3.0-or-later
"""Build shader node trees in few words, on every Blender we support.

Sockets were renamed between releases (``Fac`` became ``Factor``), so they are looked up by identifier, then by name,
then by the other of the two names.
"""

import bpy

_RENAMED = {"Fac": "Factor", "Factor": "Fac"}


def socket(sockets, key):
    """The socket of a node's ``inputs`` or ``outputs`` with this identifier, name or number."""
    if isinstance(key, int):
        return sockets[key]
    for name in (key, _RENAMED.get(key)):
        for field in ("identifier", "name"):
            for candidate in sockets:
                if getattr(candidate, field) == name:
                    return candidate
    raise KeyError(f"no socket {key!r} among {[s.identifier for s in sockets]}")


def node_tree(owner) -> bpy.types.NodeTree:
    """The node tree of a material or world; newer releases always have one, older ones must be asked."""
    if owner.node_tree is None:
        owner.use_nodes = True
    return owner.node_tree


class Graph:
    """A shader node tree being written from scratch.

    A value given to an input is either a number, a tuple or another node's output (which is linked).
    """

    def __init__(self, owner):
        self.tree = node_tree(owner)
        self.tree.nodes.clear()

    def node(self, kind: str, inputs: dict | None = None, **settings):
        """Add the node ``ShaderNode<kind>``, apply its settings, then set or link its inputs."""
        node = self.tree.nodes.new("ShaderNode" + kind)
        for name, value in settings.items():
            setattr(node, name, value)
        # A row of nodes in the order of writing: readable enough to find one's way.
        node.location = (220 * (len(self.tree.nodes) % 8), -320 * (len(self.tree.nodes) // 8))
        for key, value in (inputs or {}).items():
            self.put(node, key, value)
        return node

    def put(self, node, key, value) -> None:
        """Set one input to a value, or link it to an output."""
        target = socket(node.inputs, key)
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, target)
        elif isinstance(value, tuple) and len(value) == 3 and target.type == "RGBA":
            target.default_value = (*value, 1.0)
        else:
            target.default_value = value

    def attribute(self, name: str, output: str = "Vector"):
        """An attribute of the mesh, as an output."""
        return socket(self.node("Attribute", attribute_name=name).outputs, output)

    def math(self, operation: str, *values, clamp: bool = False):
        """A math node, as an output."""
        return self.node("Math", dict(enumerate(values)), operation=operation, use_clamp=clamp).outputs[0]

    def vector(self, operation: str, *values):
        """A vector math node, as its vector output (its value for LENGTH, DOT_PRODUCT and DISTANCE)."""
        node = self.node("VectorMath", operation=operation)
        for index, value in enumerate(values):
            self.put(node, 3 if operation == "SCALE" and index == 1 else index, value)
        return node.outputs[1 if operation in ("LENGTH", "DOT_PRODUCT", "DISTANCE") else 0]

    def separate(self, vector):
        """The three components of a vector, as outputs."""
        return tuple(self.node("SeparateXYZ", {0: vector}).outputs)

    def combine(self, x=0.0, y=0.0, z=0.0):
        """A vector of three numbers, as an output."""
        return self.node("CombineXYZ", {0: x, 1: y, 2: z}).outputs[0]

    def mix(self, factor, a, b, blend: str = "MIX"):
        """Two colours mixed, as an output."""
        inputs = {"Factor_Float": factor, "A_Color": a, "B_Color": b}
        return socket(self.node("Mix", inputs, data_type="RGBA", blend_type=blend).outputs, "Result_Color")

    def noise(self, vector, scale: float, detail: float = 2.0, roughness: float = 0.5):
        """Fractal noise 0..1, as an output."""
        inputs = {"Vector": vector, "Scale": scale, "Detail": detail, "Roughness": roughness}
        return self.node("TexNoise", inputs).outputs[0]

    def smooth(self, value, low: float, high: float, to_low: float = 0.0, to_high: float = 1.0):
        """A smooth step from ``to_low`` where value <= low to ``to_high`` where value >= high, as an output."""
        inputs = {"Value": value, "From Min": low, "From Max": high, "To Min": to_low, "To Max": to_high}
        return self.node("MapRange", inputs, interpolation_type="SMOOTHSTEP").outputs[0]

    def ramp(self, value, stops):
        """A colour ramp of ``(position, (r, g, b))`` stops, linear, as an output."""
        node = self.node("ValToRGB", {0: value})
        elements = node.color_ramp.elements
        while len(elements) < len(stops):
            elements.new(1.0)
        for element, (position, colour) in zip(elements, stops, strict=True):
            element.position = position
            element.color = (*colour, 1.0)
        return node.outputs[0]

    def bump(self, height, distance: float, strength: float = 1.0, normal=None):
        """A bumped normal from a height 0..1 times ``distance`` metres, as an output."""
        inputs = {"Height": height, "Distance": distance, "Strength": strength}
        if normal is not None:
            inputs["Normal"] = normal
        return self.node("Bump", inputs).outputs[0]

    def surface(self, shader) -> None:
        """Link the shader to the material's output."""
        self.node("OutputMaterial", {"Surface": shader})
