//! A LiDAR over simple surfaces, whose returns follow in closed form.

use edgepuck_segment::{Label, Segmentation, Segmenter, Settings, Sweep};

/// Elevations of a VLP-32C in degrees, ascending (VeloView-VLP-32C.yaml).
pub const VLP32C: [f64; 32] = [
    -25.0, -15.639, -11.31, -8.843, -7.254, -6.148, -5.333, -4.667, -4.0, -3.667, -3.333, -3.0,
    -2.667, -2.333, -2.0, -1.667, -1.333, -1.0, -0.667, -0.333, 0.0, 0.333, 0.667, 1.0, 1.333,
    1.667, 2.333, 3.333, 4.667, 7.0, 10.333, 15.0,
];

/// Height of the sensor over flat ground in metres.
pub const HEIGHT: f64 = 1.8;

/// The distance along a beam's direction to a surface.
pub type Surface = Box<dyn Fn([f64; 3]) -> Option<f64>>;

/// Ground through `(0, 0, -HEIGHT)` that climbs by `slope` along x, where `is_there` accepts x and
/// y; `step` higher than that.
pub fn ground(slope: f64, step: f64, is_there: impl Fn(f64, f64) -> bool + 'static) -> Surface {
    Box::new(move |[x, y, z]| {
        let distance = (step - HEIGHT) / (z - slope * x);
        let is_hit = distance > 0.0 && is_there(distance * x, distance * y);
        is_hit.then_some(distance)
    })
}

pub fn flat() -> Surface {
    ground(0.0, 0.0, |_, _| true)
}

/// A box that stands `above` the flat ground, given by its middle, its size and its height.
pub fn block(middle: [f64; 2], size: [f64; 2], above: f64, height: f64) -> Surface {
    let low = [middle[0] - size[0] / 2.0, middle[1] - size[1] / 2.0, above - HEIGHT];
    let high = [middle[0] + size[0] / 2.0, middle[1] + size[1] / 2.0, above + height - HEIGHT];
    Box::new(move |beam| {
        let (mut enter, mut leave) = (0.0f64, f64::INFINITY);
        for axis in 0..3 {
            let ends = [low[axis] / beam[axis], high[axis] / beam[axis]];
            enter = enter.max(ends[0].min(ends[1]));
            leave = leave.min(ends[0].max(ends[1]));
        }
        (enter <= leave).then_some(enter)
    })
}

pub struct Scan {
    pub points: Vec<[f32; 3]>,
    pub rings: Vec<u16>,
    pub surfaces: Vec<usize>,
}

/// Scans `surfaces` up to 100 m with rings at `elevations_deg` and azimuth steps of 0.2 degrees.
pub fn scan(elevations_deg: &[f64], surfaces: &[Surface]) -> Scan {
    let mut scan = Scan { points: vec![], rings: vec![], surfaces: vec![] };
    for step in 0..1800 {
        for (ring, elevation) in elevations_deg.iter().enumerate() {
            // A step between two columns, so that rounding decides nothing.
            let (sin, cos) = ((f64::from(step) + 0.5) * 0.2).to_radians().sin_cos();
            let (up, flat) = elevation.to_radians().sin_cos();
            let beam = [flat * cos, flat * sin, up];
            let hits =
                surfaces.iter().enumerate().filter_map(|(i, surface)| Some((surface(beam)?, i)));
            let nearest = hits.min_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((distance, surface)) = nearest.filter(|hit| hit.0 < 100.0) {
                scan.points.push(beam.map(|x| (distance * x) as f32));
                scan.rings.push(ring as u16);
                scan.surfaces.push(surface);
            }
        }
    }
    scan
}

impl Scan {
    /// Segments the scan by the default settings, with its rings and without, and hands both
    /// results to `check`.
    pub fn check(&self, check: impl Fn(&Segmentation)) {
        for rings in [Some(&self.rings[..]), None] {
            let mut segmenter = Segmenter::new(Settings::default()).unwrap();
            check(segmenter.segment(&Sweep { points: &self.points, rings }).unwrap());
        }
    }

    /// The share of the points of `surface` whose label `is_it` accepts.
    pub fn share(
        &self,
        segmentation: &Segmentation,
        surface: usize,
        is_it: impl Fn(Label) -> bool,
    ) -> f64 {
        let labels = segmentation.labels().iter().zip(&self.surfaces);
        let labels: Vec<_> = labels.filter(|(_, on)| **on == surface).map(|(l, _)| *l).collect();
        assert!(!labels.is_empty(), "no point on surface {surface}");
        labels.iter().filter(|label| is_it(**label)).count() as f64 / labels.len() as f64
    }

    pub fn surfaces_of_clusters(&self, segmentation: &Segmentation) -> Vec<Vec<usize>> {
        let surfaces = segmentation.clusters().map(|cluster| {
            let mut on: Vec<_> =
                cluster.points.iter().map(|&point| self.surfaces[point as usize]).collect();
            on.sort_unstable();
            on.dedup();
            on
        });
        surfaces.collect()
    }
}
