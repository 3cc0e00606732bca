//! What `bench pi-model` prints and writes.

use super::PiModelArgs;
use super::kernels::{Kernel, Kernels};
use super::model::Machine;
use super::plan::Sampler;
use super::plan::Setting;
use super::rows::Row;
use crate::render::table::{Column, Table, digits};
use infer_cpu::Precision;
use serde::Serialize;
use std::fmt;

/// What the figures leave out.
const LEFT_OUT: &str = "\
What the model leaves out. llvm-mca knows pipes and latencies, but no caches:
activations and the weights at hand are taken to be in the first-level cache
whenever a loop wants them. Every layer's weights come from main memory once a
classification, at the bandwidth given, behind or before its arithmetic,
whichever is longer; a real board's memory is slower for one core, and slower
when its refresh or a screen is busy. Work outside inner loops runs at a flat
number of instructions a cycle, and overlaps with nothing. Threads wake, meet
and share out in no time, the clock never drops, and nothing else runs. Page
and TLB misses, mispredicted branches and the first classification after
loading are not there. Cycles are those of inner loops: a whole tile, with the
start and the end of its sums, takes some 5 to 10 % more, of which the
instructions are counted among the others. What depends on the data is that of
the model file and of the clouds of `infer-cpu bench`: inputs of vector layers
that are 0, and skipped, and products in fp32 that int8 could not rule out.
Measure a real board with `infer-cpu bench --json`.";

/// Everything modelled.
#[derive(Serialize)]
pub struct Report {
    machine: Machine,
    llvm_mca: String,
    kernels: Vec<Kernel>,
    rows: Vec<Row>,
}

impl Report {
    /// A report of `rows`.
    pub fn new(args: &PiModelArgs, llvm_mca: &str, kernels: &Kernels, rows: Vec<Row>) -> Self {
        let kernels = kernels.all().cloned().collect();
        Self { machine: args.machine(), llvm_mca: llvm_mca.to_owned(), kernels, rows }
    }

    /// The rows as CSV under a heading; what was not counted is empty.
    pub fn csv(&self) -> anyhow::Result<Vec<u8>> {
        let columns: [Column<'_, Row>; 10] = [
            ("sampler", &|row| row.setting.sampler.word().to_owned()),
            ("from", &|row| row.setting.from.to_string()),
            ("points", &|row| row.setting.points.to_string()),
            ("precision", &|row| row.setting.precision.to_string()),
            ("macs", &|row| row.macs.to_string()),
            ("points_ms", &|row| row.time.points_ms.to_string()),
            ("vectors_ms", &|row| row.time.vectors_ms.to_string()),
            ("choosing_ms", &|row| row.time.choosing_ms.to_string()),
            ("other_ms", &|row| row.time.other_ms.map(|ms| ms.to_string()).unwrap_or_default()),
            ("total_ms", &|row| row.time.total_ms.to_string()),
        ];
        Table::of("", &self.rows, &columns).to_csv()
    }

    /// Milliseconds by points and precision, of one sampler.
    fn times(&self, sampler: Sampler, title: &str) -> Table {
        let rows = self.rows.iter().filter(|row| row.setting.sampler == sampler);
        // In the order in which they were asked for.
        let mut precisions: Vec<Precision> = Vec::new();
        let mut points: Vec<Vec<&Row>> = Vec::new();
        for row in rows {
            let Setting { precision, points: n, .. } = row.setting;
            if !precisions.contains(&precision) {
                precisions.push(precision);
            }
            match points.iter_mut().find(|rows| rows[0].setting.points == n) {
                Some(rows) => rows.push(row),
                None => points.push(vec![row]),
            }
        }
        let ms = |rows: &[&Row], precision| {
            let row = rows.iter().find(|row| row.setting.precision == precision);
            row.map_or_else(String::new, |row| format!("{:.2}", row.time.total_ms))
        };
        let names = precisions.iter().map(|precision| precision.name());
        let heading: Vec<&str> = ["points", "MMAC"].into_iter().chain(names).collect();
        let mut table = Table::new(title, &heading);
        for rows in &points {
            let Row { setting, macs, .. } = rows[0];
            let first = [setting.points.to_string(), format!("{:.1}", *macs as f64 / 1e6)];
            let others = precisions.iter().map(|&precision| ms(rows, precision));
            table.push(first.into_iter().chain(others).collect::<Vec<_>>());
        }
        table
    }

    /// Where the time of the largest network and of each CPL goes.
    fn shares(&self) -> Table {
        let is_shown = |row: &&Row| match row.setting.sampler {
            Sampler::All => row.setting.points == 1024,
            sampler => sampler != Sampler::Fps,
        };
        let rows: Vec<&Row> = self.rows.iter().filter(is_shown).collect();
        let name = |Setting { sampler, from, points, precision }| {
            format!("{} {points} of {from}, {precision}", Sampler::word(sampler))
        };
        let columns: [Column<'_, &Row>; 6] = [
            ("", &|row| name(row.setting)),
            ("layers of points", &|row| digits(row.time.points_ms)),
            ("layers of vectors", &|row| digits(row.time.vectors_ms)),
            ("choosing", &|row| digits(row.time.choosing_ms)),
            ("other", &|row| row.time.other_ms.map(digits).unwrap_or_default()),
            ("total", &|row| digits(row.time.total_ms)),
        ];
        Table::of("Where the time goes, ms", &rows, &columns)
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Machine { threads, hertz, bytes_per_s, instructions_per_cycle } = self.machine;
        let title = |what: &str| {
            format!(
                "{what}: modelled ms, {threads} threads at {} GHz, {} GB/s",
                hertz / 1e9,
                bytes_per_s / 1e9
            )
        };
        let fps = self.rows.iter().find(|row| row.setting.sampler == Sampler::Fps);
        let from = fps.map_or(0, |row| row.setting.from);
        for (sampler, title) in [
            (Sampler::All, title("All points")),
            (Sampler::Fps, title(&format!("Farthest points of {from}"))),
            (Sampler::Cpl, title("Critical points, front end of its own")),
            (Sampler::CplStn, title("Critical points, trunk of STN3d shared")),
        ] {
            write!(f, "{}", self.times(sampler, &title))?;
        }
        write!(f, "{}", self.shares())?;
        if self.rows.iter().any(|row| row.other.is_none()) {
            writeln!(f, "\nInstructions outside inner loops are NOT counted in: see above why.")?;
        } else {
            writeln!(f, "\nOther work runs at {instructions_per_cycle} instructions a cycle.")?;
        }
        writeln!(f, "\n{LEFT_OUT}")
    }
}

/// The inner loops and what llvm-mca makes of them.
pub fn kernels(kernels: &Kernels, version: &str) -> Table {
    let share = |kernel: &Kernel| Some(format!("{:.1}", kernel.share_of_peak()? * 100.0));
    let columns: [Column<'_, &Kernel>; 6] = [
        ("inner loop", &|kernel| kernel.name.clone()),
        ("products", &|kernel| kernel.work.to_string()),
        ("instructions", &|kernel| format!("{:.0}", kernel.cost.instructions)),
        ("cycles", &|kernel| format!("{:.2}", kernel.cost.cycles)),
        ("products/cycle", &|kernel| format!("{:.2}", kernel.work as f64 / kernel.cost.cycles)),
        ("% of peak", &|kernel| share(kernel).unwrap_or_default()),
    ];
    let title = format!("Inner loops as compiled, one round, by {version} as Neoverse N1");
    Table::of(title, &kernels.all().collect::<Vec<_>>(), &columns)
}
