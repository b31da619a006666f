"""The unstructured lumigraph: a few rays per texel, blended by angle at the surface (docs/model-format.md)."""

import numpy as np

from .gutter import fill
from .surface import surface_points

# Rays blended for one texel.
BLENDED = 4
NO_RAY = 65535
# Rays answered at once, for the memory's sake.
CHUNK = 1 << 18


class RayBlend:
    """Rays ready to be blended; raises ValueError where one names a view that is not there.

    slots: of each, colours (N × 3, 8 bit) and views (N, 16 bit), asked for one after the other, since each is kept once,
    where texels show anything; count: how many there are; centers: views × 3.
    """

    def __init__(self, slots, count, centers, mesh, size):
        self.size = size
        self.centers = centers
        self.shown, self.points = surface_points(mesh, size)
        self.colors = np.empty((len(self.shown), count, 3), np.uint8)
        self.views = np.empty((len(self.shown), count), np.uint16)
        for k, (colors, views) in enumerate(slots):
            self.colors[:, k], self.views[:, k] = colors[self.shown], views[self.shown]
        wild = self.views[(self.views != NO_RAY) & (self.views >= len(centers))]
        if wild.size:
            raise ValueError(f"a ray names view {wild[0]} of {len(centers)}")

    def atlas(self, eye):
        """The atlas as seen from `eye`, N × 3, in levels of 0..255; gutters are filled from around."""
        width, height = self.size
        atlas = np.zeros((height * width, 3), np.float32)
        known = np.zeros(height * width, bool)
        step = max(CHUNK // self.views.shape[1], 1)
        for start in range(0, len(self.shown), step):
            part = slice(start, start + step)
            blended, has_rays = self._blend(part, np.asarray(eye, np.float64))
            atlas[self.shown[part]] = blended
            known[self.shown[part]] = has_rays
        return fill(atlas.reshape(height, width, 3), known.reshape(height, width)).reshape(-1, 3)

    def _blend(self, part, eye):
        points, views = self.points[part], self.views[part].astype(np.int64)
        is_ray = views != NO_RAY
        penalties = np.where(is_ray, self._penalties(points, views * is_ray, eye), np.inf)
        nearest = _least(penalties, BLENDED + 1)
        penalties = np.take_along_axis(penalties, nearest, axis=1)
        count = np.minimum(is_ray.sum(axis=1), BLENDED + 1)
        last = np.take_along_axis(penalties, np.maximum(count - 1, 0)[:, None], axis=1)
        # The fifth is the threshold; with fewer rays, a little more than the last.
        threshold = np.where(count[:, None] > BLENDED, last, 1.01 * last) + 1e-12
        penalties, nearest = penalties[:, :BLENDED], nearest[:, :BLENDED]
        is_blended = np.isfinite(penalties)
        p = np.where(is_blended, penalties, 0.0)
        weights = is_blended * (np.maximum(1.0 - p / threshold, 0.0) / np.maximum(p, 1e-6) + 1e-9)
        colors = np.take_along_axis(self.colors[part], nearest[..., None], axis=1)
        has_rays = count > 0
        total = np.where(has_rays, weights.sum(axis=1), 1.0)
        return np.einsum("tk,tkc->tc", weights, colors) / total[:, None], has_rays

    def _penalties(self, points, views, eye):
        """|normalize(c_i − p) − normalize(e − p)|, texels × slots."""
        to_eye = _unit(eye - points).astype(np.float32)
        to_views = _unit((self.centers[views] - points[:, None]).astype(np.float32))
        return _norms(to_views - to_eye[:, None])


def _least(values, count):
    """Columns of the `count` least values of each row, ascending; all where there are fewer."""
    columns = np.arange(values.shape[1])[None].repeat(len(values), axis=0)
    if values.shape[1] > count:
        columns = np.argpartition(values, count - 1, axis=1)[:, :count]
    order = np.argsort(np.take_along_axis(values, columns, axis=1), axis=1, kind="stable")
    return np.take_along_axis(columns, order, axis=1)


def _norms(v):
    return np.sqrt(np.einsum("...i,...i->...", v, v))


def _unit(v):
    return v / np.maximum(_norms(v), np.finfo(v.dtype).tiny)[..., None]
