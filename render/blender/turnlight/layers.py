"""Static texture, VDTM and DynTex: `colour = Σ_k w_k (offset_k + scale_k · layer_k)`, w per facet and eye."""

import numpy as np


class LayerBlend:
    """Layers ready to be blended.

    texels: K arrays of N × 3, 8 bit, asked for one after the other, since each is kept once; facet_of_texel: N numbers
    of facets. Kept facet by facet, so that one product of matrices answers a facet: Σ_facets texels · rank
    multiply-adds an eye.
    """

    def __init__(self, texels, layers, facet_of_texel, facets):
        self.facets = facets
        self.scales = np.array([layer.scale for layer in layers], np.float32)
        self.offsets = np.array([layer.offset for layer in layers], np.float32)
        self.order = np.argsort(facet_of_texel, kind="stable")
        self.ends = np.concatenate([[0], np.cumsum(np.bincount(facet_of_texel, minlength=facets.count))])
        self.texels = np.empty((len(layers), len(self.order), 3), np.uint8)
        for kept, layer in zip(self.texels, texels):
            kept[:] = layer[self.order]

    def atlas(self, eye):
        """The atlas as seen from `eye`, N × 3, unclamped, in levels of 0..255."""
        weights = self.facets.weights(eye).astype(np.float32)
        blended = np.empty((len(self.order), 3), np.float32)
        for facet, rank in enumerate(self.facets.ranks):
            start, end = self.ends[facet], self.ends[facet + 1]
            w = weights[facet, :rank]
            values = self.texels[:rank, start:end].reshape(rank, -1).astype(np.float32)
            blended[start:end] = ((w * self.scales[:rank]) @ values).reshape(-1, 3) + w @ self.offsets[:rank]
        atlas = np.empty_like(blended)
        atlas[self.order] = blended
        return atlas
