mod desk;

use desk::desk;

use crate::primitives::*;
use crate::supports::{
    Legs, crossed_legs, disc_pedestal, four_legs, side_panels, sledge, star_pedestal,
};

/// The size of a table and the outline of its top.
struct Top {
    half: DVec2,
    height_m: f64,
    /// The thickness; 0 for glass, which is a single sheet.
    thick_m: f64,
    shape: Shape,
}

#[derive(Clone, Copy, PartialEq)]
enum Shape {
    Rectangle,
    Rounded,
    Soft,
    Round,
    Oval,
}

#[derive(Clone, Copy)]
enum Support {
    Legs,
    Panels,
    Trestle,
    Desk,
    Crossed,
    Sledge,
    Disc,
    Star,
}

impl Top {
    /// Draws a top between the sizes of a stool and of a banquet table. The long side lies along y.
    fn draw(s: &mut Sampler) -> Self {
        use Shape::{Oval, Rectangle, Round, Rounded, Soft};
        let height_m = s.log_uniform(0.32, 1.05);
        let width_m = s.log_uniform(0.35, 1.0);
        let shape = s.weighted(&[(3, Rectangle), (1, Rounded), (1, Soft), (1, Round), (1, Oval)]);
        let ratio = if shape == Round { 1.0 } else { s.log_uniform(1.0, 2.6) };
        let half = dvec2(0.5 * width_m, 0.5 * width_m * ratio);
        let thick_m = s.log_uniform(0.01, 0.07);
        let glass = s.chance(0.12);
        Self { half, height_m, thick_m: if glass { 0.0 } else { thick_m }, shape }
    }

    fn outline(&self, b: &Builder) -> Vec<DVec2> {
        let n = b.around(self.half.y, 16);
        let radius_m = 0.3 * self.half.x;
        match self.shape {
            Shape::Rounded => {
                outline::rounded_rectangle(self.half, radius_m, b.around(radius_m, 12) / 4)
            }
            Shape::Soft => outline::superellipse(self.half, 4.0, n),
            Shape::Round | Shape::Oval => outline::ellipse(self.half, n),
            Shape::Rectangle => outline::rectangle(self.half),
        }
    }

    fn angular(&self) -> bool {
        matches!(self.shape, Shape::Rectangle | Shape::Rounded)
    }

    /// Half the size of the rectangle at whose corners the legs stand.
    fn legs_half(&self, inset_m: f64) -> DVec2 {
        let share = if self.angular() { 0.96 } else { 0.66 };
        (share * self.half - inset_m).max(0.4 * self.half)
    }

    fn under_m(&self) -> f64 {
        self.height_m - self.thick_m
    }
}

pub fn build(b: &mut Builder, s: &mut Sampler) {
    use Support::{Crossed, Desk, Disc, Legs, Panels, Sledge, Star, Trestle};
    let top = Top::draw(s);
    build_top(b, s, &top);
    let support = s.pick(if top.angular() {
        &[Legs, Legs, Legs, Panels, Trestle, Desk, Crossed, Sledge, Disc][..]
    } else {
        &[Legs, Legs, Disc, Disc, Star, Crossed]
    });
    let reach_m = top.half.x * s.uniform(0.5, 0.85);
    let thick_m = top.half.x * s.uniform(0.04, 0.12);
    let inner = top.legs_half(thick_m);
    match support {
        Panels => {
            let half = dvec2(0.96 * top.half.y, 0.95 * top.half.x);
            turned(b, |b| side_panels(b, half, top.under_m(), thick_m));
            back_panel(b, s, &top, inner.y);
        }
        Trestle => trestle(b, s, &top),
        Desk => desk(b, s, &top),
        Crossed => turned(b, |b| {
            crossed_legs(b, dvec2(0.8 * inner.y, inner.x), top.under_m(), thick_m);
        }),
        Sledge => turned(b, |b| {
            sledge(b, dvec2(inner.y, 0.9 * inner.x), top.under_m(), 0.5 * thick_m);
        }),
        Disc => disc_pedestal(b, s, reach_m, top.under_m()),
        Star => star_pedestal(b, s, reach_m, top.under_m()),
        Legs => legged(b, s, &top),
    }
}

/// Builds with x and y exchanged by a quarter turn, because supports are made for furniture that is
/// wide along x.
fn turned(b: &mut Builder, build: impl FnOnce(&mut Builder)) {
    b.place(DAffine3::from_rotation_z(std::f64::consts::FRAC_PI_2), build);
}

fn build_top(b: &mut Builder, s: &mut Sampler, top: &Top) {
    let outline = top.outline(b);
    if top.thick_m == 0.0 {
        cap(b, &outline::at_height(&outline, top.height_m));
    } else {
        prism(b, &outline, top.under_m(), top.height_m, s.pick(&[1.0, 1.0, 1.02, 0.97]));
    }
}

/// Four legs, with stretchers, an apron or a lower shelf.
fn legged(b: &mut Builder, s: &mut Sampler, top: &Top) {
    let legs = Legs::draw(s, top.height_m);
    let half = top.legs_half(legs.half_width_m);
    let stretcher = if s.chance(0.2) { Some(s.uniform(0.12, 0.4)) } else { None };
    four_legs(b, &legs, half, top.under_m(), stretcher);
    if s.chance(0.5) {
        apron(b, s, top, half);
    }
    if s.chance(0.25) {
        let z = top.height_m * s.uniform(0.15, 0.45);
        block(b, z * DVec3::Z, (2.0 * half).extend(0.5 * top.thick_m.max(0.016)));
    }
}

/// Boards under the top's edge, between the legs.
fn apron(b: &mut Builder, s: &mut Sampler, top: &Top, half: DVec2) {
    let high_m = top.height_m * s.uniform(0.05, 0.16);
    let thin_m = 0.02;
    let z = top.under_m() - 0.5 * high_m;
    for side in [-1.0, 1.0] {
        block(b, dvec3(side * half.x, 0.0, z), dvec3(thin_m, 2.0 * half.y, high_m));
        block(b, dvec3(0.0, side * half.y, z), dvec3(2.0 * half.x, thin_m, high_m));
    }
}

fn back_panel(b: &mut Builder, s: &mut Sampler, top: &Top, half_y_m: f64) {
    if s.chance(0.6) {
        let low_m = top.height_m * s.uniform(0.0, 0.6);
        let x = top.half.x * s.pick(&[0.0, 0.8]);
        let low = dvec3(x - 0.01, -half_y_m, low_m);
        block_between(b, low, dvec3(x + 0.01, half_y_m, top.under_m()));
    }
}

/// Two T- or A-shaped trestles joined by a beam.
fn trestle(b: &mut Builder, s: &mut Sampler, top: &Top) {
    let wide_m = top.height_m * s.uniform(0.06, 0.12);
    let y_m = top.half.y * s.uniform(0.55, 0.8);
    let reach_m = 0.8 * top.half.x;
    let splayed = s.chance(0.5);
    let z = top.height_m * s.uniform(0.25, 0.5);
    for side in [-1.0, 1.0] {
        let at = |x: f64, z: f64| dvec3(x, side * y_m, z);
        if splayed {
            for lean in [-1.0, 1.0] {
                let rung = at(lean * reach_m * (1.0 - 0.7 * z / top.under_m()), z);
                bar(b, at(0.0, z), rung, 0.6 * wide_m, 0.6 * wide_m);
                let high = at(0.3 * lean * reach_m, top.under_m());
                bar(b, at(lean * reach_m, 0.0), high, wide_m, wide_m);
            }
        } else {
            block(b, at(0.0, 0.5 * wide_m), dvec3(2.0 * reach_m, wide_m, wide_m));
            block(b, at(0.0, 0.5 * top.under_m()), dvec3(2.0 * wide_m, wide_m, top.under_m()));
        }
        block(b, at(0.0, top.under_m() - 0.5 * wide_m), dvec3(2.0 * reach_m, wide_m, wide_m));
    }
    bar(b, dvec3(0.0, -y_m, z), dvec3(0.0, y_m, z), 0.6 * wide_m, wide_m);
}
