"""Pictures decoded by Blender, and the one that plays."""

import bpy
import numpy as np

from .glb import ModelError


def decode(coded, size, what):
    """8-bit texels of a coded image as stored, N × 3, row by row from the top."""
    image = bpy.data.images.new(what, 1, 1)
    try:
        image.colorspace_settings.name = "Non-Color"
        image.pack(data=coded, data_len=len(coded))
        image.source = "FILE"
        width, height = size
        if tuple(image.size) != (width, height) or len(image.pixels) != 4 * width * height:
            raise ModelError(f"{what} cannot be decoded")
        values = np.empty(4 * width * height, np.float32)
        image.pixels.foreach_get(values)
    finally:
        bpy.data.images.remove(image)
    texels = np.rint(values.reshape(height, width, 4)[::-1, :, :3] * 255.0).astype(np.uint8)
    return texels.reshape(-1, 3)


def new_atlas(name, size):
    """An 8-bit picture whose values are taken as they are."""
    image = bpy.data.images.new(name, *size, alpha=False, float_buffer=False)
    image.colorspace_settings.name = "Non-Color"
    return image


def show(image, atlas):
    """Puts an atlas (N × 3, levels of 0..255, rows from the top) into `image`."""
    width, height = image.size
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = np.clip(atlas.reshape(height, width, 3)[::-1] / 255.0, 0.0, 1.0)
    image.pixels.foreach_set(pixels.ravel())
    image.update()
