//! Average precision as nuScenes defines it (Caesar et al., "nuScenes", CVPR 2020, 3.1): a detection is
//! right by the horizontal distance of its centre from that of a labelled object of its class.

use crate::table::{Table, percent};

/// The farthest centres of the four precisions, metres.
const DISTANCES_M: [f64; 4] = [0.5, 1.0, 2.0, 4.0];
/// Lower recalls and precisions do not count.
const LEAST: f64 = 0.1;
/// Steps of recall.
const STEPS: usize = 100;

/// Where an object is said or labelled to be.
#[derive(Clone, Copy)]
pub struct Place {
    /// The number of the frame.
    pub frame: usize,
    pub centre_m: [f64; 2],
    /// The confidence; 0 of a label.
    pub score: f64,
}

/// What was found of a class, and what is there.
pub struct OfClass {
    pub class: &'static str,
    pub found: Vec<Place>,
    pub labelled: Vec<Place>,
}

impl OfClass {
    /// The average precision of detections within a distance of the label.
    fn average_precision(&self, within_m: f64) -> f64 {
        let mut order: Vec<usize> = (0..self.found.len()).collect();
        order.sort_by(|&a, &b| self.found[b].score.total_cmp(&self.found[a].score).then(b.cmp(&a)));
        let mut is_taken = vec![false; self.labelled.len()];
        let (mut n_right, mut curve) = (0usize, Vec::new());
        for (n, &at) in (1..).zip(&order) {
            let found = self.found[at];
            let off_m = |label: &Place| {
                (label.centre_m[0] - found.centre_m[0]).hypot(label.centre_m[1] - found.centre_m[1])
            };
            let free = self.labelled.iter().enumerate();
            let free = free.filter(|(i, label)| label.frame == found.frame && !is_taken[*i]);
            let nearest = free.min_by(|(_, a), (_, b)| off_m(a).total_cmp(&off_m(b)));
            if let Some((i, _)) = nearest.filter(|(_, label)| off_m(label) < within_m) {
                is_taken[i] = true;
                n_right += 1;
            }
            let share = |of: usize| n_right as f64 / of as f64;
            curve.push([share(self.labelled.len()), share(n)]);
        }
        if n_right == 0 {
            return 0.0;
        }
        // Recalls above the least one, of which the first step is left out.
        let first = (STEPS as f64 * LEAST).round() as usize + 1;
        let steps = (first..=STEPS).map(|step| step as f64 / STEPS as f64);
        let sum: f64 = steps.map(|recall| (precision_at(&curve, recall) - LEAST).max(0.0)).sum();
        sum / (STEPS + 1 - first) as f64 / (1.0 - LEAST)
    }
}

/// The precision at a recall, between those of the curve; 0 beyond its last.
fn precision_at(curve: &[[f64; 2]], recall: f64) -> f64 {
    let after = curve.partition_point(|[reached, _]| *reached <= recall);
    match (after.checked_sub(1).map(|before| curve[before]), curve.get(after)) {
        (None, first) => first.map_or(0.0, |[_, precision]| *precision),
        (Some([reached, precision]), None) => {
            if reached == recall {
                precision
            } else {
                0.0
            }
        }
        (Some([low, precision]), Some([high, next])) => {
            precision + (next - precision) * (recall - low) / (high - low)
        }
    }
}

/// The average precisions of each class, at each distance and their mean.
pub fn table(classes: &[OfClass]) -> Table {
    let titles = ["class", "labelled", "0.5 m", "1 m", "2 m", "4 m", "mean"];
    let mut table =
        Table::new("Average precision of the centres, by nuScenes' definition", &titles);
    for of in classes {
        let all = DISTANCES_M.map(|within_m| of.average_precision(within_m));
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        let mut row = vec![of.class.to_owned(), of.labelled.len().to_string()];
        row.extend(all.into_iter().chain([mean]).map(percent));
        table.push(row);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The values are those of nuscenes-devkit 1.2.0 for these boxes
    /// (`accumulate` and `calc_ap`, least recall and precision 0.1).
    #[test]
    fn the_precision_is_that_of_nuscenes() {
        let place = |frame, x, y, score| Place { frame, centre_m: [x, y], score };
        let labelled =
            [(0, 10.0, 0.0), (0, 20.0, 5.0), (0, 21.5, 5.0), (1, 8.0, -3.0), (1, 30.0, 1.0)];
        let found = [
            (0, 10.3, 0.1, 0.9),
            (0, 20.9, 5.2, 0.8),
            (0, 20.1, 5.0, 0.8),
            (0, 40.0, 0.0, 0.7),
            (1, 8.0, -1.5, 0.95),
            (1, 8.1, -3.2, 0.6),
            (1, 33.5, 1.0, 0.5),
            (1, 10.0, 0.0, 0.4),
        ];
        let of = OfClass {
            class: "car",
            found: found.map(|(frame, x, y, score)| place(frame, x, y, score)).to_vec(),
            labelled: labelled.map(|(frame, x, y)| place(frame, x, y, 0.0)).to_vec(),
        };
        let none = OfClass { class: "car", found: Vec::new(), labelled: of.labelled.clone() };
        assert_eq!(none.average_precision(4.0), 0.0);
        let expected =
            [0.2380658436213992, 0.43477366255144034, 0.7716049382716051, 0.9186507936507938];
        for (within_m, expected) in DISTANCES_M.into_iter().zip(expected) {
            let ap = of.average_precision(within_m);
            assert!((ap - expected).abs() < 1e-12, "{within_m} m: {ap}");
        }
    }
}
