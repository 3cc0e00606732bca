//! The forward pass, divided among a team of threads.
//!
//! A *pass* runs point-wise layers on all points and pools the result: the passes are the T-Nets,
//! the trunk and the front end. Points are processed in blocks of [`BLOCK`]. The features before
//! the last layer are kept for a few blocks ([`RUN_BLOCKS`]); the outputs of the last layer are
//! pooled at once and never stored. The last layer is divided by output channels, so that a core's
//! share of the weights stays in its cache while points stream by.
//!
//! One thread computes each output in a fixed order, so results are the same for any number of
//! threads. All memory is allocated when the engine is built, except for the points of the largest
//! cloud so far.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock};

pub use edgepuck_kernels::GROUP;
use edgepuck_kernels::{
    EdgeConv, EdgeScratch, Format, GEMV_NR, Kernels, LANES, Lanes, Neighborhood, Panels,
    PrefilterLevels, PrefilterScratch,
};

use crate::model::layers::{Conv, Layers, Packed, Vector};

mod chunks;
mod forward;
mod interleave;
mod route;
mod sets;
pub mod team;

pub use forward::{Forward, Input, Scratch, folding_pays};
use interleave::Interleave;
use route::stacks;
use sets::Sets;

/// The most points of a block: whole tiles of every kernel, and few enough that their features stay
/// in a first-level cache.
pub const BLOCK: usize = 48;
/// The size of a block is a multiple of this: whole tiles of most kernels.
const BLOCK_STEP: usize = 8;
/// Blocks whose features are kept: 1,056 points, 540 KiB for 128 features.
pub const RUN_BLOCKS: usize = 22;
/// Blocks of 64 outputs of a vector layer in one chunk of work.
pub const VECTOR_CHUNK: usize = 2;
/// Outputs of a block of a vector layer.
pub const VECTOR_BLOCK: usize = GEMV_NR;
/// A vector layer of fewer products than this runs in one thread: waking others would take longer.
pub const SMALL_VECTOR: usize = 1 << 15;

/// The number of points of a block when `n_threads` divide `n_points`, chosen so that no thread is
/// idle while others work.
#[must_use]
pub fn block_points(n_points: usize, n_threads: usize) -> usize {
    let n_threads = n_threads.clamp(1, RUN_BLOCKS);
    let rounds = n_points.div_ceil(n_threads * BLOCK).max(1);
    n_points.div_ceil(n_threads * rounds).next_multiple_of(BLOCK_STEP).clamp(BLOCK_STEP, BLOCK)
}

/// A sequence of point-wise layers that ends in a pooling.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pass {
    /// The front end of a Critical Points Layer.
    Front,
    /// The T-Net of the coordinates.
    Stn,
    /// The T-Net of the features.
    Fstn,
    Trunk,
}

/// A sequence of vector layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Head {
    Stn,
    Fstn,
    Class,
}

/// The current task of the team.
#[derive(Clone, Copy)]
enum Task {
    /// Compute the features of blocks of points before the last layer of a pass.
    Hidden { pass: Pass, run: Run },
    /// Compute the last layer of these blocks and pool it.
    Pool { pass: Pass, run: Run },
    /// Compute the features of blocks of points, or of the centres of an abstraction.
    Set { level: usize, run: Run },
    /// Compute one vector layer.
    Vector { head: Head, layer: usize },
}

/// The blocks of a run, and whether to keep the winning points.
#[derive(Clone, Copy)]
struct Run {
    /// Points of a block, but for the last.
    block: usize,
    first_block: usize,
    n_blocks: usize,
    winners: bool,
}

/// A network of format `T` and its working memory.
pub struct Engine<T: Format> {
    kernels: &'static Kernels,
    /// Shared by all engines of one model.
    layers: Arc<Layers<T>>,
    /// The trunk's first layer, multiplied by the input transform.
    entry: RwLock<Panels<f32>>,
    feature: RwLock<Packed<T>>,
    folded: RwLock<Packed<T>>,
    fold: AtomicBool,
    task: RwLock<Task>,
    /// Rows x, y, z, 0, in the order of [`Interleave`].
    points: RwLock<Vec<f32>>,
    edges: EdgeConv,
    /// All points in which `edges` searches for neighbours.
    cloud: RwLock<Neighborhood>,
    sets: Sets,
    blocks: Vec<RwLock<Block<T>>>,
    groups: Vec<Mutex<Group<T::Sum>>>,
    threads: Vec<Mutex<ThreadScratch<T>>>,
    /// The nonzero inputs of the current vector layer, with their indices.
    vector: RwLock<Vec<(u32, f32)>>,
    vector_out: Vec<Mutex<Vec<f32>>>,
    clipped: AtomicU64,
    overflow: AtomicBool,
    observing: bool,
}

/// Features of up to [`BLOCK`] points before the last layer.
struct Block<T: Format> {
    features: Vec<T::Activation>,
    /// The features in levels, if `has_levels`.
    levels: PrefilterLevels,
    has_levels: bool,
}

/// The maxima of [`GROUP`] channels, and the points that attain them.
struct Group<S> {
    maxima: Vec<S>,
    winners: Vec<u32>,
    /// Whether prefiltering has paid so far.
    prefilters: bool,
}

/// The working memory of a thread: the features of a block, before and after rounding.
struct ThreadScratch<T: Format> {
    /// Points with their EdgeConv features.
    edged: Vec<f32>,
    edge_scratch: EdgeScratch,
    /// The maxima of a block's centres over their neighbours.
    set_maxima: Vec<Lanes>,
    wide: Vec<f32>,
    narrow: [Vec<T::Activation>; 2],
    prefilter_scratch: PrefilterScratch,
}

/// How far passes left the range of their number format.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RangeEvents {
    /// Activations above their calibrated range, which were clipped.
    pub clipped: u64,
    /// Whether a transform is not finite.
    pub overflow: bool,
}

impl RangeEvents {
    pub fn add(&mut self, further: Self) {
        self.clipped += further.clipped;
        self.overflow |= further.overflow;
    }
}

impl<T: Format> Engine<T> {
    /// An engine for `layers` and a team of `n_threads`. If it is `observing`, it keeps the largest
    /// activation of each layer.
    pub fn new(
        layers: Arc<Layers<T>>,
        kernels: &'static Kernels,
        n_threads: usize,
        observing: bool,
    ) -> Self {
        let trunk_first = layers.trunk[0].first();
        let transformed = layers.fstn.as_ref().map(|fstn| {
            let after = layers.trunk[layers.transform_after].packed();
            (fstn.k, after)
        });
        let (feature, folded) = match transformed {
            Some((k, after)) => {
                // Only the weights depend on the cloud; bias and ReLU are those of the layer after
                // the transform.
                let mut folded = Packed::zeros(kernels, k, after.panels.outputs());
                folded.name.clone_from(&after.name);
                folded.panels.biases_mut().copy_from_slice(after.panels.biases());
                folded.panels.relu = after.panels.relu;
                folded.range = after.range;
                (Packed::zeros(kernels, k, k), folded)
            }
            None => (Packed::zeros(kernels, 1, 1), Packed::zeros(kernels, 1, 1)),
        };
        let Widths { hidden, pooled, vector } = Widths::new(&layers);
        let prefilters = pooled_layers(&layers).any(|layer| layer.prefilter.is_some());
        let edges = EdgeConv::new(&layers.edges);
        // Without EdgeConv layers, rows are the points themselves.
        let edged = if edges.is_empty() { 0 } else { BLOCK * trunk_first.panels.padded_inputs() };
        let edge_scratch = edges.scratch(BLOCK);
        let sets = Sets::new(&layers);
        let thread = || ThreadScratch {
            edged: vec![0.0; edged],
            edge_scratch: edge_scratch.clone(),
            set_maxima: vec![[0.0; LANES]; BLOCK * sets.most_lanes()],
            wide: vec![0.0; BLOCK * hidden],
            narrow: [(); 2].map(|()| vec![T::Activation::default(); BLOCK * hidden]),
            prefilter_scratch: PrefilterScratch::new(if prefilters { BLOCK } else { 0 }),
        };
        let group =
            || Group { maxima: vec![T::LOWEST; GROUP], winners: vec![0; GROUP], prefilters: false };
        let block = || {
            // Blocks outlive a task: one thread computes a block, and all threads pool it.
            RwLock::new(Block {
                features: vec![T::Activation::default(); BLOCK * hidden],
                levels: PrefilterLevels::with_room(if prefilters { BLOCK * hidden } else { 0 }),
                has_levels: false,
            })
        };
        let chunk = || Mutex::new(vec![0.0; VECTOR_CHUNK * VECTOR_BLOCK]);
        Self {
            kernels,
            entry: RwLock::new(trunk_first.panels.clone()),
            feature: RwLock::new(feature),
            folded: RwLock::new(folded),
            fold: AtomicBool::new(false),
            // Any task will do before the first `begin`.
            task: RwLock::new(Task::Vector { head: Head::Class, layer: 0 }),
            points: RwLock::new(Vec::new()),
            edges,
            cloud: RwLock::default(),
            threads: (0..n_threads.max(1)).map(|_| Mutex::new(thread())).collect(),
            sets,
            blocks: (0..RUN_BLOCKS).map(|_| block()).collect(),
            // Enough for the widest pass; the others use the first ones.
            groups: (0..pooled.div_ceil(GROUP)).map(|_| Mutex::new(group())).collect(),
            vector: RwLock::new(Vec::with_capacity(vector)),
            vector_out: (0..vector.div_ceil(VECTOR_CHUNK * VECTOR_BLOCK))
                .map(|_| chunk())
                .collect(),
            clipped: AtomicU64::new(0),
            overflow: AtomicBool::new(false),
            observing,
            layers,
        }
    }

    /// Stores `input` for the next pass, and resets the range events.
    fn take(&self, input: &Input<'_>) {
        let Input { points, cloud, .. } = *input;
        let mut rows = write(&self.points);
        rows.clear();
        let is_set = !self.layers.abstractions.is_empty();
        let interleave =
            if is_set { Interleave::none(points.len()) } else { Interleave::new(points.len()) };
        // The order does not change a maximum, only how early the prefilter finds it.
        let in_order = (0..points.len()).map(|row| points[interleave.point(row)]);
        rows.extend(in_order.flat_map(|[x, y, z]| [x, y, z, 0.0]));
        if !self.edges.is_empty() {
            write(&self.cloud).set(cloud);
        }
        if is_set {
            self.sets.take(points, self.kernels);
        }
        self.clipped.store(0, Ordering::Relaxed);
        self.overflow.store(false, Ordering::Relaxed);
    }

    fn events(&self) -> RangeEvents {
        RangeEvents {
            clipped: self.clipped.load(Ordering::Relaxed),
            overflow: self.overflow.load(Ordering::Relaxed),
        }
    }

    /// The largest activation of each layer that was observed, by its name.
    pub fn observed(&self) -> Vec<(String, f32)> {
        let pools = self.layers.abstractions.iter().map(|abstraction| &abstraction.pool);
        let mut seen: Vec<_> = stacks(&self.layers)
            .flatten()
            .chain(pools)
            .map(|conv| match conv {
                Conv::First(first) => (first.dense.name.clone(), first.seen.get()),
                _ => (conv.packed().name.clone(), conv.packed().seen.get()),
            })
            .collect();
        // The folded layer stands in for the layer of the file with the same name.
        let folded = read(&self.folded);
        for (name, largest) in &mut seen {
            if *name == folded.name {
                *largest = largest.max(folded.seen.get());
            }
        }
        seen
    }

    fn begin(&self, task: Task) {
        *write(&self.task) = task;
    }

    fn head(&self, head: Head) -> &[Vector<T>] {
        let net = match head {
            Head::Class => return &self.layers.head,
            Head::Stn => self.layers.stn.as_ref(),
            Head::Fstn => self.layers.fstn.as_ref(),
        };
        net.map_or(&[], |net| &net.fcs)
    }
}

/// The sizes of an engine's buffers, in elements of a row.
struct Widths {
    /// Features between point-wise layers.
    hidden: usize,
    /// Features that are pooled.
    pooled: usize,
    /// Inputs and outputs of vector layers.
    vector: usize,
}

impl Widths {
    fn new<T: Format>(layers: &Layers<T>) -> Self {
        let nets = [&layers.stn, &layers.fstn].into_iter().flatten();
        let fcs = nets.flat_map(|net| &net.fcs).chain(&layers.head);
        let columns = fcs.map(|layer| &layer.columns);
        // The outputs of set abstractions are all stored.
        let pools = layers.abstractions.iter().map(|abstraction| &abstraction.pool);
        let n_pooled = usize::from(layers.abstractions.is_empty());
        let stored = stacks(layers).flat_map(|convs| &convs[..convs.len() - n_pooled]);
        let hidden = stored.chain(pools).map(Conv::width);
        let pooled = pooled_layers(layers).map(Packed::width);
        Self {
            hidden: hidden.max().unwrap_or(0),
            pooled: pooled.max().unwrap_or(0),
            vector: columns.map(|c| c.padded_outputs().max(c.inputs())).max().unwrap_or(0),
        }
    }
}

fn pooled_layers<T: Format>(layers: &Layers<T>) -> impl Iterator<Item = &Packed<T>> {
    let pools = layers.abstractions.is_empty();
    stacks(layers).filter(move |_| pools).filter_map(<[_]>::last).map(Conv::packed)
}

/// Only a panic of another thread poisons a lock. It is a defect, which the caller must see.
fn read<V>(lock: &RwLock<V>) -> std::sync::RwLockReadGuard<'_, V> {
    lock.read().unwrap_or_else(|_| panic!("a worker panicked"))
}

fn write<V>(lock: &RwLock<V>) -> std::sync::RwLockWriteGuard<'_, V> {
    lock.write().unwrap_or_else(|_| panic!("a worker panicked"))
}

fn lock<V>(lock: &Mutex<V>) -> MutexGuard<'_, V> {
    lock.lock().unwrap_or_else(|_: PoisonError<_>| panic!("a worker panicked"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_shared_out_evenly() {
        assert_eq!([1, 2, 4].map(|threads| block_points(64, threads)), [32, 32, 16]);
        assert_eq!([1, 2, 4].map(|threads| block_points(1024, threads)), [48, 48, 48]);
        assert_eq!([0, 1, 3].map(|points| block_points(points, 4)), [8, 8, 8]);
        for (points, threads) in [(100, 3), (1057, 22), (1_000_000, 64), (5, 1000)] {
            let block = block_points(points, threads);
            assert!((1..=BLOCK).contains(&block), "{points} points, {threads} threads: {block}");
        }
    }
}
