//! The figures of a sensor from a recording at rest.

use super::directions::{Direction, directions};
use super::estimate::{Estimate, missing, repeatability};
use super::firings::Recording;
use super::median::median;
use super::quantum::quantum;
use super::turning::{Turning, turning};

/// Bounds of the bins of range, metres.
const BINS_M: [f64; 8] = [0.0, 2.0, 5.0, 10.0, 20.0, 40.0, 80.0, f64::INFINITY];

/// A jump of a range is larger than this many standard deviations, and than 10 cm and 2 %.
const JUMP: f64 = 8.0;

/// The fewest directions that return turn after turn.
const LEAST_DIRECTIONS: usize = 100;

/// In this share of directions, something may change; the sensor and the scene are at rest.
pub const STILL: f64 = 0.01;

/// Where something changes in more directions, or ranges drift more, the scene is another one.
const CHANGED: f64 = 0.2;
const DRIFT: f64 = 1.3;

/// Ranges that drift less do not spoil the figures; a scene at rest has 0.8 to 1.05.
pub const STEADY: f64 = 1.12;

pub struct Figures {
    pub n_directions: usize,
    /// The share of directions in which a range jumps.
    pub jumping: Estimate,
    /// The median over directions of how far ranges drift; 1 at rest.
    pub drift: f64,
    pub repeatability_m: Estimate,
    pub missing: Estimate,
    pub bins: Vec<Part>,
    pub rings: Vec<Part>,
    pub quantum_m: Option<Estimate>,
    pub turning: Option<Turning>,
    /// Least and largest range of the directions that usually return, metres.
    pub ranges_m: [f64; 2],
}

/// The figures of some directions.
pub struct Part {
    pub name: String,
    pub repeatability_m: Option<Estimate>,
    pub missing: Option<Estimate>,
}

/// Measures a `recording`, or says why it is not one of a sensor and a scene at rest.
pub fn figures(recording: &Recording) -> Result<Figures, String> {
    let ranges_m = recording.rings.iter().flat_map(|ring| &ring.firings).map(|it| it.range_m);
    let quantum_m = quantum(ranges_m.filter(|range_m| !range_m.is_nan()).collect());
    let unit_m = quantum_m.map_or(0.0, |quantum| quantum.value);
    let mut all = Vec::new();
    for ring in &recording.rings {
        let first_block = all.last().map_or(0, |last: &Direction| last.block + 1);
        all.extend(directions(ring, recording.start, recording.n_turns, first_block));
    }
    let inner: Vec<&Direction> = all.iter().filter(|direction| direction.is_inner).collect();
    let few = format!(
        "expected {LEAST_DIRECTIONS} directions or more with returns from the same surface turn after \
         turn, found {}: does the sensor or the scene move, or does it see too little?",
        inner.len()
    );
    let spread = repeatability(&inner, unit_m).filter(|_| inner.len() >= LEAST_DIRECTIONS);
    let spread = spread.ok_or(few)?;
    let mut drifts: Vec<f64> =
        inner.iter().map(|direction| direction.drift).filter(|drift| !drift.is_nan()).collect();
    let drift = median(&mut drifts).unwrap_or(1.0);
    let jumps = |direction: &&Direction| {
        let limit_m = (JUMP * spread.high.max(unit_m)).max(0.1 + 0.02 * direction.range_m);
        direction.differences_m.iter().any(|difference| difference.abs() > limit_m)
    };
    let n_jumping = inner.iter().filter(|direction| jumps(direction)).count();
    let (low, high) = formats::interval::wilson(n_jumping, inner.len());
    let n = inner.len();
    let jumping = Estimate { value: n_jumping as f64 / n as f64, low, high, n };
    if drift > DRIFT || jumping.value > CHANGED {
        return Err(format!(
            "expected a sensor and a scene at rest, found ranges that jump in {:.0} % of directions \
             and, in half of them, drift to {drift:.1} times the variance from turn to turn: record \
             while nothing moves",
            100.0 * jumping.value
        ));
    }
    let still: Vec<&Direction> = inner.into_iter().filter(|direction| !jumps(direction)).collect();
    // What noise bends, and a millimetre. The mean of normal deviates is independent of their spread,
    // so that this does not choose by it.
    let flat_m = 1e-3 + 2.0 * spread.value / (recording.n_turns as f64).sqrt();
    let is_flat = |direction: &&&Direction| direction.bend_m <= flat_m;
    let repeatability = |directions: &[&Direction]| {
        repeatability(&directions.iter().filter(is_flat).copied().collect::<Vec<_>>(), unit_m)
    };
    let part = |name: String, directions: &[&Direction]| Part {
        name,
        repeatability_m: repeatability(directions),
        missing: missing(directions),
    };
    let bins = BINS_M.windows(2).map(|ends| {
        let is_in = |direction: &&&Direction| (ends[0]..ends[1]).contains(&direction.range_m);
        let name = match ends[1].is_finite() {
            true => format!("{} to {} m", ends[0], ends[1]),
            false => format!("{} m and more", ends[0]),
        };
        part(name, &still.iter().filter(is_in).copied().collect::<Vec<_>>())
    });
    let rings = recording.rings.iter().map(|ring| {
        let is_of = |direction: &&&Direction| direction.ring == ring.number;
        let name = format!("ring {}", ring.number);
        part(name, &still.iter().filter(is_of).copied().collect::<Vec<_>>())
    });
    let ends = still.iter().map(|direction| direction.range_m);
    let measured = |part: &Part| part.repeatability_m.is_some() || part.missing.is_some();
    Ok(Figures {
        n_directions: still.len(),
        jumping,
        drift,
        repeatability_m: repeatability(&still).unwrap_or(spread),
        missing: missing(&still).ok_or("expected 100 firings or more, found fewer")?,
        bins: bins.filter(measured).collect(),
        rings: rings.filter(measured).collect(),
        quantum_m,
        turning: turning(recording),
        ranges_m: ends.fold([f64::INFINITY, 0.0], |[a, b], range| [a.min(range), b.max(range)]),
    })
}
