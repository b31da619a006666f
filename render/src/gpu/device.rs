//! The adapter: found without a window, or taken over from one.

use super::GpuError;
use pollster::block_on;
use wgpu::util::DeviceExt;

/// Bytes a model may take on the adapter: nothing tells how much memory there is.
const MOST_BYTES: u64 = 1 << 30;

/// What draws. Cheap to clone.
#[derive(Clone, Debug)]
pub struct Device {
    device: wgpu::Device,
    queue: wgpu::Queue,
    name: String,
    is_software: bool,
}

impl Device {
    /// The system's fastest adapter, without a window. The environment variable `WGPU_BACKEND` names
    /// another interface (`vulkan`, `gl`, `metal`, `dx12`).
    ///
    /// # Errors
    /// [`GpuError::NoAdapter`] where there is none that draws.
    pub fn headless() -> Result<Self, GpuError> {
        let none = |fault: String| GpuError::NoAdapter { fault };
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
        let power_preference = wgpu::PowerPreference::HighPerformance;
        let options = wgpu::RequestAdapterOptions { power_preference, ..Default::default() };
        let adapter = block_on(instance.request_adapter(&options)).map_err(|e| none(e.to_string()))?;
        let limits = adapter.limits();
        let descriptor = wgpu::DeviceDescriptor { required_limits: limits, ..Default::default() };
        let (device, queue) = block_on(adapter.request_device(&descriptor)).map_err(|e| none(e.to_string()))?;
        Ok(Self::from_wgpu(device, queue))
    }

    /// A device that somebody else made, as for a window; its limits hold. Compute shaders are not needed.
    pub fn from_wgpu(device: wgpu::Device, queue: wgpu::Queue) -> Self {
        let info = device.adapter_info();
        let is_software = info.device_type == wgpu::DeviceType::Cpu;
        Self { device, queue, name: format!("{} ({})", info.name, info.backend), is_software }
    }

    /// The adapter's name and interface.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether the adapter is a program on the CPU, as Mesa's lavapipe.
    pub fn is_software(&self) -> bool {
        self.is_software
    }

    /// As wgpu knows it.
    pub fn wgpu(&self) -> &wgpu::Device {
        &self.device
    }

    /// What work is handed to.
    pub fn queue(&self) -> &wgpu::Queue {
        &self.queue
    }

    pub(super) fn limits(&self) -> wgpu::Limits {
        self.device.limits()
    }

    /// Waits until all that was submitted is done.
    pub(super) fn wait(&self) -> Result<(), GpuError> {
        self.device.poll(wgpu::PollType::wait_indefinitely()).map(drop).map_err(|e| self.fault(e.to_string()))
    }

    pub(super) fn fault(&self, fault: String) -> GpuError {
        GpuError::Driver { adapter: self.name.clone(), fault }
    }

    pub(super) fn too_large(&self, what: String, limit: String) -> GpuError {
        GpuError::TooLarge { what, adapter: self.name.clone(), limit }
    }

    /// Refuses what is larger than a limit.
    pub(super) fn check(&self, what: &str, count: u64, limit: u64) -> Result<(), GpuError> {
        if count <= limit { Ok(()) } else { Err(self.too_large(format!("{count} {what}"), limit.to_string())) }
    }

    /// Refuses textures that nobody has memory for.
    pub(super) fn check_bytes(&self, bytes: u64) -> Result<(), GpuError> {
        let mega = |bytes: u64| format!("{} MiB", bytes >> 20);
        if bytes <= MOST_BYTES {
            Ok(())
        } else {
            Err(self.too_large(format!("{} of textures", mega(bytes)), mega(MOST_BYTES)))
        }
    }

    /// Runs what talks to the driver; what goes wrong there becomes an error instead of a panic.
    pub(crate) fn guarded<T>(&self, work: impl FnOnce() -> Result<T, GpuError>) -> Result<T, GpuError> {
        let filters = [wgpu::ErrorFilter::Internal, wgpu::ErrorFilter::OutOfMemory, wgpu::ErrorFilter::Validation];
        let scopes = filters.map(|filter| self.device.push_error_scope(filter));
        let outcome = work();
        // Innermost first.
        let faults = scopes.into_iter().rev().filter_map(|scope| block_on(scope.pop()));
        match faults.last() {
            Some(fault) => Err(self.fault(fault.to_string())),
            None => outcome,
        }
    }

    /// A buffer that holds `bytes`; some zeros in their place if there are none, for bindings are not empty.
    pub(super) fn buffer(&self, bytes: &[u8], usage: wgpu::BufferUsages) -> Result<wgpu::Buffer, GpuError> {
        let limits = self.limits();
        let limit = if usage.contains(wgpu::BufferUsages::STORAGE) {
            limits.max_buffer_size.min(limits.max_storage_buffer_binding_size)
        } else {
            limits.max_buffer_size
        };
        self.check("bytes in a row", bytes.len() as u64, limit)?;
        let contents = if bytes.is_empty() { &[0; 256] } else { bytes };
        let usage = usage | wgpu::BufferUsages::COPY_DST;
        Ok(self.device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: None, contents, usage }))
    }

    /// A texture array of `layers` and with `levels` of mip-maps.
    pub(super) fn texture(
        &self,
        [width, height]: [u32; 2],
        [layers, levels]: [u32; 2],
        format: wgpu::TextureFormat,
        usage: wgpu::TextureUsages,
    ) -> wgpu::Texture {
        self.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width, height, depth_or_array_layers: layers },
            mip_level_count: levels,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage,
            view_formats: &[],
        })
    }

    /// Fills the corner of a layer's level 0 with `size` texels, row by row.
    pub(super) fn write(&self, texture: &wgpu::Texture, layer: u32, [width, height]: [u32; 2], texels: &[u8]) {
        let origin = wgpu::Origin3d { x: 0, y: 0, z: layer };
        let to = wgpu::TexelCopyTextureInfo { texture, mip_level: 0, origin, aspect: wgpu::TextureAspect::All };
        let bytes_per_row = Some(texels.len() as u32 / height.max(1));
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row, rows_per_image: None };
        self.queue.write_texture(to, texels, layout, wgpu::Extent3d { width, height, depth_or_array_layers: 1 });
    }

    pub(super) fn shader(&self, source: &str) -> wgpu::ShaderModule {
        let source = wgpu::ShaderSource::Wgsl(source.into());
        self.device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source })
    }

    /// Bindings 0.. of group `index` of a pipeline.
    pub(super) fn bind(
        &self,
        pipeline: &wgpu::RenderPipeline,
        index: u32,
        resources: &[wgpu::BindingResource<'_>],
    ) -> wgpu::BindGroup {
        let entries: Vec<wgpu::BindGroupEntry<'_>> = (0..)
            .zip(resources)
            .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource: resource.clone() })
            .collect();
        let layout = &pipeline.get_bind_group_layout(index);
        self.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
    }

    /// A pipeline that runs fragment function `entry` over a whole viewport.
    pub(super) fn covering(&self, source: &str, entry: &str, format: wgpu::TextureFormat) -> wgpu::RenderPipeline {
        let module = &self.shader(&[include_str!("cover.wgsl"), source].concat());
        let compilation_options = wgpu::PipelineCompilationOptions::default();
        let targets = &[Some(format.into())];
        self.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(entry),
            layout: None,
            vertex: wgpu::VertexState {
                module,
                entry_point: Some("cover"),
                compilation_options: compilation_options.clone(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: None,
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState { module, entry_point: Some(entry), compilation_options, targets }),
            multiview_mask: None,
            cache: None,
        })
    }
}

/// Covers `size` pixels of a target from `origin` on.
pub(super) fn cover(
    encoder: &mut wgpu::CommandEncoder,
    pipeline: &wgpu::RenderPipeline,
    bindings: &wgpu::BindGroup,
    (target, load): (&wgpu::TextureView, wgpu::LoadOp<wgpu::Color>),
    (origin, size): ([u32; 2], [u32; 2]),
) {
    let ops = wgpu::Operations { load, store: wgpu::StoreOp::Store };
    let attachment = wgpu::RenderPassColorAttachment { view: target, depth_slice: None, resolve_target: None, ops };
    let color_attachments = &[Some(attachment)];
    let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor { color_attachments, ..Default::default() });
    let ([x, y], [width, height]) = (origin.map(|v| v as f32), size.map(|v| v as f32));
    pass.set_viewport(x, y, width, height, 0.0, 1.0);
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, bindings, &[]);
    pass.draw(0..3, 0..1);
}
