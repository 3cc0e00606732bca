//! Average precision as nuScenes defines it (Caesar et al., "nuScenes", CVPR 2020, 3.1): a detection is
//! right by the horizontal distance of its centre from that of a labelled object of its class.

use super::frames::{Frames, Thing};

/// The farthest centres of the four precisions, metres.
pub const DISTANCES_M: [f64; 4] = [0.5, 1.0, 2.0, 4.0];
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
    pub found: Vec<Place>,
    pub labelled: Vec<Place>,
}

impl OfClass {
    /// Those of a class; labelled objects of fewer than `min_points` are left out.
    pub fn of(frames: &Frames, class: usize, min_points: u64) -> Self {
        let mut of = Self { found: Vec::new(), labelled: Vec::new() };
        for (frame, [found, labelled]) in frames.of.iter().enumerate() {
            for (things, places, least) in
                [(found, &mut of.found, 0), (labelled, &mut of.labelled, min_points)]
            {
                let is_asked = |one: &&Thing| one.n_points.is_none_or(|n| n >= least);
                let of_class =
                    things.iter().filter(|one| one.class == Some(class)).filter(is_asked);
                places.extend(of_class.map(|one| {
                    let [x, y, _] = one.place.centre_m;
                    Place { frame, centre_m: [x, y], score: one.score }
                }));
            }
        }
        of
    }

    /// Recall and precision after each detection, the best first.
    pub fn curve(&self, within_m: f64) -> Vec<[f64; 2]> {
        let mut order: Vec<usize> = (0..self.found.len()).collect();
        order.sort_by(|&a, &b| self.found[b].score.total_cmp(&self.found[a].score).then(b.cmp(&a)));
        let mut is_taken = vec![false; self.labelled.len()];
        let (mut n_right, mut curve) = (0usize, Vec::new());
        for (n, &at) in (1..).zip(&order) {
            let found = self.found[at];
            let off_m = |label: &Place| {
                libm::hypot(
                    label.centre_m[0] - found.centre_m[0],
                    label.centre_m[1] - found.centre_m[1],
                )
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
        curve
    }

    /// The average precision of detections within a distance of the label.
    pub fn average_precision(&self, within_m: f64) -> f64 {
        let curve = self.curve(within_m);
        if curve.last().is_none_or(|[recall, _]| *recall == 0.0) {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Boxes, and their precisions by nuscenes-devkit 1.2.0, which tests/peers/detectors.py computes.
    #[test]
    fn the_precision_is_that_of_nuscenes() {
        #[derive(serde::Deserialize)]
        struct Case {
            labelled: Vec<(usize, f64, f64)>,
            found: Vec<(usize, f64, f64, f64)>,
            precision: Vec<(f64, f64)>,
        }
        let place = |frame, x, y, score| Place { frame, centre_m: [x, y], score };
        let cases: Vec<Case> = serde_json::from_str(include_str!("precision.json")).unwrap();
        for Case { labelled, found, precision } in cases {
            let of = OfClass {
                found: found.into_iter().map(|(frame, x, y, s)| place(frame, x, y, s)).collect(),
                labelled: labelled
                    .into_iter()
                    .map(|(frame, x, y)| place(frame, x, y, 0.0))
                    .collect(),
            };
            assert_eq!(precision.len(), DISTANCES_M.len());
            for ((within_m, expected), ours_m) in precision.into_iter().zip(DISTANCES_M) {
                let ap = of.average_precision(within_m);
                assert!(within_m == ours_m && (ap - expected).abs() < 1e-12, "{within_m} m: {ap}");
            }
        }
    }
}
