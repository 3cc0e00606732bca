use super::Contacts;
use super::parts::{Filling, handlebar, mudguard, wheel};
use crate::primitives::*;

/// The measures of a motorcycle, metres. The middle between its axles is at x = 0.
///
/// The ranges are those of makers' data sheets, from a scooter (Vespa Primavera: wheelbase 1.34,
/// length 1.86, saddle 0.79) to a cruiser (Harley-Davidson Softail: wheelbase 1.63, length 2.36,
/// saddle 0.68) and an adventure tourer (BMW R 1250 GS: 1.51, 2.2, 0.85).
pub struct Motorcycle {
    scooter: bool,
    wheel_m: [f64; 2],
    tyre_m: [f64; 2],
    wheelbase_m: f64,
    saddle: DVec3,
    grip: DVec3,
    /// Half the width of the fairing, the engine and the tank.
    half_m: f64,
    fairing: bool,
}

impl Motorcycle {
    pub fn draw(s: &mut Sampler) -> Self {
        let scooter = s.chance(0.4);
        let saddle_m = if scooter { s.uniform(0.74, 0.82) } else { s.uniform(0.68, 0.87) };
        let wheelbase_m = if scooter { s.uniform(1.2, 1.5) } else { s.uniform(1.36, 1.64) };
        let front_m = if scooter { s.uniform(0.21, 0.29) } else { s.uniform(0.29, 0.34) };
        let tyre_m = if scooter { s.uniform(0.09, 0.13) } else { s.uniform(0.1, 0.13) };
        let rear_tyre_m = if scooter { tyre_m + 0.01 } else { s.uniform(0.12, 0.2) };
        let grip_m = saddle_m + s.uniform(0.13, 0.33);
        let grip_x = 0.5 * wheelbase_m - s.uniform(0.28, 0.45);
        Self {
            scooter,
            wheel_m: [front_m - s.uniform(0.0, 0.02), front_m],
            tyre_m: [rear_tyre_m, tyre_m],
            wheelbase_m,
            saddle: dvec3(-s.uniform(0.16, 0.28), 0.0, saddle_m),
            grip: dvec3(grip_x, s.uniform(0.3, 0.42), grip_m),
            half_m: s.uniform(0.12, 0.19),
            fairing: !scooter && s.chance(0.5),
        }
    }

    pub fn contacts(&self) -> Contacts {
        let sole = if self.scooter {
            dvec3(0.22, 0.12, 0.31)
        } else {
            dvec3(self.saddle.x + 0.2, self.half_m + 0.06, 0.32)
        };
        let soles = [-1.0, 1.0].map(|side| dvec3(sole.x, side * sole.y, sole.z));
        Contacts { saddle: self.saddle, grip: self.grip, soles }
    }

    pub fn build(&self, b: &mut Builder, s: &mut Sampler) {
        let half_m = 0.5 * self.wheelbase_m;
        let rear = dvec3(-half_m, 0.0, self.wheel_m[0]);
        let front = dvec3(half_m, 0.0, self.wheel_m[1]);
        let spokes = Filling::Spokes(s.pick(&[5, 6, 10]), s.uniform(0.03, 0.05));
        let filling = if self.scooter || s.chance(0.3) { Filling::Disc } else { spokes };
        wheel(b, rear, self.tyre_m[0], filling);
        wheel(b, front, self.tyre_m[1], filling);
        mudguard(b, front, self.tyre_m[1] + 0.02, [20.0, 150.0]);
        mudguard(b, rear, self.tyre_m[0] + 0.02, [60.0, 170.0]);
        self.front_end(b, s, front);
        if self.scooter {
            self.scooter_body(b, rear, front);
        } else {
            self.motorcycle_body(b, rear, front);
        }
        self.exhaust(b, rear);
        if s.chance(if self.scooter { 0.35 } else { 0.2 }) {
            let at = dvec3(rear.x - 0.02, 0.0, self.saddle.z + 0.22);
            cushion(b, at, dvec3(0.38, 0.42, 0.32), 0.06);
        }
        if !self.scooter && s.chance(0.15) {
            let at = dvec3(rear.x + 0.02, self.half_m + 0.14, self.saddle.z - 0.15);
            b.mirrored_y(|b| cushion(b, at, dvec3(0.45, 0.2, 0.32), 0.05));
        }
    }

    /// Fork, bar, lamp, mirrors, windshield.
    fn front_end(&self, b: &mut Builder, s: &mut Sampler, front: DVec3) {
        let stem = dvec3(self.grip.x + 0.06, 0.0, self.grip.z - 0.06);
        handlebar(b, stem, self.grip, 0.018);
        let fork_y = 0.5 * self.tyre_m[1] + 0.035;
        b.mirrored_y(|b| {
            let aside = fork_y * DVec3::Y;
            rod(b, front + aside, stem + aside - 0.05 * DVec3::Z, [0.028, 0.022]);
            let mirror = self.grip + dvec3(0.08, -0.03, 0.2);
            rod(b, self.grip - 0.1 * DVec3::Y, mirror, [0.006, 0.006]);
            ellipsoid(b, mirror, dvec3(0.02, 0.065, 0.045));
        });
        let lamp = dvec3(stem.x + 0.1, 0.0, stem.z - 0.08);
        ellipsoid(b, lamp, dvec3(0.09, 0.09, 0.09));
        if s.chance(0.4) {
            let half_y = s.uniform(0.15, 0.24);
            let high_m = s.uniform(0.2, 0.5);
            b.glass(|b| {
                sheet(b, [2.0 * half_y, high_m], |u, v| {
                    let across = 2.0 * u - 1.0;
                    let back = 0.4 * high_m * v + 0.08 * across * across;
                    let y = half_y * across * (1.0 - 0.3 * v);
                    lamp + dvec3(0.08 - back, y, 0.05 + high_m * v)
                });
            });
        }
    }

    /// Tank, saddle, tail, engine, frame and perhaps a fairing.
    fn motorcycle_body(&self, b: &mut Builder, rear: DVec3, front: DVec3) {
        let saddle = self.saddle;
        let w = self.half_m;
        let tank = dvec3(0.5 * (saddle.x + self.grip.x) + 0.08, 0.0, saddle.z + 0.05);
        ellipsoid(b, tank, dvec3(0.29, w, 0.15));
        let tail = dvec3(rear.x - 0.12, 0.0, saddle.z + 0.06);
        let section =
            |at: DVec3, half: DVec2| outline::across_x(&outline::superellipse(half, 3.0, 8), at);
        let seat_front = dvec3(saddle.x + 0.25, 0.0, saddle.z - 0.05);
        let middle = saddle - dvec3(0.1, 0.0, 0.06);
        let sections = [
            section(seat_front, dvec2(0.5 * w, 0.05)),
            section(middle, dvec2(w.min(0.15), 0.07)),
            section(tail, dvec2(0.5 * w, 0.045)),
        ];
        loft(b, &sections);
        let engine = dvec3(0.02, 0.0, 0.42);
        cushion(b, engine, dvec3(0.5, 1.7 * w, 0.4), 0.08);
        block(b, dvec3(0.5 * front.x, 0.0, 0.5), dvec3(0.1, 1.5 * w, 0.3));
        b.mirrored_y(|b| {
            let aside = 0.6 * w * DVec3::Y;
            let pivot = dvec3(-0.22, 0.0, 0.4) + aside;
            rod(b, rear + aside, pivot, [0.025, 0.035]);
            rod(b, pivot, tail + 0.2 * DVec3::X + 0.5 * aside, [0.02, 0.015]);
            rod(b, pivot + 0.25 * DVec3::Z, tank + 0.25 * DVec3::X, [0.025, 0.03]);
        });
        if self.fairing {
            let nose = dvec3(front.x - 0.02, 0.0, self.grip.z - 0.1);
            let waist = dvec3(0.3 * front.x, 0.0, 0.62);
            let sections = [
                section(nose, dvec2(0.1, 0.1)),
                section(nose - dvec3(0.2, 0.0, 0.03), dvec2(1.3 * w, 0.2)),
                section(waist, dvec2(1.25 * w, 0.34)),
                section(engine, dvec2(1.1 * w, 0.24)),
            ];
            loft(b, &sections);
        }
    }

    /// Leg shield, step, and the body under the saddle.
    fn scooter_body(&self, b: &mut Builder, rear: DVec3, front: DVec3) {
        let w = self.half_m + 0.02;
        let shield_top = dvec3(self.grip.x + 0.08, 0.0, self.grip.z - 0.12);
        let shield_foot = dvec3(0.5 * front.x + 0.05, 0.0, 0.3);
        sheet(b, [2.0 * w, 0.6], |u, v| {
            let across = 2.0 * u - 1.0;
            let half_y = 1.35 * w * (1.0 - 0.35 * (2.0 * v - 1.0).powi(2));
            let bow = DVec3::X * (0.06 - 0.1 * across * across);
            shield_foot.lerp(shield_top, v) + bow + DVec3::Y * half_y * across
        });
        let step = [self.saddle.x + 0.2, shield_foot.x + 0.03];
        let middle = dvec3(0.5 * (step[0] + step[1]), 0.0, 0.27);
        block(b, middle, dvec3((step[1] - step[0]).max(0.1), 2.2 * w, 0.08));
        let section = |x: f64, low: f64, high: f64, half: f64| {
            let ring = outline::superellipse(dvec2(half, 0.5 * (high - low)), 3.0, 10);
            outline::across_x(&ring, dvec3(x, 0.0, 0.5 * (low + high)))
        };
        let top = self.saddle.z;
        let sections = [
            section(self.saddle.x + 0.26, 0.26, top - 0.05, 0.8 * w),
            section(self.saddle.x, 0.3, top, 1.1 * w),
            section(rear.x, rear.z + 0.16, top + 0.03, w),
            section(rear.x - 0.2, rear.z + 0.3, top - 0.02, 0.5 * w),
        ];
        loft(b, &sections);
        block(b, dvec3(rear.x + 0.2, 0.0, 0.3), dvec3(0.4, 1.4 * w, 0.2));
    }

    fn exhaust(&self, b: &mut Builder, rear: DVec3) {
        let y = -(0.5 * self.tyre_m[0] + 0.1);
        let from = dvec3(rear.x + 0.45, y, rear.z + 0.02);
        rod(b, from, dvec3(rear.x - 0.1, y, rear.z + 0.12), [0.035, 0.055]);
    }
}
