//! The chunks of work of one thread.

use std::sync::atomic::Ordering;

use edgepuck_kernels::{
    Best, EdgeScratch, Format, Kernels, PrefilterLevels, PrefilterScratch, Rows, Weight,
};

use super::{
    Block, Engine, GROUP, Group, Head, Pass, Run, Task, ThreadScratch, VECTOR_BLOCK, VECTOR_CHUNK,
};
use super::{lock, read, write};
use crate::engine::team::Work;
use crate::model::layers::Packed;

impl<T: Format> Work for Engine<T> {
    fn chunk(&self, thread: usize, chunk: usize) {
        let task = *read(&self.task);
        match task {
            Task::Hidden { pass, run } => self.hidden(thread, pass, run, chunk),
            Task::Pool { pass, run } => self.pool_group(thread, pass, run, chunk),
            Task::Set { level, run } => self.set_block(thread, level, run, chunk),
            Task::Vector { head, layer } => self.vector_chunk(head, layer, chunk),
        }
    }
}

impl<T: Format> Engine<T> {
    /// Computes the features of block `slot` of a run up to the last layer of a pass.
    fn hidden(&self, thread: usize, pass: Pass, run: Run, slot: usize) {
        let (feature, folded) = (read(&self.feature), read(&self.folded));
        // Nothing writes these during a task, so the read locks never wait.
        let points = read(&self.points);
        let mut scratch = lock(&self.threads[thread]);
        // A thread locks only its own scratch memory, so there is no contention.
        let ThreadScratch { edged, edge_scratch, wide, narrow: [from, to], .. } = &mut *scratch;
        let rows = block_rows(&points, run.block, run.first_block + slot);
        let n = rows.n();
        let first = self.first(pass);
        let mut width = first.panels.padded_outputs();
        match pass {
            // These two see raw coordinates; the others see them after the input transform, with
            // EdgeConv features.
            Pass::Front | Pass::Stn => self.multiply(&rows, &first.panels, wide, width),
            Pass::Fstn | Pass::Trunk => {
                let rows = self.with_edge_features(&rows, edged, edge_scratch);
                self.multiply(&rows, &read(&self.entry), wide, width);
            }
        }
        if self.observing {
            first.seen.observe(&wide[..n * width]);
        }
        let mut layers = self.route(pass, &feature, &folded);
        let mut next = layers.next();
        self.round(&wide[..n * width], first.range, from);
        while let Some(layer) = next {
            next = layers.next();
            // The last layer is pooled by `pool_group`, never stored.
            if next.is_none() {
                break;
            }
            let gemm = T::gemm(self.kernels).expect("invariant: kernels fit the format");
            let rows = Rows::new(from, width, n);
            width = layer.width();
            (gemm.rows)(&rows, &layer.panels, 0..layer.panels.n_panels(), wide, width);
            if self.observing {
                layer.seen.observe(&wide[..n * width]);
            }
            self.round(&wide[..n * width], layer.range, to);
            std::mem::swap(from, to);
        }
        let last = self.last(pass, &feature, &folded);
        write(&self.blocks[slot]).set(self.kernels, &Rows::new(from, width, n), last);
    }

    /// `rows` of coordinates, each followed by the point's EdgeConv features.
    fn with_edge_features<'a>(
        &self,
        rows: &Rows<'a, f32>,
        edged: &'a mut [f32],
        edge_scratch: &mut EdgeScratch,
    ) -> Rows<'a, f32> {
        if self.edges.is_empty() {
            return *rows;
        }
        let stride = self.layers.trunk[0].first().panels.padded_inputs();
        let edged = &mut edged[..rows.n() * stride];
        let points = rows.data().chunks_exact(rows.stride());
        for (point, row) in points.zip(edged.chunks_exact_mut(stride)) {
            // Points have 4 numbers; in rows with features, the features begin after the third.
            row[..3].copy_from_slice(&point[..3]);
        }
        let rows_out = (&mut *edged, stride);
        (self.kernels.edge_features)(&self.edges, rows_out, &read(&self.cloud), edge_scratch);
        Rows::new(edged, stride, rows.n())
    }

    /// Rounds a layer's outputs to the input format of the next layer, and counts clipped values.
    pub(super) fn round(&self, wide: &[f32], range: f32, out: &mut [T::Activation]) {
        let clipped = T::narrow(self.kernels, wide, range, &mut out[..wide.len()]);
        if clipped > 0 {
            // Relaxed suffices: `Team::run` synchronises before `events` reads the counters.
            self.clipped.fetch_add(clipped, Ordering::Relaxed);
        }
    }

    /// Pools channel group `group` of the last layer of a pass over the blocks of a run.
    fn pool_group(&self, thread: usize, pass: Pass, run: Run, group: usize) {
        let Run { block: block_points, first_block, n_blocks, winners } = run;
        let (feature, folded) = (read(&self.feature), read(&self.folded));
        let last = self.last(pass, &feature, &folded);
        let n_points = read(&self.points).len() / 4;
        let stride = self.width_before_last(pass, &feature, &folded);
        // One chunk of work owns a group, so the lock never waits.
        let mut pool = lock(&self.groups[group]);
        // Later runs continue with the maxima of the runs before.
        if first_block == 0 {
            pool.begin::<T>(last, group, winners);
        }
        for slot in 0..n_blocks {
            let first_row = (first_block + slot) * block_points;
            let block = read(&self.blocks[slot]);
            let rows =
                Rows::new(&block.features[..], stride, block_points.min(n_points - first_row));
            let is_pooled = pool.prefilters && block.has_levels && {
                let prefilter_scratch = &mut lock(&self.threads[thread]).prefilter_scratch;
                pool.prefilter::<T>(
                    self.kernels,
                    (last, group),
                    (&rows, &block.levels),
                    prefilter_scratch,
                    first_row,
                )
            };
            // Once the prefilter rules out too few products of a block, it is off for the group:
            // later blocks of the cloud are alike, since `Interleave` makes each a sample of the
            // whole.
            if !is_pooled {
                pool.prefilters &= !block.has_levels;
                let first_row = winners.then_some(first_row as u32);
                pool.multiply::<T>(self.kernels, (last, group), &rows, first_row);
            }
        }
    }

    fn width_before_last(&self, pass: Pass, feature: &Packed<T>, folded: &Packed<T>) -> usize {
        let first = self.first(pass).panels.padded_outputs();
        let widths = self.route(pass, feature, folded).map(Packed::width);
        // The width before the last layer; the first layer counts.
        std::iter::once(first).chain(widths).fold((0, 0), |(_, before), width| (before, width)).0
    }

    fn vector_chunk(&self, head: Head, layer: usize, chunk: usize) {
        // The matrix exceeds the caches, so each thread reads its own part of it once.
        let columns = &self.head(head)[layer].columns;
        let first = chunk * VECTOR_CHUNK;
        let blocks = first..columns.n_panels().min(first + VECTOR_CHUNK);
        let mut out = lock(&self.vector_out[chunk]);
        let out = &mut out[..blocks.len() * VECTOR_BLOCK];
        T::Weight::gemv(self.kernels)(&read(&self.vector), columns, blocks, out);
    }
}

impl<T: Format> Block<T> {
    /// Stores `rows` for the layer `next`.
    fn set(&mut self, kernels: &Kernels, rows: &Rows<'_, T::Activation>, next: &Packed<T>) {
        let n = rows.n() * rows.stride();
        // A copy, since the thread overwrites its scratch memory with the next block.
        self.features[..n].copy_from_slice(&rows.data()[..n]);
        let plain = next.prefilter.as_ref().and_then(|_| T::as_f32(rows.data(), &mut []));
        self.has_levels = plain.is_some_and(|(data, _)| {
            self.levels.take(kernels, &Rows::new(data, rows.stride(), rows.n()))
        });
    }
}

impl<S: Copy> Group<S> {
    fn begin<T: Format<Sum = S>>(&mut self, last: &Packed<T>, group: usize, wants_winners: bool) {
        self.maxima.fill(T::LOWEST);
        self.winners.fill(0);
        self.prefilters = last.prefilter.is_some();
        let channels = n_channels(last, group);
        if let Some(prefilter) = &last.prefilter
            && let Some((_, maxima)) = T::as_f32(&[], &mut self.maxima[..channels])
        {
            prefilter.begin(group, wants_winners, maxima);
        }
    }

    /// Pools rows by the prefilter; returns false if it gives up or does not apply.
    fn prefilter<T: Format<Sum = S>>(
        &mut self,
        kernels: &Kernels,
        (last, group): (&Packed<T>, usize),
        (rows, levels): (&Rows<'_, T::Activation>, &PrefilterLevels),
        prefilter_scratch: &mut PrefilterScratch,
        first_row: usize,
    ) -> bool {
        let channels = n_channels(last, group);
        let plain = T::as_f32(rows.data(), &mut self.maxima[..channels]);
        let (Some(prefilter), Some((data, maxima))) = (&last.prefilter, plain) else {
            return false;
        };
        let rows = Rows::new(data, rows.stride(), rows.n());
        let winners = &mut self.winners[..channels];
        let mut best = Best { maxima, winners, first_row: first_row as u32 };
        prefilter.pool(kernels, group, (&rows, levels), prefilter_scratch, &mut best)
    }

    /// Pools rows by computing all products; keeps the winners if the number of the first row is
    /// given.
    fn multiply<T: Format<Sum = S>>(
        &mut self,
        kernels: &Kernels,
        (last, group): (&Packed<T>, usize),
        rows: &Rows<'_, T::Activation>,
        first_row: Option<u32>,
    ) {
        let gemm = T::gemm(kernels).expect("invariant: kernels fit the format");
        // GROUP is a multiple of every `nr`, so that a group is a range of whole panels.
        let first = group * GROUP / gemm.nr;
        let channels = n_channels(last, group);
        let panels = first..first + channels / gemm.nr;
        let (maxima, winners) = (&mut self.maxima[..channels], &mut self.winners[..channels]);
        match first_row {
            Some(row) => (gemm.argmax)(rows, &last.panels, panels, row, maxima, winners),
            None => (gemm.max)(rows, &last.panels, panels, maxima),
        }
    }
}

/// The number of channels of a group, padding included.
fn n_channels<T: Format>(last: &Packed<T>, group: usize) -> usize {
    GROUP.min(last.width() - group * GROUP)
}

/// The rows of block `block` of `points`; every block has `size` rows, the last one may have fewer.
pub(super) fn block_rows(points: &[f32], size: usize, block: usize) -> Rows<'_, f32> {
    let n = size.min(points.len() / 4 - block * size);
    Rows::new(&points[block * size * 4..][..n * 4], 4, n)
}
