//! What one thread does at a time.

use std::sync::atomic::Ordering;

use super::{
    BLOCK, Engine, GROUP, Group, Head, Pass, Run, Scratch, Task, VECTOR_BLOCK, VECTOR_CHUNK,
};
use super::{lock, read, write};
use crate::kernel::Rows;
use crate::layers::Packed;
use crate::precision::{F16_LARGEST, Format};
use crate::team::Work;

impl<T: Format> Work for Engine<T> {
    fn chunk(&self, thread: usize, chunk: usize) {
        let task = *read(&self.task);
        match task {
            Task::Hidden { pass, first_block } => self.hidden(thread, pass, first_block, chunk),
            Task::Pool { pass, run } => self.pool_group(pass, run, chunk),
            Task::Vector { head, layer } => self.vector_chunk(head, layer, chunk),
        }
    }
}

impl<T: Format> Engine<T> {
    /// Takes block `first_block + slot` of the points up to a pass's last layer.
    fn hidden(&self, thread: usize, pass: Pass, first_block: usize, slot: usize) {
        let (feature, folded) = (read(&self.feature), read(&self.folded));
        let points = read(&self.points);
        let mut scratch = lock(&self.scratch[thread]);
        let Scratch { wide, narrow: [from, to] } = &mut *scratch;
        let rows = block_rows(&points, first_block + slot);
        let n = rows.n;
        let first = self.first(pass);
        let mut width = first.panels.padded_outputs();
        match pass {
            Pass::Front | Pass::Stn => self.multiply(&rows, &first.panels, wide, width),
            Pass::Fstn | Pass::Trunk => self.multiply(&rows, &read(&self.entry), wide, width),
        }
        if self.observing {
            first.seen.observe(&wide[..n * width]);
        }
        let mut layers = self.places(pass).map(|place| self.place(place, &feature, &folded));
        let mut next = layers.next();
        self.round(&wide[..n * width], first.range, next, from);
        while let Some(layer) = next {
            next = layers.next();
            if next.is_none() {
                break;
            }
            let gemm = T::gemm(self.kernels).expect("invariant: kernels fit the format");
            let rows = Rows { data: from, stride: width, n };
            width = layer.width();
            (gemm.rows)(&rows, &layer.panels, 0..layer.panels.n_panels(), wide, width);
            if self.observing {
                layer.seen.observe(&wide[..n * width]);
            }
            self.round(&wide[..n * width], layer.range, next, to);
            std::mem::swap(from, to);
        }
        write(&self.blocks[slot])[..n * width].copy_from_slice(&from[..n * width]);
    }

    /// Rounds a layer's outputs for the layer `next`, and notes what is lost.
    fn round(&self, wide: &[f32], range: f32, next: Option<&Packed<T>>, out: &mut [T::Activation]) {
        let met = T::narrow(self.kernels, wide, range, &mut out[..wide.len()]);
        if met.clipped > 0 {
            self.clipped.fetch_add(met.clipped, Ordering::Relaxed);
        }
        // No partial sum of the next layer exceeds this.
        let gain = next.map_or(1.0, |layer| layer.gain.max(1.0));
        if met.largest * gain > F16_LARGEST {
            self.overflow.store(true, Ordering::Relaxed);
        }
    }

    /// Pools group `group` of a pass's last channels over some blocks.
    fn pool_group(&self, pass: Pass, run: Run, group: usize) {
        let Run { first_block, n_blocks, winners: wants_winners } = run;
        let (feature, folded) = (read(&self.feature), read(&self.folded));
        let last = self.place(self.last(pass), &feature, &folded);
        let gemm = T::gemm(self.kernels).expect("invariant: kernels fit the format");
        let per_group = GROUP / gemm.nr;
        let panels = group * per_group..last.panels.n_panels().min((group + 1) * per_group);
        let n_channels = panels.len() * gemm.nr;
        let n_points = read(&self.points).len() / 4;
        let mut group = lock(&self.groups[group]);
        let Group { maxima, winners } = &mut *group;
        let (maxima, winners) = (&mut maxima[..n_channels], &mut winners[..n_channels]);
        if first_block == 0 {
            maxima.fill(T::LOWEST);
            winners.fill(0);
        }
        let stride = self.width_before_last(pass, &feature, &folded);
        for slot in 0..n_blocks {
            let first_row = (first_block + slot) * BLOCK;
            let block = read(&self.blocks[slot]);
            let rows = Rows { data: &block[..], stride, n: BLOCK.min(n_points - first_row) };
            if wants_winners {
                let first_row = first_row as u32;
                (gemm.argmax)(&rows, &last.panels, panels.clone(), first_row, maxima, winners);
            } else {
                (gemm.max)(&rows, &last.panels, panels.clone(), maxima);
            }
        }
    }

    fn width_before_last(&self, pass: Pass, feature: &Packed<T>, folded: &Packed<T>) -> usize {
        let first = self.first(pass).panels.padded_outputs();
        let widths = self.places(pass).map(|place| self.place(place, feature, folded).width());
        // The last but one, the first layer counted in.
        std::iter::once(first).chain(widths).fold((0, 0), |(_, before), width| (before, width)).0
    }

    fn vector_chunk(&self, head: Head, layer: usize, chunk: usize) {
        let columns = &self.head(head)[layer].columns;
        let first = chunk * VECTOR_CHUNK;
        let blocks = first..columns.n_blocks().min(first + VECTOR_CHUNK);
        let mut out = lock(&self.vector_out[chunk]);
        let out = &mut out[..blocks.len() * VECTOR_BLOCK];
        T::gemv(self.kernels)(&read(&self.vector), columns, blocks, out);
    }
}

/// The rows of block `block` of `points`.
fn block_rows(points: &[f32], block: usize) -> Rows<'_, f32> {
    let n = BLOCK.min(points.len() / 4 - block * BLOCK);
    Rows { data: &points[block * BLOCK * 4..][..n * 4], stride: 4, n }
}
