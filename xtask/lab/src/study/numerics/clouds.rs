//! Clouds by rule.

use formats::rng::StreamKey;

/// Cloud `number` of `n` points: on an ellipsoid, a box, a cone or a rod, stretched
/// at random.
pub fn cloud(number: u32, n: usize) -> Vec<[f64; 3]> {
    let key = StreamKey::new(0, "growth", number);
    let stretch = [0, 1, 2].map(|axis| 0.3 + key.unit(axis));
    let point = |i: usize| {
        let unit = |k: usize| 2.0 * key.unit((3 + 3 * i + k) as u64) - 1.0;
        let p = [unit(0), unit(1), unit(2)];
        let on_surface = match number % 4 {
            0 => {
                let radius = p.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-9);
                p.map(|x| x / radius)
            }
            1 => {
                let mut p = p;
                p[i % 3] = p[i % 3].signum();
                p
            }
            2 => [p[0] * (1.0 - p[2]) / 2.0, p[1] * (1.0 - p[2]) / 2.0, p[2]],
            _ => [0.1 * p[0], 0.1 * p[1], p[2]],
        };
        [0, 1, 2].map(|axis| on_surface[axis] * stretch[axis])
    };
    (0..n).map(point).collect()
}
