"""An object that needs no add-on any more: a picture per frame, as the camera will see it."""

import pathlib

import bpy
import numpy as np

from . import playback
from .objects import PICTURE, picture_of
from .pictures import new_atlas


def bake(context, held, folder):
    """Blends `held` for every frame of the scene, writes NAME_0001.png and so on into `folder`, and lets it wear them.

    The object does not play afterwards. Raises OSError and RuntimeError where pictures cannot be written.
    """
    scene, image = context.scene, picture_of(held)
    folder.mkdir(parents=True, exist_ok=True)
    name = bpy.path.clean_name(held.name)
    if scene.frame_start < 0:
        raise RuntimeError("frames below 0 make no sequence; start the scene at 0 or later")
    now = scene.frame_current
    try:
        for frame in range(scene.frame_start, scene.frame_end + 1):
            scene.frame_set(frame)
            depsgraph = context.evaluated_depsgraph_get()
            playback.play(scene, depsgraph, playback.camera_eye(scene, depsgraph))
            _write(image, folder / f"{name}_{frame:04}.png")
        _wear(held, image, _sequence(folder / f"{name}_{scene.frame_start:04}.png"), scene)
        del held[PICTURE]
    finally:
        scene.frame_set(now)


def _write(image, path):
    """A picture of its own is written: one that has been saved belongs to its file."""
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    written = new_atlas(path.stem, image.size)
    try:
        written.pixels.foreach_set(values)
        written.filepath_raw, written.file_format = str(path), "PNG"
        written.save()
    finally:
        bpy.data.images.remove(written)


def _sequence(first):
    image = bpy.data.images.load(str(first))
    image.source = "SEQUENCE"
    image.colorspace_settings.name = "Non-Color"
    return image


def _wear(held, image, sequence, scene):
    """Puts `sequence` where the materials of `held` have `image`."""
    for material in held.data.materials:
        for node in material.node_tree.nodes:
            if node.type == "TEX_IMAGE" and node.image == image:
                node.image = sequence
                node.image_user.frame_start = scene.frame_start
                node.image_user.frame_offset = scene.frame_start - 1
                node.image_user.frame_duration = scene.frame_end - scene.frame_start + 1
                node.image_user.use_auto_refresh = True


class BakeTurnlight(bpy.types.Operator):
    """Write what the camera sees of the object in every frame as pictures, so that it plays without the add-on"""

    bl_idname = "object.turnlight_bake"
    bl_label = "Bake Turnlight to Pictures"
    bl_options = {"REGISTER"}

    directory: bpy.props.StringProperty(subtype="DIR_PATH")

    @classmethod
    def poll(cls, context):
        return context.object is not None and picture_of(context.object) is not None

    def invoke(self, context, _event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context):
        try:
            bake(context, context.object, pathlib.Path(bpy.path.abspath(self.directory)))
        except (OSError, RuntimeError) as fault:
            self.report({"ERROR"}, f"{self.directory}: pictures cannot be written ({fault}); choose another folder")
            return {"CANCELLED"}
        return {"FINISHED"}
