//! The order of passes: T-Nets, trunk, head.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use edgepuck_kernels::{Format, Panels, Rows, Sum};

use super::{
    Engine, GROUP, Head, Interleave, Pass, RUN_BLOCKS, RangeEvents, Run, SMALL_VECTOR, Task,
    VECTOR_BLOCK, VECTOR_CHUNK, block_points, lock, read, write,
};
use crate::engine::team::{Team, Work};
use crate::model::layers::Conv;
use crate::model::layers::Matrix;

/// Whether it takes fewer products to multiply the feature transform into the layer after it, for
/// `n` points and a layer with this number of `outputs`.
#[must_use]
pub const fn folding_pays(n: usize, outputs: usize) -> bool {
    n > outputs
}

/// The input of a network.
#[derive(Clone, Copy)]
pub struct Input<'a> {
    /// The points that the network processes.
    pub points: &'a [[f32; 3]],
    /// The cloud in which EdgeConv layers search for neighbours.
    pub cloud: &'a [[f32; 3]],
    /// Whether [`Scratch::values`] already holds the pooled vector of the coordinates' T-Net for
    /// these points.
    pub pooled_stn: bool,
}

/// The caller's working memory for forward passes.
#[derive(Default)]
pub struct Scratch {
    /// The pooled vector, and then the outputs of the vector layers; after a whole run, the logits.
    pub values: Vec<f32>,
    /// The point that won each channel, after a pass that keeps winners.
    pub winners: Vec<u32>,
    /// The range events of all passes since the caller reset them.
    pub events: RangeEvents,
    product: Vec<f32>,
}

impl Scratch {
    pub fn reserve(&mut self, channels: usize) {
        self.values.reserve(channels.saturating_sub(self.values.len()));
        self.winners.reserve(channels.saturating_sub(self.winners.len()));
    }
}

/// A network in any number format.
///
/// A run depends on its arguments alone, not on earlier calls.
pub trait Forward: Send + Sync {
    fn reserve(&self, n: usize);
    /// Runs the whole network; the logits are in `scratch.values` afterwards, and range events are
    /// added to `scratch.events`.
    fn run(&self, input: &Input<'_>, scratch: &mut Scratch);
    /// Pools the features of `pass` into `scratch.values`, and the winning points into
    /// `scratch.winners`.
    fn pool_winners(&self, pass: Pass, input: &Input<'_>, scratch: &mut Scratch);
    /// The number of features that `pass` pools.
    fn channels(&self, pass: Pass) -> usize;
    /// Working memory that is large enough for every run.
    fn scratch(&self) -> Scratch;
    fn n_classes(&self) -> usize;
    /// The same network, for one thread and with its own working memory.
    fn twin(&self) -> std::io::Result<Box<dyn Forward>>;
}

impl<T: Format> Forward for Team<Engine<T>> {
    fn reserve(&self, n: usize) {
        let engine = self.work();
        let mut points = write(&engine.points);
        // A point has four numbers, so that kernels read whole vectors.
        let missing = (n * 4).saturating_sub(points.len());
        points.reserve(missing);
        if !engine.edges.is_empty() {
            write(&engine.cloud).reserve(n);
        }
        if !engine.layers.abstractions.is_empty() {
            engine.sets.reserve(n, engine.kernels);
        }
    }

    fn run(&self, input: &Input<'_>, scratch: &mut Scratch) {
        self.work().take(input);
        Engine::classify(self, input.pooled_stn, scratch);
        scratch.events.add(self.work().events());
    }

    fn pool_winners(&self, pass: Pass, input: &Input<'_>, scratch: &mut Scratch) {
        self.work().take(input);
        Engine::pool(self, pass, true, scratch);
        scratch.events.add(self.work().events());
    }

    fn channels(&self, pass: Pass) -> usize {
        let engine = self.work();
        engine.last(pass, &read(&engine.feature), &read(&engine.folded)).panels.outputs()
    }

    fn scratch(&self) -> Scratch {
        let engine = self.work();
        let pooled = engine.groups.len() * GROUP;
        let vector = engine.vector_out.len() * VECTOR_CHUNK * VECTOR_BLOCK;
        let product = read(&engine.folded).panels.n_weights() * 2;
        Scratch {
            values: Vec::with_capacity(pooled.max(vector)),
            winners: Vec::with_capacity(pooled),
            events: RangeEvents::default(),
            product: Vec::with_capacity(product),
        }
    }

    fn n_classes(&self) -> usize {
        self.work().layers.head.last().map_or(0, |layer| layer.columns.outputs())
    }

    fn twin(&self) -> std::io::Result<Box<dyn Forward>> {
        let engine = self.work();
        let twin = Engine::new(Arc::clone(&engine.layers), engine.kernels, 1, engine.observing);
        Ok(Box::new(Self::new(twin, 1)?))
    }
}

impl<T: Format> Engine<T> {
    /// Runs every layer of the network, the front end included.
    pub fn observe(team: &Team<Self>, input: &Input<'_>, scratch: &mut Scratch) {
        if team.work().layers.front.is_some() {
            team.pool_winners(Pass::Front, input, scratch);
        }
        Forward::run(team, input, scratch);
    }

    fn classify(team: &Team<Self>, pooled_stn: bool, scratch: &mut Scratch) {
        let engine = team.work();
        let n_points = read(&engine.points).len() / 4;
        if engine.layers.stn.is_some() {
            // A Critical Points Layer may have left the pooled vector in `values`.
            if !pooled_stn {
                Self::pool(team, Pass::Stn, false, scratch);
            }
            Self::vectors(team, Head::Stn, &mut scratch.values);
            engine.note_overflow(&scratch.values);
            engine.set_input_transform(&scratch.values);
        }
        if engine.layers.fstn.is_some() {
            Self::pool(team, Pass::Fstn, false, scratch);
            Self::vectors(team, Head::Fstn, &mut scratch.values);
            engine.note_overflow(&scratch.values);
            engine.set_feature_transform(scratch, n_points);
        }
        if engine.layers.abstractions.is_empty() {
            Self::pool(team, Pass::Trunk, false, scratch);
        } else {
            Self::abstract_sets(team, scratch);
        }
        Self::vectors(team, Head::Class, &mut scratch.values);
    }

    fn pool(team: &Team<Self>, pass: Pass, winners: bool, scratch: &mut Scratch) {
        let engine = team.work();
        let n_points = read(&engine.points).len() / 4;
        let block = block_points(n_points, engine.threads.len());
        let n_blocks = n_points.div_ceil(block);
        let width = engine.last_width(pass);
        // A run bounds the features that are kept before the last layer, for clouds of any size.
        for first_block in (0..n_blocks).step_by(RUN_BLOCKS) {
            let n_blocks = RUN_BLOCKS.min(n_blocks - first_block);
            let run = Run { block, first_block, n_blocks, winners };
            // A group pools all blocks of the run, so their features must be complete first.
            engine.begin(Task::Hidden { pass, run });
            team.run(n_blocks);
            engine.begin(Task::Pool { pass, run });
            team.run(width.div_ceil(GROUP));
        }
        engine.collect(pass, winners, scratch);
    }

    /// Applies scale, bias and ReLU to the maxima alone, which is exact, since all three are
    /// monotonic.
    fn collect(&self, pass: Pass, winners: bool, scratch: &mut Scratch) {
        let (feature, folded) = (read(&self.feature), read(&self.folded));
        let panels = &self.last(pass, &feature, &folded).panels;
        let interleave = Interleave::new(read(&self.points).len() / 4);
        scratch.values.clear();
        scratch.winners.clear();
        for (g, first) in (0..panels.outputs()).step_by(GROUP).enumerate() {
            let group = lock(&self.groups[g]);
            let channels = first..panels.outputs().min(first + GROUP);
            if winners {
                let points = group.winners[..channels.len()].iter();
                scratch.winners.extend(points.map(|&row| interleave.point(row as usize) as u32));
            }
            for (channel, &sum) in channels.zip(&group.maxima) {
                let scale = panels.scales().get(channel).copied().unwrap_or(1.0);
                let value = sum.to_f32() * scale + panels.biases()[channel];
                // A comparison instead of `max`, which would turn NaN into 0 and hide an overflow.
                let is_cut = panels.relu && value < 0.0;
                scratch.values.push(if is_cut { 0.0 } else { value });
            }
        }
    }

    /// Runs the layers of `head` on `values`, in place.
    fn vectors(team: &Team<Self>, head: Head, values: &mut Vec<f32>) {
        let engine = team.work();
        for (i, layer) in engine.head(head).iter().enumerate() {
            let nonzero = values.iter().enumerate().filter(|&(_, &value)| value != 0.0);
            // After a ReLU many inputs are 0, and the kernel skips their columns.
            let mut vector = write(&engine.vector);
            vector.clear();
            vector.extend(nonzero.map(|(j, &value)| (j as u32, value)));
            drop(vector);
            engine.begin(Task::Vector { head, layer: i });
            let columns = &layer.columns;
            let n_chunks = columns.n_panels().div_ceil(VECTOR_CHUNK);
            // Waking the team would take longer than this product.
            if columns.inputs() * columns.outputs() < SMALL_VECTOR {
                (0..n_chunks).for_each(|chunk| engine.chunk(0, chunk));
            } else {
                team.run(n_chunks);
            }
            values.clear();
            for chunk in 0..n_chunks {
                let left = columns.outputs() - values.len();
                let out = lock(&engine.vector_out[chunk]);
                values.extend(out.iter().take(left));
            }
            if layer.relu {
                // NaN is not below 0, so an overflow stays visible in the logits.
                values.iter_mut().filter(|value| **value < 0.0).for_each(|value| *value = 0.0);
            }
        }
    }

    /// Records an overflow if a transform is not finite. The ReLU of later layers would hide it,
    /// since kernels turn NaN into 0.
    fn note_overflow(&self, transform: &[f32]) {
        if !transform.iter().all(|value| value.is_finite()) {
            self.overflow.store(true, Ordering::Relaxed);
        }
    }

    fn set_input_transform(&self, transform: &[f32]) {
        self.layers.trunk[0].first().turn(transform, &mut write(&self.entry));
    }

    /// Packs the feature transform `[k, k]` as a layer of its own or multiplied into the layer
    /// after it, whichever takes fewer products for `n` points.
    fn set_feature_transform(&self, scratch: &mut Scratch, n: usize) {
        let Scratch { values: transform, product, .. } = scratch;
        let Conv::Turned(after, plain) = &self.layers.trunk[self.layers.transform_after] else {
            unreachable!("invariant: the layer after a feature transform has that role");
        };
        let k = plain.inputs();
        // An unsigned format cannot hold the negative outputs of the transform, and an observing
        // engine needs the outputs of the layers of the file.
        let fold = !T::SIGNED || self.observing || folding_pays(n, after.panels.outputs());
        self.fold.store(fold, Ordering::Relaxed);
        let range = self.range_before_transform();
        if !fold {
            write(&self.feature).set(&Matrix { data: transform, stride: k }, range);
            return;
        }
        let width = plain.padded_outputs();
        // Within the capacity of `Forward::scratch`, so that this does not allocate.
        product.resize(k * width, 0.0);
        let rows = Rows::new(transform, k, k);
        self.multiply(&rows, plain, product, width);
        write(&self.folded).set(&Matrix { data: product, stride: width }, range);
    }

    fn range_before_transform(&self) -> f32 {
        match &self.layers.trunk[self.layers.transform_after - 1] {
            Conv::First(first) => first.range,
            conv => conv.packed().range,
        }
    }

    /// `rows` times `panels` in fp32.
    pub(super) fn multiply(
        &self,
        rows: &Rows<'_, f32>,
        panels: &Panels<f32>,
        out: &mut [f32],
        stride: usize,
    ) {
        (self.kernels.f32.rows)(rows, panels, 0..panels.n_panels(), out, stride);
    }
}
