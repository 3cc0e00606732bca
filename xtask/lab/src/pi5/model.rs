//! Milliseconds from cycles, bytes and instructions.

use super::kernels::Kernels;
use super::load::load;
use super::plan::Stage;
use serde::Serialize;

/// The machine that is modelled.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Machine {
    /// Cores at work.
    pub threads: usize,
    /// Cycles a second.
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Time {
    /// Point-wise layers of sampler and network.
    pub points_ms: f64,
    /// Vector layers.
    pub vectors_ms: f64,
    /// Choosing points, but for a front end's layers.
    pub choosing_ms: f64,
    /// Everything outside the inner loops; `None` where it was not counted.
    pub other_ms: Option<f64>,
    /// All of these.
    pub total_ms: f64,
}

/// Instructions of one classification outside the inner loops.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Other {
    /// That threads share out.
    pub shared: f64,
    /// Of the thread that asks.
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

#[cfg(test)]
mod tests {
    use super::super::kernels::tests::round_kernels;
    use super::super::network::Layer;
    use super::super::number::Number;
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
    fn columns_that_are_skipped_take_no_time() {
        let layer = Layer { inputs: 1024, outputs: 512 };
        let stages = [Stage::Vector { layer, stored: Number::F32 }];
        let kernels = round_kernels();
        // Memory so fast that arithmetic decides.
        let machine = Machine { bytes_per_s: 1e12, ..MACHINE };
        let whole = time(&machine, &kernels, &stages, 1.0, None).vectors_ms;
        // 4 chunks of 2 blocks, a cycle an input and block.
        assert_eq!(whole, 2.0 * 1.024);
        assert_eq!(time(&machine, &kernels, &stages, 0.5, None).vectors_ms, whole / 2.0);
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
}
