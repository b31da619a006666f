"""Plays models: whenever the eye or an object moves, blends the atlas anew.

The eye is the scene's camera while a picture is rendered, and in a viewport that looks through it; else the viewport
that is looked at. Handlers are told of changes of the scene and of frames; of a turn of the viewport nothing tells,
so a timer looks.
"""

import bpy
from bpy.app.handlers import persistent
from mathutils import Vector

from . import appearance, glb, pictures
from .objects import MODEL, picture_of

# How often viewports are looked at.
PERIOD_S = 0.04
# World units, or distances of an orthographic camera from the origin, that are as good as infinitely far.
FAR = 1e4

# By picture (its session's number): its player; None where its model is refused.
_players = {}
# The eye of the viewport when the timer looked last.
_looked_from = None


class Player:
    """What blends a model, and the eye for which it did last. Raises ModelError."""

    def __init__(self, model):
        self.blend = appearance.prepare(model)
        self.eye = None

    def play(self, image, eye):
        """Makes `image` the atlas as seen from `eye` (in the coordinates of the mesh), unless it is that already."""
        if self.eye is None or (eye - self.eye).length > 1e-7 * eye.length:
            self.eye = eye
            pictures.show(image, self.blend.atlas(eye))


def adopt(image, player):
    """Lets `player` play `image`; forgets those of pictures that are gone."""
    for gone in _players.keys() - {image.session_uid for image in bpy.data.images}:
        del _players[gone]
    _players[image.session_uid] = player


def _player(image):
    """The player of a picture; made of the model it carries where the file has just been opened."""
    if image.session_uid not in _players:
        try:
            model = glb.read(image[MODEL])
            if tuple(image.size) != model.size:
                raise glb.ModelError(f"its picture is {image.size[0]}×{image.size[1]}, not of the model's size")
            adopt(image, Player(model))
        except glb.ModelError as fault:
            print(f"Turnlight: {image.name}: {fault}")
            adopt(image, None)
    return _players[image.session_uid]


def play(scene, depsgraph, eye):
    """Blends every model of `scene` for `eye` (world). Of objects that share a picture, the first by name decides."""
    if not any(MODEL in image for image in bpy.data.images):
        return
    played = set()
    for held in sorted(scene.objects, key=lambda held: held.name):
        image = picture_of(held)
        if image is None or image.session_uid in played:
            continue
        played.add(image.session_uid)
        player = _player(image)
        if player is not None:
            player.play(image, held.evaluated_get(depsgraph).matrix_world.inverted_safe() @ eye)


def camera_eye(scene, depsgraph):
    """Where the scene's camera is; far in front of all without one."""
    if scene.camera is None:
        return Vector((0.0, -FAR, 0.0))
    pose = scene.camera.evaluated_get(depsgraph).matrix_world
    if scene.camera.data.type != "ORTHO":
        return pose.translation.copy()
    return pose @ Vector((0.0, 0.0, FAR * max(pose.translation.length, 1.0)))


def _viewport_eye():
    """That of the first viewport that looks at the scene on its own; None where all look through the camera."""
    # Without a screen, windows are there that nobody sees.
    for window in [] if bpy.app.background else bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D" and area.spaces.active.region_3d.view_perspective != "CAMERA":
                return area.spaces.active.region_3d.view_matrix.inverted_safe().translation
    return None


def play_what_is_seen(scene, depsgraph):
    """Blends every model of `scene` for whoever looks at it."""
    eye = None if depsgraph.mode == "RENDER" else _viewport_eye()
    play(scene, depsgraph, camera_eye(scene, depsgraph) if eye is None else eye)


@persistent
def _on_change(scene, depsgraph):
    if not bpy.app.is_job_running("RENDER") or depsgraph.mode == "RENDER":
        play_what_is_seen(scene, depsgraph)


@persistent
def _on_load(_path):
    _players.clear()
    _on_change(bpy.context.scene, bpy.context.evaluated_depsgraph_get())


@persistent
def _on_save(_path):
    """What a picture shows is kept, for those who open the file without this add-on."""
    for image in bpy.data.images:
        if MODEL in image and image.is_dirty:
            image.pack()


def _look():
    global _looked_from
    eye = _viewport_eye()
    if eye != _looked_from and not bpy.app.is_job_running("RENDER"):
        _looked_from = eye
        _on_change(bpy.context.scene, bpy.context.evaluated_depsgraph_get())
    return PERIOD_S


def _handlers():
    handlers = bpy.app.handlers
    return [
        (handlers.frame_change_post, _on_change),
        (handlers.depsgraph_update_post, _on_change),
        (handlers.load_post, _on_load),
        (handlers.save_pre, _on_save),
    ]


def register():
    for handlers, handler in _handlers():
        handlers.append(handler)
    if not bpy.app.background:
        bpy.app.timers.register(_look, persistent=True)


def unregister():
    if bpy.app.timers.is_registered(_look):
        bpy.app.timers.unregister(_look)
    for handlers, handler in _handlers():
        handlers.remove(handler)
    _players.clear()
