"""A surface that shows its picture as stored: no light falls on it, none is asked for.

The picture holds encoded sRGB, and is filtered so; what leaves it is decoded to linear light, which a view transform
"Standard" encodes again. So a render shows the bytes of the file.
"""

import bpy

GROUP = "Turnlight: encoded sRGB to light"


def new_material(name, image):
    """An emission of what `image` shows."""
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    picture = _node(tree, "ShaderNodeTexImage", -560)
    picture.image, picture.extension, picture.interpolation = image, "EXTEND", "Linear"
    decode = _node(tree, "ShaderNodeGroup", -240)
    decode.node_tree = _decoder()
    emission = _node(tree, "ShaderNodeEmission", -40)
    output = _node(tree, "ShaderNodeOutputMaterial", 160)
    tree.links.new(picture.outputs["Color"], decode.inputs["Encoded"])
    tree.links.new(decode.outputs["Light"], emission.inputs["Color"])
    tree.links.new(emission.outputs["Emission"], output.inputs["Surface"])
    if hasattr(material, "cycles"):
        # It is a picture of light, not a lamp: thousands of glowing triangles would only slow the sampling.
        material.cycles.emission_sampling = "NONE"
    return material


def _node(tree, kind, x, y=0, **settings):
    node = tree.nodes.new(kind)
    node.location = (x, y)
    for name, value in settings.items():
        setattr(node, name, value)
    return node


def _decoder():
    """IEC 61966-2-1: v / 12.92 up to 0.04045, above ((v + 0.055) / 1.055) ^ 2.4; per channel."""
    found = bpy.data.node_groups.get(GROUP)
    if found is not None:
        return found
    tree = bpy.data.node_groups.new(GROUP, "ShaderNodeTree")
    tree.interface.new_socket("Encoded", in_out="INPUT", socket_type="NodeSocketColor")
    tree.interface.new_socket("Light", in_out="OUTPUT", socket_type="NodeSocketColor")
    encoded = _node(tree, "NodeGroupInput", -700).outputs["Encoded"]
    low = _vector(tree, "MULTIPLY", (-400, 200), encoded, (1 / 12.92,) * 3)
    raised = _vector(tree, "MULTIPLY_ADD", (-400, 0), encoded, (1 / 1.055,) * 3, (0.055 / 1.055,) * 3)
    high = _node(tree, "ShaderNodeGamma", -200)
    high.inputs["Gamma"].default_value = 2.4
    tree.links.new(raised, high.inputs["Color"])
    # Pictures hold 0 to 1, so that rounding up what is above the bend gives 1, and 0 for the rest.
    above = _vector(tree, "SUBTRACT", (-400, -200), encoded, (0.04045,) * 3)
    is_high = _vector(tree, "CEIL", (-200, -200), above)
    rise = _vector(tree, "SUBTRACT", (0, 100), high.outputs["Color"], low)
    light = _vector(tree, "MULTIPLY_ADD", (200, 0), is_high, rise, low)
    output = _node(tree, "NodeGroupOutput", 400)
    tree.links.new(light, output.inputs["Light"])
    return tree


def _vector(tree, operation, at, *operands):
    """The result of vector arithmetic on sockets and constants."""
    node = _node(tree, "ShaderNodeVectorMath", *at, operation=operation)
    for socket, operand in zip(node.inputs, operands):
        if isinstance(operand, tuple):
            socket.default_value = operand
        else:
            tree.links.new(operand, socket)
    return node.outputs["Vector"]
