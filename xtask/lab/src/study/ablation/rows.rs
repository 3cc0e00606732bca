//! The lines of `ablations.csv`.

use super::effects::{EFFECTS, Effect, Judge, REFERENCE};
use crate::measure::clock::Spread;
use formats::interval::wilson;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// One set to train on and one to test on.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Test {
    /// The set that the network learns from.
    pub trained_on: &'static str,
    /// The set that it is tested on.
    pub tested_on: &'static str,
}

/// One network's answers on one set: a line of `answers.csv`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Answer {
    pub trained_on: &'static str,
    pub tested_on: &'static str,
    pub seed: u64,
    pub correct: usize,
    pub n: usize,
    pub train_clouds: usize,
    pub epochs: u32,
}

/// What a dataset costs: CPU seconds of a mesh with all its views, and the bytes of
/// a cloud.
pub type Cost = (Spread, f64);

/// A line: an effect, a direction and a seed. Where positions were compared,
/// nothing was trained, and `n` is the number of scans that are equal.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
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
pub fn tests() -> Vec<Test> {
    let mut tests = BTreeSet::new();
    for effect in EFFECTS.iter().filter(|effect| effect.judged_by == Judge::Networks) {
        for trained_on in [effect.with, effect.without] {
            let tested = tested_on(effect).into_iter();
            tests.extend(tested.map(|(_, tested_on)| Test { trained_on, tested_on }));
        }
    }
    tests.into_iter().collect()
}

/// The lines of all effects, in their order. `compared` is the number of equal
/// scans by effect.
pub fn rows(
    answers: &[Answer],
    compared: &BTreeMap<&str, usize>,
    costs: &BTreeMap<&str, Cost>,
) -> Vec<Row> {
    let mut rows = Vec::new();
    for effect in &EFFECTS {
        for (direction, set) in [("with", effect.with), ("without", effect.without)] {
            let Some((seconds, bytes_per_cloud)) = costs.get(set) else { continue };
            let row = Row {
                effect: effect.name,
                trained_on: direction,
                trained_set: set,
                scan_seconds_cpu: seconds.median,
                scan_seconds_cpu_low: seconds.min,
                scan_seconds_cpu_high: seconds.max,
                bytes_per_cloud: *bytes_per_cloud,
                ..Row::default()
            };
            if effect.judged_by == Judge::Positions {
                let n = compared.get(effect.name).copied().unwrap_or(0);
                rows.push(Row { judged_by: "identical positions", n, ..row });
                continue;
            }
            for (tested, tested_set) in tested_on(effect) {
                let of_test = |a: &&Answer| a.trained_on == set && a.tested_on == tested_set;
                rows.extend(answers.iter().filter(of_test).map(|answer| {
                    let (low, high) = wilson(answer.correct, answer.n);
                    Row {
                        judged_by: "networks",
                        tested_on: Some(tested),
                        tested_set: Some(tested_set),
                        seed: Some(answer.seed),
                        accuracy: Some(answer.correct as f64 / answer.n.max(1) as f64),
                        accuracy_low: Some(low),
                        accuracy_high: Some(high),
                        n: answer.n,
                        train_clouds: Some(answer.train_clouds),
                        epochs: Some(answer.epochs),
                        ..row.clone()
                    }
                }));
            }
        }
    }
    rows
}
