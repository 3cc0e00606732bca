//! Pareto-optimal settings: no other setting costs as little and is as good.

use edgepuck_program::trade_record::{Device, Measurement, Part};
use std::collections::BTreeMap;

/// Which of `points` are Pareto-optimal: no other is at most as large in every coordinate
/// and smaller in one.
fn optimal<const N: usize>(points: &[[f64; N]]) -> Vec<bool> {
    let dominates = |other: &[f64; N], own: &[f64; N]| {
        other != own && other.iter().zip(own).all(|(other, own)| other <= own)
    };
    points.iter().map(|own| !points.iter().any(|other| dominates(other, own))).collect()
}

/// Marks the Pareto-optimal rows of each group, for each device.
///
/// Costs are as measured and shares are of clouds: a row is dominated even if the
/// difference is smaller than the interval of its accuracy.
pub fn mark(rows: &mut [Measurement]) {
    let mut groups: BTreeMap<GroupKey, Vec<usize>> = BTreeMap::new();
    for (i, row) in rows.iter().enumerate() {
        groups.entry(group_key(row)).or_default().push(i);
    }
    let each = Device::ALL.into_iter().flat_map(|d| groups.values().map(move |g| (d, g)));
    for (device, group) in each {
        let (members, points): (Vec<usize>, Vec<[f64; 3]>) =
            group.iter().filter_map(|&i| Some((i, costs(&rows[i], device)?))).unzip();
        for (i, is_optimal) in members.into_iter().zip(optimal(&points)) {
            match device {
                Device::Pi5 => rows[i].front_pi5 = is_optimal,
                Device::Here => rows[i].front_here = is_optimal,
            }
        }
    }
}

type GroupKey = (Part, String, Option<u64>, Option<u64>);

/// Rows that are compared with each other. Distance and noise are given, not chosen: scans
/// from 3 m and from 20 m are compared among themselves.
fn group_key(row: &Measurement) -> GroupKey {
    let bits = |x: Option<f64>| x.map(f64::to_bits);
    (row.part, row.test_set.clone(), bits(row.distance_m), bits(row.noise_m))
}

/// Time and errors: of ranges for a caster, of classes for everything else.
fn costs(row: &Measurement, device: Device) -> Option<[f64; 3]> {
    let [first, second] = match row.part {
        Part::Caster => [row.range_rms_m?, row.wrong_rays_per_million?],
        Part::Scan | Part::Classifier => [1.0 - row.accuracy, 0.0],
    };
    let costs = [row.ms(device)?, first, second];
    costs.iter().all(|cost| cost.is_finite()).then_some(costs)
}

pub fn is_optimal(row: &Measurement) -> bool {
    row.front_here || row.front_pi5
}

/// A parameter and its value, such as the sampler `voxel`.
pub type Choice = (&'static str, String);

/// The values that no Pareto-optimal row has.
pub fn dominated_settings(rows: &[Measurement]) -> Vec<Choice> {
    let mut all: BTreeMap<Choice, bool> = BTreeMap::new();
    for row in rows {
        for choice in choices_of(row) {
            *all.entry(choice).or_default() |= is_optimal(row);
        }
    }
    all.into_iter().filter(|(_, is_optimal)| !is_optimal).map(|(choice, _)| choice).collect()
}

/// The parameters of a row that a user chooses: not the object's place, and not the
/// number of threads, since cores are not counted as a cost.
fn choices_of(row: &Measurement) -> Vec<Choice> {
    let text = |parameter, value: &String| (!value.is_empty()).then(|| (parameter, value.clone()));
    let count = |parameter, value: Option<usize>| Some((parameter, value?.to_string()));
    let size =
        |parameter, value: Option<f64>, digits| Some((parameter, format!("{:.digits$}", value?)));
    let choices = match row.part {
        Part::Scan => vec![
            text("sensor", &row.sensor),
            size("azimuth step, degrees", row.azimuth_step_deg, 1),
            size("range quantum, m", row.range_quantum_m, 3),
        ],
        Part::Caster => vec![text("caster", &row.caster), text("culling", &row.culling)],
        Part::Classifier => vec![
            text("model", &row.model),
            text("sampler", &row.sampler),
            count("points", row.points),
            text("precision", &row.precision),
            text("T-Nets", &row.t_nets),
        ],
    };
    choices.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(model: &str, ms: f64, right: usize) -> Measurement {
        let row = Measurement {
            part: Part::Classifier,
            model: model.to_owned(),
            ..Measurement::default()
        };
        Measurement { ms_pi5: Some(ms), ..row }.with_accuracy(right, 100)
    }

    #[test]
    fn a_row_is_optimal_unless_another_is_as_cheap_and_as_good() {
        let mut rows = [row("a", 1.0, 80), row("b", 2.0, 90), row("c", 2.0, 85), row("d", 3.0, 90)];
        mark(&mut rows);
        assert_eq!(rows.each_ref().map(|row| row.front_pi5), [true, true, false, false]);
        assert_eq!(
            dominated_settings(&rows)[..2],
            [("model", "c".to_owned()), ("model", "d".to_owned())]
        );
    }

    #[test]
    fn times_on_different_devices_are_not_compared() {
        let here = Measurement { ms_here: Some(0.1), ms_pi5: None, ..row("x86", 0.0, 99) };
        let mut rows = [row("board", 1.0, 80), here];
        mark(&mut rows);
        assert_eq!(rows.each_ref().map(|row| row.front_pi5), [true, false]);
        assert_eq!(rows.each_ref().map(|row| row.front_here), [false, true]);
    }
}
