use std::f64::consts::TAU;

use crate::primitives::*;

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Bellied,
    Trumpet,
    Cylinder,
    Shouldered,
}

struct Form {
    height_m: f64,
    foot_m: f64,
    belly_m: f64,
    neck_m: f64,
    lip_m: f64,
    /// The height of the belly, over the height of the vase.
    belly_at: f64,
    neck_at: f64,
}

impl Form {
    /// Half of the vases are slender; the others range from bottles to bowls.
    fn draw(s: &mut Sampler) -> Self {
        let height_m = s.log_uniform(0.12, 0.6);
        let belly_m = height_m * s.log_uniform(0.13, 0.75);
        let neck_m = belly_m * s.uniform(0.22, 0.95);
        Self {
            height_m,
            belly_m,
            foot_m: belly_m * s.uniform(0.35, 0.9),
            neck_m,
            lip_m: neck_m * s.uniform(1.0, 1.7),
            belly_at: s.uniform(0.25, 0.65),
            neck_at: s.uniform(0.75, 0.92),
        }
    }

    fn at(&self, height: f64) -> f64 {
        height * self.height_m
    }
}

pub fn build(b: &mut Builder, s: &mut Sampler) {
    use Kind::{Bellied, Cylinder, Shouldered, Trumpet};
    let form = Form::draw(s);
    let kind = s.weighted(&[(3, Bellied), (1, Trumpet), (1, Cylinder), (1, Shouldered)]);
    let closed = s.chance(0.85);
    let bottom = Profile::from(if closed { 0.0 } else { form.foot_m }, 0.0);
    let outside = outside(bottom, &form, kind);
    let mut vessel = Vessel::new(outside, Wall::draw(s, form.belly_m), section(s));
    if !matches!(vessel.section, Section::Round) && s.chance(0.3) {
        vessel.twist_rad = s.uniform(-1.0, 1.0) * TAU / 4.0 / form.height_m;
    }
    vessel.build(b);
    let round = matches!(vessel.section, Section::Round);
    if round && kind == Bellied && s.chance(0.35) {
        handles(b, s, &form);
    }
    if closed && s.chance(0.17) {
        flowers(b, s, &form);
    }
}

fn section(s: &mut Sampler) -> Section {
    let (polygon, count) = (Section::Polygon(s.count(4, 8)), s.count(6, 16));
    let (square, depth) = (Section::Square(s.uniform(3.0, 7.0)), s.uniform(0.02, 0.08));
    let fluted = Section::Fluted { count, depth };
    let oval = Section::Oval(s.uniform(0.5, 0.9));
    s.weighted(&[(6, Section::Round), (1, polygon), (1, square), (1, fluted), (1, oval)])
}

fn outside(bottom: Profile, form: &Form, kind: Kind) -> Profile {
    let f = form;
    let bottom = bottom.line(f.foot_m, 0.0);
    match kind {
        Kind::Trumpet => bottom.curve(&[
            (0.75 * f.foot_m, f.at(0.3)),
            (0.9 * f.foot_m, f.at(0.65)),
            (1.05 * f.foot_m.max(f.lip_m), f.at(0.9)),
            (1.4 * f.foot_m.max(f.lip_m), f.at(1.0)),
        ]),
        Kind::Cylinder => {
            bottom.line(f.belly_m, f.at(0.01)).line(f.belly_m.max(f.lip_m), f.at(1.0))
        }
        Kind::Shouldered => bottom
            .curve(&[(0.85 * f.belly_m, f.at(0.35)), (f.belly_m, f.at(0.7))])
            .curve(&[(0.8 * f.belly_m, f.at(0.85)), (f.neck_m, f.at(0.93))])
            .line(f.lip_m, f.at(1.0)),
        Kind::Bellied => bottom.curve(&[
            (0.5 * (f.foot_m + f.belly_m), f.at(0.4 * f.belly_at)),
            (f.belly_m, f.at(f.belly_at)),
            (f.neck_m, f.at(f.neck_at)),
            (f.lip_m, f.at(1.0)),
        ]),
    }
}

/// Two handles from the neck to the belly, as on an amphora.
fn handles(b: &mut Builder, s: &mut Sampler, form: &Form) {
    let thick_m = 0.05 * form.height_m * s.uniform(0.5, 1.0);
    let out_m = form.belly_m * s.uniform(1.05, 1.35);
    let points = [
        (0.97 * form.neck_m, form.neck_at),
        (0.8 * out_m, form.neck_at + 0.04),
        (out_m, 0.5 * (form.neck_at + form.belly_at) + 0.05),
        (0.97 * form.belly_m, form.belly_at),
    ];
    let path = smooth(b, &points.map(|(x, z)| dvec3(x, 0.0, form.at(z))), 3);
    b.mirrored_x(|b| tube(b, &path, thick_m));
}

/// A few stems with leaves or blossoms.
fn flowers(b: &mut Builder, s: &mut Sampler, form: &Form) {
    for _ in 0..s.count(3, 7) {
        let out = DVec2::from_angle(s.uniform(0.0, TAU));
        let height_m = form.height_m * s.uniform(1.3, 2.1);
        let spread_m = form.height_m * s.uniform(0.05, 0.5);
        let r = 0.008 * form.height_m;
        let base = (0.2 * form.foot_m * out).extend(form.at(0.01));
        let mouth = (0.6 * form.neck_m * out).extend(form.at(form.neck_at));
        let tip = ((0.6 * form.neck_m + spread_m) * out).extend(height_m);
        smooth_tube(b, &[base, mouth, tip], 3, r);
        let size_m = form.height_m * s.uniform(0.12, 0.3);
        let turn = DAffine3::from_rotation_z(out.to_angle() + s.uniform(-1.0, 1.0));
        b.turned(tip, turn, |b| leaf(b, size_m));
    }
}

/// A pointed leaf that bends down along x.
fn leaf(b: &mut Builder, size_m: f64) {
    sheet(b, [size_m, 0.4 * size_m], |u, v| {
        let width = 0.4 * (u * (1.0 - u)).sqrt();
        let bend = 0.6 * u - 0.9 * u * u;
        size_m * dvec3(u, (2.0 * v - 1.0) * width, bend)
    });
}
