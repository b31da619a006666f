"""python play.py JOB.json: plays models in Blender and writes what came of it to the job's `report`.

JOB: { addon, report, cases: [{ model | blend | obj, turn, cameras, output, supersample, animated, baked, save }] }.
`addon` is the .zip, installed as a user would below BLENDER_USER_RESOURCES, or null to go without. `model` is imported
by the add-on, `blend` was saved before, `obj` is imported by Blender alone. `turn` (4 × 4) moves object and cameras.
For each of `cameras` (frames of a transforms.json) comes a picture, NNNN.png in `output`: supersample² pixels for each
of the camera's, a sample in the middle of each; `animated` takes them as the frames of one animation, after the object
was baked to pictures in the folder `baked`, where one is named. Reported are `refused`, what the operator said, and
what is there in the end.
"""

import json
import pathlib
import sys

import bpy
from mathutils import Matrix

ADD_ON = "bl_ext.user_default.turnlight"


def main(job):
    if job["addon"] is not None:
        bpy.ops.extensions.package_install_files(filepath=job["addon"], repo="user_default", enable_on_install=True)
        assert ADD_ON in bpy.context.preferences.addons, "the add-on is not enabled"
    report = [play(case) for case in job["cases"]]
    pathlib.Path(job["report"]).write_text(json.dumps(report))


def play(case):
    refused = open_or_import(case)
    if "turn" in case:
        bpy.context.object.matrix_world = Matrix(case["turn"])
    if case.get("animated"):
        animate(case)
    for number, frame in enumerate([] if case.get("animated") else case.get("cameras", [])):
        look(frame, case)
        bpy.context.scene.render.filepath = f"{case['output']}/{number:04}.png"
        bpy.ops.render.render(write_still=True)
    if "save" in case:
        bpy.ops.wm.save_as_mainfile(filepath=case["save"])
    meshes = [[len(mesh.vertices), len(mesh.polygons), len(mesh.uv_layers)] for mesh in bpy.data.meshes]
    images = [[image.name, *image.size] for image in bpy.data.images if image.has_data or image.size[0] > 0]
    return {"refused": refused, "objects": len(bpy.data.objects), "meshes": meshes, "images": images}


def open_or_import(case):
    """What the operator said where it refused."""
    if "blend" in case:
        bpy.ops.wm.open_mainfile(filepath=case["blend"])
        return None
    bpy.ops.wm.read_homefile(use_empty=True)
    if "obj" in case:
        bpy.ops.wm.obj_import(filepath=case["obj"])
        return None
    try:
        bpy.ops.import_scene.turnlight(filepath=case["model"])
    except RuntimeError as fault:
        return str(fault)
    return None


def animate(case):
    scene = bpy.context.scene
    if "blend" not in case:
        scene.frame_start, scene.frame_end = 0, len(case["cameras"]) - 1
        for number, frame in enumerate(case["cameras"]):
            look(frame, case)
            scene.camera.keyframe_insert("location", frame=number)
            scene.camera.keyframe_insert("rotation_euler", frame=number)
    if "baked" in case:
        bpy.ops.object.turnlight_bake(directory=case["baked"])
    scene.render.filepath = f"{case['output']}/"
    bpy.ops.render.render(animation=True)


def look(frame, case):
    """Places the camera of a frame, and asks for one sample in the middle of each pixel."""
    scene = bpy.context.scene
    if scene.camera is None:
        scene.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
        scene.collection.objects.link(scene.camera)
        scene.world = None
    scene.camera.matrix_world = Matrix(case.get("turn", Matrix())) @ Matrix(frame["transform_matrix"])
    width, height = frame["w"], frame["h"]
    lens, aspect = scene.camera.data, frame["fl_x"] / frame["fl_y"]
    lens.sensor_fit, lens.sensor_width, lens.lens = "HORIZONTAL", 36.0, 36.0 * frame["fl_x"] / width
    lens.shift_x, lens.shift_y = 0.5 - frame["cx"] / width, (frame["cy"] - height / 2) * aspect / width
    lens.clip_start = 1e-3
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y = width * case["supersample"], height * case["supersample"]
    render.resolution_percentage = 100
    render.pixel_aspect_x, render.pixel_aspect_y = max(1 / aspect, 1.0), max(aspect, 1.0)
    render.film_transparent, render.dither_intensity = True, 0.0
    render.image_settings.file_format, render.image_settings.color_mode = "PNG", "RGBA"
    cycles.samples, cycles.use_adaptive_sampling, cycles.use_denoising = 1, False, False
    cycles.pixel_filter_type, cycles.filter_width = "GAUSSIAN", 0.01


main(json.loads(pathlib.Path(sys.argv[1]).read_text()))
