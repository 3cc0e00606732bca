//! Milliseconds from cycles, bytes and instructions, as threads share out the stages.

use super::kernels::{Kernels, Number};
use super::mca::Cost;
use super::plan::{Product, Stage};
use infer_cpu::kernel::WIDTH_STEP;
use infer_cpu::sharing::{GROUP, SMALL_VECTOR, VECTOR_BLOCK, VECTOR_CHUNK, block_points};

#[derive(Clone, Copy, Debug)]
pub struct Machine {
    pub threads: usize,
    pub hertz: f64,
    /// Bytes a second from main memory, of all cores together.
    pub bytes_per_s: f64,
    /// Instructions a cycle outside the inner loops.
    pub instructions_per_cycle: f64,
}

impl Machine {
    /// A Raspberry Pi 5: four Cortex-A76 at 2.4 GHz (its data sheet). 10 GB/s is
    /// what LPDDR4X-4267 of 32 bits, 17 GB/s at most, is taken to deliver; the
    /// core's two SIMD pipes allow two instructions a cycle.
    pub const PI_5: Self =
        Self { threads: 4, hertz: 2.4e9, bytes_per_s: 10e9, instructions_per_cycle: 2.0 };
}

/// Modelled time of one classification, milliseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Time {
    /// Point-wise layers of sampler and network.
    pub points_ms: f64,
    pub vectors_ms: f64,
    /// Choosing points, but for a front end's layers.
    pub choosing_ms: f64,
    /// Everything outside the inner loops; `None` where it was not counted.
    pub other_ms: Option<f64>,
    pub total_ms: f64,
}

/// Instructions of one classification outside the inner loops.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Other {
    /// Shared out among threads.
    pub shared: f64,
    /// On the calling thread alone.
    pub alone: f64,
}

/// The time that `stages` take. `columns_read` is the share of the vector
/// layers' columns whose input is not 0, the others being skipped.
pub fn time(
    machine: &Machine,
    kernels: &Kernels,
    stages: &[Stage],
    columns_read: f64,
    other: Option<Other>,
) -> Time {
    let mut time = Time::default();
    let (mut cycles, mut span) = (0.0, 0.0);
    for stage in stages {
        let share = if matches!(stage, Stage::Vector { .. }) { columns_read } else { 1.0 };
        let load = load(stage, kernels, machine.threads);
        cycles += load.cycles * share;
        span += load.span * share;
        // Arithmetic hides behind the weights' way from memory, or they
        // behind it.
        let seconds = (load.span / machine.hertz).max(load.bytes / machine.bytes_per_s);
        let place = match stage {
            Stage::Vector { .. } => &mut time.vectors_ms,
            Stage::Farthest { .. } => &mut time.choosing_ms,
            _ => &mut time.points_ms,
        };
        *place += seconds * share * 1e3;
    }
    // What threads share out they share out as unevenly as the loops.
    let busy_threads = if span > 0.0 { cycles / span } else { 1.0 };
    time.other_ms = other.map(|other| {
        let instructions = other.alone + other.shared / busy_threads;
        instructions / machine.instructions_per_cycle / machine.hertz * 1e3
    });
    time.total_ms =
        time.points_ms + time.vectors_ms + time.choosing_ms + time.other_ms.unwrap_or(0.0);
    time
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// Cycles of all threads together.
    pub cycles: f64,
    /// Cycles until the last thread is done.
    pub span: f64,
    /// Instructions of all threads together.
    pub instructions: f64,
    /// Bytes of weights, each read once from main memory.
    pub bytes: f64,
}

/// The load of `stage`, shared out among `threads` as infer-cpu does.
pub fn load(stage: &Stage, kernels: &Kernels, threads: usize) -> Load {
    match stage {
        Stage::Hidden { rows, products } => {
            let size = block_points(*rows, threads);
            let blocks = (0..*rows).step_by(size).map(|first| size.min(rows - first));
            let block = |rows: usize| products.iter().map(|p| tiles(p, rows, kernels)).sum();
            shared(blocks.map(block), threads, products.iter().map(weight_bytes).sum())
        }
        Stage::Pool { rows, product, screened } => {
            let width = product.layer.outputs.next_multiple_of(WIDTH_STEP);
            let whole = tiles(product, *rows, kernels);
            let group = |first: usize| whole * (GROUP.min(width - first) as f64 / width as f64);
            // Nearly every channel has a product to be computed in fp32.
            let in_f32 = screened.then_some(Product { number: Number::F32, ..*product });
            let bytes = weight_bytes(product) + in_f32.iter().map(weight_bytes).sum::<f64>();
            shared((0..width).step_by(GROUP).map(group), threads, bytes)
        }
        Stage::Alone { rows, product } => {
            shared([tiles(product, *rows, kernels)], 1, weight_bytes(product))
        }
        Stage::Vector { layer, stored } => {
            let n_blocks = layer.outputs.div_ceil(VECTOR_BLOCK);
            let kernel = kernels.gemv(*stored);
            let rounds = layer.inputs as f64 * (VECTOR_BLOCK as f64 / kernel.work as f64);
            let block = kernel.cost * rounds;
            let chunks = (0..n_blocks).step_by(VECTOR_CHUNK);
            let chunks = chunks.map(|first| block * VECTOR_CHUNK.min(n_blocks - first) as f64);
            let is_small = layer.inputs * layer.outputs < SMALL_VECTOR;
            let bytes = layer.inputs * n_blocks * VECTOR_BLOCK * stored.bytes();
            shared(chunks, if is_small { 1 } else { threads }, bytes as f64)
        }
        Stage::Farthest { points, picks } => {
            let kernel = &kernels.farthest;
            // One pass a pick: the first is farthest from the centroid.
            let rounds = (points * picks) as f64 / kernel.work as f64;
            shared([kernel.cost * rounds], 1, 0.0)
        }
    }
}

/// The cost of taking `rows` through `product`, by whole tiles.
fn tiles(product: &Product, rows: usize, kernels: &Kernels) -> Cost {
    let tile = kernels.tile(product.number);
    let panels = product.layer.outputs.next_multiple_of(WIDTH_STEP) / tile.channels;
    let n_tiles = rows.div_ceil(tile.rows) * panels;
    let rounds = n_tiles * product.layer.inputs.div_ceil(tile.inputs);
    tile.kernel.cost * rounds as f64
}

fn weight_bytes(product: &Product) -> f64 {
    let width = product.layer.outputs.next_multiple_of(WIDTH_STEP);
    (product.layer.inputs * width * product.number.bytes()) as f64
}

/// Chunks that threads claim one after the other, each whichever is free, and the bytes of
/// their weights.
fn shared(chunks: impl IntoIterator<Item = Cost>, threads: usize, bytes: f64) -> Load {
    let mut load = Load { bytes, ..Load::default() };
    let mut busy_until = vec![0.0; threads.max(1)];
    for chunk in chunks {
        load.cycles += chunk.cycles;
        load.instructions += chunk.instructions;
        let free = busy_until.iter_mut().min_by(|a: &&mut f64, b: &&mut f64| a.total_cmp(b));
        free.into_iter().for_each(|until| *until += chunk.cycles);
    }
    load.span = busy_until.into_iter().fold(0.0, f64::max);
    load
}

/// Instructions of the inner loops of tiles that compute in `number`.
pub fn tile_instructions(stages: &[Stage], kernels: &Kernels, number: Number) -> f64 {
    let of_stage = |stage: &Stage| -> f64 {
        let (rows, products) = stage.products();
        let products = products.iter().filter(|product| product.number == number);
        products.map(|product| tiles(product, rows, kernels).instructions).sum()
    };
    stages.iter().map(of_stage).sum()
}

#[cfg(test)]
mod tests {
    use super::super::kernels::Number;
    use super::super::kernels::tests::round_kernels;
    use super::super::network::Layer;
    use super::super::plan::Product;
    use super::*;

    const MACHINE: Machine =
        Machine { threads: 4, hertz: 1e6, bytes_per_s: 1e9, instructions_per_cycle: 2.0 };

    fn pool(inputs: usize) -> Stage {
        let layer = Layer { inputs, outputs: 1024 };
        Stage::Pool { rows: 48, product: Product { layer, number: Number::F32 }, screened: false }
    }

    #[test]
    fn a_stage_takes_the_longer_of_arithmetic_and_memory() {
        let kernels = round_kernels();
        // 6 tiles of rows, 128 panels, 128 inputs, a cycle for each: 98,304
        // cycles over 4 threads, in milliseconds at 1 MHz.
        let time = |machine: &Machine| time(machine, &kernels, &[pool(128)], 1.0, None);
        assert_eq!(time(&MACHINE).points_ms, 24.576);
        // 512 KiB at 1 MB/s.
        let slow = Machine { bytes_per_s: 1e6, ..MACHINE };
        assert_eq!(time(&slow).points_ms, 524.288);
        assert_eq!(time(&slow).total_ms, 524.288);
    }

    #[test]
    fn other_work_is_shared_out_like_the_loops() {
        let kernels = round_kernels();
        let other = Some(Other { shared: 8000.0, alone: 1000.0 });
        let time = |stages: &[Stage]| time(&MACHINE, &kernels, stages, 1.0, other).other_ms;
        // All four threads are busy: 2,000 + 1,000 instructions, two a cycle.
        assert_eq!(time(&[pool(128)]), Some(1.5));
        let alone = Stage::Farthest { points: 64, picks: 2 };
        assert_eq!(time(&[alone]), Some(4.5));
    }

    fn product(inputs: usize, outputs: usize) -> Product {
        Product { layer: Layer { inputs, outputs }, number: Number::F32 }
    }

    #[test]
    fn threads_share_out_blocks_of_points() {
        let kernels = round_kernels();
        let hidden = |rows| Stage::Hidden { rows, products: vec![product(64, 128)] };
        // 8 rows, 16 panels of 8 channels, 64 inputs.
        let tile = 16.0 * 64.0;
        // Three blocks of 16 points.
        let few = load(&hidden(48), &kernels, 4);
        assert_eq!((few.cycles, few.span), (6.0 * tile, 2.0 * tile));
        assert_eq!(few.bytes, 64.0 * 128.0 * 4.0);
        // Seven blocks of 32 and one of 16: two for each thread.
        let more = load(&hidden(240), &kernels, 4);
        assert_eq!((more.cycles, more.span), (30.0 * tile, 8.0 * tile));
    }

    #[test]
    fn small_vectors_stay_on_one_thread() {
        let kernels = round_kernels();
        let vector = |outputs| {
            let layer = Layer { inputs: 256, outputs };
            load(&Stage::Vector { layer, stored: Number::F32 }, &kernels, 4)
        };
        assert_eq!(vector(40).span, vector(40).cycles);
        assert_eq!(vector(4096).span * 4.0, vector(4096).cycles);
        // One block of 64 is read for 40 outputs.
        assert_eq!(vector(40).bytes, 256.0 * 64.0 * 4.0);
    }
}
