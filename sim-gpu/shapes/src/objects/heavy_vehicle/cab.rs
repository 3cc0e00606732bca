use super::shell::Shell;
use crate::objects::car::panel::Arch;
use crate::primitives::{Builder, Sampler, block, block_between, dvec3, loft, outline};

/// The measures of a cab. The front of the vehicle is at x = 0.
pub struct Cab {
    pub half_width_m: f64,
    pub wheel_m: f64,
    /// x of the front axle.
    pub axle_x: f64,
    /// x of the cab's rear wall.
    pub rear_x: f64,
    pub roof_m: f64,
    /// The length of a bonnet in front of the windscreen; 0 if the driver sits above the engine.
    pub bonnet_m: f64,
}

impl Cab {
    pub fn build(&self, b: &mut Builder, s: &mut Sampler) {
        let front_x = -self.bonnet_m;
        let heavy = self.wheel_m > 0.44;
        let [sill_m, waist_m] = if heavy { [0.38, 1.75] } else { [0.32, 1.2] };
        let waist_m = waist_m + s.uniform(-0.12, 0.12);
        let lintel_m = (waist_m + s.uniform(0.75, 1.0)).min(self.roof_m - 0.12);
        let arch = Arch { x: self.axle_x, z: self.wheel_m, radius_m: self.wheel_m + 0.09 };
        let rake_m = s.uniform(0.08, 0.3) * (self.roof_m - waist_m);
        let window = front_x - s.uniform(1.05, 1.25)..front_x - 0.34;
        let shell = Shell {
            rear_x: self.rear_x,
            front_x,
            half_width_m: self.half_width_m,
            sill_m,
            waist_m,
            roof_m: self.roof_m,
            lintel_m,
            arches: if self.bonnet_m > 0.0 { vec![] } else { vec![arch] },
            rake_m,
            bow_m: s.uniform(0.05, 0.18),
            inset_m: s.uniform(0.02, 0.12),
            windows: vec![window.start.max(self.rear_x + 0.15)..window.end],
            doors: (0.0, vec![]),
            has_rear_window: false,
            has_windscreen: true,
        };
        shell.build(b);
        self.inside(b, s, waist_m, front_x);
        self.mirrors(b, s, waist_m, front_x);
        if self.bonnet_m > 0.0 {
            self.bonnet(b, waist_m);
        }
        if heavy && s.chance(0.4) {
            // A deflector on the roof.
            let top_m = (self.roof_m + s.uniform(0.2, 0.6)).min(4.0);
            let [rear, front] = [self.rear_x + 0.1, self.rear_x + 0.95];
            let y = 0.85 * self.half_width_m;
            b.surface([1, 1], |u, v| {
                let z = top_m + v * (self.roof_m - top_m);
                dvec3(rear + v * (front - rear), y * (2.0 * u - 1.0), z)
            });
        }
    }

    /// Floor, dashboard and seats.
    fn inside(&self, b: &mut Builder, s: &mut Sampler, waist_m: f64, front_x: f64) {
        let y = self.half_width_m - 0.08;
        let floor_m = waist_m - 0.75;
        let low = dvec3(self.rear_x + 0.05, -0.6 * y, 0.5);
        block_between(b, low, dvec3(front_x - 0.25, 0.6 * y, floor_m));
        let low = dvec3(front_x - 0.65, -y, floor_m);
        block_between(b, low, dvec3(front_x - 0.3, y, waist_m - 0.05));
        let x = (front_x - s.uniform(1.35, 1.5)).max(self.rear_x + 0.15);
        b.mirrored_y(|b| {
            let back = dvec3(x, 0.55 * y, floor_m + 0.75);
            block(b, back, dvec3(0.14, 0.5, 0.75));
            block(b, back + dvec3(0.3, 0.0, -0.4), dvec3(0.5, 0.5, 0.2));
        });
    }

    /// Mirrors on arms, 0.2 m wide and 0.4 to 0.8 m high.
    fn mirrors(&self, b: &mut Builder, s: &mut Sampler, waist_m: f64, front_x: f64) {
        let high_m = s.uniform(0.35, 0.8);
        let x = front_x - s.uniform(0.05, 0.25);
        let at = dvec3(x, self.half_width_m + 0.16, waist_m + 0.1 + 0.5 * high_m);
        b.mirrored_y(|b| {
            block(b, at, dvec3(0.1, 0.2, high_m));
            block(b, at - dvec3(0.05, 0.12, -0.45 * high_m), dvec3(0.05, 0.2, 0.05));
        });
    }

    /// A bonnet with wings over the front wheels.
    fn bonnet(&self, b: &mut Builder, waist_m: f64) {
        let y = 0.55 * self.half_width_m;
        let top_m = waist_m - 0.05;
        let slope_m = 0.25;
        loft(
            b,
            &[
                outline::upright(-self.bonnet_m, y + 0.12, [0.5, top_m]),
                outline::upright(-0.15, y, [0.5, top_m - slope_m]),
                outline::upright(0.0, 0.9 * y, [0.5, top_m - slope_m - 0.1]),
            ],
        );
        let outer = self.half_width_m;
        block_between(b, dvec3(-0.25, -outer, 0.4), dvec3(0.0, outer, 0.75));
        b.mirrored_y(|b| {
            b.surface([6, 1], |u, v| {
                let (sin, cos) = libm::sincos(u * std::f64::consts::PI);
                let r = self.wheel_m + 0.1;
                let across = y + v * (outer - y);
                dvec3(self.axle_x + r * cos, across, self.wheel_m + r * sin)
            });
        });
    }
}
