//! The buffers of one dispatch in flight. Slots are reused, so that a long run allocates only as
//! much as its largest batches need.

use super::batch::Batch;
use super::clock::Clock;
use super::compose::{WORKGROUP_SIZE, reads_random_bits};
use super::pipeline::Pipeline;
use crate::bvh::Bvh;
use crate::fixed_frame::fixed_direction;
use crate::sensor::Directions;
use futures_channel::mpsc::{UnboundedReceiver, UnboundedSender, unbounded};
use std::sync::{Arc, Weak};

const INPUT: wgpu::BufferUsages = wgpu::BufferUsages::STORAGE.union(wgpu::BufferUsages::COPY_DST);
const UNIFORM: wgpu::BufferUsages = wgpu::BufferUsages::UNIFORM.union(wgpu::BufferUsages::COPY_DST);
const OUTPUT: wgpu::BufferUsages = wgpu::BufferUsages::STORAGE.union(wgpu::BufferUsages::COPY_SRC);
const READBACK: wgpu::BufferUsages =
    wgpu::BufferUsages::MAP_READ.union(wgpu::BufferUsages::COPY_DST);

struct Growing {
    label: &'static str,
    usage: wgpu::BufferUsages,
    buffer: Option<wgpu::Buffer>,
}

impl Growing {
    fn new(label: &'static str, usage: wgpu::BufferUsages) -> Self {
        Self { label, usage, buffer: None }
    }

    /// Makes room for `bytes`, and returns whether the buffer was replaced.
    fn reserve(&mut self, device: &wgpu::Device, bytes: u64) -> bool {
        if self.buffer.as_ref().is_some_and(|buffer| buffer.size() >= bytes) {
            return false;
        }
        let limits = device.limits();
        let limit = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
        let size = bytes.next_power_of_two().max(4096).min(limit).max(bytes);
        // The old buffer is dropped first, so that both never exist at the same time.
        self.buffer = None;
        self.buffer = Some(device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(self.label),
            size,
            usage: self.usage,
            mapped_at_creation: false,
        }));
        true
    }

    fn upload(&mut self, pipeline: &Pipeline, bytes: &[u8]) -> bool {
        let grown = self.reserve(&pipeline.device, bytes.len() as u64);
        pipeline.queue.write_buffer(self.get(), 0, bytes);
        grown
    }

    fn get(&self) -> &wgpu::Buffer {
        self.buffer.as_ref().expect("invariant: room was made before the buffer is used")
    }
}

/// Both bind groups, which are reused until a buffer is replaced.
struct BindGroups {
    trace: wgpu::BindGroup,
    effects: Option<wgpu::BindGroup>,
}

pub(super) struct Slot {
    nodes: Growing,
    triangles: Growing,
    rays: Growing,
    views: Growing,
    directions: Growing,
    counts: Growing,
    codes: Growing,
    outputs: Growing,
    streams: Growing,
    codes_readback: Growing,
    outputs_readback: Growing,
    /// The content of the buffers of nodes and triangles, so that trees that are cast again stay.
    trees: Vec<Weak<Bvh>>,
    /// The content of the buffer of directions.
    patterns: Vec<Directions>,
    bind_groups: Option<BindGroups>,
    clock: Option<Clock>,
    answer: AnswerBytes,
    submission: Option<wgpu::SubmissionIndex>,
    mapped: Option<UnboundedReceiver<Mapped>>,
}

/// Whether a buffer can be read.
type Mapped = Result<(), wgpu::BufferAsyncError>;

/// Bytes of each buffer that is read back; 0 for those that are not.
#[derive(Clone, Copy, Default)]
struct AnswerBytes {
    codes: u64,
    outputs: u64,
    clock: u64,
}

pub(super) struct Answer {
    pub(super) codes: Vec<u32>,
    pub(super) outputs: Vec<f32>,
    /// The duration of the pass by the adapter's clock, if requested.
    pub(super) seconds: Option<f64>,
}

impl Slot {
    /// A slot without buffers; with a clock if passes are `timed` and the device has timestamps.
    pub(super) fn new(pipeline: &Pipeline, timed: bool) -> Self {
        Self {
            nodes: Growing::new("nodes", INPUT),
            triangles: Growing::new("triangles", INPUT),
            rays: Growing::new("rays", INPUT),
            views: Growing::new("views", INPUT),
            directions: Growing::new("directions", INPUT),
            counts: Growing::new("counts", UNIFORM),
            codes: Growing::new("codes", OUTPUT),
            outputs: Growing::new("effect outputs", OUTPUT),
            streams: Growing::new("streams", INPUT),
            codes_readback: Growing::new("codes, read back", READBACK),
            outputs_readback: Growing::new("effect outputs, read back", READBACK),
            trees: Vec::new(),
            patterns: Vec::new(),
            bind_groups: None,
            clock: if timed { Clock::new(pipeline) } else { None },
            answer: AnswerBytes::default(),
            submission: None,
            mapped: None,
        }
    }

    /// Uploads `batch`, dispatches it and asks for the answer.
    pub(super) fn start(&mut self, pipeline: &Pipeline, batch: &Batch) {
        let device = &pipeline.device;
        let grown = self.upload(pipeline, batch);
        if grown || self.bind_groups.is_none() {
            self.bind_groups = Some(self.bind(pipeline));
        }
        let Some(BindGroups { trace, effects }) = &self.bind_groups else { return };
        let mut encoder =
            device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("trace") });
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("trace"),
            timestamp_writes: self.clock.as_ref().map(Clock::around_pass),
        });
        pass.set_pipeline(&pipeline.compute);
        pass.set_bind_group(0, trace, &[]);
        if let Some(effects) = effects {
            pass.set_bind_group(1, effects, &[]);
        }
        let [x, y] = workgroups(batch.n_rays, &device.limits());
        pass.dispatch_workgroups(x, y, 1);
        drop(pass);
        self.read_back(pipeline, encoder);
    }

    /// Fills the buffers for `batch`, and returns whether any bound buffer was replaced.
    fn upload(&mut self, pipeline: &Pipeline, batch: &Batch) -> bool {
        let Pipeline { device, effects, .. } = pipeline;
        let n_rays = batch.n_rays;
        self.answer.codes = (n_rays * size_of::<u32>()) as u64;
        self.answer.outputs = (n_rays * effects.outputs_per_ray() * size_of::<f32>()) as u64;
        let mut grown = self.upload_trees(pipeline, batch);
        grown |= self.rays.upload(pipeline, bytemuck::cast_slice(&batch.rays));
        grown |= self.views.upload(pipeline, bytemuck::cast_slice(&batch.views));
        grown |= self.upload_directions(pipeline, &batch.directions);
        // At most 2^22 rays, and a view for each.
        let counts = [batch.n_rays as u32, batch.views.len() as u32];
        grown |= self.counts.upload(pipeline, bytemuck::bytes_of(&counts));
        grown |= self.codes.reserve(device, self.answer.codes);
        if self.answer.outputs > 0 {
            grown |= self.outputs.reserve(device, self.answer.outputs);
        }
        if reads_random_bits(effects) {
            grown |= self.streams.upload(pipeline, bytemuck::cast_slice(&batch.streams));
        }
        grown
    }

    /// Uploads the trees of `batch`, unless an earlier batch did.
    fn upload_trees(&mut self, pipeline: &Pipeline, batch: &Batch) -> bool {
        // The memory of a tree is not used again while a slot has a weak reference to it.
        let is_here = |(here, tree): (&Weak<Bvh>, _)| here.as_ptr() == Arc::as_ptr(tree);
        if self.trees.len() == batch.trees.len() && self.trees.iter().zip(&batch.trees).all(is_here)
        {
            return false;
        }
        self.trees = batch.trees.iter().map(Arc::downgrade).collect();
        let (nodes, triangles) = batch.joined_trees();
        let grown = self.nodes.upload(pipeline, bytemuck::cast_slice(&nodes));
        self.triangles.upload(pipeline, bytemuck::cast_slice(&triangles)) | grown
    }

    /// Uploads the directions of `patterns`, unless an earlier batch did.
    fn upload_directions(&mut self, pipeline: &Pipeline, patterns: &[Directions]) -> bool {
        let is_there = |(here, wanted): (&Directions, &Directions)| here.is_shared_with(wanted);
        let are_there = self.patterns.len() >= patterns.len()
            && self.patterns.iter().zip(patterns).all(is_there);
        if are_there && self.directions.buffer.is_some() {
            return false;
        }
        let fixed: Vec<[i32; 3]> = patterns.iter().flatten().map(|&d| fixed_direction(d)).collect();
        self.patterns = patterns.to_vec();
        self.directions.upload(pipeline, bytemuck::cast_slice(&fixed))
    }

    fn bind(&self, pipeline: &Pipeline) -> BindGroups {
        let group = |label, layout, buffers: &[(u32, &Growing)]| {
            let mut entries = Vec::with_capacity(buffers.len());
            for &(binding, buffer) in buffers {
                let resource = buffer.get().as_entire_binding();
                entries.push(wgpu::BindGroupEntry { binding, resource });
            }
            pipeline.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some(label),
                layout,
                entries: &entries,
            })
        };
        let inputs = [&self.nodes, &self.triangles, &self.rays];
        let others = [&self.codes, &self.views, &self.directions, &self.counts];
        let trace: Vec<_> = (0..).zip(inputs.into_iter().chain(others)).collect();
        let effects = &pipeline.effects;
        let mut read_by_effects = vec![(0, &self.outputs)];
        read_by_effects.extend(reads_random_bits(effects).then_some((1, &self.streams)));
        BindGroups {
            trace: group("trace", &pipeline.trace_layout, &trace),
            effects: pipeline
                .effects_layout
                .as_ref()
                .map(|layout| group("effects", layout, &read_by_effects)),
        }
    }

    fn read_back(&mut self, pipeline: &Pipeline, mut encoder: wgpu::CommandEncoder) {
        let (send, receive) = unbounded();
        let mut copy = |from: &Growing, to: &mut Growing, bytes| {
            if bytes > 0 {
                to.reserve(&pipeline.device, bytes);
                encoder.copy_buffer_to_buffer(from.get(), 0, to.get(), 0, bytes);
            }
        };
        copy(&self.codes, &mut self.codes_readback, self.answer.codes);
        copy(&self.outputs, &mut self.outputs_readback, self.answer.outputs);
        if let Some(clock) = &self.clock {
            clock.resolve(&mut encoder);
            self.answer.clock = clock.readback().size();
        }
        self.submission = Some(pipeline.queue.submit([encoder.finish()]));
        map(self.codes_readback.buffer.as_ref(), self.answer.codes, &send);
        map(self.outputs_readback.buffer.as_ref(), self.answer.outputs, &send);
        map(self.clock.as_ref().map(Clock::readback), self.answer.clock, &send);
        self.mapped = Some(receive);
    }

    /// The answer of the batch that was started last.
    pub(super) async fn answer(&mut self, pipeline: &Pipeline) -> Result<Answer, String> {
        let mapped = self.mapped.as_mut().ok_or("nothing was dispatched")?;
        // Waits for this batch alone: the next may be in flight already. A browser does not wait here.
        let submission_index = self.submission.clone();
        let poll = wgpu::PollType::Wait { submission_index, timeout: None };
        pipeline.device.poll(poll).map_err(|e| e.to_string())?;
        // Another thread, or the browser, may run the callbacks: this ends once all senders are dropped.
        while let Ok(result) = mapped.recv().await {
            result.map_err(|error| error.to_string())?;
        }
        let ticks = copy_out(self.clock.as_ref().map(Clock::readback), self.answer.clock)?;
        Ok(Answer {
            codes: copy_out(self.codes_readback.buffer.as_ref(), self.answer.codes)?,
            outputs: copy_out(self.outputs_readback.buffer.as_ref(), self.answer.outputs)?,
            seconds: self.clock.as_ref().map(|clock| clock.seconds(&ticks)),
        })
    }
}

fn map(buffer: Option<&wgpu::Buffer>, bytes: u64, done: &UnboundedSender<Mapped>) {
    let Some(buffer) = buffer.filter(|_| bytes > 0) else { return };
    let done = done.clone();
    buffer.slice(..bytes).map_async(wgpu::MapMode::Read, move |mapped| {
        // Sending fails only if the waiter is gone.
        let _ = done.unbounded_send(mapped);
    });
}

fn copy_out<T: bytemuck::Pod>(from: Option<&wgpu::Buffer>, bytes: u64) -> Result<Vec<T>, String> {
    let Some(buffer) = from.filter(|_| bytes > 0) else { return Ok(Vec::new()) };
    let copy = {
        let view = buffer.slice(..bytes).get_mapped_range().map_err(|e| e.to_string())?;
        bytemuck::pod_collect_to_vec(&view[..])
    };
    buffer.unmap();
    Ok(copy)
}

/// Workgroups in x and y that cover `rays`.
fn workgroups(rays: usize, limits: &wgpu::Limits) -> [u32; 2] {
    let groups = rays.div_ceil(WORKGROUP_SIZE) as u32;
    let x = groups.min(limits.max_compute_workgroups_per_dimension).max(1);
    [x, groups.div_ceil(x)]
}
