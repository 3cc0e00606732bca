//! Modelled times: a row for each sampler, number of points and precision.

use super::PiModelArgs;
use super::count::Counter;
use super::kernels::{Kernel, Kernels};
use super::model::{Machine, Other, Time, time};
use super::network::Network;
use super::plan::{Sampler, Setting, Stage};
use crate::table::{Column, Table, digits};
use anyhow::Result;

/// Clouds of more points are not run under QEMU: what is counted grows by the
/// same amount with every run of blocks.
const MOST_COUNTED: usize = 1024;

/// Points of the clouds that samplers choose from, and that a Critical Points Layer keeps.
const FROM: usize = 1024;
const CRITICAL: usize = 64;

pub struct PiRow {
    pub setting: Setting,
    /// Multiplications with an addition, of sampler and network.
    pub macs: usize,
    pub time: Time,
}

pub fn rows(
    args: &PiModelArgs,
    network: &Network,
    kernels: &Kernels,
    counter: Option<&Counter>,
) -> Result<Vec<PiRow>> {
    let mut rows = Vec::new();
    for setting in settings(args) {
        let Some(stages) = setting.stages(network) else { continue };
        let count = |counter| count(counter, network, kernels, setting);
        let counted = counter.map(count).transpose()?;
        let share = counted.as_ref().map_or(1.0, |counted| counted.columns_read);
        let time =
            time(&Machine::PI_5, kernels, &stages, share, counted.map(|counted| counted.other));
        rows.push(PiRow { setting, macs: stages.iter().map(Stage::macs).sum(), time });
    }
    Ok(rows)
}

fn settings(args: &PiModelArgs) -> impl Iterator<Item = Setting> {
    let all = args.points.iter().map(|&n| (Sampler::All, n, n));
    let fewer = args.points.iter().filter(|&&points| points < FROM);
    let fps = fewer.map(|&points| (Sampler::Fps, FROM, points));
    all.chain(fps).chain([(Sampler::Cpl, FROM, CRITICAL)]).flat_map(|(sampler, from, points)| {
        let precisions = args.precision.iter();
        precisions.map(move |&precision| Setting { sampler, from, points, precision })
    })
}

pub struct Counted {
    /// Instructions outside the inner loops.
    pub other: Other,
    /// Share of the vector layers' columns that were read.
    pub columns_read: f64,
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
        Ok(Counted { other, columns_read })
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
    Ok(Counted { other, ..whole })
}

pub const LEFT_OUT: &str = include_str!("left_out.txt");

/// The modelled times; what was not counted is empty.
pub fn times(rows: &[PiRow]) -> Table {
    let columns: [Column<'_, PiRow>; 10] = [
        ("sampler", &|row| row.setting.sampler.word().to_owned()),
        ("from", &|row| row.setting.from.to_string()),
        ("points", &|row| row.setting.points.to_string()),
        ("precision", &|row| row.setting.precision.to_string()),
        ("macs", &|row| row.macs.to_string()),
        ("points_ms", &|row| digits(row.time.points_ms)),
        ("vectors_ms", &|row| digits(row.time.vectors_ms)),
        ("choosing_ms", &|row| digits(row.time.choosing_ms)),
        ("other_ms", &|row| row.time.other_ms.map(digits).unwrap_or_default()),
        ("total_ms", &|row| digits(row.time.total_ms)),
    ];
    let Machine { threads, hertz, bytes_per_s, instructions_per_cycle } = Machine::PI_5;
    let title = format!(
        "Modelled ms: {threads} threads at {} GHz, {} GB/s, {instructions_per_cycle} instructions a \
         cycle outside inner loops",
        hertz / 1e9,
        bytes_per_s / 1e9
    );
    Table::of(title, rows, &columns)
}

/// The inner loops and their costs by llvm-mca.
pub fn kernels(kernels: &Kernels, version: &str) -> Table {
    let columns: [Column<'_, &Kernel>; 5] = [
        ("inner loop", &|kernel| kernel.name.clone()),
        ("products", &|kernel| kernel.work.to_string()),
        ("instructions", &|kernel| format!("{:.0}", kernel.cost.instructions)),
        ("cycles", &|kernel| format!("{:.2}", kernel.cost.cycles)),
        ("products/cycle", &|kernel| format!("{:.2}", kernel.work as f64 / kernel.cost.cycles)),
    ];
    let title = format!("Inner loops as compiled, one round, by {version} as Neoverse N1");
    Table::of(title, &kernels.all().collect::<Vec<_>>(), &columns)
}
