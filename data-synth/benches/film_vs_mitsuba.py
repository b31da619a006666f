"""Rays per second of CPU beside Mitsuba 3 on the same mesh, camera, lights and finish, in one run.

    pip install mitsuba numpy pillow; a libLLVM Mitsuba accepts, named in DRJIT_LIBLLVM_PATH
    cargo build --release -p turnlight
    python data-synth/benches/film_vs_mitsuba.py target/release/turnlight [--size 640x480] [--samples 64]

The scene is `blank`: one colour, so that no texture is weighed against another. Nor are start and building:
both are run at two numbers of samples, and the difference is divided by. Ours counts its rays. Mitsuba's are
counted as its integrator casts them: one from the camera, then one shadow ray and one scattered ray per
surface. How many surfaces a path touches is not told, but bounded: by one, and by what a body that sees
nothing but itself would make of it, 1/(1 − reflectance).
"""
import argparse, json, os, resource, subprocess, tempfile
import numpy as np
from PIL import Image

parser = argparse.ArgumentParser()
parser.add_argument("turnlight")
parser.add_argument("--size", default="640x480")
parser.add_argument("--samples", type=int, default=64)
args = parser.parse_args()
width, height = map(int, args.size.split("x"))
LOW = max(args.samples // 8, 1)
REFLECTANCE = 0.62


def cpu(who):
    usage = resource.getrusage(who)
    return usage.ru_utime + usage.ru_stime


def ours(folder, samples):
    before = cpu(resource.RUSAGE_CHILDREN)
    out = subprocess.run(
        [args.turnlight, "synth", "blank", "-o", folder, "--views", "1", "--size", args.size,
         "--elevations", "20", "--samples", str(samples), "--json"],
        check=True, capture_output=True).stdout
    return cpu(resource.RUSAGE_CHILDREN) - before, json.loads(out)["rays"]


work = tempfile.mkdtemp()
(few_s, few_rays), (many_s, many_rays) = ours(f"{work}/few", LOW), ours(f"{work}/many", args.samples)

import mitsuba as mi
mi.set_variant("llvm_ad_rgb")
import drjit as dr
dr.set_thread_count(2)

frames = json.load(open(f"{work}/many/transforms.json"))
to_world = np.array(frames["frames"][0]["transform_matrix"])
low, high = map(np.array, frames["aabb"])
target, radius = (low + high) / 2, np.linalg.norm(high - low) / 2


def light(shape, azimuth, elevation, half, radiance):
    """A light of the studio, in the room, whose +x points at this camera (azimuth 0)."""
    a, e = np.radians([azimuth, elevation])
    center = target + 6 * radius * np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    frame = mi.ScalarTransform4f().look_at(center.tolist(), target.tolist(), [0, 0, 1])
    size = [half[0] * radius, half[1] * radius, 1]
    return {"type": shape, "to_world": frame @ mi.ScalarTransform4f().scale(size),
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": radiance}}}


def scene(depth):
    flip = np.diag([-1.0, 1.0, -1.0, 1.0])
    return mi.load_dict({
        "type": "scene",
        "integrator": {"type": "path", "max_depth": depth, "rr_depth": 2},
        "sensor": {"type": "perspective", "to_world": mi.ScalarTransform4f(to_world @ flip),
                   "fov": float(np.degrees(2 * np.arctan(width / 2 / frames["fl_x"]))), "fov_axis": "x",
                   "film": {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}},
                   "sampler": {"type": "independent"}},
        "sky": {"type": "constant", "radiance": 0.4},
        "key": light("rectangle", -42, 44, [1.15, 1.15], [16.0, 14.8, 13.4]),
        "strip": light("rectangle", 58, 20, [0.45, 2.2], [5.0, 5.6, 6.6]),
        "back": light("disk", 165, 40, [1.2, 1.2], [7.0, 7.0, 7.0]),
        "body": {"type": "ply", "filename": f"{work}/many/truth.ply", "face_normals": False,
                 "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": REFLECTANCE}}}})


def render(world, samples):
    before = cpu(resource.RUSAGE_SELF)
    picture = np.array(mi.render(world, spp=samples, seed=samples))
    return cpu(resource.RUSAGE_SELF) - before, picture


world = scene(100)
render(world, 1)
render(world, args.samples)  # compiled
(few_m, _), (many_m, picture) = render(world, LOW), render(world, args.samples)

covered = np.asarray(Image.open(f"{work}/many/masks/0000.png")) == 255
paths = covered.sum() * (args.samples - LOW)
for bound, surfaces in [("at least", 1.0), ("at most", 1 / (1 - REFLECTANCE))]:
    rays = paths * (1 + 2 * surfaces)
    print(f"Mitsuba {mi.__version__} llvm: {rays / (many_m - few_m) / 1e6:.2f} M rays a second of CPU, {bound}")
print(f"Turnlight: {(many_rays - few_rays) / (many_s - few_s) / 1e6:.2f} M rays a second of CPU, "
      f"{(many_rays - few_rays) / paths:.1f} a path")
print(f"paths on the body a second of CPU: Mitsuba {paths / (many_m - few_m) / 1e6:.2f} M, "
      f"Turnlight {paths / (many_s - few_s) / 1e6:.2f} M")
srgb = np.asarray(Image.open(f"{work}/many/images/0000.png"), float) / 255
linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
print(f"mean radiance on the body: Mitsuba {picture[covered][..., :3].mean():.4f}, "
      f"Turnlight {linear[covered].mean():.4f} (whose sky changes with height)")
