//! One row for each sampler, number of points and precision.

use super::PiModelArgs;
use super::count::Counter;
use super::kernels::Kernels;
use super::model::{Other, Time, time};
use super::network::Network;
use super::plan::{Sampler, Setting, Stage};
use anyhow::Result;
use serde::Serialize;

/// Clouds of more points are not run under QEMU: what is counted grows by the
/// same amount with every run of blocks.
const MOST_COUNTED: usize = 1024;

/// Functions of a row that are named.
const NAMED_FUNCTIONS: usize = 12;

/// One modelled classification.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// What is modelled.
    #[serde(flatten)]
    pub setting: Setting,
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
pub fn rows(
    args: &PiModelArgs,
    network: &Network,
    kernels: &Kernels,
    counter: Option<&Counter>,
) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    for setting in settings(args) {
        let Some(stages) = setting.stages(network) else { continue };
        let count = |counter| count(counter, network, kernels, setting);
        let counted = counter.map(count).transpose()?;
        let columns_read = counted.as_ref().map(|counted| counted.columns_read);
        let other = counted.as_ref().map(|counted| counted.other);
        let share = columns_read.unwrap_or(1.0);
        rows.push(Row {
            setting,
            macs: stages.iter().map(Stage::macs).sum(),
            time: time(&args.machine(), kernels, &stages, share, other),
            columns_read,
            other,
            functions: counted.map(|counted| counted.functions).unwrap_or_default(),
        });
    }
    Ok(rows)
}

fn settings(args: &PiModelArgs) -> impl Iterator<Item = Setting> {
    let from = args.from;
    let all = args.points.iter().map(|&n| (Sampler::All, n, n));
    let fewer = args.points.iter().filter(move |&&points| points < from);
    let fps = fewer.map(move |&points| (Sampler::Fps, from, points));
    let critical = args.critical.min(from);
    let cpl = [Sampler::Cpl, Sampler::CplStn].map(|kind| (kind, from, critical));
    all.chain(fps).chain(cpl).flat_map(|(sampler, from, points)| {
        let precisions = args.precision.iter();
        precisions.map(move |&precision| Setting { sampler, from, points, precision })
    })
}

/// What counting gave.
pub struct Counted {
    /// Instructions outside the inner loops.
    pub other: Other,
    /// Share of the vector layers' columns that were read.
    pub columns_read: f64,
    functions: Vec<(String, f64)>,
}

/// Counts one setting; one that is too large for QEMU is extrapolated from two
/// that are not. Fails if the binary does not do what is planned.
pub fn count(
    counter: &Counter,
    network: &Network,
    kernels: &Kernels,
    setting: Setting,
) -> Result<Counted> {
    let Setting { sampler, from, points, .. } = setting;
    let measure = |setting: Setting| -> Result<Counted> {
        let counts = counter.classification(setting)?;
        let stages = setting.stages(network).unwrap_or_default();
        let (other, columns_read) = counts.outside_loops(&stages, kernels)?;
        Ok(Counted { other, columns_read, functions: counts.largest(NAMED_FUNCTIONS) })
    };
    if from <= MOST_COUNTED || sampler != Sampler::All {
        return measure(setting);
    }
    let all = |n: usize| measure(Setting { from: n, points: n, ..setting });
    let (half, whole) = (all(MOST_COUNTED / 2)?, all(MOST_COUNTED)?);
    let steps = (points - MOST_COUNTED) as f64 / (MOST_COUNTED / 2) as f64;
    let beyond = |half: f64, whole: f64| whole + steps * (whole - half);
    let other = Other {
        shared: beyond(half.other.shared, whole.other.shared),
        alone: beyond(half.other.alone, whole.other.alone),
    };
    Ok(Counted { other, functions: Vec::new(), ..whole })
}
