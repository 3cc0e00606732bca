//! The load of `infer-cpu live` on a Raspberry Pi 5, by stage: instructions under QEMU at a flat
//! number of them a cycle.

use super::count::{Counter, Counts};
use super::model::Machine;
use crate::table::Table;
use anyhow::{Context, Result, ensure};
use serde::Deserialize;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Clusters of the turn whose time is modelled.
const CLUSTERS: f64 = 20.0;
const TURNS_HZ: f64 = 10.0;

/// A stage, and parts of the names of its functions. A function belongs to the first stage that
/// fits. Code that the compiler has moved into the pipeline's loop, and code that several stages
/// call, belongs to the last.
const STAGES: [(&str, &[&str]); 5] = [
    ("decode packets", &["live::sensor", "live::packet_clock", "formats::"]),
    ("boxes and tracks", &["oriented_box", "live::tracker", "live::kalman", "live::object"]),
    ("ground and clusters", &["edgepuck_segment"]),
    (
        "classify",
        &[
            "infer_cpu::kernel",
            "infer_cpu::engine",
            "infer_cpu::prefilter",
            "infer_cpu::classifier",
            "infer_cpu::sampler",
            "infer_cpu::normalize",
            "infer_cpu::team",
        ],
    ),
    ("all else", &[""]),
];
const TRACKS: usize = 1;
const CLASSIFY: usize = 3;

/// A line of `infer-cpu live`.
#[derive(Deserialize)]
struct Line {
    turn: u64,
    confidence: Option<f64>,
}

/// The work between the ends of two captures of one drive.
#[derive(Debug, Default)]
struct Work {
    instructions: [f64; STAGES.len()],
    turns: f64,
    clusters: f64,
    classified: f64,
}

/// Counts two captures of a drive, the second longer than the first, and reports on the difference,
/// in which no model is loaded.
pub fn table(counter: &Counter, captures: [&PathBuf; 2], machine: Machine) -> Result<String> {
    let [short, long] = captures.map(|capture| Work::of(counter, capture));
    let (short, long) = (short?, long?);
    let work = long.less(&short);
    ensure!(
        work.turns > 0.0 && work.classified > 0.0,
        "expected a second capture of more turns than the first, with clusters, found {} \
         turns and {} clusters more",
        work.turns,
        work.classified
    );
    Ok(work.report(machine))
}

impl Work {
    fn of(counter: &Counter, capture: &Path) -> Result<Self> {
        eprintln!("counting {}", capture.display());
        let (counts, lines) = counter.live(capture)?;
        let lines: Vec<Line> = lines
            .lines()
            .map(|line| serde_json::from_str(line).context("a line of infer-cpu live"))
            .collect::<Result<_>>()?;
        let turns: BTreeSet<u64> = lines.iter().map(|line| line.turn).collect();
        Ok(Self {
            instructions: by_stage(&counts),
            turns: turns.len() as f64,
            clusters: lines.len() as f64,
            classified: lines.iter().filter(|line| line.confidence.is_some()).count() as f64,
        })
    }

    fn less(&self, other: &Self) -> Self {
        Self {
            instructions: std::array::from_fn(|i| self.instructions[i] - other.instructions[i]),
            turns: self.turns - other.turns,
            clusters: self.clusters - other.clusters,
            classified: self.classified - other.classified,
        }
    }

    /// Instructions of a turn in which `clusters` clusters are all classified.
    fn of_turn(&self, clusters: f64) -> [f64; STAGES.len()] {
        let mut turn = self.instructions.map(|count| count / self.turns);
        turn[CLASSIFY] = self.instructions[CLASSIFY] / self.classified * clusters;
        turn[TRACKS] = self.instructions[TRACKS] / self.clusters * clusters;
        turn
    }

    fn report(&self, machine: Machine) -> String {
        let ms = |count: f64| count / machine.instructions_per_cycle / machine.hertz * 1e3;
        let title = format!(
            "A turn, modelled: {} GHz, {} instructions a cycle",
            machine.hertz / 1e9,
            machine.instructions_per_cycle
        );
        let asked = format!("{CLUSTERS} clusters, ms");
        let heading = ["stage", "million instructions", "ms", "share, %", &asked];
        let mut table = Table::new(title, &heading);
        let whole = self.instructions.map(|count| count / self.turns);
        let total: f64 = whole.iter().sum();
        let turn = self.of_turn(CLUSTERS);
        let mut push = |name: &str, count: f64, of_turn: f64| {
            let numbers = [count / 1e6, ms(count), 100.0 * count / total, ms(of_turn)];
            let cells = numbers.map(|number| format!("{number:.1}"));
            table.push([name.to_owned()].into_iter().chain(cells).collect::<Vec<_>>());
        };
        for ((name, _), (count, of_turn)) in STAGES.iter().zip(whole.into_iter().zip(turn)) {
            push(name, count, of_turn);
        }
        let asked: f64 = turn.iter().sum();
        push("together", total, asked);
        let shared = ms(asked - turn[CLASSIFY]) + ms(turn[CLASSIFY]) / machine.threads as f64;
        format!(
            "{table}\n{:.1} clusters a turn, of which {:.1} are classified. All stages take {:.0} % of \
             one core at {TURNS_HZ} turns a second; with {CLUSTERS} clusters, {:.0} %, and {shared:.1} ms \
             a turn where {} threads classify.\n",
            self.clusters / self.turns,
            self.classified / self.turns,
            100.0 * ms(total) * 1e-3 * TURNS_HZ,
            100.0 * ms(asked) * 1e-3 * TURNS_HZ,
            machine.threads,
        )
    }
}

fn by_stage(counts: &Counts) -> [f64; STAGES.len()] {
    let mut stages = [0.0; STAGES.len()];
    for (name, count) in counts.all() {
        let fits = |(_, parts): &(_, &[&str])| parts.iter().any(|part| name.contains(part));
        let stage = STAGES.iter().position(fits).expect("invariant: all names fit the last");
        stages[stage] += count;
    }
    stages
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_belong_to_the_first_stage_that_names_them() {
        let counts = Counts::parse(
            "8 edgepuck_segment::oriented_box::around\n4 edgepuck_segment::link::link_column\n\
             2 memcpy\n1 infer_cpu::live::sensor::Decoder::decode\n16 infer_cpu::kernel::neon::dot\n",
        );
        assert_eq!(by_stage(&counts), [1.0, 8.0, 4.0, 16.0, 2.0]);
    }

    #[test]
    fn clusters_are_scaled_and_the_rest_of_a_turn_is_not() {
        let instructions = [10.0, 30.0, 40.0, 60.0, 20.0];
        let work = Work { instructions, turns: 10.0, clusters: 300.0, classified: 200.0 };
        assert_eq!(work.of_turn(20.0), [1.0, 2.0, 4.0, 6.0, 2.0]);
        let told = work.report(Machine::PI_5);
        assert!(told.contains("30.0 clusters a turn, of which 20.0 are classified"), "{told}");
    }
}
