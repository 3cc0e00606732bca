use super::cab::Cab;
use super::cargo::{Cargo, Space};
use crate::objects::car::wheel;
use crate::primitives::{Builder, Makes, Sampler, block_between, cylinder, dvec3, rod};

/// The makes, with their weights. They keep to the limits of Directive 96/53/EC: 12 m long, or 16.5
/// m with a semi-trailer; 2.55 m wide and 4 m high.
pub const MAKES: Makes = &[(4, delivery), (5, rigid), (3, articulated)];

/// The frame under a body: two rails, axles, and parts between the axles.
struct Frame {
    wheel_m: f64,
    half_width_m: f64,
    top_m: f64,
    rear_x: f64,
    front_x: f64,
}

impl Frame {
    /// Builds `cab` and its axle, and draws the frame behind it, whose top is in the range `top_m`.
    fn behind(
        cab: &Cab,
        b: &mut Builder,
        s: &mut Sampler,
        half_width_m: f64,
        [rear_x, front_x]: [f64; 2],
        top_m: [f64; 2],
    ) -> Self {
        cab.build(b, s);
        let top_m = s.within(top_m);
        let frame = Self { wheel_m: cab.wheel_m, half_width_m, top_m, rear_x, front_x };
        frame.axle(b, cab.axle_x, 1.0);
        frame
    }

    fn build(&self, b: &mut Builder, s: &mut Sampler, rear_axles: &[f64]) {
        let [low, high] = [self.top_m - 0.26, self.top_m];
        b.mirrored_y(|b| {
            block_between(b, dvec3(self.rear_x, 0.34, low), dvec3(self.front_x, 0.43, high));
        });
        for &x in rear_axles {
            self.axle(b, x, 2.0);
        }
        // The underrun protection.
        let y = 0.92 * self.half_width_m;
        block_between(b, dvec3(self.rear_x, -y, 0.42), dvec3(self.rear_x + 0.1, y, 0.56));
        if s.chance(0.7) {
            b.mirrored_y(|b| {
                for x in rear_axles {
                    let rear = x - self.wheel_m - 0.08;
                    let low = dvec3(rear, 0.55 * self.half_width_m, 0.3);
                    block_between(b, low, dvec3(rear + 0.02, y, self.top_m - 0.1));
                }
            });
        }
    }

    /// An axle with one wheel on each side, or with two (`twin` of 2).
    fn axle(&self, b: &mut Builder, x: f64, twin: f64) {
        let width_m = 0.62 * self.wheel_m * 0.5 * (1.0 + twin);
        let dish_m = if twin > 1.0 { 0.3 * self.wheel_m } else { 0.06 };
        for side in [-1.0, 1.0] {
            let at = dvec3(x, side * (self.half_width_m - 0.02), self.wheel_m);
            let size = [self.wheel_m, width_m, dish_m];
            b.shifted(at, |b| wheel::wheel(b, size, side));
        }
        let end = dvec3(x, self.half_width_m - 0.4, self.wheel_m);
        rod(b, end, end * dvec3(1.0, -1.0, 1.0), [0.09, 0.09]);
    }

    /// Tanks, boxes and guards between the axles.
    fn flanks(&self, b: &mut Builder, s: &mut Sampler, [from, to]: [f64; 2]) {
        let room_m = to - from;
        for side in [-1.0, 1.0] {
            let outer = side * self.half_width_m;
            if room_m > 0.8 && s.chance(0.7) {
                let length_m = s.uniform(0.5, 0.95) * room_m.min(1.6);
                let start = to - length_m - s.uniform(0.0, room_m - length_m);
                let low = dvec3(start, outer - side * 0.6, 0.42);
                block_between(b, low, dvec3(start + length_m, outer - side * 0.06, 0.95));
            }
            if room_m > 1.5 && s.chance(0.6) {
                for z in [0.5, 0.78] {
                    let low = dvec3(from, outer - side * 0.03, z);
                    block_between(b, low, dvec3(to, outer, z + 0.1));
                }
            }
        }
    }
}

/// A delivery truck of 3.5 to 7.5 t with a box, 5.5 to 8 m long.
fn delivery(b: &mut Builder, s: &mut Sampler) {
    let length_m = s.uniform(5.5, 8.0);
    let wheel_m = s.uniform(0.35, 0.42);
    let half_width_m = s.uniform(0.95, 1.08);
    let box_half_m = half_width_m + s.uniform(0.02, 0.17);
    let cab_m = s.uniform(1.6, 2.0);
    let cab = Cab {
        half_width_m,
        wheel_m,
        axle_x: -s.uniform(0.95, 1.15),
        rear_x: -cab_m,
        roof_m: s.uniform(2.1, 2.5),
        bonnet_m: 0.0,
    };
    let frame = Frame::behind(&cab, b, s, half_width_m, [-length_m, -0.6], [0.75, 0.95]);
    let rear_axle = -length_m + s.uniform(1.1, 1.9);
    frame.build(b, s, &[rear_axle]);
    frame.flanks(b, s, [rear_axle + 0.5, -cab_m - 0.1]);
    let space = Space {
        rear_x: -length_m,
        front_x: -cab_m - 0.08,
        half_width_m: box_half_m,
        deck_m: frame.top_m,
        top_m: s.uniform(2.6, 3.5),
    };
    let cargo = s.weighted(&[(6, Space::closed as Cargo), (2, Space::platform), (1, Space::skip)]);
    cargo(&space, b, s);
}

/// A rigid lorry of 12 to 32 t, 7 to 12 m long.
fn rigid(b: &mut Builder, s: &mut Sampler) {
    let length_m = s.uniform(7.0, 12.0);
    let wheel_m = s.uniform(0.46, 0.53);
    let half_width_m = s.uniform(1.2, 1.275);
    let bonnet_m = if s.chance(0.15) { s.uniform(1.0, 1.5) } else { 0.0 };
    let cab = heavy_cab(s, half_width_m, wheel_m, bonnet_m);
    let frame = Frame::behind(&cab, b, s, half_width_m, [-length_m, -0.8], [0.95, 1.1]);
    let last = -length_m + s.uniform(1.3, 2.3);
    let step_m = 2.0 * wheel_m + 0.32;
    let n_axles = if length_m > 8.5 && s.chance(0.6) { 2 } else { 1 };
    let axles: Vec<f64> = (0..n_axles).map(|k| last + f64::from(k) * step_m).collect();
    frame.build(b, s, &axles);
    let first = last + f64::from(n_axles - 1) * step_m;
    frame.flanks(b, s, [first + wheel_m + 0.1, cab.rear_x.min(cab.axle_x - 0.6)]);
    let space = Space {
        rear_x: -length_m,
        front_x: cab.rear_x - s.uniform(0.05, 0.3),
        half_width_m: half_width_m.max(1.22),
        deck_m: frame.top_m + 0.04,
        top_m: s.uniform(3.1, 4.0),
    };
    let cargo = s.weighted(&[
        (5, Space::closed as Cargo),
        (3, Space::skip),
        (2, Space::platform),
        (1, Space::tank),
        (1, Space::mixer),
        (2, Space::refuse),
    ]);
    cargo(&space, b, s);
}

fn heavy_cab(s: &mut Sampler, half_width_m: f64, wheel_m: f64, bonnet_m: f64) -> Cab {
    Cab {
        half_width_m: half_width_m - s.uniform(0.0, 0.03),
        wheel_m,
        axle_x: if bonnet_m > 0.0 { -0.75 } else { -s.uniform(1.3, 1.5) },
        rear_x: -bonnet_m - s.uniform(1.65, 2.3),
        roof_m: s.uniform(2.75, 3.75),
        bonnet_m,
    }
}

/// A tractor with a semi-trailer of 10 to 13.6 m.
fn articulated(b: &mut Builder, s: &mut Sampler) {
    let wheel_m = s.uniform(0.48, 0.52);
    let half_width_m = 1.25;
    let bonnet_m = if s.chance(0.1) { 1.4 } else { 0.0 };
    let cab = heavy_cab(s, half_width_m, wheel_m, bonnet_m);
    cab.build(b, s);
    let drive_x = cab.axle_x - s.uniform(3.6, 3.9);
    let tractor = Frame { wheel_m, half_width_m, top_m: 1.0, rear_x: drive_x - 0.9, front_x: -0.8 };
    tractor.axle(b, cab.axle_x, 1.0);
    tractor.build(b, s, &[drive_x]);
    tractor.flanks(b, s, [drive_x + wheel_m + 0.1, cab.axle_x - wheel_m - 0.15]);
    let space = Space {
        rear_x: cab.rear_x - 0.7 - s.uniform(10.0, 13.6),
        front_x: cab.rear_x - 0.7,
        half_width_m: 1.275,
        deck_m: 1.2,
        top_m: s.uniform(3.6, 4.0),
    };
    let trailer = Frame {
        wheel_m,
        half_width_m: 1.25,
        top_m: 1.2,
        rear_x: space.rear_x,
        front_x: space.front_x - 0.3,
    };
    let last = space.rear_x + s.uniform(1.2, 2.8);
    let axles: Vec<f64> = (0..s.count(2, 3)).map(|k| last + 1.31 * k as f64).collect();
    trailer.build(b, s, &axles);
    // Landing legs, and guards along the sides.
    let legs_x = space.front_x - 2.6;
    b.mirrored_y(|b| cylinder(b, dvec3(legs_x, 0.85, 0.35), 0.07, 0.9));
    trailer.flanks(b, s, [last + 1.31 * axles.len() as f64, legs_x - 0.3]);
    let cargo = s.weighted(&[
        (7, Space::closed as Cargo),
        (2, Space::skip),
        (2, Space::platform),
        (2, Space::tank),
    ]);
    cargo(&space, b, s);
}
