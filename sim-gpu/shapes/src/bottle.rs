use crate::primitives::*;

struct Form {
    body_m: f64,
    neck_m: f64,
    /// The heights where the shoulder begins and where the neck begins.
    shoulder_at_m: f64,
    neck_at_m: f64,
    height_m: f64,
}

impl Form {
    fn draw(s: &mut Sampler) -> Self {
        let height_m = s.log_uniform(0.1, 0.4);
        let body_m = height_m * s.log_uniform(0.11, 0.34);
        let neck_share = s.uniform(0.05, 0.3);
        let shoulder_share = s.uniform(0.06, 0.35);
        Self {
            body_m,
            neck_m: body_m * s.uniform(0.22, 0.7),
            shoulder_at_m: height_m * (1.0 - neck_share - shoulder_share),
            neck_at_m: height_m * (1.0 - neck_share),
            height_m,
        }
    }
}

pub fn build(b: &mut Builder, s: &mut Sampler) {
    let form = Form::draw(s);
    let section = section(s);
    let wall = if s.chance(0.5) { Wall::Sheet } else { Wall::draw(s, form.body_m) };
    Vessel::new(outside(s, &form), wall, section).build(b);
    let closures: [fn(&mut Builder, &mut Sampler, &Form); 5] = [cap, cap, cork, pump, trigger];
    if s.chance(0.7) {
        s.pick(&closures)(b, s, &form);
    }
    if matches!(section, Section::Round) && s.chance(0.15) {
        handle(b, s, &form);
    }
}

fn section(s: &mut Sampler) -> Section {
    let oval = Section::Oval(s.uniform(0.4, 0.8));
    let square = Section::Square(s.uniform(3.0, 8.0));
    let polygon = Section::Polygon(s.pick(&[6, 8]));
    s.weighted(&[(6, Section::Round), (1, oval), (2, square), (1, polygon)])
}

fn outside(s: &mut Sampler, f: &Form) -> Profile {
    let waist = s.uniform(0.8, 0.95);
    let edge_m = 0.12 * f.body_m;
    let mut profile = Profile::from(0.0, 0.0);
    if s.chance(0.3) {
        profile = Profile::from(0.0, 0.3 * f.body_m).curve(&[(0.5 * f.body_m, 0.15 * f.body_m)]);
    }
    profile = profile.line(f.body_m - edge_m, 0.0).line(f.body_m, edge_m);
    let at = |share: f64| edge_m + share * (f.shoulder_at_m - edge_m);
    let top = (f.body_m, f.shoulder_at_m);
    let straight = profile.clone().line(f.body_m, f.shoulder_at_m);
    let waisted = profile.clone().curve(&[(f.body_m, at(0.2)), (waist * f.body_m, at(0.5)), top]);
    let bellied =
        profile.clone().curve(&[(1.2 * f.body_m, at(0.35)), (1.15 * f.body_m, at(0.7)), top]);
    let tapered = profile.clone().line(waist * f.body_m, f.shoulder_at_m);
    let ribbed = ribs(profile, f, at);
    let profile =
        s.weighted(&[(2, straight), (1, waisted), (1, ribbed), (1, bellied), (1, tapered)]);
    shoulder(s, profile, f)
}

/// A side with four ribs; `at` returns the height at a share of the side.
fn ribs(mut profile: Profile, f: &Form, at: impl Fn(f64) -> f64) -> Profile {
    for rib in 0..4 {
        let at = |share: f64| at((rib as f64 + share) / 4.0);
        profile = profile
            .line(f.body_m, at(0.7))
            .line(0.94 * f.body_m, at(0.8))
            .line(0.94 * f.body_m, at(0.9))
            .line(f.body_m, at(1.0));
    }
    profile
}

/// A round, sloping or stepped shoulder, and the neck with its lip.
fn shoulder(s: &mut Sampler, profile: Profile, f: &Form) -> Profile {
    let between = |share: f64| f.shoulder_at_m + share * (f.neck_at_m - f.shoulder_at_m);
    let radius = |share: f64| f.neck_m + share * (f.body_m - f.neck_m);
    let neck = (f.neck_m, f.neck_at_m);
    let round = [(radius(0.9), between(0.35)), (radius(0.5), between(0.75)), neck];
    let sloping = [(radius(0.6), between(0.4)), (radius(0.2), between(0.75)), neck];
    let [round, sloping] = [round, sloping].map(|through| profile.clone().curve(&through));
    let profile = s.pick(&[round, sloping, profile.line(f.neck_m, f.neck_at_m)]);
    let lip_m = 0.06 * f.height_m;
    let profile = profile.line(0.96 * f.neck_m, f.height_m - lip_m);
    if s.chance(0.6) {
        let swell_m = f.neck_m * s.uniform(1.08, 1.25);
        profile.line(swell_m, f.height_m - 0.95 * lip_m).line(swell_m, f.height_m)
    } else {
        profile.line(0.96 * f.neck_m, f.height_m)
    }
}

fn cap(b: &mut Builder, s: &mut Sampler, f: &Form) {
    let high_m = f.height_m * s.uniform(0.05, 0.14);
    let radius_m = f.neck_m * s.uniform(1.2, 1.4);
    let base = (f.height_m - 0.8 * high_m) * DVec3::Z;
    frustum(b, base, [radius_m, radius_m * s.uniform(0.85, 1.0)], high_m);
}

fn cork(b: &mut Builder, s: &mut Sampler, f: &Form) {
    let high_m = f.height_m * s.uniform(0.04, 0.1);
    frustum(b, (f.height_m - 0.5 * high_m) * DVec3::Z, [0.8 * f.neck_m, 0.95 * f.neck_m], high_m);
}

/// A soap pump: collar, stem and a spout to the front.
fn pump(b: &mut Builder, s: &mut Sampler, f: &Form) {
    let top_m = f.height_m * s.uniform(1.15, 1.3);
    let thin_m = 0.25 * f.neck_m;
    let reach_m = f.body_m * s.uniform(0.7, 1.2);
    cylinder(b, 0.97 * f.height_m * DVec3::Z, 1.15 * f.neck_m, 0.06 * f.height_m);
    cylinder(b, f.height_m * DVec3::Z, thin_m, top_m - f.height_m);
    let points = [(0.4 * thin_m, 0.0), (-0.6 * reach_m, 0.01), (-reach_m, -0.05)];
    let points = points.map(|(y, z)| dvec3(0.0, y, top_m + z * f.height_m));
    smooth_tube(b, &points, 2, 1.3 * thin_m);
}

/// A spray head with a nozzle and a trigger.
fn trigger(b: &mut Builder, s: &mut Sampler, f: &Form) {
    let size_m = f.body_m * s.uniform(0.7, 1.0);
    let z = f.height_m + 0.25 * size_m;
    cylinder(b, 0.96 * f.height_m * DVec3::Z, 1.1 * f.neck_m, 0.05 * f.height_m);
    block(b, dvec3(0.0, -0.3 * size_m, z), dvec3(0.45 * size_m, 1.7 * size_m, 0.5 * size_m));
    let lever = [(-0.7, -0.1), (-0.8, -0.6), (-1.05, -1.0)];
    let lever = lever.map(|(y, dz)| dvec3(0.0, y * size_m, z + dz * size_m));
    smooth_tube(b, &lever, 2, 0.1 * size_m);
    let forwards = DAffine3::from_rotation_x(std::f64::consts::FRAC_PI_2);
    b.turned(dvec3(0.0, -1.1 * size_m, z), forwards, |b| {
        cylinder(b, DVec3::ZERO, 0.15 * size_m, 0.25 * size_m);
    });
}

/// A jug's handle from the neck to the body.
fn handle(b: &mut Builder, s: &mut Sampler, f: &Form) {
    let reach_m = f.body_m * s.uniform(1.2, 1.5);
    let low_m = f.shoulder_at_m * s.uniform(0.6, 0.95);
    let high_m = 0.5 * (f.neck_at_m + f.height_m);
    let points = [
        (0.9 * f.neck_m, high_m),
        (0.7 * reach_m, high_m + 0.02 * f.height_m),
        (reach_m, 0.5 * (high_m + low_m)),
        (0.92 * f.body_m, low_m),
    ];
    smooth_tube(b, &points.map(|(x, z)| dvec3(x, 0.0, z)), 3, 0.12 * f.body_m);
}
