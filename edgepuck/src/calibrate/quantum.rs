//! The unit in which a sensor states ranges.

use super::estimate::Estimate;

/// Steps below this are those of numbers, not of sensors, metres.
const LEAST_M: f64 = 1e-4;

/// Ranges are multiples of a quantum if they lie this close to them, in quanta: evenly spread ones
/// have 0.29.
const MOST_OFF: f64 = 0.1;

/// The greatest unit of which nearly all `ranges_m` are multiples; `None` if there is none, or one too
/// fine for numbers of single precision.
pub fn quantum(mut ranges_m: Vec<f64>) -> Option<Estimate> {
    ranges_m.sort_by(f64::total_cmp);
    // The rounding of singles, on both sides.
    ranges_m.dedup_by(|a, b| *a - *b < 4.0 * f64::from(f32::EPSILON) * *a + 1e-6);
    let mut steps: Vec<f64> = ranges_m.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    // A few strays do not decide.
    let least = *steps.get(steps.len() / 100)?;
    let same: Vec<f64> =
        steps.iter().copied().filter(|step| (step / least - 1.0).abs() < 0.3).collect();
    let mut quantum_m = same.iter().sum::<f64>() / same.len() as f64;
    if quantum_m < LEAST_M || ranges_m.len() < 20 {
        return None;
    }
    // The farther, the finer a range tells the quantum, once it tells the number of quanta.
    let farthest = *ranges_m.last()? / quantum_m;
    let mut reach = 50.0;
    loop {
        let is_near = |range: &f64| *range <= reach * quantum_m;
        let near = &ranges_m[..ranges_m.partition_point(is_near)];
        let (mut sum, mut squares) = (0.0, 0.0);
        for range in near {
            let count = (range / quantum_m).round();
            (sum, squares) = (sum + range * count, squares + count * count);
        }
        if squares > 0.0 {
            quantum_m = sum / squares;
        }
        if reach > farthest {
            let off = |range: &f64| (range / quantum_m - (range / quantum_m).round()).powi(2);
            let off = (near.iter().map(off).sum::<f64>() / near.len() as f64).sqrt();
            let found = Estimate::normal(quantum_m, off * quantum_m / squares.sqrt(), near.len());
            return (off < MOST_OFF).then_some(found);
        }
        reach *= 2.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quantum_of_singles_is_found_and_none_of_continuous_ranges() {
        for unit_m in [0.001, 0.002, 0.004, 0.008, 0.0625] {
            let ranges = |i: u32| f64::from((f64::from(i * i % 20_011) * unit_m) as f32);
            let found = quantum((1..9_000).map(ranges).collect()).unwrap();
            assert!((found.value / unit_m - 1.0).abs() < 1e-6, "{unit_m}: {found:?}");
        }
        let continuous = (1..9_000u32).map(|i| f64::from(i).sqrt().fract() * 90.0).collect();
        assert_eq!(quantum(continuous), None);
        assert_eq!(quantum(Vec::new()), None);
    }
}
