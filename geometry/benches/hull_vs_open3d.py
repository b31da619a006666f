"""Our hull beside Open3D's voxel carving, on the analytic torus and sphere, in one run.

    pip install open3d scikit-image pillow numpy
    python geometry/benches/hull_vs_open3d.py --data ../shared/data/analytic_torus --resolutions 128 256

Prints one JSON line a run: CPU and wall seconds from masks in memory to a grid or mesh, and the residual: the mean
absolute first-order distance (scene units; a pixel is about .0043) of points spread evenly by area over
the mesh from the hull of the exact silhouettes. That hull needs no table: a point X lies outside the silhouette
of a camera C by the smallest value of the solid's distance function along the ray from C through X.
"""

import argparse
import json
import os
import subprocess
import tempfile
import time

import numpy as np

TILT, AXIS_R, TUBE_R = np.radians(30.0), 0.55, 0.18
AXIS = np.array([np.sin(TILT), 0.0, np.cos(TILT)])
SPHERE_C, SPHERE_R = np.array([0.25, 0.10, 0.35]), 0.30
LOW, HIGH = -0.8, 0.8


def solid_distance(x):
    along = x @ AXIS
    ring = np.sqrt(np.maximum((x * x).sum(-1) - along**2, 0.0)) - AXIS_R
    return np.minimum(np.hypot(ring, along) - TUBE_R, np.linalg.norm(x - SPHERE_C, axis=-1) - SPHERE_R)


def outside_silhouette(points, eye):
    """Signed distance (at the point's depth) of each point from the cone of the exact silhouette."""
    rays = points - eye
    reach = np.linalg.norm(rays, axis=1, keepdims=True)
    rays = rays / reach
    ts = np.linspace(1.9, 4.1, 111)
    values = np.stack([solid_distance(eye + t * rays) / t for t in ts])
    best = values.argmin(0)
    t = ts[best]
    step = ts[1] - ts[0]
    for _ in range(30):  # ternary search in the cell of the smallest sample
        step *= 0.66
        near, far = t - step / 2, t + step / 2
        closer = solid_distance(eye + near[:, None] * rays) / near < solid_distance(eye + far[:, None] * rays) / far
        t = np.where(closer, near, far)
    return solid_distance(eye + t[:, None] * rays) / t * reach[:, 0]


def residual(vertices, faces, eyes, samples=20000):
    rng = np.random.default_rng(0)
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    pick = rng.choice(len(faces), samples, p=area / area.sum())
    uv = rng.random((samples, 2))
    uv[uv.sum(1) > 1] = 1 - uv[uv.sum(1) > 1]
    points = a[pick] + uv[:, :1] * (b - a)[pick] + uv[:, 1:] * (c - a)[pick]
    worst = np.max([outside_silhouette(points, eye) for eye in eyes], axis=0)
    return {"mean_abs": float(np.abs(worst).mean()), "p95_abs": float(np.percentile(np.abs(worst), 95)), "mean": float(worst.mean())}


def load(data, masks):
    from PIL import Image

    capture = json.load(open(f"{data}/transforms.json"))
    poses = [np.array(f["transform_matrix"]) for f in capture["frames"]]
    names = [os.path.basename(f["file_path"]) for f in capture["frames"]]
    return capture, poses, [np.array(Image.open(f"{data}/{masks}/{n}")) for n in names]


def open3d_hull(capture, poses, masks, n):
    import open3d as o3d
    from skimage.measure import marching_cubes

    cell = (HIGH - LOW) / n
    grid = o3d.geometry.VoxelGrid.create_dense(np.full(3, LOW), np.zeros(3), cell, *[HIGH - LOW - 0.5 * cell] * 3)
    for pose, mask in zip(poses, masks):
        camera = o3d.camera.PinholeCameraParameters()
        # Open3D's pixel centres are whole numbers.
        camera.intrinsic = o3d.camera.PinholeCameraIntrinsic(
            capture["w"], capture["h"], capture["fl_x"], capture["fl_y"], capture["cx"] - 0.5, capture["cy"] - 0.5)
        camera.extrinsic = np.diag([1.0, -1, -1, 1]) @ np.linalg.inv(pose)
        grid.carve_silhouette(o3d.geometry.Image((mask > 127).astype(np.float32)), camera, False)
    index = np.array([v.grid_index for v in grid.get_voxels()])
    field = np.full((n, n, n), 0.5, np.float32)
    field[tuple(index[(index < n).all(1)].T)] = -0.5
    vertices, faces, _, _ = marching_cubes(field, 0.0)
    return LOW + (vertices + 0.5) * cell, faces


def our_hull(n, masks, root):
    import resource

    out = os.path.join(tempfile.mkdtemp(), "hull.ply")
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = ["cargo", "bench", "-q", "-p", "geometry", "--bench", "hull", "--", "--write", str(n), masks, out]
    text = subprocess.run(command, cwd=root, check=True, capture_output=True, text=True).stdout
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    lines = open(out).read().split("end_header\n")
    v, f = (int(line.split()[2]) for line in lines[0].splitlines() if line.startswith("element"))
    body = lines[1].splitlines()
    report = json.loads(text.splitlines()[-1])
    # Reading masks, writing the file and cargo's own start are in here too.
    report["cpu_s_at_most"] = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return np.loadtxt(body[:v]), np.loadtxt(body[v : v + f], dtype=int)[:, 1:], report


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", required=True)
    parser.add_argument("--resolutions", type=int, nargs="+", default=[128, 256])
    args = parser.parse_args()
    root = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
    capture, poses, masks = load(args.data, "masks")
    eyes = [pose[:3, 3] for pose in poses]
    for n in args.resolutions:
        for kind in ["masks", "masks_aa"]:
            vertices, faces, report = our_hull(n, kind, root)
            print(json.dumps({"hull": "ours", "masks": kind, "n": n, **report, "residual": residual(vertices, faces, eyes)}), flush=True)
        wall, cpu = time.perf_counter(), time.process_time()
        vertices, faces = open3d_hull(capture, poses, masks, n)
        times = {"seconds": time.perf_counter() - wall, "cpu_s": time.process_time() - cpu}
        print(json.dumps({"hull": "open3d", "masks": "masks", "n": n, **times, "residual": residual(vertices, faces, eyes)}), flush=True)


if __name__ == "__main__":
    main()
