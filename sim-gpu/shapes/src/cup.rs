use crate::primitives::*;

struct Body {
    rim_m: f64,
    base_m: f64,
    height_m: f64,
    /// The bulge of the side between base and rim, over the radius of the rim.
    bulge: f64,
    /// The height of a stem under the body; 0 without one.
    stem_m: f64,
}

impl Body {
    fn draw(s: &mut Sampler) -> Self {
        let rim_m = s.log_uniform(0.028, 0.06);
        let height_m = rim_m * s.log_uniform(1.0, 3.6);
        let stemmed = s.chance(0.15);
        let stem_m = rim_m * s.uniform(0.6, 2.0);
        Self {
            rim_m,
            base_m: rim_m * s.uniform(0.5, 1.05),
            height_m,
            bulge: s.uniform(-0.08, 0.28),
            stem_m: if stemmed { stem_m } else { 0.0 },
        }
    }

    /// The outer radius and the height at a share of the body's height.
    fn at(&self, share: f64) -> (f64, f64) {
        let bulge_m = 4.0 * share * (1.0 - share) * self.bulge * self.rim_m;
        let radius_m = self.base_m + share * (self.rim_m - self.base_m) + bulge_m;
        (radius_m, self.stem_m + share * self.height_m)
    }

    fn outside(&self, bottomless: bool) -> Profile {
        let straight = self.bulge < 0.04;
        let profile = if self.stem_m > 0.0 {
            stem(self)
        } else if bottomless {
            Profile::from(self.base_m, 0.0)
        } else {
            Profile::from(0.0, 0.0).line(self.base_m, 0.0)
        };
        if straight {
            profile.line(self.rim_m, self.at(1.0).1)
        } else {
            profile.curve(&[self.at(0.2), self.at(0.5), self.at(0.8), self.at(1.0)])
        }
    }
}

/// A foot and a thin stem that widens to the base of the body.
fn stem(body: &Body) -> Profile {
    let thin_m = 0.12 * body.rim_m;
    Profile::from(0.0, 0.0)
        .line(0.85 * body.rim_m, 0.0)
        .line(0.8 * body.rim_m, 0.06 * body.rim_m)
        .curve(&[
            (2.0 * thin_m, 0.15 * body.rim_m + 0.05 * body.stem_m),
            (thin_m, 0.4 * body.stem_m),
            (thin_m, 0.85 * body.stem_m),
            (body.base_m, body.stem_m),
        ])
}

pub fn build(b: &mut Builder, s: &mut Sampler) {
    let body = Body::draw(s);
    let wall = Wall::draw(s, body.rim_m);
    let polygon = Section::Polygon(s.count(6, 10));
    let section = s.weighted(&[(4, Section::Round), (1, polygon)]);
    let bottomless = s.chance(0.1);
    let mut vessel = Vessel::new(body.outside(bottomless), wall, section);
    vessel.hollow_from_m = body.stem_m;
    let with_saucer = body.stem_m == 0.0 && body.height_m < 2.0 * body.rim_m && s.chance(0.4);
    let lift_m = if with_saucer { saucer(b, s, &body) } else { 0.0 };
    b.shifted(lift_m * DVec3::Z, |b| {
        vessel.build(b);
        if body.stem_m == 0.0 && s.chance(0.7) {
            handle(b, s, &body);
        }
    });
}

/// Builds the saucer under a cup and returns the height at which the cup stands.
fn saucer(b: &mut Builder, s: &mut Sampler, body: &Body) -> f64 {
    let rim_m = body.rim_m * s.uniform(1.45, 2.0);
    let lift_m = 0.06 * rim_m;
    Profile::from(0.0, lift_m)
        .line(0.8 * body.base_m, lift_m)
        .curve(&[(0.6 * rim_m, 1.4 * lift_m), (rim_m, 3.2 * lift_m)])
        .line(0.98 * rim_m, 2.9 * lift_m)
        .curve(&[(0.6 * rim_m, 0.6 * lift_m), (0.9 * body.base_m, 0.0)])
        .line(0.0, 0.0)
        .revolve(b, Section::Round);
    lift_m
}

/// A round, ear-shaped or angular handle of round or flat section.
fn handle(b: &mut Builder, s: &mut Sampler, body: &Body) {
    let (top, foot) = (s.uniform(0.72, 0.92), s.uniform(0.12, 0.35));
    let reach_m = s.uniform(0.3, 0.6) * (0.5 * body.rim_m + 0.3 * body.height_m);
    let [above, below] = [body.at(top), body.at(foot)];
    let out_m = above.0.max(below.0) + reach_m;
    let root = |(radius, z): (f64, f64)| (0.96 * radius, z);
    let fall = (above.1 - below.1) * s.uniform(0.0, 0.2);
    let round = vec![
        (0.7 * out_m + 0.3 * above.0, above.1 + 0.02 * body.height_m),
        (out_m, 0.5 * (above.1 + below.1)),
        (0.7 * out_m + 0.3 * below.0, below.1 - 0.02 * body.height_m),
    ];
    let ear = vec![
        (0.8 * out_m + 0.2 * above.0, above.1 + fall),
        (out_m, above.1 - fall),
        (0.5 * (out_m + below.0), below.1 + 1.5 * fall),
    ];
    let angular = vec![(out_m, above.1), (out_m, below.1 + fall)];
    let (is_smooth, between) =
        s.weighted(&[(2, (true, round)), (1, (true, ear)), (1, (false, angular))]);
    let points = [vec![root(above)], between, vec![root(below)]].concat();
    let points: Vec<_> = points.iter().map(|&(r, z)| dvec3(r, 0.0, z)).collect();
    let path = if is_smooth { smooth(b, &points, 3) } else { points };
    let thick_m = body.rim_m * s.uniform(0.07, 0.14);
    let wide_m = thick_m * s.uniform(1.0, 2.0);
    // The path lies in the plane y = 0, so a section's x is level across it.
    let section = outline::superellipse(dvec2(wide_m, thick_m), 2.5, b.around(thick_m, 6));
    sweep(b, &path, &section);
}
