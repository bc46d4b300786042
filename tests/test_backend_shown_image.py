# SPDX-License-Identifier: GPL-3.0-or-later
"""Which picture gives a material its colour, as importers and photogrammetry add-ons build materials."""

import numpy as np
import pytest


class _Material:
    """A material being built, with pictures ``skin`` and ``other``, and ``numbers`` that are no colours."""

    def __init__(self, bpy):
        from headshop.headshop_addon.shader_nodes import Graph

        self.bpy, self.material = bpy, bpy.data.materials.new("scan")
        self.graph = Graph(self.material)
        for name in ("skin", "other", "numbers"):
            setattr(self, name, bpy.data.images.new(name, 2, 2))
        self.numbers.colorspace_settings.name = "Non-Color"

    def picture(self, image, output="Color"):
        return self.graph.node("TexImage", image=image).outputs[output]

    def node(self, kind, inputs, output=0, **settings):
        return self.graph.node(kind, inputs, **settings).outputs[output]

    def shown(self, shader):
        """The name of the picture that is found when the surface shows ``shader``."""
        from headshop.headshop_addon.scan_texture import image_of

        nodes = self.graph.tree.nodes
        for node in [node for node in nodes if node.type == "OUTPUT_MATERIAL"]:
            nodes.remove(node)
        self.graph.surface(shader)
        image = image_of(self.material)
        return None if image is None else image.name

    def group(self, build, name="Group"):
        """A node of a new group: ``build(graph, colour input)`` returns what the group puts out."""
        from headshop.headshop_addon.shader_nodes import Graph

        class _Owner:
            node_tree = self.bpy.data.node_groups.new(name, "ShaderNodeTree")

        tree = _Owner.node_tree
        tree.interface.new_socket("Unused", in_out="INPUT", socket_type="NodeSocketColor")
        tree.interface.new_socket("Tint", in_out="INPUT", socket_type="NodeSocketColor")
        tree.interface.new_socket("Mask", in_out="OUTPUT", socket_type="NodeSocketColor")
        graph = Graph(_Owner)
        start, end = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
        made = build(graph, start.outputs["Tint"])
        kind = "NodeSocketShader" if made.type == "SHADER" else "NodeSocketColor"
        tree.interface.new_socket("Made", in_out="OUTPUT", socket_type=kind)
        tree.links.new(made, end.inputs["Made"])
        node = self.graph.node("Group", node_tree=tree)
        return node


@pytest.fixture
def made(bpy):
    return _Material(bpy)


@pytest.mark.parametrize(
    ("kind", "key", "settings"),
    [
        ("Gamma", "Color", {}),
        ("HueSaturation", "Color", {}),
        ("BrightContrast", "Color", {}),
        ("RGBCurve", "Color", {}),
        ("Invert", "Color", {}),
        ("MixRGB", "Color1", {}),
        ("MixRGB", "Color2", {}),
        ("Mix", "A_Color", {"data_type": "RGBA"}),
        ("Mix", "B_Color", {"data_type": "RGBA", "blend_type": "MULTIPLY"}),
        ("VectorMath", 0, {}),
    ],
)
@pytest.mark.parametrize("shader", ["BsdfPrincipled", "BsdfDiffuse", "Emission", "Background"])
def test_through_nodes_that_change_colour_to_any_shader(made, shader, kind, key, settings):
    colour = made.node(kind, {key: made.picture(made.skin)}, **settings)
    colour = next(out for out in colour.node.outputs if out.enabled)
    assert made.shown(made.node(shader, {0: colour})) == "skin"


def test_through_channels(made):
    channels = made.node("SeparateColor", {"Color": made.picture(made.skin)}).node.outputs
    colour = made.node("CombineColor", {0: channels[2], 1: channels[1], 2: channels[0]})
    assert made.shown(made.node("BsdfPrincipled", {"Base Color": colour})) == "skin"


def test_through_rerouted_links(made):
    reroute = made.graph.tree.nodes.new("NodeReroute")
    made.graph.tree.links.new(made.picture(made.skin), reroute.inputs[0])
    assert made.shown(made.node("BsdfPrincipled", {"Base Color": reroute.outputs[0]})) == "skin"


def test_through_shaders_that_are_mixed(made):
    """As an opacity is made, and as unlit glTF is."""
    opaque = made.node("BsdfDiffuse", {"Color": made.picture(made.skin)})
    clear = made.node("BsdfTransparent", {})
    mixed = made.node("MixShader", {0: made.picture(made.other, "Alpha"), 1: clear, 2: opaque})
    assert made.shown(made.node("AddShader", {0: mixed, 1: made.node("Emission", {})})) == "skin"


def test_a_shader_that_is_mixed_out_shows_nothing(made):
    first, second = (made.node("BsdfDiffuse", {"Color": made.picture(each)}) for each in (made.other, made.skin))
    assert made.shown(made.node("MixShader", {0: 1.0, 1: first, 2: second})) == "skin"
    assert made.shown(made.node("MixShader", {0: 0.0, 1: second, 2: first})) == "skin"
    assert made.shown(made.node("MixShader", {0: 0.5, 1: second, 2: first})) == "skin"
    assert made.shown(made.node("MixShader", {0: 0.0, 1: made.node("BsdfTransparent", {}), 2: first})) is None


def test_a_factor_that_is_linked_leaves_nothing_out(made):
    mixed = made.node("MixShader", {0: 0.0, 2: made.node("BsdfDiffuse", {"Color": made.picture(made.skin)})})
    made.graph.put(mixed.node, 0, made.picture(made.other, "Alpha"))
    assert made.shown(mixed) == "skin"


def test_what_a_mix_of_numbers_once_had_as_colour_is_not_seen(made):
    colour = made.graph.mix(0.5, made.picture(made.skin), (1.0, 1, 1))
    colour.node.data_type = "FLOAT"
    assert made.shown(made.node("BsdfPrincipled", {"Base Color": colour.node.outputs[0]})) is None


def test_of_mixed_pictures_it_is_the_first_unless_the_second_replaces_it(made):
    first, second = made.picture(made.skin), made.picture(made.other)
    for factor, blend, wanted in ((0.5, "MIX", "skin"), (1.0, "MULTIPLY", "skin"), (1.0, "MIX", "other")):
        colour = made.graph.mix(factor, first, second, blend)
        assert made.shown(made.node("BsdfPrincipled", {"Base Color": colour})) == wanted
        colour = made.node("MixRGB", {0: factor, 1: first, 2: second}, blend_type=blend)
        assert made.shown(made.node("BsdfPrincipled", {"Base Color": colour})) == wanted


def test_masks_opacity_numbers_and_distortions_are_no_colour(made):
    mask = made.graph.mix(made.picture(made.other), (1.0, 0, 0), (0.0, 1, 0))
    noise = made.node("TexNoise", {"Vector": made.picture(made.other)}, "Color")
    for colour in (mask, noise, made.picture(made.numbers), made.picture(made.other, "Alpha"), (1.0, 0, 0)):
        inputs = {
            "Base Color": colour,
            "Alpha": made.picture(made.other, "Alpha"),
            "Roughness": made.picture(made.other),
        }
        assert made.shown(made.node("BsdfPrincipled", inputs)) is None


def test_what_is_lit_counts_before_what_glows_and_light_of_no_strength_not_at_all(made):
    def glowing(strength, **more):
        return made.node(
            "BsdfPrincipled", {"Emission Color": made.picture(made.other), "Emission Strength": strength} | more
        )

    assert made.shown(glowing(1.0)) == "other"
    assert made.shown(glowing(0.0)) is None
    assert made.shown(glowing(1.0, **{"Base Color": made.picture(made.skin)})) == "skin"


def test_into_groups_and_out_of_them(made):
    def outer(graph, tint):
        return graph.node("BsdfPrincipled", {"Base Color": graph.node("Gamma", {"Color": tint}).outputs[0]}).outputs[0]

    group = made.group(outer)
    made.graph.put(group, "Unused", made.picture(made.other))
    assert made.shown(group.outputs["Made"]) is None
    made.graph.put(group, "Tint", made.picture(made.skin))
    assert made.shown(group.outputs["Made"]) == "skin"


def test_a_group_that_is_used_twice_is_followed_as_each_is_linked(made):
    def inner(graph, tint):
        return graph.node("HueSaturation", {"Color": tint}).outputs[0]

    one = made.group(inner)
    two = made.graph.node("Group", node_tree=one.node_tree)
    made.graph.put(one, "Tint", made.picture(made.skin))
    made.graph.put(two, "Tint", one.outputs["Made"])
    assert made.shown(made.node("Emission", {"Color": two.outputs["Made"]})) == "skin"


def test_through_a_group_within_a_group(made):
    one = made.group(lambda graph, tint: graph.node("Gamma", {"Color": tint}).outputs[0])

    def outer(graph, tint):
        node = graph.node("Group", node_tree=one.node_tree)
        graph.put(node, "Tint", tint)
        return node.outputs["Made"]

    two = made.group(outer)
    made.graph.put(two, "Tint", made.picture(made.skin))
    assert made.shown(made.node("Emission", {"Color": two.outputs["Made"]})) == "skin"


def test_pictures_within_groups(made):
    def inner(graph, tint):
        return graph.node("TexImage", image=made.skin).outputs["Color"]

    group = made.group(inner)
    assert made.shown(made.node("Emission", {"Color": group.outputs["Made"]})) == "skin"
    assert made.shown(made.node("Emission", {"Color": group.outputs["Mask"]})) is None
    nodes = group.node_tree.nodes
    end, picture = nodes.new("NodeGroupOutput"), nodes.new("ShaderNodeTexImage")
    group.node_tree.links.new(picture.outputs["Color"], end.inputs["Made"])
    picture.image = made.other
    for active, wanted in ((True, "other"), (False, "skin")):  # the group puts out what its active output gets
        end.is_active_output = active
        next(node for node in nodes if node.type == "GROUP_OUTPUT" and node != end).is_active_output = not active
        assert made.shown(made.node("Emission", {"Color": group.outputs["Made"]})) == wanted
    colour = made.node("Emission", {"Color": group.outputs["Made"]})
    group.node_tree = None
    assert made.shown(colour) is None


def test_muted_nodes_pass_through_and_muted_pictures_are_none(made):
    first, second = made.picture(made.skin), made.picture(made.other)
    colour = made.graph.mix(1.0, first, second)
    shader = made.node("BsdfPrincipled", {"Base Color": colour})
    colour.node.mute = True
    assert made.shown(shader) == "skin"
    first.node.mute = True
    assert made.shown(shader) is None


def test_links_that_are_muted_pass_nothing_on(made):
    shader = made.node("BsdfPrincipled", {"Base Color": made.picture(made.skin)})
    assert made.shown(shader) == "skin"
    (link,) = shader.node.inputs["Base Color"].links
    link.is_muted = True
    assert made.shown(shader) is None


def test_the_active_output_counts_first(made):
    nodes, shaders = made.graph.tree.nodes, []
    for image in (made.other, made.skin, made.other):
        shaders.append(made.node("Emission", {"Color": made.picture(image)}))
        made.graph.surface(shaders[-1])
    outputs = [node for node in nodes if node.type == "OUTPUT_MATERIAL"]
    outputs[1].is_active_output = True
    from headshop.headshop_addon.scan_texture import image_of

    assert image_of(made.material).name == "skin"


def test_links_in_a_circle_come_to_an_end(made):
    a, b = (made.graph.node("Gamma") for _ in range(2))
    made.graph.put(a, "Color", b.outputs[0])
    made.graph.put(b, "Color", a.outputs[0])
    assert made.shown(made.node("BsdfPrincipled", {"Base Color": a.outputs[0]})) is None


def test_an_adopted_object_shows_what_its_group_does(made):
    """Up to the colours of the mesh."""
    from headshop.headshop_addon import bridge, scan_texture
    from headshop.sim.mesh import Mesh
    from headshop.sim.scan.joined import joined

    def glowing(graph, tint):
        return graph.node("Emission", {0: graph.node("TexImage", image=made.skin).outputs[0]}).outputs[0]

    made.skin.pixels = np.tile([0.0, 1, 0, 1], 4).tolist()
    made.graph.surface(made.group(glowing).outputs["Made"])
    points = np.array([[0.0, 0, 0], [10, 0, 0], [0, 0, 10]])
    uv = np.zeros((1, 4, 2), np.float32) + 0.5
    obj = bridge.mesh_to_object(Mesh(points, np.array([[0, 1, 2, -1]], np.int32), uv=uv), "scan")
    obj.data.materials.append(made.material)
    scan = joined([scan_texture.with_pictures(bridge.object_to_mesh(obj), obj)])
    np.testing.assert_allclose(scan.colour, [[0, 1, 0]] * 3, atol=1e-6)
