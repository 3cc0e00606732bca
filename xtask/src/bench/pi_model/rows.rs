//! One row for each sampler, number of points and precision.

use super::PiModelArgs;
use super::count::Counter;
use super::kernels::Kernels;
use super::model::{Machine, Other, Time, time};
use super::network::Network;
use super::plan::{Sampler, Stage, stages};
use anyhow::Result;
use infer_cpu::Precision;
use serde::Serialize;

/// Clouds of more points are not run under QEMU: what is counted grows by the
/// same amount with every run of blocks.
const MOST_COUNTED: usize = 1024;

/// Functions of a row that are named.
const NAMED_FUNCTIONS: usize = 12;

/// One modelled classification.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Where the points come from.
    pub sampler: Sampler,
    /// Points of the cloud.
    pub from: usize,
    /// Points that the network sees.
    pub points: usize,
    /// `infer-cpu`'s name of the precision.
    pub precision: &'static str,
    /// Multiplications with an addition, of sampler and network.
    pub macs: usize,
    /// Modelled time.
    pub time: Time,
    /// Share of the vector layers' columns that were read.
    pub columns_read: Option<f64>,
    /// Instructions outside the inner loops.
    pub other: Option<Other>,
    /// Where most instructions were counted, the inner loops among them.
    pub functions: Vec<(String, f64)>,
}

/// All rows that `args` ask for.
///
/// # Errors
/// A binary that cannot be counted, or that does not do what is planned.
pub fn rows(
    args: &PiModelArgs,
    network: &Network,
    kernels: &Kernels,
    counter: Option<&Counter>,
) -> Result<Vec<Row>> {
    let setting = |sampler, from, points| (sampler, (from, points));
    let all = args.points.iter().map(|&n| setting(Sampler::All, n, n));
    let fewer = args.points.iter().filter(|&&points| points < args.from);
    let fps = fewer.map(|&points| setting(Sampler::Fps, args.from, points));
    let critical = args.critical.min(args.from);
    let cpl = [Sampler::Cpl, Sampler::CplStn].map(|kind| setting(kind, args.from, critical));
    let mut rows = Vec::new();
    for (sampler, sizes) in all.chain(fps).chain(cpl) {
        for &precision in &args.precision {
            let Some(stages) = stages(network, sampler, sizes, precision) else { continue };
            let macs = stages.iter().map(Stage::macs).sum();
            let counted = match counter {
                Some(counter) => {
                    Some(count(counter, network, kernels, (sampler, sizes, precision))?)
                }
                None => None,
            };
            let columns_read = counted.as_ref().map(|counted| counted.columns_read);
            let other = counted.as_ref().map(|counted| counted.other);
            let share = columns_read.unwrap_or(1.0);
            let time = time(&machine(args), kernels, &stages, share, other);
            let functions = counted.map_or_else(Vec::new, |counted| counted.functions);
            let ((from, points), precision) = (sizes, precision.name());
            rows.push(Row {
                sampler,
                from,
                points,
                precision,
                macs,
                time,
                columns_read,
                other,
                functions,
            });
        }
    }
    Ok(rows)
}

/// The machine that `args` describe.
pub fn machine(args: &PiModelArgs) -> Machine {
    Machine {
        threads: args.threads.into(),
        hertz: args.clock * 1e9,
        bytes_per_s: args.bandwidth * 1e9,
        instructions_per_cycle: args.other_ipc,
    }
}

/// What counting gave.
struct Counted {
    other: Other,
    columns_read: f64,
    functions: Vec<(String, f64)>,
}

/// Counts one setting; one that is too large for QEMU is extrapolated from two
/// that are not.
fn count(
    counter: &Counter,
    network: &Network,
    kernels: &Kernels,
    (sampler, (from, points), precision): (Sampler, (usize, usize), Precision),
) -> Result<Counted> {
    let measure = |sizes: (usize, usize)| -> Result<Counted> {
        let name = precision.name();
        eprintln!("counting {} {} of {} in {name}", sampler.word(), sizes.1, sizes.0);
        let counts = counter.classification(sampler, sizes, precision)?;
        let stages = stages(network, sampler, sizes, precision).unwrap_or_default();
        let (other, columns_read) = counts.outside_loops(&stages, kernels)?;
        Ok(Counted { other, columns_read, functions: counts.largest(NAMED_FUNCTIONS) })
    };
    if from <= MOST_COUNTED || sampler != Sampler::All {
        return measure((from, points));
    }
    let (half, whole) =
        (measure((MOST_COUNTED / 2, MOST_COUNTED / 2))?, measure((MOST_COUNTED, MOST_COUNTED))?);
    let steps = (points - MOST_COUNTED) as f64 / (MOST_COUNTED / 2) as f64;
    let beyond = |half: f64, whole: f64| whole + steps * (whole - half);
    let other = Other {
        shared: beyond(half.other.shared, whole.other.shared),
        alone: beyond(half.other.alone, whole.other.alone),
    };
    Ok(Counted { other, functions: Vec::new(), ..whole })
}
