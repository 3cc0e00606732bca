//! A device with the compiled shader variant of one set of effects.

use super::compose::{compose, reads_random_bits};
use crate::effects::Effects;

pub(super) struct Pipeline {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) compute: wgpu::ComputePipeline,
    /// The layout of group 0: the buffers of every variant.
    pub(super) trace_layout: wgpu::BindGroupLayout,
    /// The layout of group 1: the buffers of effects, if there are any.
    pub(super) effects_layout: Option<wgpu::BindGroupLayout>,
    pub(super) effects: Effects,
}

impl Pipeline {
    pub(super) fn new(device: wgpu::Device, queue: wgpu::Queue, effects: &Effects) -> Self {
        let layout = |label, entries: &[wgpu::BindGroupLayoutEntry]| {
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some(label),
                entries,
            })
        };
        let buffers = [0, 1, 2, 3, 4, 5].map(|binding| storage(binding, binding != CODES));
        let trace: Vec<_> = buffers.into_iter().chain([uniform(COUNTS)]).collect();
        let trace_layout = layout("trace", &trace);
        let effects_layout = effects.per_ray().next().map(|_| {
            let mut entries = vec![storage(0, false)];
            entries.extend(reads_random_bits(effects).then(|| storage(1, true)));
            layout("effects", &entries)
        });
        let groups: Vec<_> = [Some(&trace_layout), effects_layout.as_ref()]
            .into_iter()
            .filter(Option::is_some)
            .collect();
        let constants: Vec<_> = effects.per_ray().flat_map(|effect| effect.constants()).collect();
        let compute = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("trace"),
            layout: Some(&device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some("trace"),
                bind_group_layouts: &groups,
                immediate_size: 0,
            })),
            module: &device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some("trace"),
                source: wgpu::ShaderSource::Wgsl(compose(effects).into()),
            }),
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: &constants,
                // The shader uses no workgroup memory.
                zero_initialize_workgroup_memory: false,
            },
            cache: None,
        });
        let effects = effects.clone();
        Self { device, queue, compute, trace_layout, effects_layout, effects }
    }
}

/// The binding of group 0 that the shader writes to.
const CODES: u32 = 3;

/// The binding of group 0 with the numbers of rays and views. It is no immediate data, which browsers
/// lack.
const COUNTS: u32 = 6;

fn storage(binding: u32, read_only: bool) -> wgpu::BindGroupLayoutEntry {
    entry(binding, wgpu::BufferBindingType::Storage { read_only })
}

fn uniform(binding: u32) -> wgpu::BindGroupLayoutEntry {
    entry(binding, wgpu::BufferBindingType::Uniform)
}

fn entry(binding: u32, ty: wgpu::BufferBindingType) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
        count: None,
    }
}
