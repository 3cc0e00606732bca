//! The buffers of one dispatch under way. Slots are used again, so that a long
//! run allocates as much as its largest batches need and no more.

use super::batch::Batch;
use super::caster::Core;
use super::compose::{Input, WORKGROUP_SIZE, reads};
use std::sync::mpsc::{Receiver, channel};

const INPUT: wgpu::BufferUsages = wgpu::BufferUsages::STORAGE.union(wgpu::BufferUsages::COPY_DST);
const OUTPUT: wgpu::BufferUsages = wgpu::BufferUsages::STORAGE.union(wgpu::BufferUsages::COPY_SRC);
const READBACK: wgpu::BufferUsages =
    wgpu::BufferUsages::MAP_READ.union(wgpu::BufferUsages::COPY_DST);

/// A buffer that is replaced by a larger one when it must hold more.
#[derive(Default)]
struct Growing(Option<wgpu::Buffer>);

impl Growing {
    fn with_room(
        &mut self,
        device: &wgpu::Device,
        bytes: u64,
        usage: wgpu::BufferUsages,
    ) -> &wgpu::Buffer {
        let too_small = self.0.as_ref().is_none_or(|buffer| buffer.size() < bytes);
        if too_small {
            let limits = device.limits();
            let limit = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
            let size = bytes.next_power_of_two().max(4096).min(limit).max(bytes);
            self.0 = None;
            self.0 = Some(device.create_buffer(&wgpu::BufferDescriptor {
                label: None,
                size,
                usage,
                mapped_at_creation: false,
            }));
        }
        self.0.as_ref().expect("invariant: it was filled above")
    }
}

/// See the module.
#[derive(Default)]
pub(super) struct Slot {
    nodes: Growing,
    triangles: Growing,
    rays: Growing,
    codes: Growing,
    words: Growing,
    streams: Growing,
    reflectivities: Growing,
    codes_readback: Growing,
    words_readback: Growing,
    answer_bytes: [u64; 2],
    submission: Option<wgpu::SubmissionIndex>,
    mapped: Option<Receiver<Result<(), wgpu::BufferAsyncError>>>,
}

impl Slot {
    /// Uploads `batch`, dispatches it and asks for the answer.
    pub(super) fn start(&mut self, core: &Core, batch: &Batch) {
        let Core { device, queue, modules, .. } = core;
        self.answer_bytes = batch.answer_bytes(modules);
        let [codes_bytes, words_bytes] = self.answer_bytes;
        let upload = |to: &mut Growing, bytes: &[u8]| {
            let buffer = to.with_room(device, bytes.len() as u64, INPUT);
            queue.write_buffer(buffer, 0, bytes);
            (buffer.clone(), bytes.len() as u64)
        };
        let mut trace = vec![
            upload(&mut self.nodes, bytemuck::cast_slice(&batch.nodes)),
            upload(&mut self.triangles, bytemuck::cast_slice(&batch.triangles)),
            upload(&mut self.rays, bytemuck::cast_slice(&batch.rays)),
        ];
        let codes = self.codes.with_room(device, codes_bytes, OUTPUT).clone();
        trace.push((codes.clone(), codes_bytes));

        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&core.pipeline);
        pass.set_bind_group(0, &bind(core, 0, &[0, 1, 2, 3], &trace), &[]);
        if !modules.is_empty() {
            let words = self.words.with_room(device, words_bytes, OUTPUT).clone();
            let (mut bindings, mut buffers) = (vec![0], vec![(words, words_bytes)]);
            if reads(modules, Input::Stream) {
                bindings.push(1);
                buffers.push(upload(&mut self.streams, bytemuck::cast_slice(&batch.streams)));
            }
            if reads(modules, Input::Reflectivity) {
                let bytes = bytemuck::cast_slice(&batch.reflectivities);
                bindings.push(2);
                buffers.push(upload(&mut self.reflectivities, bytes));
            }
            pass.set_bind_group(1, &bind(core, 1, &bindings, &buffers), &[]);
        }
        let [x, y] = workgroups(batch.rays.len(), &device.limits());
        pass.dispatch_workgroups(x, y, 1);
        drop(pass);
        self.read_back(core, encoder, &codes);
    }

    fn read_back(&mut self, core: &Core, mut encoder: wgpu::CommandEncoder, codes: &wgpu::Buffer) {
        let [codes_bytes, words_bytes] = self.answer_bytes;
        let device = &core.device;
        let readback = self.codes_readback.with_room(device, codes_bytes, READBACK).clone();
        encoder.copy_buffer_to_buffer(codes, 0, &readback, 0, codes_bytes);
        let words_readback = self.words.0.as_ref().filter(|_| words_bytes > 0).map(|words| {
            let readback = self.words_readback.with_room(device, words_bytes, READBACK);
            encoder.copy_buffer_to_buffer(words, 0, readback, 0, words_bytes);
            readback.clone()
        });
        self.submission = Some(core.queue.submit([encoder.finish()]));
        let (send, receive) = channel();
        let map = |buffer: &wgpu::Buffer, bytes| {
            let send = send.clone();
            buffer.slice(..bytes).map_async(wgpu::MapMode::Read, move |mapped| {
                // The receiver is gone only if nobody waits any more.
                let _ = send.send(mapped);
            });
        };
        map(&readback, codes_bytes);
        if let Some(buffer) = &words_readback {
            map(buffer, words_bytes);
        }
        self.mapped = Some(receive);
    }

    /// The codes and words of the batch, once they are there.
    pub(super) fn wait(&self, core: &Core) -> Result<(Vec<u32>, Vec<f32>), String> {
        let mapped = self.mapped.as_ref().ok_or("nothing was dispatched")?;
        // This batch alone: the next may be on its way already.
        let submission_index = self.submission.clone();
        let poll = wgpu::PollType::Wait { submission_index, timeout: None };
        core.device.poll(poll).map_err(|e| e.to_string())?;
        // Another thread may be the one that runs the callbacks: this waits for
        // it, until both ends of the channel were dropped.
        for result in mapped {
            result.map_err(|error| error.to_string())?;
        }
        let [codes_bytes, words_bytes] = self.answer_bytes;
        Ok((
            copy_out(&self.codes_readback, codes_bytes)?,
            copy_out(&self.words_readback, words_bytes)?,
        ))
    }
}

fn copy_out<T: bytemuck::AnyBitPattern>(from: &Growing, bytes: u64) -> Result<Vec<T>, String> {
    let Some(buffer) = from.0.as_ref().filter(|_| bytes > 0) else { return Ok(Vec::new()) };
    let copy = {
        let view = buffer.slice(..bytes).get_mapped_range().map_err(|e| e.to_string())?;
        bytemuck::cast_slice(&view).to_vec()
    };
    buffer.unmap();
    Ok(copy)
}

fn bind(
    core: &Core,
    group: u32,
    bindings: &[u32],
    buffers: &[(wgpu::Buffer, u64)],
) -> wgpu::BindGroup {
    let entries: Vec<_> = bindings
        .iter()
        .zip(buffers)
        .map(|(&binding, (buffer, bytes))| wgpu::BindGroupEntry {
            binding,
            resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer,
                offset: 0,
                size: wgpu::BufferSize::new(*bytes),
            }),
        })
        .collect();
    core.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &core.pipeline.get_bind_group_layout(group),
        entries: &entries,
    })
}

/// Workgroups in x and y that cover `rays`.
fn workgroups(rays: usize, limits: &wgpu::Limits) -> [u32; 2] {
    let groups = rays.div_ceil(WORKGROUP_SIZE) as u32;
    let x = groups.min(limits.max_compute_workgroups_per_dimension).max(1);
    [x, groups.div_ceil(x)]
}
