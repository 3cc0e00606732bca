//! The noise of ranges on flat patches, and the returns that are missing.

use super::mounting::Mounting;
use super::quantile;
use super::sweep::Return;
use glam::DVec3;
use nalgebra::{Matrix3, SymmetricEigen};
use sim_gpu::internals::sensor::Rotating;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Rings and firing sequences of a patch: some 4 degrees.
const PATCH: [usize; 2] = [3, 12];
/// A patch of fewer returns is an edge's.
const MIN_RETURNS: usize = 20;
/// A patch whose points are this far from its plane (root mean square) is not flat:
/// twice what the sensor's data sheet allows, with the relief of asphalt and plaster.
const FLAT_M: f64 = 0.05;
/// Neighbours whose ranges differ by less than this share see one surface.
const SAME_SURFACE: f64 = 0.03;
/// Ranges below this are written finely enough to distinguish steps of 4 mm, metres.
const NEAR_M: f64 = 8.0;
/// Firing sequences of one direction: 5 degrees.
const DIRECTION: usize = 25;
/// A longer row of missing returns is a hole, such as a window or the sky.
const LONGEST_GAP: usize = 3;

struct Placed {
    ring: usize,
    slot: usize,
    seen_m: DVec3,
    /// Variance of the range that the file's rounding adds, square metres.
    rounding_m2: f64,
}

pub struct Patch {
    /// Mean range, metres.
    pub range_m: f64,
    /// Mean angle between the beams and the normal, degrees.
    pub incidence_deg: f64,
    /// Variance of the range from one return of a laser to its next, square metres.
    pub next_m2: f64,
    /// Variance of the range around the plane of all lasers, square metres.
    pub plane_m2: f64,
}

/// The noise, gaps and ranges of one sensor's sweep.
pub struct Shown {
    pub patches: Vec<Patch>,
    /// For each pair of neighbours on one surface: the range, and the number of firings between
    /// them without a return.
    pub gaps: Vec<(f64, usize)>,
    /// The ranges of all returns, metres.
    pub ranges_m: Vec<f64>,
    /// Returns of each row of the profile's table.
    pub counts: Vec<usize>,
    /// Firing sequences from the first return to the last.
    pub sequences: usize,
    /// Ranges of near returns of one laser in one direction, metres.
    near_m: Vec<Vec<f64>>,
}

impl Shown {
    /// Measures the sweep of the sensor at `mounting`.
    pub fn of(returns: &[Return], mounting: &Mounting, table: &Rotating) -> Self {
        let placed = place(returns, mounting, table);
        let mut counts = vec![0; table.beam.len()];
        returns.iter().for_each(|r| counts[mounting.rows[r.laser]] += 1);
        let gaps = placed.windows(2).filter_map(|pair| {
            let [a, b] = pair else { return None };
            let [near, far] = [a, b].map(|p| p.seen_m.length());
            let missing = b.slot.checked_sub(a.slot + 1).filter(|_| a.ring == b.ring)?;
            let is_same = (near - far).abs() < SAME_SURFACE * near.min(far);
            (is_same && missing <= LONGEST_GAP).then_some(((near + far) / 2.0, missing))
        });
        let gaps = gaps.collect();
        let ranges_m = placed.iter().map(|p| p.seen_m.length()).collect();
        let sequences = placed.iter().map(|p| p.slot + 1).max().unwrap_or(0);
        let mut near_m = BTreeMap::<_, Vec<f64>>::new();
        for p in placed.iter().filter(|p| p.seen_m.length() < NEAR_M) {
            near_m.entry((p.ring, p.slot / DIRECTION)).or_default().push(p.seen_m.length());
        }
        let near_m = near_m.into_values().filter(|ranges| ranges.len() > 5).collect();
        let mut by_patch = BTreeMap::<_, Vec<Placed>>::new();
        for p in placed {
            by_patch.entry((p.ring / PATCH[0], p.slot / PATCH[1])).or_default().push(p);
        }
        let patches = by_patch.values().filter_map(|patch| Patch::of(patch)).collect();
        Self { patches, gaps, ranges_m, counts, sequences, near_m }
    }

    /// How well ranges agree with multiples of `quantum_m` and a rest that is common to
    /// one direction, since the origin is known to millimetres only: 1 if they all do, 0 on average
    /// if there is no such quantum.
    pub fn coherence(&self, quantum_m: f64) -> f64 {
        let (mut pairs, mut returns) = (0.0, 0.0);
        for ranges_m in &self.near_m {
            let n = ranges_m.len() as f64;
            let turns = ranges_m.iter().map(|r| (TAU * r / quantum_m).sin_cos());
            let (sin, cos) = turns.fold((0.0, 0.0), |(s, c), (sin, cos)| (s + sin, c + cos));
            pairs += (sin * sin + cos * cos - n) / (n - 1.0);
            returns += n;
        }
        pairs / returns
    }
}

/// The returns by ring, and in each by firing sequence.
fn place(returns: &[Return], mounting: &Mounting, table: &Rotating) -> Vec<Placed> {
    let mut rank = vec![0; table.beam.len()];
    let mut order: Vec<usize> = (0..rank.len()).collect();
    order.sort_by(|&a, &b| table.beam[a].elevation_deg.total_cmp(&table.beam[b].elevation_deg));
    order.iter().zip(0..).for_each(|(&row, ring)| rank[row] = ring);
    let sequences = |r: &Return| {
        (r.time_s * 1e6 - table.beam[mounting.rows[r.laser]].firing_us) / table.sequence_us
    };
    let phases = returns.iter().map(|r| (TAU * sequences(r)).sin_cos());
    let (sines, cosines) = phases.fold((0.0, 0.0), |(s, c), (sin, cos)| (s + sin, c + cos));
    let phase = sines.atan2(cosines) / TAU;
    let number = |r: &Return| (sequences(r) - phase).round();
    let first = returns.iter().map(number).fold(f64::INFINITY, f64::min);
    let place = |r: &Return| {
        let seen_m = mounting.seen_m(r);
        let steps_m = DVec3::from_array(r.position_m.to_array().map(step_m));
        let rounding_m2 = (seen_m.normalize() * steps_m).length_squared() / 12.0;
        let (ring, slot) = (rank[mounting.rows[r.laser]], (number(r) - first) as usize);
        Placed { ring, slot, seen_m, rounding_m2 }
    };
    let mut placed: Vec<Placed> = returns.iter().map(place).collect();
    placed.sort_by_key(|p| (p.ring, p.slot));
    placed
}

/// The step of a half float at `x_m`, in which Argoverse 2's files hold coordinates:
/// 10 bits behind the leading one.
fn step_m(x_m: f64) -> f64 {
    (x_m.abs().max(1e-3).log2().floor() - 10.0).exp2()
}

impl Patch {
    /// The plane of least squares through `patch`, if it is flat.
    fn of(patch: &[Placed]) -> Option<Self> {
        let n = patch.len() as f64;
        let rings = 1 + patch.windows(2).filter(|pair| pair[0].ring != pair[1].ring).count();
        if patch.len() < MIN_RETURNS || rings < PATCH[0] {
            return None;
        }
        let centre = patch.iter().map(|p| p.seen_m).sum::<DVec3>() / n;
        let mut spread = Matrix3::<f64>::zeros();
        for p in patch {
            let d = (p.seen_m - centre).to_array();
            (0..3).for_each(|i| (0..3).for_each(|j| spread[(i, j)] += d[i] * d[j]));
        }
        let eigen = SymmetricEigen::new(spread);
        let least = eigen.eigenvalues.imin();
        let normal = DVec3::from_slice(eigen.eigenvectors.column(least).as_slice());
        let off_m2 = eigen.eigenvalues[least] / (n - 3.0);
        let farthest_m =
            patch.iter().map(|p| (p.seen_m - centre).dot(normal).abs()).fold(0.0, f64::max);
        // Four standard deviations: beyond, something else is in the patch.
        if off_m2.sqrt() > FLAT_M || farthest_m > 4.0 * off_m2.sqrt() {
            return None;
        }
        let cosine = patch.iter().map(|p| p.seen_m.normalize().dot(normal).abs()).sum::<f64>() / n;
        let beyond_m =
            |p: &Placed| p.seen_m.length() - centre.dot(normal) / p.seen_m.normalize().dot(normal);
        let bends =
            patch.windows(3).filter(|t| t[0].ring == t[2].ring && t[0].slot + 2 == t[2].slot);
        let bends: Vec<f64> =
            bends.map(|t| beyond_m(&t[0]) - 2.0 * beyond_m(&t[1]) + beyond_m(&t[2])).collect();
        // Of independent errors, a second difference has 1 + 4 + 1 times the variance.
        let bend_m2 = bends.iter().map(|b| b * b).sum::<f64>() / bends.len().max(1) as f64;
        let rounding_m2 = patch.iter().map(|p| p.rounding_m2).sum::<f64>() / n;
        (bends.len() >= 8).then(|| Self {
            range_m: patch.iter().map(|p| p.seen_m.length()).sum::<f64>() / n,
            incidence_deg: cosine.min(1.0).acos().to_degrees(),
            next_m2: bend_m2 / 6.0 - rounding_m2,
            plane_m2: off_m2 / (cosine * cosine) - rounding_m2,
        })
    }
}

/// Standard deviation of the middle one of some variances, millimetres.
pub fn typical_mm(variances_m2: Vec<f64>) -> f64 {
    1e3 * quantile(variances_m2, 0.5).max(0.0).sqrt()
}
