"""python read.py JOB.json: what the add-on can be asked without Blender; needs numpy alone.

JOB: { addon, report, cases: [{ model, eyes, surface }] }. Of each case come `refused`, why it is, or `weights`, per eye
facets × layers; into the file `surface`, where it is named, go the texels that show the surface, four numbers each:
position in the atlas, x, y, z, as 64-bit floats.
"""

import importlib
import json
import pathlib
import sys
import types

import numpy as np


def main(job):
    # The package, without running what wants Blender.
    package = types.ModuleType("turnlight")
    package.__path__ = [f"{job['addon']}/turnlight"]
    sys.modules["turnlight"] = package
    glb, surface = importlib.import_module("turnlight.glb"), importlib.import_module("turnlight.surface")
    report = [ask(glb, surface, case) for case in job["cases"]]
    pathlib.Path(job["report"]).write_text(json.dumps(report))


def ask(glb, surface, case):
    try:
        model = glb.read(pathlib.Path(case["model"]).read_bytes())
    except glb.ModelError as fault:
        return {"refused": str(fault)}
    if "surface" in case:
        shown, points = surface.surface_points(model.mesh, model.size)
        np.column_stack([shown, points]).astype("<f8").tofile(case["surface"])
    return {"weights": [model.facets.weights(eye).tolist() for eye in case["eyes"]]}


main(json.loads(pathlib.Path(sys.argv[1]).read_text()))
