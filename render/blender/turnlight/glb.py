"""Reads a model: binary glTF 2.0 with TURNLIGHT_view_dependent_texture (docs/model-format.md).

Reading trusts nothing: counts are checked against the bytes that are there before anything is made of them,
numbers must be finite, and no address in a file is followed. Images stay coded; `pictures` decodes them.
"""

import json
import struct
from dataclasses import dataclass

import numpy as np

from .directions import Facets
from .headers import check_image

EXTENSION = "TURNLIGHT_view_dependent_texture"
VERSION = 1
METHODS = ("static", "vdtm", "dyntex", "lumigraph")

# As the other readers: no atlas has more texels, or a longer side. Memory ends earlier than texels do.
MOST_TEXELS = 2**26
LONGEST_SIDE = 2**15
# Memory that a model may take; a few hundred bytes of PNG can ask for any amount.
MOST_BYTES = 2**33
# What a texel takes in a layer, in a ray (colour and number of the view), and beside them: while a picture is decoded,
# blended and handed to Blender.
LAYER_BYTES, RAY_BYTES, TEXEL_BYTES = 3, 5, 192
# Weights for an eye: facets times layers.
MOST_WEIGHTS = 2**26

FLOAT, UNSIGNED_INT, UNSIGNED_SHORT, SHORT = 5126, 5125, 5123, 5122
KINDS = {FLOAT: "<f4", UNSIGNED_INT: "<u4", UNSIGNED_SHORT: "<u2", SHORT: "<i2"}


class ModelError(Exception):
    """A file that is refused; the message says why."""


@dataclass(frozen=True)
class Mesh:
    """The proxy: positions (V × 3, world units), uvs (V × 2, v down), faces (F × 3)."""

    positions: np.ndarray
    uvs: np.ndarray
    faces: np.ndarray


@dataclass(frozen=True)
class Layer:
    """One layer: a coded image; its value is `offset + scale · texel`, in levels of 0..255."""

    coded: bytes
    scale: float
    offset: float


@dataclass(frozen=True)
class Ray:
    """One slot of a lumigraph: coded images of colours and of view numbers."""

    color: bytes
    view: bytes


@dataclass(frozen=True)
class Model:
    """What a file says, checked; what its method does not have is empty or None."""

    method: str
    size: tuple  # width and height of the atlas
    mesh: Mesh
    layers: list
    facet_map: bytes
    facets: Facets
    rays: list
    camera_centers: np.ndarray  # views × 3
    materials: int  # materials laid on charts, which are not drawn


def read(data):
    """The model in `data`, the bytes of a file. Raises ModelError."""
    try:
        return _read(_Reader(*_split(data)))
    except RecursionError:
        raise ModelError("its JSON is nested too deeply") from None


def _split(data):
    """JSON and binary chunk."""
    if len(data) < 20 or data[:4] != b"glTF":
        raise ModelError("it is no binary glTF, or cut off")
    _, version, length, text_length = struct.unpack_from("<4sIII", data)
    if version != 2 or data[16:20] != b"JSON":
        raise ModelError(f"it is no binary glTF 2.0 (version {version})")
    if length > len(data) or 28 + text_length > length:
        raise ModelError("it is cut off")
    try:
        root = json.loads(data[20 : 20 + text_length].decode("utf-8"), parse_constant=_refuse_constant)
    except ValueError as fault:
        raise ModelError(f"its JSON does not parse ({fault})") from None
    body_length, kind = struct.unpack_from("<I4s", data, 20 + text_length)
    start = 28 + text_length
    if kind != b"BIN\0" or start + body_length > length:
        raise ModelError("its binary chunk is cut off")
    if not isinstance(root, dict):
        raise ModelError("its JSON is no object")
    return root, memoryview(data)[start : start + body_length]


def _refuse_constant(name):
    raise ValueError(f"{name} is no number of JSON")


def _items(value):
    """A list of objects, whatever stands there."""
    return [item if isinstance(item, dict) else {} for item in value] if isinstance(value, list) else []


def _is_index(value):
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def _is_number(value):
    is_real = isinstance(value, (int, float)) and not isinstance(value, bool)
    return is_real and -1e30 < value < 1e30


class _Reader:
    """Bytes of a binary glTF by the numbers of its JSON."""

    def __init__(self, root, body):
        self.root = root
        self.body = body
        self._refuse_addresses()

    def _refuse_addresses(self):
        buffers = _items(self.root.get("buffers"))
        if len(buffers) != 1 or "uri" in buffers[0]:
            raise ModelError("a buffer lies outside the file; models name no other files")
        for number, image in enumerate(_items(self.root.get("images"))):
            if "uri" in image:
                raise ModelError(f"image {number} lies outside the file; models name no other files")

    def entry(self, kind, index, what):
        entries = _items(self.root.get(kind))
        if not _is_index(index) or index >= len(entries):
            raise ModelError(f"it has no {what}")
        return entries[index]

    def view(self, index, what):
        view = self.entry("bufferViews", index, what)
        start, length = view.get("byteOffset", 0), view.get("byteLength")
        if view.get("buffer") != 0 or not _is_index(start) or not _is_index(length):
            raise ModelError(f"the buffer view of its {what} has no range")
        if start + length > len(self.body):
            raise ModelError(f"the buffer view of its {what} reaches past the end of the file")
        return self.body[start : start + length]

    def accessor(self, index, component, kind, per, what):
        """The elements of a packed accessor, count × per."""
        accessor = self.entry("accessors", index, what)
        if accessor.get("componentType") != component or accessor.get("type") != kind:
            raise ModelError(f"its {what} are not {kind} of component type {component}")
        dtype = np.dtype(KINDS[component])
        width = per * dtype.itemsize
        stride = self.entry("bufferViews", accessor.get("bufferView"), what).get("byteStride", width)
        if stride != width or "sparse" in accessor:
            raise ModelError(f"its {what} are sparse or interleaved, which is not read")
        data = self.view(accessor.get("bufferView"), what)
        offset, count = accessor.get("byteOffset", 0), accessor.get("count")
        if not _is_index(offset) or not _is_index(count) or offset + count * width > len(data):
            raise ModelError(f"its {what} count more elements than the file holds")
        return np.frombuffer(data, dtype, count * per, offset).reshape(count, per)

    def part(self, index, component, kind, per, what):
        """As `accessor`, but empty where there is nothing to say."""
        if index is None:
            return np.zeros((0, per), KINDS[component])
        return self.accessor(index, component, kind, per, what)

    def floats(self, index, kind, per, what):
        values = self.accessor(index, FLOAT, kind, per, what)
        if not np.isfinite(values).all():
            raise ModelError(f"its {what} hold a value that is no number")
        return values.astype(np.float64)

    def image(self, index, size, what):
        """The bytes of an image whose header says `size`."""
        data = bytes(self.view(self.entry("images", index, what).get("bufferView"), what))
        try:
            check_image(data, size)
        except ValueError as fault:
            raise ModelError(f"{what} {fault}") from None
        return data


def _read(reader):
    material = reader.entry("materials", 0, "material")
    extensions = material.get("extensions")
    said = extensions.get(EXTENSION) if isinstance(extensions, dict) else None
    if not isinstance(said, dict):
        raise ModelError(f"its material has no extension {EXTENSION}")
    if said.get("version") != VERSION:
        raise ModelError(f"version {said.get('version')} of the extension; this add-on reads version {VERSION}")
    if said.get("method") not in METHODS:
        raise ModelError(f"no method '{said.get('method')}'")
    size = _atlas_size(said)
    _refuse_excess(reader, said, size)
    parts = {"layers": [], "facet_map": b"", "facets": None, "rays": [], "camera_centers": np.zeros((0, 3))}
    parts |= _read_rays(reader, said, size) if said["method"] == "lumigraph" else _read_layers(reader, said, size)
    materials = len(_items(said.get("materials")))
    return Model(method=said["method"], size=size, mesh=_read_mesh(reader), materials=materials, **parts)


def _atlas_size(said):
    size = said.get("atlasSize")
    is_pair = isinstance(size, list) and len(size) == 2 and all(_is_index(side) for side in size)
    if not is_pair or not all(1 <= side <= LONGEST_SIDE for side in size) or size[0] * size[1] > MOST_TEXELS:
        raise ModelError(f"an atlas of {size} texels")
    return tuple(size)


def _refuse_excess(reader, said, size):
    """A small file may not ask for any memory: layers have images of their own, and not too many."""
    rays = _items(said.get("rays"))
    named = [layer.get("image") for layer in _items(said.get("layers"))]
    named += [ray.get(key) for ray in rays for key in ("color", "view")]
    images = _items(reader.root.get("images"))
    held = [images[index] for index in named if _is_index(index) and index < len(images)]
    # What is missing counts nothing here, and is named when it is read.
    if sum(len(reader.view(image.get("bufferView"), "images")) for image in held) > len(reader.body):
        raise ModelError("its layers share images")
    each = RAY_BYTES * len(rays) + LAYER_BYTES * (len(named) - 2 * len(rays)) + TEXEL_BYTES
    needed = each * size[0] * size[1]
    if needed > MOST_BYTES:
        remedy = "make it with a smaller atlas, or with fewer layers"
        raise ModelError(f"it takes {needed >> 20} MiB, where {MOST_BYTES >> 20} are allowed; {remedy}")


def _read_mesh(reader):
    primitives = _items(reader.entry("meshes", 0, "mesh").get("primitives"))
    if len(primitives) != 1 or primitives[0].get("mode", 4) != 4:
        raise ModelError("its mesh is not one primitive of triangles")
    attributes = primitives[0].get("attributes")
    attributes = attributes if isinstance(attributes, dict) else {}
    positions = reader.floats(attributes.get("POSITION"), "VEC3", 3, "positions")
    uvs = reader.floats(attributes.get("TEXCOORD_0"), "VEC2", 2, "texture coordinates")
    corners = reader.accessor(primitives[0].get("indices"), UNSIGNED_INT, "SCALAR", 1, "faces")
    faces = corners[: len(corners) // 3 * 3].reshape(-1, 3).astype(np.int64)
    if len(uvs) != len(positions):
        raise ModelError(f"{len(uvs)} texture coordinates for {len(positions)} positions")
    if faces.size and faces.max() >= len(positions):
        raise ModelError(f"a face names vertex {faces.max()} of {len(positions)}")
    if ((uvs < -1e-6) | (uvs > 1 + 1e-6)).any():
        raise ModelError("a texture coordinate lies outside the atlas")
    return Mesh(positions, uvs, faces)


def _read_layers(reader, said, size):
    layers = []
    for k, layer in enumerate(_items(said.get("layers"))):
        scale, offset = layer.get("scale"), layer.get("offset")
        if not _is_number(scale) or not _is_number(offset):
            raise ModelError(f"layer {k} has a scale or offset that is no number")
        layers.append(Layer(reader.image(layer.get("image"), size, f"layer {k}"), scale, offset))
    if not layers:
        raise ModelError("it has no layers")
    facet_map = reader.image(said.get("facetMap"), size, "facet map")
    return {"layers": layers, "facet_map": facet_map, "facets": _read_facets(reader, said, len(layers))}


def _read_facets(reader, said, layers):
    counts = reader.accessor(said.get("facets"), UNSIGNED_SHORT, "VEC4", 4, "facets").astype(np.int64)
    centers = reader.floats(said.get("facetCenters"), "VEC3", 3, "facet centres")
    if len(centers) != len(counts):
        raise ModelError(f"{len(centers)} centres for {len(counts)} facets")
    if len(counts) * layers > MOST_WEIGHTS:
        raise ModelError(f"{len(counts)} facets of {layers} layers")
    scales = said.get("coefficientScales")
    if not isinstance(scales, list) or len(scales) != layers or not all(_is_number(scale) for scale in scales):
        raise ModelError("its coefficient scales do not fit its layers")
    wild = np.flatnonzero((counts[:, 3] < 1) | (counts[:, 3] > layers))
    if wild.size:
        raise ModelError(f"facet {wild[0]} uses {counts[wild[0], 3]} of {layers} layers")
    directions = reader.part(said.get("directions"), SHORT, "VEC3", 3, "directions")
    triangles = reader.part(said.get("triangles"), UNSIGNED_SHORT, "SCALAR", 1, "triangles")
    edges = reader.part(said.get("edges"), UNSIGNED_SHORT, "SCALAR", 1, "edges")
    coefficients = reader.part(said.get("coefficients"), SHORT, "SCALAR", 1, "coefficients")
    sites, faces, lines, ranks = counts.T
    wanted = {"directions": sites, "triangles": 3 * faces, "edges": 2 * lines, "coefficients": sites * ranks}
    given = {"directions": directions, "triangles": triangles, "edges": edges, "coefficients": coefficients}
    for what, count in wanted.items():
        if count.sum() > len(given[what]):
            raise ModelError(f"its facets want more {what} than there are")
    given = {what: values[: wanted[what].sum()] for what, values in given.items()}
    try:
        return Facets(
            counts=counts,
            centers=centers,
            directions=_snorm(given["directions"]),
            triangles=given["triangles"].reshape(-1, 3).astype(np.int64),
            edges=given["edges"].reshape(-1, 2).astype(np.int64),
            coefficients=_snorm(given["coefficients"]).ravel(),
            scales=np.array(scales, np.float64),
            axis=_ring_axis(said),
        )
    except ValueError as fault:
        raise ModelError(str(fault)) from None


def _snorm(values):
    """What a normalised 16-bit integer of glTF means."""
    return np.maximum(values.astype(np.float64) / 32767.0, -1.0)


def _ring_axis(said):
    axis = said.get("ringAxis")
    if axis is None:
        return None
    is_vector = isinstance(axis, list) and len(axis) == 3 and all(_is_number(v) for v in axis)
    if not is_vector or abs(np.linalg.norm(axis) - 1) > 1e-3:
        raise ModelError("its ring axis is no unit vector")
    return np.array(axis, np.float64)


def _read_rays(reader, said, size):
    centers = reader.floats(said.get("cameraCenters"), "VEC3", 3, "camera centres")
    rays = []
    for k, ray in enumerate(_items(said.get("rays"))):
        color = reader.image(ray.get("color"), size, f"ray colours {k}")
        rays.append(Ray(color, reader.image(ray.get("view"), size, f"ray views {k}")))
    if not rays:
        raise ModelError("it has no rays")
    return {"rays": rays, "camera_centers": centers}
