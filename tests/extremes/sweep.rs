use edgepuck_segment::{Label, Segmenter, Settings, Sweep as Input};
use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sweep {
    /// Listed points, on the lowest ring.
    #[serde(default)]
    points: Vec<[f32; 3]>,
    /// The height of flat ground below a sensor with 32 rings from -25 to 6 degrees, metres.
    ground_z: Option<f64>,
    /// The radius of an upright pipe around the same sensor, metres.
    pipe_m: Option<f64>,
    /// Number of firings of each ring in a revolution.
    #[serde(default = "columns")]
    columns: usize,
    #[serde(default = "yes")]
    rings: bool,
    ground: usize,
    clusters: Vec<usize>,
    /// Expected number of points in no cluster, because it would be too small or too large.
    small: usize,
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
    /// Segments the sweep twice, to show that the state in memory changes nothing.
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
