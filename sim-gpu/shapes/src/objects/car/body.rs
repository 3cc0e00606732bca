//! The body below the windows: sides with wheel arches, nose, tail, bonnet, boot, underside.

use super::form::{Form, Style};
use super::panel::{Arch, in_order, lid, lower_edge_m};
use crate::primitives::{Builder, DVec2, DVec3, Sampler, block_between, dvec2, dvec3};

/// The rows of points of the shell, as shares of its height.
const ROWS: [f64; 6] = [0.0, 0.2, 0.42, 0.65, 0.88, 1.0];

/// The columns of points at the nose and the tail, as shares of the half width.
const END_SHARES: [f64; 5] = [0.0, 0.3, 0.55, 0.75, 0.88];

pub struct Body<'a> {
    form: &'a Form,
    arches: [Arch; 2],
    /// The exponent of the superellipse that is the plan of the body.
    squareness: f64,
    /// How far the tail and the nose lean in between the bumper and their upper edge.
    lean_m: [f64; 2],
    /// How far the rear and the front bumper stand out.
    bumper_m: [f64; 2],
    /// How far the sides lean in at the sill and at the windows.
    inset_m: [f64; 2],
    /// The rise of the bonnet in its middle.
    crown_m: f64,
    /// Whether the car has a pick-up's bed without a cover.
    open_bed: bool,
}

impl<'a> Body<'a> {
    pub fn draw(s: &mut Sampler, form: &'a Form) -> Self {
        let radius_m = form.wheel_m + s.uniform(0.04, 0.09);
        let boxy = form.style.is_boxy();
        Self {
            form,
            arches: form.axles.map(|x| Arch { x, z: form.wheel_m, radius_m }),
            squareness: if boxy || form.style == Style::PickUp {
                s.uniform(7.0, 12.0)
            } else {
                s.uniform(4.2, 7.5)
            },
            lean_m: [s.uniform(0.0, 0.1), s.uniform(0.03, 0.22)],
            bumper_m: [s.uniform(0.0, 0.1), s.uniform(0.0, 0.05)],
            inset_m: [s.uniform(0.02, 0.09), s.uniform(0.03, if boxy { 0.06 } else { 0.1 })],
            crown_m: s.uniform(0.02, 0.07),
            open_bed: form.style == Style::PickUp && s.chance(0.75),
        }
    }

    /// Half the width at `x`, at the height where the body is widest.
    pub fn plan_y(&self, x: f64) -> f64 {
        let share = (x.abs() / self.form.half.x).min(1.0);
        let e = self.squareness;
        self.form.half.y * libm::pow((1.0 - libm::pow(share, e)).max(0.0), 1.0 / e)
    }

    /// Half the width at `x`, at the windows' lower edge.
    pub fn shoulder_y(&self, x: f64) -> f64 {
        self.plan_y(x) * (1.0 - self.inset_m[1] / self.form.half.y)
    }

    pub fn build(&self, b: &mut Builder) {
        let stations = self.stations();
        let right = |t: f64| stations.iter().map(move |&p| self.point(p, t));
        let left = |t: f64| {
            stations[1..stations.len() - 1]
                .iter()
                .rev()
                .map(move |&p| self.point(p, t) * dvec3(1.0, -1.0, 1.0))
        };
        let rows: Vec<Vec<_>> = ROWS.iter().map(|&t| right(t).chain(left(t)).collect()).collect();
        b.grid(&rows, true);
        let [tail, screen] = [self.form.rear[0], self.form.screen[0]];
        let edge: Vec<_> = stations.iter().map(|&p| (p.x, self.point(p, 1.0))).collect();
        let edge_of = |keep: &dyn Fn(f64) -> bool| -> Vec<DVec3> {
            edge.iter().filter(|(x, _)| keep(*x)).map(|(_, point)| *point).collect()
        };
        lid(b, &edge_of(&|x| x >= screen - 0.012), self.crown_m);
        if self.open_bed {
            self.bed(b);
        } else {
            lid(b, &edge_of(&|x| x <= tail + 0.012), 0.5 * self.crown_m);
        }
        self.underside(b);
    }

    /// The outline of the right side from the middle of the tail to the middle of the nose, as
    /// points of x and half the width (negative).
    fn stations(&self) -> Vec<DVec2> {
        let half = self.form.half;
        let e = self.squareness;
        let end_x =
            END_SHARES.map(|share: f64| half.x * libm::pow(1.0 - libm::pow(share, e), 1.0 / e));
        let ends = |side: f64| (0..5).map(move |k| (side * end_x[k], END_SHARES[k] * half.y));
        let corner_x = end_x[4] - 0.02;
        let arches = self.arches.iter().flat_map(Arch::stations);
        let bends = self.form.top_line.iter().map(|p| p.x);
        let feet = [self.form.rear[0], self.form.screen[0]];
        let side = in_order(arches.chain(bends).chain(feet), [-corner_x, corner_x]);
        let side = side.into_iter().map(|x| (x, self.plan_y(x)));
        let outline = ends(-1.0).chain(side).chain(ends(1.0).rev());
        outline.map(|(x, y)| dvec2(x, -y)).collect()
    }

    /// The point of the shell above the outline's point `plan`, at the share `t` of the height
    /// there.
    fn point(&self, plan: DVec2, t: f64) -> DVec3 {
        let form = self.form;
        let end = (plan.x.abs() / form.half.x).min(1.0).powi(8);
        // The lower edges of nose and tail are a little higher than the sills.
        let sill_m = form.sill_m + 0.05 * end;
        let low_m = lower_edge_m(&self.arches, sill_m, plan.x);
        let high_m = form.top_m(plan.x).max(low_m + 0.05);
        let z = low_m + t * (high_m - low_m);
        let forward = usize::from(plan.x > 0.0);
        let rise = ((z - 0.55) / (form.nose_m - 0.55)).clamp(0.0, 1.0);
        let above_bumper = ((z - 0.55) / 0.06).clamp(0.0, 1.0);
        let back_m = self.lean_m[forward] * rise + self.bumper_m[forward] * above_bumper;
        let y = plan.y * (1.0 - self.side_inset_m(z, t) / form.half.y);
        dvec3(plan.x - plan.x.signum() * end * back_m, y, z)
    }

    /// How far the side leans in at height `z`. It is widest at 0.55 m, and its upper edge is
    /// rounded.
    fn side_inset_m(&self, z: f64, t: f64) -> f64 {
        let [low_m, high_m] = self.inset_m;
        let below = ((0.55 - z) / 0.35).clamp(0.0, 1.0);
        let above = ((z - 0.55) / 0.5).clamp(0.0, 1.0);
        let shoulder = ((t - 0.88) / 0.12).max(0.0);
        low_m * below.powi(2) + 0.6 * high_m * above.powi(2) + 0.4 * high_m * shoulder
    }

    /// The floor and the walls inside an open bed.
    fn bed(&self, b: &mut Builder) {
        let form = self.form;
        let [from, to] = [-form.half.x + 0.12 + self.lean_m[0] + self.bumper_m[0], form.rear[0]];
        let y = 0.86 * form.half.y;
        let [floor_m, rim_m] = [form.top_m(from) - 0.46, form.top_m(from) - 0.01];
        let corner = |x: f64, side: f64, z: f64| dvec3(x, side * y, z);
        let ring = |z: f64| {
            vec![
                corner(from, 1.0, z),
                corner(to, 1.0, z),
                corner(to, -1.0, z),
                corner(from, -1.0, z),
            ]
        };
        b.grid(&[ring(floor_m), ring(rim_m)], true);
        b.surface([1, 1], |u, v| corner(from + u * (to - from), 2.0 * v - 1.0, floor_m));
        b.mirrored_y(|b| {
            b.surface([1, 1], |u, v| {
                let x = from + u * (to - from);
                dvec3(x, y + v * (self.shoulder_y(x) - y), form.top_m(x))
            });
        });
    }

    /// The floor, and blocks for the engine, the tank and the axles between the wheels.
    fn underside(&self, b: &mut Builder) {
        let form = self.form;
        let [rear, front] = form.axles;
        let reach_m = self.arches[0].radius_m + 0.03;
        let low = form.sill_m + 0.02;
        let side = 0.9 * form.half.y;
        let between = side - 0.3;
        let block = |b: &mut Builder, [from, to]: [f64; 2], y: f64, high: f64| {
            block_between(b, dvec3(from, -y, low), dvec3(to, y, high));
        };
        block(b, [rear + reach_m, front - reach_m], side, low + 0.1);
        let bay_m = 0.85 * form.nose_m;
        block(b, [front - reach_m, front + reach_m], between, bay_m);
        block(b, [front + reach_m, 0.5 * (front + reach_m + form.half.x)], between, bay_m);
        block(b, [rear - reach_m, rear + reach_m], between, low + 0.3);
        block(b, [0.5 * (rear - reach_m - form.half.x), rear - reach_m], between, low + 0.3);
    }
}
