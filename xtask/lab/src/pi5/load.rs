//! What a stage of infer-cpu asks of the machine, as its threads share it out.

use super::kernels::Kernels;
use super::mca::Cost;
use super::number::Number;
use super::plan::{Product, Stage};
use infer_cpu::kernel::WIDTH_STEP;
use infer_cpu::sharing::{GROUP, SMALL_VECTOR, VECTOR_BLOCK, VECTOR_CHUNK, block_points};

/// What a stage asks of the machine in its inner loops.
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

/// What `stage` asks for when `threads` share it out as infer-cpu does.
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
    use super::super::kernels::tests::round_kernels;
    use super::super::network::Layer;
    use super::*;

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
    fn tiles_are_whole() {
        let kernels = round_kernels();
        let alone = |rows, inputs| {
            load(&Stage::Alone { rows, product: product(inputs, 9) }, &kernels, 4).cycles
        };
        // Nine channels are padded to 64, eight panels.
        assert_eq!(alone(8, 4), 8.0 * 4.0);
        assert_eq!(alone(9, 4), 2.0 * alone(8, 4));
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

    #[test]
    fn instructions_are_told_apart_by_format() {
        let kernels = round_kernels();
        let stages = [Stage::Pool { rows: 8, product: product(4, 64), screened: false }];
        let of = |number| tile_instructions(&stages, &kernels, number);
        assert_eq!(of(Number::F32), 8.0 * 4.0 * 2.0);
        assert_eq!(of(Number::I8), 0.0);
    }
}
