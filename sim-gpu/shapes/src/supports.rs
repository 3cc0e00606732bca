//! Supports of furniture: legs, pedestals, stars, crosses.

use std::f64::consts::TAU;

use crate::primitives::*;

pub struct Legs {
    kind: LegKind,
    /// Half the width of a leg at its top, by which legs stand in from an edge.
    pub half_width_m: f64,
    /// The width at the floor over that at the top.
    taper: f64,
    /// The distance of the feet outwards from the tops, over the height.
    splay: f64,
}

#[derive(Clone, Copy)]
enum LegKind {
    Square,
    Round,
    Turned,
    Curved,
    Hairpin,
}

impl Legs {
    /// Draws the legs of a piece of furniture `height_m` high.
    pub fn draw(s: &mut Sampler, height_m: f64) -> Self {
        use LegKind::{Curved, Hairpin, Round, Square, Turned};
        let kind = s.weighted(&[(3, Square), (3, Round), (1, Turned), (1, Curved), (1, Hairpin)]);
        let splayed = s.chance(0.4);
        let steep = s.uniform(0.05, 0.22);
        let taper = s.uniform(0.4, 1.0);
        Self {
            kind,
            half_width_m: height_m * s.log_uniform(0.016, 0.05),
            taper: if s.chance(0.5) { taper } else { 1.0 },
            splay: if splayed && !matches!(kind, Square) { steep } else { 0.0 },
        }
    }

    /// The point on the floor of the leg with this top.
    pub fn foot(&self, top: DVec3) -> DVec3 {
        let out = dvec2(top.x, top.y).normalize_or_zero() * self.splay * top.z;
        dvec3(top.x + out.x, top.y + out.y, 0.0)
    }

    /// Adds one leg from `top` to the floor, leaning away from the z axis.
    pub fn build(&self, b: &mut Builder, top: DVec3) {
        let foot = self.foot(top);
        let [wide, narrow] = [self.half_width_m, self.half_width_m * self.taper];
        match self.kind {
            LegKind::Square => square_leg(b, top, wide, narrow),
            LegKind::Round => rod(b, foot, top, [narrow, wide]),
            LegKind::Turned => turned_leg(b, top, wide),
            LegKind::Curved => curved_leg(b, top, wide),
            LegKind::Hairpin => hairpin(b, top, foot, 0.35 * wide),
        }
    }
}

fn square_leg(b: &mut Builder, top: DVec3, wide: f64, narrow: f64) {
    let section = |half: f64, z: f64| {
        let outline = outline::rectangle(DVec2::splat(half));
        outline.iter().map(|p| (p + top.truncate()).extend(z)).collect()
    };
    loft(b, &[section(narrow, 0.0), section(wide, top.z)]);
}

fn turned_leg(b: &mut Builder, top: DVec3, r: f64) {
    let h = top.z;
    let profile = Profile::from(0.0, 0.0)
        .line(0.5 * r, 0.0)
        .curve(&[(0.8 * r, 0.08 * h), (0.5 * r, 0.2 * h), (1.1 * r, 0.5 * h), (0.6 * r, 0.7 * h)])
        .line(1.1 * r, 0.72 * h)
        .line(1.1 * r, h)
        .line(0.0, h);
    b.shifted(top.with_z(0.0), |b| profile.revolve(b, Section::Round));
}

/// A leg that bends outwards at the knee and inwards above its foot.
fn curved_leg(b: &mut Builder, top: DVec3, r: f64) {
    let out = top.with_z(0.0).normalize_or_zero() * top.z * 0.07;
    let at = |side: f64, height: f64| top.with_z(height * top.z) + side * out;
    let points = [(0.0, 1.0), (0.9, 0.8), (0.2, 0.4), (0.1, 0.1), (1.0, 0.0)];
    smooth_tube(b, &points.map(|(side, height)| at(side, height)), 2, 0.8 * r);
}

fn hairpin(b: &mut Builder, top: DVec3, foot: DVec3, r: f64) {
    let across = dvec3(-top.y, top.x, 0.0).normalize_or(DVec3::X) * 0.1 * top.z;
    for side in [-1.0, 1.0] {
        rod(b, foot, top + side * across, [r, r]);
    }
}

/// Four legs under a rectangle of half size `half`, with stretchers between them at `stretcher` of
/// the height, if given.
pub fn four_legs(b: &mut Builder, legs: &Legs, half: DVec2, top_m: f64, stretcher: Option<f64>) {
    let tops = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        .map(|(x, y)| dvec3(x * half.x, y * half.y, top_m));
    for top in tops {
        legs.build(b, top);
    }
    let Some(share) = stretcher else { return };
    let at = |top: DVec3| legs.foot(top).lerp(top, share);
    for (i, top) in tops.into_iter().enumerate() {
        let r = 0.5 * legs.half_width_m;
        rod(b, at(top), at(tops[(i + 1) % 4]), [r, r]);
    }
}

/// A foot, a column, and a plate under the top.
pub fn disc_pedestal(b: &mut Builder, s: &mut Sampler, foot_m: f64, height_m: f64) {
    let column_m = foot_m * s.uniform(0.07, 0.25);
    let thick_m = foot_m * s.uniform(0.03, 0.12);
    let plate_m = foot_m * s.uniform(0.3, 0.7);
    let flowing = s.chance(0.5);
    let profile = Profile::from(0.0, 0.0).line(foot_m, 0.0).line(foot_m, thick_m);
    let profile = if flowing {
        profile.curve(&[
            (0.5 * foot_m, thick_m + 0.02 * height_m),
            (column_m, 0.25 * height_m),
            (column_m, 0.7 * height_m),
            (plate_m, height_m),
        ])
    } else {
        profile.line(column_m, 1.5 * thick_m).line(column_m, height_m)
    };
    profile.line(0.0, height_m).revolve(b, Section::Round);
}

/// Arms from a hub to the floor, with or without castors, and a column.
pub fn star_pedestal(b: &mut Builder, s: &mut Sampler, reach_m: f64, height_m: f64) {
    let n_arms = s.pick(&[3, 4, 4, 5, 5]);
    let castors = n_arms == 5 || s.chance(0.3);
    let arm_m = reach_m * s.uniform(0.06, 0.12);
    let hub_m = height_m * s.uniform(0.15, 0.3);
    let castor_m = if castors { 0.1 * reach_m } else { 0.0 };
    for arm in 0..n_arms {
        let out = DVec2::from_angle((arm as f64 + 0.25) / n_arms as f64 * TAU).extend(0.0);
        let tip = reach_m * out + (2.0 * castor_m + 0.5 * arm_m) * DVec3::Z;
        bar(b, hub_m * DVec3::Z, tip, arm_m, arm_m);
        if castors {
            ellipsoid(b, reach_m * out + castor_m * DVec3::Z, DVec3::splat(castor_m));
        }
    }
    let column_m = arm_m * s.uniform(0.4, 0.9);
    cylinder(b, 0.7 * hub_m * DVec3::Z, 1.5 * column_m, 0.6 * hub_m);
    cylinder(b, hub_m * DVec3::Z, column_m, height_m - hub_m);
}

/// Two crossed pairs of boards, left and right, whose tops are `half` from the middle.
pub fn crossed_legs(b: &mut Builder, half: DVec2, top_m: f64, width_m: f64) {
    for [side, lean] in [[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]] {
        let x = side * half.x + lean * 0.3 * width_m;
        bar(b, dvec3(x, -lean * half.y, 0.0), dvec3(x, lean * half.y, top_m), width_m, width_m);
    }
    let end = dvec3(half.x, 0.0, 0.5 * top_m);
    rod(b, end * dvec3(-1.0, 1.0, 1.0), end, [0.3 * width_m; 2]);
}

/// Two runners of tube, left and right, on the floor.
pub fn sledge(b: &mut Builder, half: DVec2, top_m: f64, radius_m: f64) {
    let corners = [(1.0, top_m), (1.08, radius_m), (-1.08, radius_m), (-1.0, top_m)]
        .map(|(y, z)| dvec3(half.x, y * half.y, z));
    b.mirrored_x(|b| corners.windows(2).for_each(|ends| tube(b, ends, radius_m)));
}

/// Two side panels across the whole depth.
pub fn side_panels(b: &mut Builder, half: DVec2, top_m: f64, thickness_m: f64) {
    b.mirrored_x(|b| {
        block_between(b, dvec3(half.x - thickness_m, -half.y, 0.0), dvec3(half.x, half.y, top_m));
    });
}
