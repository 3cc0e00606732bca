//! Which settings no other makes pointless.

use edgepuck_program::trade_record::{Device, Part, Row};
use std::collections::BTreeMap;

/// Marks the rows on the front of their kind, for each device: no other costs at
/// most as much there and errs at most as much, and one of both less.
///
/// Costs are as measured and shares are of clouds: a row that is beaten by less
/// than the interval of its accuracy is beaten all the same.
pub fn mark(rows: &mut [Row]) {
    let kin: Vec<Kin> = rows.iter().map(kin).collect();
    for device in Device::ALL {
        let figures: Vec<Option<[f64; 3]>> = rows.iter().map(|row| figures(row, device)).collect();
        for (i, row) in rows.iter_mut().enumerate() {
            let rivals = figures.iter().zip(&kin).filter(|(_, other)| **other == kin[i]);
            let mut rivals = rivals.filter_map(|(figures, _)| figures.as_ref());
            let on_front = figures[i].is_some_and(|own| !rivals.any(|other| beats(other, &own)));
            match device {
                Device::Pi5 => row.front_pi5 = on_front,
                Device::Here => row.front_here = on_front,
            }
        }
    }
}

fn beats(other: &[f64; 3], own: &[f64; 3]) -> bool {
    other != own && other.iter().zip(own).all(|(other, own)| other <= own)
}

type Kin = (Part, String, Option<u64>, Option<u64>);

/// Rows that are compared. Distance and noise are no choices: scans from 3 m and
/// from 20 m are compared among themselves.
fn kin(row: &Row) -> Kin {
    let bits = |x: Option<f64>| x.map(f64::to_bits);
    (row.part, row.test_set.clone(), bits(row.distance_m), bits(row.noise_m))
}

/// Cost and errors. Ranges tell casters apart, classes everything else.
fn figures(row: &Row, device: Device) -> Option<[f64; 3]> {
    let [first, second] = match row.part {
        Part::Caster => [row.range_rms_m?, row.wrong_rays_per_million?],
        Part::Scan | Part::Classifier => [1.0 - row.accuracy, 0.0],
    };
    let figures = [row.ms(device)?, first, second];
    figures.iter().all(|figure| figure.is_finite()).then_some(figures)
}

/// A knob's value, such as the sampler `voxel`.
pub type Choice = (&'static str, String);

/// The choices that a user has and that are on no front of the rows in which
/// they occur.
pub fn dominated_everywhere(rows: &[Row]) -> Vec<Choice> {
    let mut all: BTreeMap<Choice, bool> = BTreeMap::new();
    for row in rows {
        for (knob, value) in choices_of(row) {
            *all.entry((knob, value)).or_default() |= row.front_here || row.front_pi5;
        }
    }
    all.into_iter().filter(|(_, on_front)| !on_front).map(|(choice, _)| choice).collect()
}

/// The knobs of a row that a user turns. Where an object stands is none; threads
/// are left out, since a front does not count cores.
fn choices_of(row: &Row) -> Vec<Choice> {
    let text = |knob, value: &String| (!value.is_empty()).then(|| (knob, value.clone()));
    let count = |knob, value: Option<usize>| Some((knob, value?.to_string()));
    let size = |knob, value: Option<f64>, digits| Some((knob, format!("{:.digits$}", value?)));
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

    fn row(model: &str, ms: f64, right: usize) -> Row {
        let row = Row { part: Part::Classifier, model: model.to_owned(), ..Row::default() };
        Row { ms_pi5: Some(ms), ..row }.with_accuracy(right, 100)
    }

    #[test]
    fn a_row_is_on_the_front_unless_another_is_as_cheap_and_as_good() {
        let mut rows = [row("a", 1.0, 80), row("b", 2.0, 90), row("c", 2.0, 85), row("d", 3.0, 90)];
        mark(&mut rows);
        assert_eq!(rows.each_ref().map(|row| row.front_pi5), [true, true, false, false]);
        assert_eq!(
            dominated_everywhere(&rows)[..2],
            [("model", "c".to_owned()), ("model", "d".to_owned())]
        );
    }

    #[test]
    fn equals_stay_side_by_side_and_what_has_no_cost_is_nowhere() {
        let mut rows = [row("a", 1.0, 80), row("b", 1.0, 80), row("c", f64::NAN, 99)];
        mark(&mut rows);
        assert_eq!(rows.each_ref().map(|row| row.front_pi5), [true, true, false]);
    }

    #[test]
    fn a_time_here_is_no_rival_to_one_on_a_board() {
        let here = Row { ms_here: Some(0.1), ms_pi5: None, ..row("x86", 0.0, 99) };
        let mut rows = [row("board", 1.0, 80), here];
        mark(&mut rows);
        assert_eq!(rows.each_ref().map(|row| row.front_pi5), [true, false]);
        assert_eq!(rows.each_ref().map(|row| row.front_here), [false, true]);
    }

    #[test]
    fn far_scans_do_not_compete_with_near_ones() {
        let scan = |distance_m, right| {
            let row = Row { distance_m: Some(distance_m), ms_here: Some(1.0), ..Row::default() };
            row.with_accuracy(right, 100)
        };
        let mut rows = [scan(3.0, 90), scan(20.0, 50), scan(20.0, 40)];
        mark(&mut rows);
        assert_eq!(rows.each_ref().map(|row| row.front_here), [true, true, false]);
    }
}
