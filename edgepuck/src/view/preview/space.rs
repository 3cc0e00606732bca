//! Which part of space a picture shows, and from where.

use crate::view::frame::Placed;
use formats::Scan;
use sim_gpu::glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_3};

/// Pixels between what is shown and the edges.
const MARGIN: f64 = 40.0;
/// The least edge of a picture, and its largest width and height, pixels.
const LEAST_EDGE: f64 = 300.0;
const MOST: DVec2 = DVec2::new(1000.0, 800.0);
/// Of a sweep's points the share that its picture shows at least: a few are far from all others.
const SHOWN: f64 = 0.95;
/// Points that span less around their sensor are no sweep.
const LEAST_SWEEP_M: f64 = 8.0;

/// A box along the axes, metres.
#[derive(Clone, Copy, Debug)]
pub struct Region {
    low: DVec3,
    high: DVec3,
}

impl Region {
    pub const ALL: Self = Self { low: DVec3::MIN, high: DVec3::MAX };

    /// What is near the sensor of a sweep, with the boxes up to twice as far; the rest would make the picture
    /// all road.
    pub fn near_sensor(sensor_m: DVec3, scan: &Scan, boxes: &[Placed]) -> Self {
        let away_m = |at: DVec3| (at - sensor_m).truncate().length();
        let mut of_points: Vec<f64> = points(scan).map(away_m).filter(|m| m.is_finite()).collect();
        of_points.sort_unstable_by(f64::total_cmp);
        let last = (SHOWN * of_points.len().saturating_sub(1) as f64) as usize;
        let near_m = 1.1 * of_points.get(last).copied().unwrap_or_default();
        let of_boxes = boxes.iter().map(|placed| away_m(placed.place.centre_m.into()) + 5.0);
        let reach_m = of_boxes.filter(|m| *m <= 2.0 * near_m).fold(near_m, f64::max);
        Self { low: sensor_m - reach_m, high: sensor_m + reach_m }
    }

    /// The bounds of the places that `whole` holds, if there are any.
    pub fn around(places: impl Iterator<Item = DVec3>, whole: Self) -> Option<Self> {
        let held = places.filter(|at| whole.holds(*at)).map(|at| Self { low: at, high: at });
        held.reduce(|all, at| Self { low: all.low.min(at.low), high: all.high.max(at.high) })
    }

    /// Its longest side, metres.
    pub fn span(&self) -> f64 {
        (self.high - self.low).max_element()
    }

    /// With half of its size on each side.
    pub fn grown(self) -> Self {
        let room = 0.5 * self.span();
        Self { low: self.low - room, high: self.high + room }
    }

    /// Whether it holds a place; none holds one that is not finite.
    pub fn holds(&self, at: DVec3) -> bool {
        at.is_finite() && at.cmpge(self.low).all() && at.cmple(self.high).all()
    }
}

/// The points of a scan, from its origin.
pub fn points(scan: &Scan) -> impl Iterator<Item = DVec3> {
    scan.positions.iter().map(|at| DVec3::from(at.map(f64::from)))
}

fn sensor_m(scan: &Scan) -> DVec3 {
    DVec3::from(scan.sensor_position_m()) - DVec3::from(scan.origin)
}

/// The place of the sensor if `scan` is a sweep around it.
pub fn sensor_of_sweep(scan: &Scan) -> Option<DVec3> {
    let (sensor_m, bounds) = (sensor_m(scan), Region::around(points(scan), Region::ALL)?);
    let size = bounds.high - bounds.low;
    let across = size.x.max(size.y);
    let is_around = bounds.holds(sensor_m.with_z(bounds.low.z));
    (is_around && across > LEAST_SWEEP_M && across > 3.0 * size.z).then_some(sensor_m)
}

/// A view without perspective.
pub struct View {
    /// Unit vectors to the right, upwards and towards the viewer.
    axes: [DVec3; 3],
    /// The middle of the picture along the axes, metres.
    middle: DVec2,
    pub pixels_per_m: f64,
    /// Width and height, pixels.
    pub size: DVec2,
}

impl View {
    /// A view of `places`. A sweep is seen from above at an angle; all else from a little above and beside the
    /// sensor of `scan`, where that is known.
    pub fn of(places: &[DVec3], scan: &Scan, is_sweep: bool) -> Self {
        let bounds = Region::around(places.iter().copied(), Region::ALL);
        let bounds = bounds.unwrap_or(Region { low: DVec3::ZERO, high: DVec3::ZERO });
        let to_sensor = sensor_m(scan) - 0.5 * (bounds.low + bounds.high);
        let (aside_rad, up_rad) = match (is_sweep, scan.pose) {
            (true, _) => (-FRAC_PI_2, 55_f64.to_radians()),
            (false, None) => (-FRAC_PI_3, 25_f64.to_radians()),
            (false, Some(_)) => {
                let to_sensor_rad = libm::atan2(to_sensor.y, to_sensor.x);
                (to_sensor_rad - 35_f64.to_radians(), 25_f64.to_radians())
            }
        };
        let axes = axes(aside_rad, up_rad);
        let flat = places.iter().map(|at| DVec2::new(axes[0].dot(*at), axes[1].dot(*at)));
        let limits =
            flat.map(|at| [at, at]).reduce(|[low, high], [at, _]| [low.min(at), high.max(at)]);
        let [low, high] = limits.unwrap_or([DVec2::ZERO; 2]);
        let extent = (high - low).max(DVec2::splat(1e-6));
        let around = DVec2::splat(2.0 * MARGIN);
        let pixels_per_m = ((MOST - around) / extent).min_element();
        let size = (pixels_per_m * extent + around).max(DVec2::splat(LEAST_EDGE));
        Self { axes, middle: 0.5 * (low + high), pixels_per_m, size: size.round() }
    }

    /// Where a place is in the picture: pixels to the right, pixels downwards, and nearness in metres.
    pub fn pixel(&self, at: DVec3) -> DVec3 {
        let [right, up, near] = self.axes.map(|axis| axis.dot(at));
        let from_middle = self.pixels_per_m * (DVec2::new(right, up) - self.middle);
        (0.5 * self.size + from_middle * DVec2::new(1.0, -1.0)).extend(near)
    }

    /// How bright a surface with this normal is, 0 to 1, on either side: light comes from the viewer's left
    /// and from above.
    pub fn brightness(&self, normal: DVec3) -> f64 {
        const DARKEST: f64 = 0.45;
        let light = (self.axes[2] - 0.4 * self.axes[0] + DVec3::Z).normalize();
        DARKEST + (1.0 - DARKEST) * normal.dot(light).abs()
    }
}

/// The axes of a viewer in this direction, counterclockwise from x and then upwards.
fn axes(aside_rad: f64, up_rad: f64) -> [DVec3; 3] {
    let (sin, cos) = libm::sincos(aside_rad);
    let right = DVec3::new(-sin, cos, 0.0);
    let ahead = DVec3::new(cos, sin, 0.0);
    let near = libm::cos(up_rad) * ahead + libm::sin(up_rad) * DVec3::Z;
    [right, near.cross(right), near]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The corners of a plate of 20 m, this far from the sensor.
    fn plate(x_m: f32) -> Scan {
        let corners = [[-10.0, -10.0], [10.0, -10.0], [10.0, 10.0], [-10.0, 10.0]];
        let positions = corners.map(|[x, y]| [x + x_m, y, 0.0]).to_vec();
        Scan { positions, ..Scan::default() }
    }

    #[test]
    fn points_around_their_sensor_are_a_sweep() {
        assert_eq!(sensor_of_sweep(&plate(0.0)), Some(DVec3::ZERO));
        assert_eq!(sensor_of_sweep(&plate(1e5)), None);
        // An object of 1 m around its origin.
        let mut object = plate(0.0);
        object.positions.iter_mut().for_each(|at| *at = at.map(|x| x / 20.0));
        assert_eq!(sensor_of_sweep(&object), None);
    }

    #[test]
    fn the_picture_of_a_sweep_holds_its_farthest_points() {
        let scan = plate(3.0);
        let region = Region::near_sensor(sensor_of_sweep(&scan).unwrap(), &scan, &[]);
        // However near or far they are.
        assert!(!region.holds(DVec3::splat(30.0)));
        let places: Vec<_> = points(&scan).collect();
        assert!(places.iter().all(|at| region.holds(*at)));
        let view = View::of(&places, &scan, true);
        for pixel in places.iter().map(|at| view.pixel(*at).truncate()) {
            let room = [pixel, view.size - pixel];
            // The size is a whole number of pixels.
            assert!(room.iter().all(|room| room.min_element() >= MARGIN - 1.0), "{pixel}");
        }
    }

    #[test]
    fn a_sweep_is_seen_from_behind_and_an_object_from_where_its_sensor_was() {
        let mut scan = plate(3.0);
        let places: Vec<_> = points(&scan).collect();
        let view = View::of(&places, &scan, true);
        // From behind along y, 55 degrees above: right, down and near in pixels and metres.
        let (sin, cos) = libm::sincos(55_f64.to_radians());
        let middle = view.pixel(DVec3::ZERO);
        for (axis, [right, down, near]) in [
            (DVec3::X, [1.0, 0.0, 0.0]),
            (DVec3::Y, [0.0, -sin, -cos]),
            (DVec3::Z, [0.0, -cos, sin]),
        ] {
            let pixels = DVec3::new(right * view.pixels_per_m, down * view.pixels_per_m, near);
            assert!((view.pixel(axis) - middle).distance(pixels) < 1e-9, "{axis}");
        }
        let at_m = DVec3::new(-20.0, 5.0, 2.0);
        scan.pose = Some(formats::geometry::Pose::at(at_m.to_array()).matrix());
        let view = View::of(&places, &scan, false);
        let nearest = places.iter().map(|at| view.pixel(*at).z).fold(f64::MIN, f64::max);
        assert!(view.pixel(at_m).z > nearest);
    }
}
