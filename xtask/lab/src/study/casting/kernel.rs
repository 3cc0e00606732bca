//! The tracing kernel by the adapter's own clock: what is left of a cast when
//! upload and read-back are free.

use crate::measure::lanes::Lane;
use anyhow::{Context, Result};
use sim_gpu::caster::Caster;
use sim_gpu::gpu::{Batch, compose};
use sim_gpu::job::CastJob;
use sim_gpu::ray::TraceRay;
use wgpu::util::{BufferInitDescriptor, DeviceExt};

/// Rays of one workgroup, as `shaders/trace.wgsl` has it.
const WORKGROUP_SIZE: usize = 64;

/// Seconds that each of `repeats` dispatches of `copies` copies of `job` took
/// on `lane`; `None` where its adapter keeps no time.
///
/// # Errors
/// If the device fails.
pub fn measure(
    lane: &Lane,
    job: &CastJob,
    copies: usize,
    repeats: usize,
) -> Result<Option<Vec<f64>>> {
    let Caster::Gpu(gpu) = &lane.caster else { return Ok(None) };
    let Some(adapter) = adapter(&gpu.summary().name) else { return Ok(None) };
    if !adapter.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
        return Ok(None);
    }
    let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
        required_features: wgpu::Features::TIMESTAMP_QUERY,
        required_limits: adapter.limits(),
        ..Default::default()
    }))?;
    // 128 MiB of binding, the least that an adapter here was seen to have, show
    // 4.2 million rays: one dispatch of the caster's.
    let bytes = copies * job.rays.len() * size_of::<TraceRay>();
    if bytes as u64 > device.limits().max_storage_buffer_binding_size {
        return Ok(None);
    }
    let (trace, n_rays) = Trace::new(&device, job, copies);
    let ticks = Ticks::new(&device);
    let mut seconds = Vec::with_capacity(repeats);
    for _ in 0..=repeats {
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        trace.dispatch(&mut encoder, &ticks, n_rays, &device.limits());
        ticks.resolve(&mut encoder);
        queue.submit([encoder.finish()]);
        seconds.push(ticks.read(&device)? * f64::from(queue.get_timestamp_period()) * 1e-9);
    }
    // The first compiles and warms up.
    Ok(Some(seconds.split_off(1)))
}

fn adapter(name: &str) -> Option<wgpu::Adapter> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY))
        .into_iter()
        .find(|adapter| adapter.get_info().name == name)
}

/// The plain variant of the shaders, with its buffers.
struct Trace {
    pipeline: wgpu::ComputePipeline,
    bindings: wgpu::BindGroup,
}

impl Trace {
    fn new(device: &wgpu::Device, job: &CastJob, copies: usize) -> (Self, usize) {
        let mut batch = Batch::default();
        (0..copies).for_each(|_| batch.push(job, 0..job.rays.len(), &[]));
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("trace"),
            source: wgpu::ShaderSource::Wgsl(compose(&[]).into()),
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("trace"),
            layout: None,
            module: &module,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        let storage = |contents: &[u8]| {
            let usage = wgpu::BufferUsages::STORAGE;
            device.create_buffer_init(&BufferInitDescriptor { label: None, contents, usage })
        };
        let codes = vec![0u32; batch.rays.len()];
        let buffers = [
            storage(bytemuck::cast_slice(&batch.nodes)),
            storage(bytemuck::cast_slice(&batch.triangles)),
            storage(bytemuck::cast_slice(&batch.rays)),
            storage(bytemuck::cast_slice(&codes)),
        ];
        let entries: Vec<_> = (0..)
            .zip(&buffers)
            .map(|(binding, buffer)| wgpu::BindGroupEntry {
                binding,
                resource: buffer.as_entire_binding(),
            })
            .collect();
        let layout = pipeline.get_bind_group_layout(0);
        let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &layout,
            entries: &entries,
        });
        (Self { pipeline, bindings }, batch.rays.len())
    }

    fn dispatch(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        ticks: &Ticks,
        n_rays: usize,
        limits: &wgpu::Limits,
    ) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: None,
            timestamp_writes: Some(wgpu::ComputePassTimestampWrites {
                query_set: &ticks.queries,
                beginning_of_pass_write_index: Some(0),
                end_of_pass_write_index: Some(1),
            }),
        });
        let groups = n_rays.div_ceil(WORKGROUP_SIZE) as u32;
        let x = groups.min(limits.max_compute_workgroups_per_dimension).max(1);
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.bindings, &[]);
        pass.dispatch_workgroups(x, groups.div_ceil(x), 1);
    }
}

/// The adapter's clock before and after a pass.
struct Ticks {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readback: wgpu::Buffer,
}

impl Ticks {
    const BYTES: u64 = 16;

    fn new(device: &wgpu::Device) -> Self {
        let buffer = |usage| {
            let (label, size, mapped_at_creation) = (None, Self::BYTES, false);
            device.create_buffer(&wgpu::BufferDescriptor { label, size, usage, mapped_at_creation })
        };
        Self {
            queries: device.create_query_set(&wgpu::QuerySetDescriptor {
                label: None,
                ty: wgpu::QueryType::Timestamp,
                count: 2,
            }),
            resolved: buffer(wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC),
            readback: buffer(wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST),
        }
    }

    fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.resolve_query_set(&self.queries, 0..2, &self.resolved, 0);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.readback, 0, Self::BYTES);
    }

    /// Ticks between the two, once the work submitted is done.
    fn read(&self, device: &wgpu::Device) -> Result<f64> {
        let slice = self.readback.slice(..);
        slice.map_async(wgpu::MapMode::Read, |_| {});
        device.poll(wgpu::PollType::wait_indefinitely())?;
        let ticks: Vec<u64> = {
            let view = slice.get_mapped_range().context("reading the adapter's clock")?;
            bytemuck::pod_collect_to_vec(&view[..])
        };
        self.readback.unmap();
        Ok(ticks[1].wrapping_sub(ticks[0]) as f64)
    }
}
