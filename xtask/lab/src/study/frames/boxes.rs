//! How far boxes of detected objects are from those that people drew.

use super::Asked;
use crate::table::Table;
use formats::geometry::OrientedBox;
use std::f64::consts::PI;

/// How far a box is off.
#[derive(Clone, Copy)]
pub struct BoxError {
    /// The horizontal distance of the centres, metres.
    centre_m: f64,
    /// The angle between the lengths, which have no front, degrees, 0 to 90.
    heading_deg: f64,
    length_m: f64,
    width_m: f64,
}

impl BoxError {
    pub fn of(found: OrientedBox, truth: OrientedBox) -> Self {
        let off = |i: usize| found.centre_m[i] - truth.centre_m[i];
        let turned = (found.yaw_rad - truth.yaw_rad + PI / 2.0).rem_euclid(PI);
        let side = |i: usize| (found.size_m[i] - truth.size_m[i]).abs();
        Self {
            centre_m: off(0).hypot(off(1)),
            heading_deg: (turned - PI / 2.0).abs().to_degrees(),
            length_m: side(0),
            width_m: side(1),
        }
    }
}

/// The boxes of cars that were found and named: around the points that are seen, and of the whole.
pub fn table(asked: &[Asked]) -> Table {
    let mut table = Table::new(
        "Boxes of cars that were found: median and 90th percentile of the error",
        &["box", "cars", "centre, m", "heading, degrees", "length, m", "width, m"],
    );
    let cars = asked.iter().filter(|one| one.class == "car").filter_map(|one| one.errors);
    let cars: Vec<[BoxError; 2]> = cars.collect();
    for (which, name) in ["around the points seen", "of the whole car"].into_iter().enumerate() {
        let column = |of: fn(&BoxError) -> f64, digits: usize| {
            let mut all: Vec<f64> = cars.iter().map(|errors| of(&errors[which])).collect();
            all.sort_by(f64::total_cmp);
            let at = |share: f64| {
                all.get((share * all.len() as f64) as usize).copied().unwrap_or(f64::NAN)
            };
            format!("{:.digits$}, {:.digits$}", at(0.5), at(0.9))
        };
        table.push(vec![
            name.to_owned(),
            cars.len().to_string(),
            column(|error| error.centre_m, 2),
            column(|error| error.heading_deg, 1),
            column(|error| error.length_m, 2),
            column(|error| error.width_m, 2),
        ]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_turned_by_half_a_turn_is_right() {
        let truth =
            OrientedBox { centre_m: [3.0, 4.0, 0.0], size_m: [4.0, 2.0, 1.5], yaw_rad: 3.0 };
        let place =
            |x, yaw_rad| OrientedBox { centre_m: [x, 4.0, 9.0], size_m: [4.5, 2.0, 1.0], yaw_rad };
        let error = BoxError::of(place(3.5, 3.0 - PI), truth);
        assert!(error.heading_deg < 1e-4 && (error.centre_m - 0.5).abs() < 1e-6);
        assert!((error.length_m - 0.5).abs() < 1e-6 && error.width_m < 1e-6);
        let error = BoxError::of(place(3.0, 3.0 + 1.5), truth);
        assert!((error.heading_deg - 1.5f64.to_degrees()).abs() < 1e-3, "{}", error.heading_deg);
    }
}
