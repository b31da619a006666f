"""How a model looks from an eye: decoded once, then one atlas an eye."""

import numpy as np

from . import glb, pictures
from .layers import LayerBlend
from .lumigraph import RayBlend


def prepare(model):
    """What blends the atlas of a model: has `atlas(eye)`. Raises ModelError."""
    return _rays(model) if model.method == "lumigraph" else _layers(model)


def _numbers(coded, size, what):
    """Numbers of facets or views: R + 256 G."""
    texels = pictures.decode(coded, size, what).astype(np.uint16)
    return texels[:, 0] + 256 * texels[:, 1]


def _layers(model):
    facet_of_texel = _numbers(model.facet_map, model.size, "facet map")
    if facet_of_texel.max() >= model.facets.count:
        raise glb.ModelError(f"a texel names facet {facet_of_texel.max()} of {model.facets.count}")
    texels = (pictures.decode(layer.coded, model.size, f"layer {k}") for k, layer in enumerate(model.layers))
    return LayerBlend(texels, model.layers, facet_of_texel, model.facets)


def _rays(model):
    def slots():
        for k, ray in enumerate(model.rays):
            colors = pictures.decode(ray.color, model.size, f"ray colours {k}")
            yield colors, _numbers(ray.view, model.size, f"ray views {k}")

    try:
        return RayBlend(slots(), len(model.rays), model.camera_centers, model.mesh, model.size)
    except ValueError as fault:
        raise glb.ModelError(str(fault)) from None
