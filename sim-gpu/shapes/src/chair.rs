mod back;
mod base;

use crate::primitives::*;

/// The seat of a chair that faces -y. All other parts are fitted to it.
struct Seat {
    half: DVec2,
    top_m: f64,
    thick_m: f64,
    shape: Shape,
}

#[derive(Clone, Copy, PartialEq)]
enum Shape {
    Board,
    Rounded,
    Cushion,
    Round,
}

#[derive(Clone, Copy, PartialEq)]
enum Arms {
    /// A rest on two posts.
    Posts,
    /// A tube that rises from the seat and returns to it.
    Loop,
    /// A tube from the seat's front to the back.
    Bent,
}

impl Seat {
    fn draw(s: &mut Sampler) -> Self {
        use Shape::{Board, Cushion, Round, Rounded};
        let width_m = s.uniform(0.36, 0.58);
        let depth_m = width_m * s.uniform(0.82, 1.15);
        let tall = s.chance(0.12);
        let top_m = if tall { s.uniform(0.6, 0.8) } else { s.uniform(0.34, 0.52) };
        let shape = s.pick(&[Board, Board, Rounded, Cushion, Cushion, Round]);
        let thick_m = if shape == Cushion { s.uniform(0.06, 0.14) } else { s.uniform(0.015, 0.05) };
        Self { half: dvec2(width_m, depth_m) / 2.0, top_m, thick_m, shape }
    }

    fn under_m(&self) -> f64 {
        self.top_m - self.thick_m
    }

    /// Half the size of the rectangle at whose corners the legs stand.
    fn legs_half(&self, inset_m: f64) -> DVec2 {
        let share = if self.shape == Shape::Round { 0.68 } else { 0.95 };
        share * self.half - inset_m
    }

    /// Half the width of the seat at `y` behind its middle, reduced a little so that parts fixed
    /// there overlap the seat.
    fn side_m(&self, y: f64) -> f64 {
        let share = if self.shape == Shape::Round { y / self.half.y } else { 0.0 };
        0.96 * self.half.x * (1.0 - share * share).max(0.0).sqrt()
    }

    /// The distance of the back behind the middle of the seat.
    fn rear_m(&self) -> f64 {
        self.half.y * if self.shape == Shape::Round { 0.68 } else { 0.9 }
    }

    fn build(&self, b: &mut Builder) {
        let corner_m = 0.35 * self.half.x;
        let outline = match self.shape {
            Shape::Cushion => {
                let middle = (self.top_m - 0.5 * self.thick_m) * DVec3::Z;
                let size = (2.0 * self.half).extend(self.thick_m);
                return cushion(b, middle, size, 0.4 * self.thick_m);
            }
            Shape::Rounded => {
                outline::rounded_rectangle(self.half, corner_m, b.around(corner_m, 12) / 4)
            }
            Shape::Round => outline::ellipse(self.half, b.around(self.half.x, 16)),
            Shape::Board => outline::rectangle(self.half),
        };
        prism(b, &outline, self.under_m(), self.top_m, 1.0);
    }
}

pub fn build(b: &mut Builder, s: &mut Sampler) {
    if s.chance(0.14) {
        return club_chair(b, s);
    }
    let seat = Seat::draw(s);
    seat.build(b);
    base::build(b, s, &seat);
    back::build(b, s, &seat);
    if s.chance(0.35) {
        arms(b, s, &seat);
    }
}

/// Arms on posts, as loops of tube, or bent down to the front.
fn arms(b: &mut Builder, s: &mut Sampler, seat: &Seat) {
    let z = seat.top_m + s.uniform(0.16, 0.26);
    let x = seat.half.x + s.uniform(0.0, 0.03);
    let [front, rear] = [-0.7 * seat.half.y, 1.05 * seat.rear_m()];
    let r = s.uniform(0.01, 0.02);
    let wide_m = s.uniform(0.03, 0.07);
    let kind = s.pick(&[Arms::Posts, Arms::Posts, Arms::Loop, Arms::Bent]);
    let mid_m = seat.top_m - 0.5 * seat.thick_m;
    let end = match kind {
        Arms::Loop => dvec3(seat.side_m(rear), rear, mid_m),
        Arms::Posts | Arms::Bent => dvec3(x, rear, z),
    };
    let points = [
        dvec3(seat.side_m(front), front, mid_m),
        dvec3(x, front - 0.04, 0.5 * (z + mid_m)),
        dvec3(x, 0.5 * front, z),
        end,
    ];
    let path = smooth(b, &points, 3);
    b.mirrored_x(|b| {
        if kind == Arms::Posts {
            bar(b, dvec3(x, front, z), dvec3(x, rear, z), wide_m, 0.02);
            for y in [0.8 * front, 0.45 * seat.half.y] {
                rod(b, dvec3(seat.side_m(y), y, mid_m), dvec3(x, y, z), [r, r]);
            }
        } else {
            tube(b, &path, r);
        }
    });
}

/// An upholstered armchair: a base, a cushion, two thick arms and a thick back.
fn club_chair(b: &mut Builder, s: &mut Sampler) {
    let inner_m = s.uniform(0.22, 0.34);
    let arm_m = s.uniform(0.06, 0.18);
    let deep_m = s.uniform(0.34, 0.46);
    let feet_m = s.uniform(0.02, 0.16);
    let seat_m = feet_m + s.uniform(0.24, 0.34);
    let arm_top_m = seat_m + s.uniform(0.08, 0.24);
    let back_top_m = arm_top_m + s.uniform(0.0, 0.4);
    let soft_m = s.uniform(0.015, 0.06);
    let half_m = inner_m + arm_m;
    let soft = |b: &mut Builder, low: [f64; 3], high: [f64; 3]| {
        let [low, high] = [low, high].map(DVec3::from);
        cushion(b, (low + high) / 2.0, high - low, soft_m);
    };
    let base_top_m = seat_m - 0.12;
    let base = dvec3(half_m, 0.95 * deep_m, base_top_m);
    block_between(b, dvec3(-base.x, -base.y, feet_m), base);
    soft(b, [-inner_m, -deep_m, base_top_m], [inner_m, 0.6 * deep_m, seat_m]);
    soft(b, [-half_m, 0.55 * deep_m, feet_m], [half_m, deep_m + 0.06, back_top_m]);
    b.mirrored_x(|b| {
        soft(b, [inner_m, -deep_m, feet_m], [half_m, deep_m, arm_top_m]);
        for y in [-0.8 * deep_m, 0.8 * deep_m] {
            let x = half_m - 0.06;
            rod(b, dvec3(x, y, 0.0), dvec3(x, y, feet_m + 0.02), [0.015, 0.025]);
        }
    });
}
