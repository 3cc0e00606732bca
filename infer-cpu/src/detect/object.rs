use edgepuck_segment::OrientedBox;

use crate::birdseye::Seen;

/// An object of a known class.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Object {
    /// Its number among the clusters, as in [`Detections::labels`](super::Detections::labels).
    pub cluster: u32,
    /// Its class.
    pub class: String,
    /// How sure the detection is, 0 to 1: of those from 0.7 to 0.9 in sweeps of other sources, some seven in ten are right.
    pub confidence: f64,
    /// The number of its points.
    pub n_points: usize,
    /// The box around its points.
    pub place: OrientedBox<f32>,
    /// The box of the whole object, with what its points do not show.
    pub whole: OrientedBox<f32>,
}

/// The least and the greatest length and width of an object of each class, metres: from a small car to a long
/// van (catalogues), and trucks and buses of 96/53/EC with mirrors; two-wheelers with their riders.
const SIZES_M: [(&str, [f32; 2], [f32; 2]); 5] = [
    ("car", [2.2, 7.0], [1.2, 2.6]),
    ("person", [0.15, 1.6], [0.15, 1.4]),
    ("two-wheeler", [0.8, 3.0], [0.2, 1.6]),
    ("truck", [3.5, 18.75], [1.4, 3.2]),
    ("bus", [4.5, 18.75], [1.7, 3.2]),
];

/// Whether an object of `class` can be as large as `size_m`; those of other classes may have any size.
pub(super) fn is_possible(class: &str, [length_m, width_m, _]: [f32; 3]) -> bool {
    let known = SIZES_M.iter().find(|(name, ..)| *name == class);
    known.is_none_or(|(_, lengths_m, widths_m)| {
        let is_within = |[least, most]: &[f32; 2], x| (*least..=*most).contains(&x);
        is_within(lengths_m, length_m) && is_within(widths_m, width_m)
    })
}

/// The box of an object that stands on ground of this height, metres, or where its points begin if that
/// is lower.
pub(super) fn whole(seen: &Seen, place: &OrientedBox<f32>, ground_z_m: f32) -> OrientedBox<f32> {
    let ([x, y], size_m) = (seen.centre_m, seen.size_m);
    let base_m = ground_z_m.min(place.centre_m[2] - place.size_m[2] / 2.0);
    OrientedBox { centre_m: [x, y, base_m + size_m[2] / 2.0], size_m, yaw_rad: seen.yaw_rad }
}

#[cfg(test)]
mod tests {
    use super::is_possible;

    #[test]
    fn no_class_takes_a_size_that_it_cannot_have() {
        assert!(is_possible("car", [4.2, 1.8, 1.5]) && is_possible("bus", [12.0, 2.55, 3.2]));
        assert!(!is_possible("car", [9.0, 1.8, 1.5]) && !is_possible("car", [4.2, 3.0, 1.5]));
        assert!(!is_possible("bus", [2.0, 2.0, 3.0]) && !is_possible("person", [2.0, 0.5, 1.7]));
        assert!(!is_possible("two-wheeler", [1.8, 0.1, 1.7]) && is_possible("tram", [40.0; 3]));
    }
}
