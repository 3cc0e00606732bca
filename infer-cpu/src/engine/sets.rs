//! The levels of set abstractions. Level 0 is the point-wise layers; each further level pools over
//! the neighborhoods of its centres in the level before, and runs its layers on the result. The last
//! level's features are pooled over all centres, in the order of the centres.

use std::sync::{Mutex, RwLock};

use edgepuck_kernels::{
    Format, Kernels, LANES, Lanes, NeighborPool, Neighborhood, PoolStep, Rows, TILE,
};

use super::chunks::block_rows;
use super::{
    Engine, RUN_BLOCKS, Run, Scratch, Task, ThreadScratch, block_points, lock, read, write,
};
use crate::engine::team::Team;
use crate::model::layers::{Conv, Layers};
use crate::model::network::SetAbstraction;
use crate::sampler::{FarthestPoints, FpsStart};

/// The working memory of all levels; empty for other networks.
#[derive(Default)]
pub(super) struct Sets {
    /// The number of centres of each level but the first.
    counts: Vec<usize>,
    /// The input of the pooling of each of these levels.
    inputs: Vec<PoolInput>,
    farthest: Mutex<(FarthestPoints, Vec<u32>)>,
    /// The centres of all levels: the first ones are those of a level.
    centres: RwLock<Vec<[f32; 3]>>,
    /// The features of the last level's centres.
    outputs: Mutex<Vec<f32>>,
}

/// The points that a level pools.
struct PoolInput {
    pool: NeighborPool,
    cloud: RwLock<Neighborhood>,
    /// The products of the points of each tile.
    tiles: RwLock<Vec<RwLock<Vec<[Lanes; TILE]>>>>,
}

impl Sets {
    pub fn new<T: Format>(layers: &Layers<T>) -> Self {
        let Some(last) = layers.abstractions.last() else { return Self::default() };
        let input = |level: &SetAbstraction<Conv<T>>| PoolInput {
            pool: NeighborPool::new(level.radius, &level.pool.first().dense),
            cloud: RwLock::default(),
            tiles: RwLock::default(),
        };
        let counts: Vec<usize> = layers.abstractions.iter().map(|level| level.centres).collect();
        let inputs: Vec<PoolInput> = layers.abstractions.iter().map(input).collect();
        inputs[1..].iter().zip(&counts).for_each(|(input, &n)| input.reserve(n));
        let width = last.convs.last().map_or(0, Conv::width);
        Self {
            farthest: Mutex::new((FarthestPoints::default(), Vec::with_capacity(counts[0]))),
            centres: RwLock::new(Vec::with_capacity(counts[0])),
            outputs: Mutex::new(vec![0.0; last.centres * width]),
            counts,
            inputs,
        }
    }

    /// The most [`Lanes`] of a centre.
    pub fn most_lanes(&self) -> usize {
        self.inputs.iter().map(|input| input.pool.n_lanes()).max().unwrap_or(0)
    }

    /// Allocates memory for clouds of `n` points.
    pub fn reserve(&self, n: usize, kernels: &Kernels) {
        let (farthest, picked) = &mut *lock(&self.farthest);
        farthest.select(&vec![[0.0; 3]; n], 1, FpsStart::First, kernels, picked);
        self.inputs[0].reserve(n);
    }

    /// Stores `points`, and chooses the centres of all levels.
    pub fn take(&self, points: &[[f32; 3]], kernels: &Kernels) {
        let (farthest, picked) = &mut *lock(&self.farthest);
        // The choice does not depend on the order of the points.
        farthest.select(points, self.counts[0], FpsStart::Farthest, kernels, picked);
        let mut centres = write(&self.centres);
        centres.clear();
        centres.extend(picked.iter().map(|&i| points[i as usize]));
        self.inputs[0].set(points);
        for (input, &n) in self.inputs[1..].iter().zip(&self.counts) {
            input.set(&centres[..n.min(centres.len())]);
        }
    }
}

impl PoolInput {
    fn reserve(&self, n: usize) {
        write(&self.cloud).reserve(n);
        let tile = || RwLock::new(vec![[[0.0; LANES]; TILE]; self.pool.n_lanes()]);
        let mut tiles = write(&self.tiles);
        let most = n.div_ceil(TILE).max(tiles.len());
        tiles.resize_with(most, tile);
    }

    fn set(&self, points: &[[f32; 3]]) {
        self.reserve(points.len());
        write(&self.cloud).set(points);
    }

    /// Stores the products of the points whose features are `rows`, beginning with point `first`.
    fn lift(&self, kernels: &Kernels, rows: &Rows<'_, f32>, first: usize) {
        let (cloud, tiles) = (read(&self.cloud), read(&self.tiles));
        let last = first + rows.n();
        for number in first / TILE..last.div_ceil(TILE) {
            let begin = number * TILE;
            let points = first.max(begin)..last.min(begin + TILE);
            let features = &rows.data()[(points.start - first) * rows.stride()..];
            (kernels.pool_neighbors)(
                &self.pool,
                PoolStep::Lift {
                    features: (features, rows.stride()),
                    tile: cloud.tile(number),
                    points: points.start - begin..points.end - begin,
                    products: &mut write(&tiles[number]),
                },
            );
        }
    }

    /// Writes the features of `centres` to the rows of `out`, which have the given stride.
    fn pool(
        &self,
        kernels: &Kernels,
        centres: &[[f32; 3]],
        maxima: &mut [Lanes],
        out: (&mut [f32], usize),
    ) {
        let (cloud, tiles) = (read(&self.cloud), read(&self.tiles));
        let maxima = &mut maxima[..centres.len() * self.pool.n_lanes()];
        maxima.fill([f32::NEG_INFINITY; LANES]);
        for (tile, products) in cloud.tiles().zip(tiles.iter()) {
            let (products, maxima) = (&read(products)[..], &mut *maxima);
            (kernels.pool_neighbors)(
                &self.pool,
                PoolStep::Raise { tile, products, centres, maxima },
            );
        }
        (kernels.pool_neighbors)(&self.pool, PoolStep::Finish { centres, maxima, out });
    }
}

impl<T: Format> Engine<T> {
    /// Runs all levels; the pooled features are in `scratch.values` afterwards.
    pub(super) fn abstract_sets(team: &Team<Self>, scratch: &mut Scratch) {
        let engine = team.work();
        for level in 0..=engine.layers.abstractions.len() {
            let n = engine.n_of_level(level);
            let block = block_points(n, engine.threads.len());
            let n_blocks = n.div_ceil(block);
            for first_block in (0..n_blocks).step_by(RUN_BLOCKS) {
                let n_blocks = RUN_BLOCKS.min(n_blocks - first_block);
                let run = Run { block, first_block, n_blocks, winners: false };
                engine.begin(Task::Set { level, run });
                team.run(n_blocks);
            }
        }
        engine.pool_centres(&mut scratch.values);
    }

    /// The number of points of a level: all for level 0, else its centres.
    fn n_of_level(&self, level: usize) -> usize {
        match level.checked_sub(1) {
            None => read(&self.points).len() / 4,
            Some(i) => self.sets.counts[i].min(read(&self.sets.centres).len()),
        }
    }

    /// Computes the features of block `slot` of a run, and passes them on to the next level.
    pub(super) fn set_block(&self, thread: usize, level: usize, run: Run, slot: usize) {
        let (layers, sets) = (&self.layers, &self.sets);
        let mut scratch = lock(&self.threads[thread]);
        let ThreadScratch { wide, narrow: [narrow, _], set_maxima, .. } = &mut *scratch;
        let first = (run.first_block + slot) * run.block;
        let n = run.block.min(self.n_of_level(level) - first);
        let (entry, convs) = match level.checked_sub(1) {
            None => {
                let points = read(&self.points);
                let entry = layers.trunk[0].first();
                let rows = block_rows(&points, run.block, run.first_block + slot);
                self.multiply(&rows, &entry.panels, wide, entry.panels.padded_outputs());
                (entry, &layers.trunk[1..])
            }
            Some(i) => {
                let (centres, entry) = (read(&sets.centres), layers.abstractions[i].pool.first());
                let out = (&mut wide[..], entry.panels.padded_outputs());
                sets.inputs[i].pool(self.kernels, &centres[first..first + n], set_maxima, out);
                (entry, &layers.abstractions[i].convs[..])
            }
        };
        let (mut width, mut range, mut seen) =
            (entry.panels.padded_outputs(), entry.range, &entry.seen);
        for layer in convs.iter().map(Conv::packed) {
            if self.observing {
                seen.observe(&wide[..n * width]);
            }
            self.round(&wide[..n * width], range, narrow);
            let gemm = T::gemm(self.kernels).expect("invariant: kernels fit the format");
            let rows = Rows::new(narrow, width, n);
            width = layer.width();
            (gemm.rows)(&rows, &layer.panels, 0..layer.panels.n_panels(), wide, width);
            (range, seen) = (layer.range, &layer.seen);
        }
        if self.observing {
            seen.observe(&wide[..n * width]);
        }
        match sets.inputs.get(level) {
            Some(next) => next.lift(self.kernels, &Rows::new(wide, width, n), first),
            None => lock(&sets.outputs)[first * width..][..n * width]
                .copy_from_slice(&wide[..n * width]),
        }
    }

    /// The maxima of the last level's features, and then their means.
    fn pool_centres(&self, values: &mut Vec<f32>) {
        let levels = &self.layers.abstractions;
        let last = levels[levels.len() - 1].convs.last().map(Conv::packed);
        let last = last.expect("invariant: an abstraction has layers after its pooling");
        let (channels, n) = (last.panels.outputs(), self.n_of_level(levels.len()));
        values.clear();
        values.resize(channels, f32::NEG_INFINITY);
        values.resize(2 * channels, 0.0);
        let (maxima, means) = values.split_at_mut(channels);
        for row in lock(&self.sets.outputs).chunks_exact(last.width()).take(n) {
            for ((most, sum), x) in maxima.iter_mut().zip(&mut *means).zip(row) {
                *most = most.max(*x);
                *sum += x;
            }
        }
        means.iter_mut().for_each(|mean| *mean /= n as f32);
    }
}
