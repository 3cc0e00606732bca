//! The lines of `ablations.csv`, joined over seeds, for people.

use super::effects::EFFECTS;
use super::rows::Row;
use crate::measure::clock::Spread;
use crate::render::table::{Table, digits};

/// Two tables: what training with an effect gains, and what the effect costs.
pub fn of(rows: &[Row]) -> String {
    format!("{}{}", gains(rows), costs(rows))
}

fn gains(rows: &[Row]) -> Table {
    let heading = ["effect", "tested", "trained with", "trained without", "gain", "least", "most"];
    let mut table = Table::new(
        "Instance accuracy, %, mean over seeds; gain of training with the effect, points, and \
         the ends over seeds",
        &heading,
    );
    for effect in &EFFECTS {
        for tested in ["with", "without", "reference"] {
            let of = |trained: &str| -> Vec<(u64, f64)> {
                let wanted = rows.iter().filter(|row| {
                    (row.effect, row.trained_on, row.tested_on)
                        == (effect.name, trained, Some(tested))
                });
                wanted.filter_map(|row| Some((row.seed?, 100.0 * row.accuracy?))).collect()
            };
            let (with, without) = (of("with"), of("without"));
            if with.is_empty() {
                continue;
            }
            let pairs = with.iter().flat_map(|(seed, p)| {
                without.iter().filter(move |(other, _)| other == seed).map(move |(_, q)| p - q)
            });
            let gain: Vec<f64> = pairs.collect();
            let ends = Spread::of(gain.iter().copied());
            let mean_of = |found: &[(u64, f64)]| mean(found.iter().map(|(_, accuracy)| *accuracy));
            let accuracies = [mean_of(&with), mean_of(&without)].map(|x| format!("{x:.1}"));
            let points = [mean(gain.into_iter()), ends.min, ends.max].map(|x| format!("{x:+.1}"));
            let row = [effect.name, tested].map(str::to_owned);
            table.push(row.into_iter().chain(accuracies).chain(points).collect());
        }
    }
    table
}

fn mean(figures: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = figures.fold((0.0, 0), |(sum, n), x| (sum + x, n + 1));
    sum / f64::from(n.max(1))
}

fn costs(rows: &[Row]) -> Table {
    let mut table = Table::new(
        "CPU ms a mesh with all its views, median and ends of the rounds; bytes of a cloud on disk",
        &["effect", "judged by", "set", "ms", "least", "most", "bytes", "equal scans"],
    );
    for effect in &EFFECTS {
        for direction in ["with", "without"] {
            let row =
                rows.iter().find(|row| (row.effect, row.trained_on) == (effect.name, direction));
            let Some(row) = row else { continue };
            let ms = [row.scan_seconds_cpu, row.scan_seconds_cpu_low, row.scan_seconds_cpu_high];
            let equal = if row.seed.is_none() { row.n.to_string() } else { "-".to_owned() };
            let effect = format!("{} {direction}", effect.name);
            let words = [effect.as_str(), row.judged_by, row.trained_set];
            let numbers = ms.map(|seconds| digits(1e3 * seconds));
            let last = [format!("{:.0}", row.bytes_per_cloud), equal];
            table.push(words.map(str::to_owned).into_iter().chain(numbers).chain(last).collect());
        }
    }
    table
}
