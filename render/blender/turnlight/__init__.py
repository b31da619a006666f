"""Imports models of Turnlight and plays them: File > Import > Turnlight and Object > Bake Turnlight to Pictures, or

    bpy.ops.import_scene.turnlight(filepath="model.glb")
    bpy.ops.object.turnlight_bake(directory="//pictures")
"""

import pathlib

import bpy
from bpy.props import BoolProperty, StringProperty
from bpy_extras.io_utils import ImportHelper

from . import glb, playback
from .bake import BakeTurnlight
from .objects import new_object, picture_of


class ImportTurnlight(bpy.types.Operator, ImportHelper):
    """Import an object that looks right from where the camera is"""

    bl_idname = "import_scene.turnlight"
    bl_label = "Import Turnlight"
    bl_options = {"REGISTER", "UNDO"}

    filename_ext = ".glb"
    filter_glob: StringProperty(default="*.glb", options={"HIDDEN"})
    set_view: BoolProperty(
        name="Colours as photographed",
        description="Set the scene's view transform to Standard, which shows the colours of the model's file",
        default=True,
    )

    def execute(self, context):
        path = pathlib.Path(self.filepath)
        try:
            data = path.read_bytes()
            model = glb.read(data)
            self._add(context, path.stem, model, data)
        except OSError as fault:
            self.report({"ERROR"}, f"{path}: cannot be read ({fault.strerror})")
            return {"CANCELLED"}
        except glb.ModelError as fault:
            self.report({"ERROR"}, f"{path.name} is refused: {fault}")
            return {"CANCELLED"}
        if model.materials:
            self.report({"WARNING"}, f"{model.materials} materials are not drawn: shown as photographed there")
        return {"FINISHED"}

    def _add(self, context, name, model, data):
        blend = playback.Player(model)
        made = new_object(name, model, data)
        playback.adopt(picture_of(made), blend)
        context.collection.objects.link(made)
        for other in context.selected_objects:
            other.select_set(False)
        made.select_set(True)
        context.view_layer.objects.active = made
        scene = context.scene
        # Pictures change while frames are rendered: the windows must not draw them at the same time.
        scene.render.use_lock_interface = True
        if self.set_view:
            view = scene.view_settings
            view.view_transform, view.look, view.exposure, view.gamma = "Standard", "None", 0.0, 1.0
        playback.play_what_is_seen(scene, context.evaluated_depsgraph_get())


def _import_menu(self, _context):
    self.layout.operator(ImportTurnlight.bl_idname, text="Turnlight (.glb)")


def _object_menu(self, _context):
    self.layout.operator(BakeTurnlight.bl_idname)


def register():
    bpy.utils.register_class(ImportTurnlight)
    bpy.utils.register_class(BakeTurnlight)
    bpy.types.TOPBAR_MT_file_import.append(_import_menu)
    bpy.types.VIEW3D_MT_object.append(_object_menu)
    playback.register()


def unregister():
    playback.unregister()
    bpy.types.VIEW3D_MT_object.remove(_object_menu)
    bpy.types.TOPBAR_MT_file_import.remove(_import_menu)
    bpy.utils.unregister_class(BakeTurnlight)
    bpy.utils.unregister_class(ImportTurnlight)
