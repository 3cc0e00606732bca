//! What `bench pi-model` prints and writes.

use super::PiModelArgs;
use super::kernels::{Kernel, Kernels};
use super::model::Machine;
use super::plan::Sampler;
use super::rows::{Row, machine};
use crate::render::table::{Table, digits};
use serde::Serialize;
use std::fmt;

/// What the figures are not.
const LEFT_OUT: &str = "\
What the model leaves out. llvm-mca knows pipes and latencies, but no caches: \
activations and the weights at hand are taken to be in the first-level cache \
whenever a loop wants them. Every layer's weights come from main memory once a \
classification, at the bandwidth given, behind or before its arithmetic, \
whichever is longer; a real board's memory is slower for one core, and slower \
when its refresh or a screen is busy. Work outside inner loops runs at a flat \
number of instructions a cycle, and overlaps with nothing. Threads wake, meet \
and share out in no time, the clock never drops, and nothing else runs. Page \
and TLB misses, mispredicted branches and the first classification after \
loading are not there. Cycles are those of inner loops: a whole tile, with the \
start and the end of its sums, takes some 5 to 10 % more, of which the \
instructions are counted among the others. What depends on the data is that of \
the model file and of the clouds of `infer-cpu bench`: inputs of vector layers \
that are 0, and skipped, and products in fp32 that int8 could not rule out. Measure a real board with `infer-cpu bench --json`.";

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
        Self { machine: machine(args), llvm_mca: llvm_mca.to_owned(), kernels, rows }
    }

    /// The rows as CSV under a heading; what was not counted is empty.
    pub fn csv(&self) -> String {
        let heading = "sampler,from,points,precision,macs,points_ms,vectors_ms,choosing_ms,\
             other_ms,total_ms\n";
        let row = |row: &Row| {
            let time = &row.time;
            let other = time.other_ms.map(|ms| ms.to_string()).unwrap_or_default();
            let Row { sampler, from, points, precision, macs, .. } = row;
            format!(
                "{},{from},{points},{precision},{macs},{},{},{},{other},{}\n",
                sampler.word(),
                time.points_ms,
                time.vectors_ms,
                time.choosing_ms,
                time.total_ms
            )
        };
        heading.to_owned() + &self.rows.iter().map(row).collect::<String>()
    }

    /// Milliseconds by points and precision, of one sampler.
    fn times(&self, sampler: Sampler, title: &str) -> Table {
        let rows: Vec<&Row> = self.rows.iter().filter(|row| row.sampler == sampler).collect();
        let mut precisions: Vec<&str> = Vec::new();
        let mut points: Vec<usize> = Vec::new();
        for row in &rows {
            if !precisions.contains(&row.precision) {
                precisions.push(row.precision);
            }
            if !points.contains(&row.points) {
                points.push(row.points);
            }
        }
        let heading: Vec<&str> = ["points", "MMAC"].into_iter().chain(precisions.clone()).collect();
        let mut table = Table::new(title, &heading);
        for &n in &points {
            let of = |precision: &str| {
                rows.iter().find(|row| row.points == n && row.precision == precision)
            };
            let macs = rows.iter().find(|row| row.points == n).map_or(0, |row| row.macs);
            let mut words = vec![n.to_string(), format!("{:.1}", macs as f64 / 1e6)];
            words.extend(precisions.iter().map(|precision| {
                of(precision).map_or_else(String::new, |row| format!("{:.2}", row.time.total_ms))
            }));
            table.push(words);
        }
        table
    }

    /// Where the time of the largest network and of each CPL goes.
    fn shares(&self) -> Table {
        let heading = ["", "layers of points", "layers of vectors", "choosing", "other", "total"];
        let mut table = Table::new("Where the time goes, ms", &heading);
        let at = |row: &&Row| row.sampler != Sampler::All || row.points == 1024;
        for row in self.rows.iter().filter(at).filter(|row| row.sampler != Sampler::Fps) {
            let time = &row.time;
            let name =
                format!("{} {} of {}, {}", row.sampler.word(), row.points, row.from, row.precision);
            let mut words = vec![name];
            let known = [time.points_ms, time.vectors_ms, time.choosing_ms].map(digits);
            words.extend(known);
            words.push(time.other_ms.map(digits).unwrap_or_default());
            words.push(digits(time.total_ms));
            table.push(words);
        }
        table
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
        write!(f, "{}", self.times(Sampler::All, &title("All points")))?;
        let from =
            self.rows.iter().find(|row| row.sampler == Sampler::Fps).map_or(0, |row| row.from);
        write!(f, "{}", self.times(Sampler::Fps, &title(&format!("Farthest points of {from}"))))?;
        let cpl = "Critical points, front end of its own";
        write!(f, "{}", self.times(Sampler::Cpl, &title(cpl)))?;
        let cpl = "Critical points, trunk of STN3d shared";
        write!(f, "{}", self.times(Sampler::CplStn, &title(cpl)))?;
        write!(f, "{}", self.shares())?;
        if self.rows.iter().any(|row| row.other.is_none()) {
            writeln!(f, "\nInstructions outside inner loops are NOT counted in: see above why.")?;
        } else {
            writeln!(f, "\nOther work runs at {instructions_per_cycle} instructions a cycle.")?;
        }
        writeln!(f, "\n{}", wrapped(LEFT_OUT, 79))
    }
}

/// The inner loops and what llvm-mca makes of them.
pub fn kernels(kernels: &Kernels, version: &str) -> Table {
    let heading =
        ["inner loop", "products", "instructions", "cycles", "products/cycle", "% of peak"];
    let title = format!("Inner loops as compiled, one round, by {version} as Neoverse N1");
    let mut table = Table::new(title, &heading);
    for kernel in kernels.all() {
        table.push(vec![
            kernel.name.clone(),
            kernel.work.to_string(),
            format!("{:.0}", kernel.instructions),
            format!("{:.2}", kernel.cycles),
            format!("{:.2}", kernel.work as f64 / kernel.cycles),
            kernel.share_of_peak().map(|share| format!("{:.1}", share * 100.0)).unwrap_or_default(),
        ]);
    }
    table
}

/// `text` in lines of at most `width` characters.
fn wrapped(text: &str, width: usize) -> String {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let line = lines.last().map_or(0, |line| line.chars().count());
        if line > 0 && line + 1 + word.chars().count() > width {
            lines.push(String::new());
        }
        if let Some(line) = lines.last_mut() {
            if !line.is_empty() {
                line.push(' ');
            }
            line.push_str(word);
        }
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_text_is_wrapped_between_words() {
        assert_eq!(wrapped("a bc def  gh", 6), "a bc\ndef gh");
        assert_eq!(wrapped("longer-than-that b", 6), "longer-than-that\nb");
    }
}
