//! The lines of `ablations.csv`.

use super::costs::Seconds;
use super::effects::{EFFECTS, Effect, Judge, REFERENCE};
use formats::interval::wilson;
use serde::Serialize;
use std::collections::BTreeMap;

/// One network's answers on one set: a line of `answers.csv`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Answer {
    pub trained_on: String,
    pub tested_on: String,
    pub seed: u64,
    pub correct: usize,
    pub n: usize,
    pub train_clouds: usize,
    pub epochs: u32,
}

/// What a dataset costs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    pub seconds: Seconds,
    pub bytes_per_cloud: f64,
}

/// A line: an effect, a direction and a seed. Where positions were compared,
/// nothing was trained, and `n` is the number of scans that are equal.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    pub effect: &'static str,
    pub judged_by: &'static str,
    /// with or without the effect.
    pub trained_on: &'static str,
    /// with, without, or the reference's scans.
    pub tested_on: Option<&'static str>,
    pub trained_set: &'static str,
    pub tested_set: Option<&'static str>,
    pub seed: Option<u64>,
    pub accuracy: Option<f64>,
    pub accuracy_low: Option<f64>,
    pub accuracy_high: Option<f64>,
    pub n: usize,
    pub train_clouds: Option<usize>,
    pub epochs: Option<u32>,
    /// CPU seconds of a mesh of the set that was trained on, with all its views:
    /// the median of the rounds, and the ends.
    pub scan_seconds_cpu: f64,
    pub scan_seconds_cpu_low: f64,
    pub scan_seconds_cpu_high: f64,
    /// Of the set that was trained on.
    pub bytes_per_cloud: f64,
}

/// Which sets the networks of `effect` are tested on, and what they are called.
fn tested_on(effect: &Effect) -> Vec<(&'static str, &'static str)> {
    let mut sets = vec![("with", effect.with), ("without", effect.without)];
    if effect.with != REFERENCE {
        sets.push(("reference", REFERENCE));
    }
    sets
}

/// All pairs of a set to train on and one to test on, each once, sorted.
pub fn tests() -> Vec<(&'static str, &'static str)> {
    let of = |effect: &Effect| {
        let tested = tested_on(effect);
        let pairs = [effect.with, effect.without]
            .into_iter()
            .flat_map(|trained| tested.iter().map(move |(_, tested)| (trained, *tested)));
        pairs.collect::<Vec<_>>()
    };
    let mut tests: Vec<_> =
        EFFECTS.iter().filter(|effect| effect.judged_by == Judge::Networks).flat_map(of).collect();
    tests.sort_unstable();
    tests.dedup();
    tests
}

/// The lines of all effects, in their order. `compared` is the number of equal
/// scans by effect.
pub fn rows(
    answers: &[Answer],
    compared: &BTreeMap<&str, usize>,
    costs: &BTreeMap<String, Cost>,
) -> Vec<Row> {
    let mut rows = Vec::new();
    for effect in &EFFECTS {
        for (direction, set) in [("with", effect.with), ("without", effect.without)] {
            let Some(cost) = costs.get(set) else { continue };
            let blank = blank(effect, (direction, set), cost);
            match effect.judged_by {
                Judge::Positions => {
                    let n = compared.get(effect.name).copied().unwrap_or(0);
                    rows.push(Row { n, ..blank });
                }
                Judge::Networks => {
                    for (tested, tested_set) in tested_on(effect) {
                        let answers = answers
                            .iter()
                            .filter(|a| a.trained_on == set && a.tested_on == tested_set);
                        rows.extend(answers.map(|answer| Row {
                            tested_on: Some(tested),
                            tested_set: Some(tested_set),
                            ..answered(answer, &blank)
                        }));
                    }
                }
            }
        }
    }
    rows
}

fn blank(effect: &Effect, (direction, set): (&'static str, &'static str), cost: &Cost) -> Row {
    Row {
        effect: effect.name,
        judged_by: match effect.judged_by {
            Judge::Networks => "networks",
            Judge::Positions => "identical positions",
        },
        trained_on: direction,
        tested_on: None,
        trained_set: set,
        tested_set: None,
        seed: None,
        accuracy: None,
        accuracy_low: None,
        accuracy_high: None,
        n: 0,
        train_clouds: None,
        epochs: None,
        scan_seconds_cpu: cost.seconds.median,
        scan_seconds_cpu_low: cost.seconds.least,
        scan_seconds_cpu_high: cost.seconds.most,
        bytes_per_cloud: cost.bytes_per_cloud,
    }
}

fn answered(answer: &Answer, blank: &Row) -> Row {
    let (low, high) = wilson(answer.correct, answer.n);
    Row {
        seed: Some(answer.seed),
        accuracy: Some(answer.correct as f64 / answer.n.max(1) as f64),
        accuracy_low: Some(low),
        accuracy_high: Some(high),
        n: answer.n,
        train_clouds: Some(answer.train_clouds),
        epochs: Some(answer.epochs),
        ..blank.clone()
    }
}
