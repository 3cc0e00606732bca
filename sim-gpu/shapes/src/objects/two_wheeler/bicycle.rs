use super::Contacts;
use super::parts::{Filling, handlebar, mudguard, wheel};
use crate::primitives::{Builder, DVec3, Sampler, block, cushion, dvec3, ellipsoid, rod, tube};

/// The measures of a bicycle, metres. The middle between its axles is at x = 0.
///
/// Wheels are ISO 5775's 559 (26 inch) to 622 (28 inch) with tyres of 23 to 57 mm. The ranges of
/// wheelbases, saddles and bars are those of makers' geometry tables.
pub struct Bicycle {
    wheel_m: f64,
    tyre_m: f64,
    wheelbase_m: f64,
    saddle: DVec3,
    grip: DVec3,
    crank: DVec3,
    /// The angle of the right crank: 0 is forward, a quarter turn is up.
    crank_rad: f64,
    /// Whether the frame has no top tube at the height of the saddle.
    low_entry: bool,
    tube_m: f64,
    racing: bool,
}

impl Bicycle {
    pub fn draw(s: &mut Sampler) -> Self {
        let racing = s.chance(0.2);
        let wheel_m = if racing { 0.335 } else { s.uniform(0.32, 0.355) };
        let tyre_m = if racing { 0.028 } else { s.uniform(0.032, 0.06) };
        let wheelbase_m = s.uniform(0.98, 1.02) + if racing { 0.0 } else { s.uniform(0.0, 0.16) };
        let saddle_m = s.uniform(0.85, 1.03);
        let saddle = dvec3(-0.2 * saddle_m + s.uniform(-0.04, 0.02), 0.0, saddle_m);
        let grip_m = saddle_m + if racing { s.uniform(-0.1, 0.0) } else { s.uniform(0.0, 0.2) };
        let back_m = if racing { s.uniform(-0.05, 0.05) } else { s.uniform(0.05, 0.25) };
        let half_bar_m = if racing { s.uniform(0.2, 0.22) } else { s.uniform(0.27, 0.38) };
        Self {
            wheel_m,
            tyre_m,
            wheelbase_m,
            saddle,
            grip: dvec3(0.38 - back_m, half_bar_m, grip_m),
            crank: dvec3(-0.08, 0.0, s.uniform(0.26, 0.3)),
            crank_rad: s.uniform(0.0, 360.0).to_radians(),
            low_entry: !racing && s.chance(0.4),
            tube_m: s.uniform(0.014, 0.024),
            racing,
        }
    }

    pub fn contacts(&self) -> Contacts {
        let soles = [-1.0, 1.0].map(|side| self.pedal(side) + 0.01 * DVec3::Z);
        Contacts { saddle: self.saddle + 0.02 * DVec3::Z, grip: self.grip, soles }
    }

    /// The middle of the right (-1) or left (1) pedal, on a crank of 0.17 m.
    fn pedal(&self, side: f64) -> DVec3 {
        let (sin, cos) = libm::sincos(self.crank_rad);
        self.crank + dvec3(-0.17 * side * cos, 0.12 * side, -0.17 * side * sin)
    }

    pub fn build(&self, b: &mut Builder, s: &mut Sampler) {
        let half_m = 0.5 * self.wheelbase_m;
        let [rear, front] = [-half_m, half_m].map(|x| dvec3(x, 0.0, self.wheel_m));
        // Spokes are 2 mm thick. A beam is a few centimetres wide and returns from spokes that a
        // thin ray would miss.
        let filling = Filling::Spokes(s.pick(&[12, 14, 16, 18]), s.uniform(0.004, 0.009));
        wheel(b, rear, self.tyre_m, filling);
        wheel(b, front, self.tyre_m, filling);
        self.frame(b, rear, front);
        cushion(b, self.saddle - 0.03 * DVec3::Z, dvec3(0.27, s.uniform(0.13, 0.22), 0.06), 0.025);
        // The chain wheel, cranks and pedals.
        let aside = 0.06 * DVec3::Y;
        rod(b, self.crank - 1.1 * aside, self.crank - 0.9 * aside, [0.08, 0.08]);
        for side in [-1.0, 1.0] {
            let pedal = self.pedal(side);
            rod(b, self.crank + side * aside, pedal - 0.05 * side * DVec3::Y, [0.012, 0.012]);
            block(b, pedal, dvec3(0.09, 0.1, 0.025));
        }
        if !self.racing {
            self.additions(b, s, rear, front);
        }
    }

    /// Tubes, fork, stem and bar.
    fn frame(&self, b: &mut Builder, rear: DVec3, front: DVec3) {
        let r = self.tube_m;
        let seat = self.saddle - dvec3(-0.02, 0.0, 0.05);
        let clamp = seat.lerp(self.crank, 0.25);
        let stem = dvec3(front.x - 0.2, 0.0, self.grip.z);
        // The steering axis is 70 degrees steep and meets the fork's upper end.
        let crown = dvec3(front.x - 0.1, 0.0, 2.0 * self.wheel_m + 0.05);
        let head = crown.lerp(stem, 0.45);
        rod(b, seat, self.crank, [0.8 * r, r]);
        rod(b, crown.lerp(head, 0.2), self.crank, [1.1 * r, 1.1 * r]);
        let top = if self.low_entry { clamp.lerp(self.crank, 0.65) } else { clamp };
        rod(b, head, top, [r, r]);
        rod(b, crown, stem, [r, r]);
        handlebar(b, stem, self.grip, 0.014);
        b.mirrored_y(|b| {
            let side = 0.06 * DVec3::Y;
            rod(b, rear + side, self.crank + 0.5 * side, [0.6 * r, 0.7 * r]);
            rod(b, rear + side, clamp, [0.5 * r, 0.6 * r]);
            rod(b, front + 0.8 * side, crown + 0.6 * side, [0.6 * r, 0.9 * r]);
            if self.racing {
                // The drop of the bar.
                let down = [
                    self.grip,
                    self.grip + dvec3(0.09, 0.0, -0.02),
                    self.grip + dvec3(0.08, 0.0, -0.1),
                    self.grip + dvec3(-0.03, 0.0, -0.13),
                ];
                tube(b, &down, 0.015);
            }
        });
    }

    /// Mudguards, a rack with bags or a child's seat, a basket, a lamp.
    fn additions(&self, b: &mut Builder, s: &mut Sampler, rear: DVec3, front: DVec3) {
        let mudguard_m = self.tyre_m + 0.015;
        if s.chance(0.7) {
            mudguard(b, rear, mudguard_m, [40.0, 190.0]);
            mudguard(b, front, mudguard_m, [20.0, 150.0]);
        }
        let rack_m = 2.0 * self.wheel_m + 0.07;
        let rack = dvec3(rear.x - 0.03, 0.0, rack_m);
        if s.chance(0.6) {
            block(b, rack, dvec3(0.38, 0.13, 0.015));
            b.mirrored_y(|b| {
                rod(b, rear + 0.07 * DVec3::Y, rack + 0.06 * DVec3::Y, [0.006, 0.006]);
            });
            let load = s.uniform(0.0, 1.0);
            if load < 0.15 {
                // A pair of bags beside the wheel.
                let size = dvec3(s.uniform(0.28, 0.38), s.uniform(0.1, 0.17), 0.33);
                b.mirrored_y(|b| {
                    cushion(b, rack + dvec3(0.0, 0.09 + 0.5 * size.y, -0.17), size, 0.03);
                });
            } else if load < 0.23 {
                // A child's seat.
                block(b, rack + 0.12 * DVec3::Z, dvec3(0.3, 0.28, 0.2));
                block(b, rack + dvec3(-0.14, 0.0, 0.35), dvec3(0.05, 0.3, 0.5));
            } else if load < 0.33 {
                let size = dvec3(0.38, 0.3, s.uniform(0.15, 0.3));
                block(b, rack + 0.5 * size.z * DVec3::Z, size);
            }
        }
        if s.chance(0.2) {
            block(b, dvec3(front.x + 0.04, 0.0, rack_m + 0.16), dvec3(0.26, 0.36, 0.24));
        }
        if s.chance(0.5) {
            ellipsoid(b, dvec3(front.x - 0.02, 0.0, rack_m + 0.08), dvec3(0.04, 0.035, 0.035));
        }
    }
}
