//! Which part of space a picture shows, and from where.

use formats::Scan;
use sim_gpu::glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_3};

/// Pixels between what is shown and the edges.
const MARGIN: f64 = 40.0;
/// The least edge of a picture, and its largest width and height, pixels.
const LEAST_EDGE: f64 = 300.0;
const MOST: DVec2 = DVec2::new(1000.0, 800.0);
/// What is farther from the sensor is left out of a sweep's picture.
const FARTHEST_M: f64 = 50.0;
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

    /// What is near the sensor of a sweep; the rest would make the picture all road.
    pub fn near_sensor(sensor_m: DVec3) -> Self {
        Self { low: sensor_m - FARTHEST_M, high: sensor_m + FARTHEST_M }
    }

    /// The bounds of the places that `whole` holds, if there are any.
    pub fn around(places: impl Iterator<Item = DVec3>, whole: Self) -> Option<Self> {
        let held = places.filter(|at| whole.holds(*at)).map(|at| Self { low: at, high: at });
        held.reduce(|all, at| Self { low: all.low.min(at.low), high: all.high.max(at.high) })
    }

    /// With half of its size on each side.
    pub fn grown(self) -> Self {
        let room = 0.5 * (self.high - self.low).max_element();
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

    /// A view from above: x to the right, y upwards, at 10 pixels per metre.
    fn from_above() -> View {
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        View {
            axes,
            middle: DVec2::new(1.0, 2.0),
            pixels_per_m: 10.0,
            size: DVec2::new(400.0, 300.0),
        }
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
        let region = Region::near_sensor(sensor_of_sweep(&scan).unwrap());
        let places: Vec<_> = points(&scan).collect();
        assert!(places.iter().all(|at| region.holds(*at)));
        let view = View::of(&places, &scan, true);
        for pixel in places.iter().map(|at| view.pixel(*at).truncate()) {
            let room = [pixel, view.size - pixel];
            // The size is a whole number of pixels.
            assert!(room.iter().all(|room| room.min_element() >= MARGIN - 1.0), "{pixel}");
        }
    }

    /// (1, 2) is in the middle, at (200, 150).
    #[test]
    fn places_are_projected_along_the_axes_of_the_viewer() {
        for (at, pixel) in
            [([1.0, 2.0, 5.0], [200.0, 150.0, 5.0]), ([3.0, 1.0, 0.0], [220.0, 160.0, 0.0])]
        {
            assert_eq!(from_above().pixel(at.into()).to_array(), pixel);
        }
        // A viewer in the direction of -y, 55 degrees upwards.
        let (sin, cos) = libm::sincos(55_f64.to_radians());
        let [right, up, near] = axes(-FRAC_PI_2, 55_f64.to_radians());
        for (found, expected) in
            [(right, DVec3::X), (up, DVec3::new(0.0, sin, cos)), (near, DVec3::new(0.0, -cos, sin))]
        {
            assert!(found.distance(expected) < 1e-15, "{found} beside {expected}");
        }
    }

    #[test]
    fn turned_box_is_turned_from_above() {
        // 4 m long to the left, 2 m wide.
        let placed = formats::geometry::OrientedBox {
            centre_m: [1.0, 2.0, 0.5],
            size_m: [4.0, 2.0, 1.0],
            yaw_rad: FRAC_PI_2,
        };
        let found = placed.corners().map(|corner| from_above().pixel(corner).truncate());
        for corner in [[190.0, 130.0], [210.0, 130.0], [190.0, 170.0], [210.0, 170.0]] {
            let n = found.iter().filter(|at| at.distance(corner.into()) < 1e-9).count();
            assert_eq!(n, 2, "{corner:?}: {found:?}");
        }
    }
}
