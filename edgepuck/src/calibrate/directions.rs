//! What a sensor measured in each direction, turn after turn.

use super::firings::{Firing, Ring};
use super::median::median;

/// The closest firing of a turn lies within this share of a step.
const NEAR: f64 = 0.55;

/// A firing this close to a direction, in steps, is taken as it is: as in sensors that fire at the
/// same angles in each turn.
const SAME: f64 = 0.02;

/// Neighbours whose ranges differ by more than this, and more than 5 %, are on different surfaces.
const STEP_M: f64 = 0.2;

/// Directions in a block, whose errors may hang together: neighbours share firings.
const BLOCK: usize = 16;

/// A direction of one laser.
pub struct Direction {
    pub ring: u16,
    /// The number of its block.
    pub block: usize,
    /// Median range of its returns, metres.
    pub range_m: f64,
    /// Turns in which the laser was fired in this direction, and those of them without a return: each
    /// counts if it returned in most of the others, so that none is chosen by its own outcome.
    pub n_fired: usize,
    pub n_missing: usize,
    /// Whether it usually returns, and its neighbours on the ring do so from the same surface.
    pub is_inner: bool,
    /// How far its mean range lies off the line between those of its neighbours, metres: where
    /// surfaces bend, the range between two firings is not known.
    pub bend_m: f64,
    /// The differences of the range from one turn to the next, metres, each divided by the standard
    /// deviation that it has if ranges have that of 1.
    pub differences_m: Vec<f64>,
    /// How far the range drifts: its variance over that which the differences tell. About 1 at rest.
    pub drift: f64,
}

/// The directions of `ring` as the first of `n_turns` turns has them, and blocks from `first_block`.
pub fn directions(ring: &Ring, start: f64, n_turns: usize, first_block: usize) -> Vec<Direction> {
    let firings = &ring.firings;
    let n_first = firings.partition_point(|firing| firing.turns < start + 1.0);
    let mut next = vec![0; n_turns];
    let mut found: Vec<Direction> = Vec::with_capacity(n_first);
    let mut means = Vec::with_capacity(n_first);
    for (i, reference) in firings[..n_first].iter().enumerate() {
        let (mut ranges, mut series) = (Vec::new(), Vec::with_capacity(n_turns));
        let (mut n_fired, mut n_missing) = (0, 0);
        for (turn, next) in (0u32..).zip(&mut next) {
            let angle = reference.turns + f64::from(turn);
            // The first firing beyond the angle: angles grow from direction to direction.
            *next += firings[*next..].partition_point(|firing| firing.turns <= angle);
            let pair = [next.checked_sub(1), Some(*next)].map(|at| firings.get(at?));
            let near = pair
                .into_iter()
                .flatten()
                .min_by(|a, b| (a.turns - angle).abs().total_cmp(&(b.turns - angle).abs()));
            let near = near.filter(|near| (near.turns - angle).abs() < NEAR * ring.step);
            if let Some(near) = near {
                n_fired += 1;
                n_missing += usize::from(near.range_m.is_nan());
                ranges.extend((!near.range_m.is_nan()).then_some(near.range_m));
            }
            series.push(range_at(angle, pair, ring.step));
        }
        let range_m = median(&mut ranges).unwrap_or(f64::NAN);
        let known: Vec<f64> = series.iter().flatten().map(|[range, _]| *range).collect();
        means.push(known.iter().sum::<f64>() / known.len() as f64);
        let differences_m = series.windows(2).filter_map(|pair| {
            let ([a, b], [c, d]) = (pair[0]?, pair[1]?);
            Some((c - a) / (b + d).sqrt())
        });
        let usually_returns = |n_missing: usize| 2 * n_missing + 1 < n_fired;
        found.push(Direction {
            ring: ring.number,
            block: first_block + i / BLOCK,
            range_m,
            n_fired: n_missing + if usually_returns(n_missing) { n_fired - n_missing } else { 0 },
            n_missing,
            is_inner: usually_returns(n_missing.saturating_sub(1)) && 2 * n_fired > n_turns,
            bend_m: f64::INFINITY,
            differences_m: differences_m.collect(),
            drift: drift(&known),
        });
    }
    let is_usual: Vec<bool> = found.iter().map(|direction| direction.is_inner).collect();
    let ranges: Vec<f64> = found.iter().map(|direction| direction.range_m).collect();
    let n = found.len();
    for (i, direction) in found.iter_mut().enumerate() {
        let beside = [(i + n - 1) % n, (i + 1) % n];
        direction.bend_m = (means[i] - 0.5 * (means[beside[0]] + means[beside[1]])).abs();
        direction.is_inner &= beside
            .iter()
            .all(|&other| is_usual[other] && is_same_surface(ranges[i], ranges[other]));
    }
    found
}

/// The range at `angle` between the `pair` of firings around it, and its variance, where that of a
/// firing is 1.
fn range_at(angle: f64, pair: [Option<&Firing>; 2], step: f64) -> Option<[f64; 2]> {
    let alone = |firing: &Firing| (!firing.range_m.is_nan()).then_some([firing.range_m, 1.0]);
    let close = |firing: &&Firing| (firing.turns - angle).abs() < SAME * step;
    if let Some(same) = pair.into_iter().flatten().find(close) {
        return alone(same);
    }
    let [low, high] = [pair[0]?, pair[1]?];
    let gap = high.turns - low.turns;
    let [[a, _], [b, _]] = [alone(low)?, alone(high)?];
    if gap > 1.5 * step || !is_same_surface(a, b) {
        return None;
    }
    let share = (angle - low.turns) / gap;
    Some([a + share * (b - a), (1.0 - share).powi(2) + share.powi(2)])
}

fn is_same_surface(a: f64, b: f64) -> bool {
    (a - b).abs() <= STEP_M + 0.05 * a.min(b)
}

/// The variance of a series over half of its mean squared step (von Neumann 1941); NaN of one that
/// is short or does not vary.
fn drift(ranges: &[f64]) -> f64 {
    let n = ranges.len() as f64;
    if n < 5.0 {
        return f64::NAN;
    }
    let mean = ranges.iter().sum::<f64>() / n;
    let variance = ranges.iter().map(|range| (range - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let steps = ranges.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum::<f64>();
    variance / (0.5 * steps / (n - 1.0))
}
