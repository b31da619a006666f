"""Smooth content between charts, by push and pull (Gortler, Grzeszczuk, Szeliski, Cohen 1996).

Push: a texel of a level of half the size is the mean of its known children. Pull: an unknown texel is the bilinear
interpolation of the level above. Without any known texel all stay 0.
"""

import numpy as np


def fill(image, known):
    """Fills image (h × w × 3, float) where known (h × w) is false; known texels stay as they are."""
    if known.all() or known.size == 1:
        return np.where(known[..., None], image, 0.0)
    coarse = fill(*_push(image, known))
    return np.where(known[..., None], image, _pull(coarse, known.shape))


def _push(image, known):
    height, width = known.shape
    even = ((0, height % 2), (0, width % 2))
    counts = np.pad(known, even).astype(image.dtype)
    sums = np.pad(image * known[..., None], (*even, (0, 0)))
    counts = counts[0::2] + counts[1::2]
    sums = sums[0::2] + sums[1::2]
    counts, sums = counts[:, 0::2] + counts[:, 1::2], sums[:, 0::2] + sums[:, 1::2]
    return sums / np.maximum(counts, 1.0)[..., None], counts > 0


def _pull(coarse, size):
    """A texel's centre lies a quarter of a coarse one from its parent's: shares of 3/4 and 1/4 along each axis."""
    for axis, length in enumerate(size):
        fine = np.arange(length)
        own = fine // 2
        next_to = np.clip(own + 2 * (fine % 2) - 1, 0, coarse.shape[axis] - 1)
        coarse = 0.75 * coarse.take(own, axis) + 0.25 * coarse.take(next_to, axis)
    return coarse
