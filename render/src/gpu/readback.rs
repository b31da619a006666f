//! Pixels from the adapter back into an image.

use super::GpuError;
use super::device::Device;
use super::tiles::Tile;
use capture::Image;

/// Pixels of a picture: encoded, not premultiplied.
pub(super) const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

/// A target of our own, and where it is copied to.
#[derive(Debug)]
pub(super) struct Readback {
    size: [u32; 2],
    texture: wgpu::Texture,
    view: wgpu::TextureView,
    buffer: wgpu::Buffer,
}

impl Readback {
    pub(super) fn new(device: &Device, [width, height]: [u32; 2]) -> Self {
        let usage = wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC;
        let texture = device.texture([width, height], [1, 1], FORMAT, usage);
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let buffer = device.wgpu().create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: u64::from(stride(width)) * u64::from(height),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        Self { size: [width, height], texture, view, buffer }
    }

    /// Whether a tile of `size` pixels fits.
    pub(super) fn fits(&self, size: [u32; 2]) -> bool {
        (0..2).all(|k| self.size[k] >= size[k])
    }

    pub(super) fn target(&self) -> &wgpu::TextureView {
        &self.view
    }

    /// Copies the target to where it can be read.
    pub(super) fn copy(&self, encoder: &mut wgpu::CommandEncoder) {
        let [width, height] = self.size;
        let layout =
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(stride(width)), rows_per_image: None };
        let to = wgpu::TexelCopyBufferInfo { buffer: &self.buffer, layout };
        let size = wgpu::Extent3d { width, height, depth_or_array_layers: 1 };
        encoder.copy_texture_to_buffer(self.texture.as_image_copy(), to, size);
    }

    /// Waits for the copy and puts it where the tile lies in `frame`.
    pub(super) fn read(&self, device: &Device, tile: &Tile, frame: &mut Image<[u8; 4]>) -> Result<(), GpuError> {
        let (sender, receiver) = std::sync::mpsc::channel();
        self.buffer.slice(..).map_async(wgpu::MapMode::Read, move |mapped| drop(sender.send(mapped)));
        device.wait()?;
        let mapped = receiver.recv().map_err(|e| device.fault(e.to_string()))?;
        mapped.map_err(|e| device.fault(e.to_string()))?;
        let bytes = self.buffer.slice(..).get_mapped_range().map_err(|e| device.fault(e.to_string()))?;
        let ([x, y], [width, height], across) = (tile.origin, tile.size, frame.width());
        for (row, line) in bytes.chunks(stride(self.size[0]) as usize).take(height).enumerate() {
            let start = (y + row) * across + x;
            let pixels = &mut frame.pixels_mut()[start..start + width];
            pixels.as_flattened_mut().copy_from_slice(&line[..4 * width]);
        }
        drop(bytes);
        self.buffer.unmap();
        Ok(())
    }
}

/// Bytes of a row, as copies want them.
fn stride(width: u32) -> u32 {
    (4 * width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT)
}
