use super::Seat;
use crate::primitives::{Builder, DVec2, Sampler, dvec2, dvec3, outline, smooth, sweep, tube};
use crate::supports::{
    Legs, crossed_legs, disc_pedestal, four_legs, side_panels, sledge, star_pedestal,
};

pub fn build(b: &mut Builder, s: &mut Sampler, seat: &Seat) {
    let under_m = seat.under_m();
    let tube_m = s.uniform(0.01, 0.016);
    let legs_half = seat.legs_half(0.0);
    // Each base has some of the fourteen outcomes: legs five, a star two, and so on.
    match s.count(1, 14) {
        1..=5 => legged(b, s, seat),
        6..=7 => star_pedestal(b, s, seat.half.x * 1.15, under_m),
        8 => disc_pedestal(b, s, seat.half.x * 0.95, under_m),
        9..=10 => cantilever(b, seat, tube_m),
        11 => sledge(b, legs_half * dvec2(1.0, 0.85), under_m, tube_m),
        12 => crossed_legs(b, 0.92 * legs_half, under_m, 2.2 * tube_m),
        13 => side_panels(b, legs_half, under_m, 2.0 * tube_m),
        _ => rocker(b, s, seat),
    }
}

fn legged(b: &mut Builder, s: &mut Sampler, seat: &Seat) {
    let legs = Legs::draw(s, seat.top_m);
    let stretcher = if s.chance(0.35) { Some(s.uniform(0.2, 0.5)) } else { None };
    four_legs(b, &legs, seat.legs_half(legs.half_width_m), seat.under_m(), stretcher);
}

/// A tube from the rear of the seat along its underside, down in front and back along the floor.
/// The rear has no legs.
fn cantilever(b: &mut Builder, seat: &Seat, radius_m: f64) {
    let (x, y) = (seat.legs_half(radius_m).x, seat.half.y);
    let under_m = seat.under_m() - radius_m;
    let bend_m = 0.12 * seat.top_m;
    let points = [
        (0.9 * y, under_m),
        (-y + bend_m, under_m),
        (-y, under_m - bend_m),
        (-y, radius_m + bend_m),
        (-y + bend_m, radius_m),
        (0.9 * y, radius_m),
    ];
    let path = smooth(b, &points.map(|(y, z)| dvec3(x, y, z)), 1);
    b.mirrored_x(|b| tube(b, &path, radius_m));
    let rear = dvec3(x, 0.9 * y, radius_m);
    tube(b, &[rear, rear * dvec3(-1.0, 1.0, 1.0)], radius_m);
}

fn rocker(b: &mut Builder, s: &mut Sampler, seat: &Seat) {
    let runner_m = s.uniform(0.015, 0.025);
    let x = 0.85 * seat.legs_half(0.0).x;
    let y = 0.75 * seat.half.y;
    let at = |y: f64, z: f64| dvec3(x, y, z);
    let points = [(-1.9, 0.16), (-1.0, 0.045), (0.0, 0.0), (1.0, 0.045), (2.3, 0.22)];
    let path = smooth(b, &points.map(|(along, rise)| at(along * y, runner_m + rise)), 2);
    let section = outline::rectangle(DVec2::splat(runner_m));
    b.mirrored_x(|b| {
        sweep(b, &path, &section);
        for side in [-y, y] {
            tube(b, &[at(side, runner_m + 0.045), at(0.95 * side, seat.under_m())], 0.9 * runner_m);
        }
    });
}
