"""A model in a scene: a mesh, its material, and the picture that plays.

The picture carries the model's file as a custom property, so that a .blend needs nothing else; the object points at
the picture, so that its place counts and that it comes along when the object is appended elsewhere.
"""

import bpy
import numpy as np

from .material import new_material
from .pictures import new_atlas

# Custom properties: of the picture, the bytes of the .glb; of the object, the picture.
MODEL = "turnlight_model"
PICTURE = "turnlight_picture"


def new_object(name, model, data):
    """An object of `model`, read from the bytes `data`; in no collection yet."""
    image = new_atlas(name, model.size)
    image[MODEL] = data
    mesh = _new_mesh(name, model.mesh)
    mesh.materials.append(new_material(name, image))
    made = bpy.data.objects.new(name, mesh)
    made[PICTURE] = image
    return made


def picture_of(held):
    """The picture of an object that carries a model; None of any other."""
    image = held.get(PICTURE)
    return image if isinstance(image, bpy.types.Image) and isinstance(image.get(MODEL), bytes) else None


def _new_mesh(name, said):
    mesh = bpy.data.meshes.new(name)
    corners = said.faces.ravel().astype(np.int32)
    mesh.vertices.add(len(said.positions))
    mesh.loops.add(len(corners))
    mesh.polygons.add(len(said.faces))
    mesh.vertices.foreach_set("co", said.positions.astype(np.float32).ravel())
    mesh.loops.foreach_set("vertex_index", corners)
    mesh.polygons.foreach_set("loop_start", np.arange(0, len(corners), 3, dtype=np.int32))
    # Blender's v points up.
    uvs = np.stack([said.uvs[:, 0], 1.0 - said.uvs[:, 1]], axis=1).astype(np.float32)
    mesh.uv_layers.new(name="UVMap").data.foreach_set("uv", uvs[corners].ravel())
    mesh.update(calc_edges=True)
    mesh.validate()
    return mesh
