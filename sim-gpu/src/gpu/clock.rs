//! The adapter's own clock around a compute pass.

use super::pipeline::Pipeline;

/// The buffers of two timestamps, before and after a pass.
pub(super) struct Clock {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readback: wgpu::Buffer,
    seconds_per_tick: f64,
}

impl Clock {
    const BYTES: u64 = 2 * size_of::<u64>() as u64;

    /// A clock on the device of `pipeline`; `None` if it has no timestamps.
    pub(super) fn new(pipeline: &Pipeline) -> Option<Self> {
        let Pipeline { device, queue, .. } = pipeline;
        if !device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return None;
        }
        let buffer = |label, usage| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: Self::BYTES,
                usage,
                mapped_at_creation: false,
            })
        };
        let resolve = wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC;
        let read = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        Some(Self {
            queries: device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("clock"),
                ty: wgpu::QueryType::Timestamp,
                count: 2,
            }),
            resolved: buffer("clock", resolve),
            readback: buffer("clock, read back", read),
            seconds_per_tick: f64::from(queue.get_timestamp_period()) * 1e-9,
        })
    }

    pub(super) fn around_pass(&self) -> wgpu::ComputePassTimestampWrites<'_> {
        wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(0),
            end_of_pass_write_index: Some(1),
        }
    }

    pub(super) fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.resolve_query_set(&self.queries, 0..2, &self.resolved, 0);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.readback, 0, Self::BYTES);
    }

    pub(super) fn readback(&self) -> &wgpu::Buffer {
        &self.readback
    }

    pub(super) fn seconds(&self, ticks: &[u64]) -> f64 {
        ticks[1].wrapping_sub(ticks[0]) as f64 * self.seconds_per_tick
    }
}
