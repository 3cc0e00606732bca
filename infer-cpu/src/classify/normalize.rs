//! Normalisation of clouds, as in training.

use formats::model_card::Normalization;

/// The bits of a coordinate that count for the mean.
const FRACTION_BITS: i32 = 62;

/// Writes the normalised `points` to `out`. The ground counts only for clouds in metres. All
/// coordinates must be finite.
pub fn normalize(
    normalization: Normalization,
    points: &[[f64; 3]],
    ground_z: Option<f64>,
    out: &mut Vec<[f32; 3]>,
) {
    match normalization {
        Normalization::UnitSphere => to_unit_sphere(points, out),
        Normalization::Metric => to_metric(points, ground_z, out),
        Normalization::MetricSight => to_metric_sight(points, ground_z, out),
        Normalization::None => not_at_all(points, out),
    }
}

/// Moves the mean of `points` to 0, scales the largest radius to 1 and writes the result to `out`.
/// If all points coincide, they become 0.
///
/// The mean is summed in integers of 62 bits a coordinate, so that it is bit-identical for any
/// order of the points. All other arithmetic is f64. All coordinates must be finite.
///
/// The result depends only on shape if the largest coordinate is a normal number, 2.3e-308 or more.
/// Smaller clouds keep their remaining bits, or become points at 0 if the caller's thread flushes
/// subnormal numbers.
pub fn to_unit_sphere(points: &[[f64; 3]], out: &mut Vec<[f32; 3]>) {
    out.clear();
    let Some(first) = points.first() else { return };
    if points.iter().all(|point| point == first) {
        out.resize(points.len(), [0.0; 3]);
        return;
    }
    // Scaled by a power of two, so that no square overflows or vanishes.
    let largest = points.as_flattened().iter().fold(0.0f64, |most, x| most.max(x.abs()));
    let unit = power_of_two_above(largest);
    let scaled = |point: &[f64; 3]| point.map(|x| x / unit);
    let mean = [0, 1, 2].map(|axis| exact_mean(points.iter().map(|point| scaled(point)[axis])));
    let from_mean = |point: &[f64; 3]| {
        let point = scaled(point);
        [0, 1, 2].map(|axis| point[axis] - mean[axis])
    };
    let square = |p: [f64; 3]| p[0] * p[0] + p[1] * p[1] + p[2] * p[2];
    let radius = points.iter().map(|point| square(from_mean(point))).fold(0.0, f64::max).sqrt();
    let scale = if radius > 0.0 { radius.recip() } else { 0.0 };
    out.extend(points.iter().map(|point| from_mean(point).map(|x| (x * scale) as f32)));
}

/// Moves the means of x and y to 0 and the ground to z = 0, without scaling, and writes the result
/// to `out`. The ground is at `ground_z`, or at the lowest point if that is `None` or not finite.
/// The result is in metres and does not depend on the position of the sensor. The network therefore
/// sees the size of an object and the heights of its parts above the ground.
///
/// The mean is computed as in [`to_unit_sphere`]. All input must be finite; the output is limited
/// to the range of f32.
pub fn to_metric(points: &[[f64; 3]], ground_z: Option<f64>, out: &mut Vec<[f32; 3]>) {
    turned_metric(points, ground_z, |_| [1.0, 0.0], out);
}

/// Does the same as [`to_metric`], then rotates about z so that the line of sight from the sensor
/// (the origin of `points`) to the mean becomes x. A cluster with its mean at the sensor is not
/// rotated.
pub fn to_metric_sight(points: &[[f64; 3]], ground_z: Option<f64>, out: &mut Vec<[f32; 3]>) {
    let direction = |[x, y]: [f64; 2]| {
        let angle = libm::atan2(y, x);
        [libm::cos(angle), libm::sin(angle)]
    };
    turned_metric(points, ground_z, direction, out);
}

/// Normalises in metres; `turned` returns the unit vector that becomes x, given the means of x and
/// y.
fn turned_metric(
    points: &[[f64; 3]],
    ground_z: Option<f64>,
    turned: impl Fn([f64; 2]) -> [f64; 2],
    out: &mut Vec<[f32; 3]>,
) {
    out.clear();
    let mean = [0, 1].map(|axis| exact_mean(points.iter().map(|point| point[axis])));
    let [cos, sin] = turned(mean);
    let lowest = || points.iter().fold(f64::INFINITY, |lowest, point| lowest.min(point[2]));
    let foot = ground_z.filter(|z| z.is_finite()).unwrap_or_else(lowest);
    let moved = |[x, y, z]: &[f64; 3]| {
        let [x, y] = [x - mean[0], y - mean[1]];
        [cos * x + sin * y, cos * y - sin * x, z - foot].map(in_f32)
    };
    out.extend(points.iter().map(moved));
}

/// Writes `points` to `out` unchanged, rounded to f32 and limited to its range.
pub fn not_at_all(points: &[[f64; 3]], out: &mut Vec<[f32; 3]>) {
    out.clear();
    out.extend(points.iter().map(|point| point.map(in_f32)));
}

/// `x` rounded to f32 and limited to its range.
fn in_f32(x: f64) -> f32 {
    let largest = f64::from(f32::MAX);
    x.clamp(-largest, largest) as f32
}

/// The mean of `values`, which must be finite: bit-identical for any order.
fn exact_mean(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let largest = values.clone().fold(0.0f64, |most, x| most.max(x.abs()));
    let unit = power_of_two_above(largest);
    let one = 2f64.powi(FRACTION_BITS);
    let (sum, n) = values.fold((0i128, 0i128), |(sum, n), value| {
        // 62 bits and a sign: 2^65 of them fit an i128.
        (sum + i128::from((value / unit * one) as i64), n + 1)
    });
    sum as f64 / n as f64 / one * unit
}

/// A power of two of at least `x`, and at least the least normal number.
fn power_of_two_above(x: f64) -> f64 {
    let bits = x.max(f64::MIN_POSITIVE).to_bits();
    let exponent = bits >> 52;
    let next = if bits & ((1 << 52) - 1) == 0 { exponent } else { exponent + 1 };
    f64::from_bits(next.min(2046) << 52)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metric_clusters_depend_neither_on_place_nor_order() {
        let metric = |points: &[[f64; 3]]| {
            let mut out = Vec::new();
            to_metric(points, None, &mut out);
            out
        };
        let cluster = [[1.0, 0.0, 0.5], [3.0, 0.5, -0.25], [2.0, -0.5, 1.5]];
        let expected = [[-1.0, 0.0, 0.75], [1.0, 0.5, 0.0], [0.0, -0.5, 1.75]];
        assert_eq!(metric(&cluster), expected);
        // Whole metres away: exact in f64.
        assert_eq!(metric(&cluster.map(|[x, y, z]| [x + 40.0, y - 7.0, z - 2.0])), expected);
        let [a, b, c] = metric(&[cluster[2], cluster[0], cluster[1]])[..] else { unreachable!() };
        assert_eq!([b, c, a], expected);
        assert_eq!(metric(&[]), [[0.0; 3]; 0]);
        assert_eq!(metric(&[[5.0; 3]]), [[0.0; 3]]);
        // Halves of the largest number are apart by the largest number.
        let far = f64::MAX / 2.0;
        assert_eq!(metric(&[[-far, 0.0, -far], [far, 0.0, far]])[1], [f32::MAX, 0.0, f32::MAX]);
        assert_eq!(metric(&[[f64::MAX; 3]; 3]), [[0.0; 3]; 3]);
    }

    #[test]
    fn a_cluster_turned_to_the_line_of_sight_is_the_same_in_any_direction() {
        let ahead = [[9.0, 0.0, 0.5], [11.0, 0.5, -0.25], [10.0, -0.5, 1.5]];
        let expected = [[-1.0, 0.0, 0.75], [1.0, 0.5, 0.0], [0.0, -0.5, 1.75]];
        for degrees in [0.0, 30.0, 90.0, 180.0, -135.0f64] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let turned = ahead.map(|[x, y, z]| [cos * x - sin * y, sin * x + cos * y, z]);
            let mut out = Vec::new();
            to_metric_sight(&turned, None, &mut out);
            // Rounding of coordinates of 11 m in f64, twice, and of 1 m in f32.
            for (found, expected) in out.as_flattened().iter().zip(expected.as_flattened()) {
                assert!((found - expected).abs() <= 1e-6, "{found} for {expected}");
            }
        }
        let mut out = Vec::new();
        to_metric_sight(&[[1.0, 2.0, 0.0], [-1.0, -2.0, 0.0]], None, &mut out);
        assert_eq!(out, [[1.0, 2.0, 0.0], [-1.0, -2.0, 0.0]]);
    }
}
