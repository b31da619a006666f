"""The surface behind every texel of the atlas."""

import numpy as np


def surface_points(mesh, size):
    """Points of the surface that texels show: which texels (ascending, row by row) and where (texels × 3, world).

    A texel shows the point nearest to its centre of the nearest triangle, among those that meet the open square of
    half-width 1 about the centre: bilinear samplers of others do not read it. Triangles without area are skipped.
    """
    width, height = size
    distances = np.full((height, width), np.inf)
    points = np.zeros((height, width, 3))
    for face in mesh.faces:
        corners = mesh.uvs[face] * size
        area = _perp(corners[1] - corners[0], corners[2] - corners[0])
        if area == 0.0:
            continue
        low = np.maximum(np.ceil(corners.min(axis=0) - 1.5), 0).astype(int)
        high = np.minimum(np.floor(corners.max(axis=0) + 0.5) + 1, size).astype(int)
        columns, rows = slice(low[0], high[0]), slice(low[1], high[1])
        centres = np.stack(np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1])), axis=-1) + 0.5
        weights, squared = _nearest_in_triangle(corners, area, centres)
        squared[~_meets_square(corners, area, centres)] = np.inf
        is_nearer = squared < distances[rows, columns]
        distances[rows, columns][is_nearer] = squared[is_nearer]
        points[rows, columns][is_nearer] = weights[is_nearer] @ mesh.positions[face]
    shown = np.flatnonzero(np.isfinite(distances))
    return shown, points.reshape(-1, 3)[shown]


def _perp(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _meets_square(corners, area, p):
    """Whether the triangle meets the open square of half-width 1 about p, which its box is known to."""
    meets = np.ones(p.shape[:-1], bool)
    for k in range(3):
        start, edge = corners[k], corners[(k + 1) % 3] - corners[k]
        normal = np.array([-edge[1], edge[0]]) * np.sign(area)
        meets &= (p - start) @ normal + np.abs(normal).sum() > 0.0
    return meets


def _nearest_in_triangle(corners, area, p):
    """Barycentric coordinates of the triangle's points nearest to p (… × 2), and squared distances."""
    a, b, c = corners
    u, v = _perp(c - b, p - b) / area, _perp(a - c, p - c) / area
    weights = np.stack([u, v, 1.0 - u - v], axis=-1)
    is_inside = (weights >= 0.0).all(axis=-1)
    squared = np.where(is_inside, 0.0, np.inf)
    for k in range(3):
        start, edge = corners[k], corners[(k + 1) % 3] - corners[k]
        t = np.clip((p - start) @ edge / max(edge @ edge, np.finfo(float).tiny), 0.0, 1.0)
        away = ((p - start - t[..., None] * edge) ** 2).sum(axis=-1)
        is_best = away < squared
        squared[is_best] = away[is_best]
        weights[is_best] = 0.0
        weights[is_best, k] = 1.0 - t[is_best]
        weights[is_best, (k + 1) % 3] = t[is_best]
    return weights, squared
