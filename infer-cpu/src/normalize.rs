//! Clouds moved and scaled as in training.

/// Bits of a coordinate that enter the mean.
const FRACTION_BITS: i32 = 62;

/// Moves the mean of `points` to 0, scales the largest radius to 1 and leaves
/// the result in `out`. Points that all coincide go to 0.
///
/// The mean is summed in integers, 62 bits a coordinate, so that it does not
/// depend on the order of the points by a single bit; everything else is f64.
/// All coordinates must be finite.
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

/// The mean of `values`, all below 1 in magnitude: the same for any order.
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

/// A power of two not below `x`, at least the least normal number.
fn power_of_two_above(x: f64) -> f64 {
    let bits = x.max(f64::MIN_POSITIVE).to_bits();
    let exponent = bits >> 52;
    let next = if bits & ((1 << 52) - 1) == 0 { exponent } else { exponent + 1 };
    f64::from_bits(next.min(2046) << 52)
}
