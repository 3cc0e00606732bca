//! Cases of what a sweep is cut into.

use edgepuck_segment::{Label, Segmenter, Settings, Sweep as Input};
use serde::Deserialize;

/// A sweep, by parts that are listed or made by a rule, and how many of its points are
/// what.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sweep {
    /// Points as they are, on the lowest ring.
    #[serde(default)]
    points: Vec<[f32; 3]>,
    /// A sensor of 32 rings, -25 to 6 degrees, over even ground that is this high, metres.
    ground_z: Option<f64>,
    /// The same sensor within an upright pipe of this radius, metres.
    pipe_m: Option<f64>,
    /// How often each ring is fired in a turn.
    #[serde(default = "columns")]
    columns: usize,
    /// Whether the points come with their rings.
    #[serde(default = "yes")]
    rings: bool,
    /// Points that are ground.
    ground: usize,
    /// Points of each cluster.
    clusters: Vec<usize>,
    /// Points that are in no cluster, because there are too few of them or too many.
    small: usize,
    /// Points that are nothing.
    invalid: usize,
}

fn columns() -> usize {
    1800
}

fn yes() -> bool {
    true
}

const RINGS: u16 = 32;

impl Sweep {
    /// Cuts the sweep, twice: what is left in memory changes nothing.
    pub fn check(&self) {
        let (mut points, mut rings) = (self.points.clone(), vec![0; self.points.len()]);
        let mut add = |ring, point: [f64; 3]| {
            points.push(point.map(|x| x as f32));
            rings.push(ring);
        };
        for column in 0..self.columns {
            let azimuth = std::f64::consts::TAU * column as f64 / self.columns as f64;
            for ring in 0..RINGS {
                let rise = (f64::from(ring) - 25.0).to_radians().tan();
                let mut at =
                    |range| add(ring, [range * azimuth.cos(), range * azimuth.sin(), range * rise]);
                if let Some(z) = self.ground_z.filter(|z| z * rise > 0.0) {
                    at(z / rise);
                }
                if let Some(radius) = self.pipe_m {
                    at(radius);
                }
            }
        }
        let sweep = Input { points: &points, rings: self.rings.then_some(&rings[..]) };
        let mut segmenter = Segmenter::new(Settings::default()).unwrap();
        for _ in 0..2 {
            let found = segmenter.segment(&sweep).unwrap();
            let n = |label| found.labels().iter().filter(|found| **found == label).count();
            let clusters: Vec<_> = found.clusters().map(|cluster| cluster.points.len()).collect();
            assert_eq!(
                (n(Label::Ground), clusters, n(Label::Small), n(Label::Invalid)),
                (self.ground, self.clusters.clone(), self.small, self.invalid),
                "points of ground, of each cluster, of none, and invalid ones, found and expected"
            );
        }
    }
}
