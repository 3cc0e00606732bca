mod screen;

use crate::primitives::*;
use screen::Screen;

/// Builds the stand of a flat screen up to the gap below the screen. The last argument is half the
/// size of the foot.
type Stand = fn(&mut Builder, &mut Sampler, &Screen, f64, DVec2);

pub const MAKES: Makes = &[(4, flat), (2, tube_monitor), (1, pair)];

fn flat(b: &mut Builder, s: &mut Sampler) {
    let screen = Screen::draw(s);
    let gap_m = screen.height_m * s.uniform(0.08, 0.4);
    let middle_m = gap_m + 0.5 * screen.height_m;
    let tilt_rad = if s.chance(0.5) { s.uniform(-0.25, 0.0) } else { 0.0 };
    stand(b, s, &screen, gap_m);
    let tilt = DAffine3::from_rotation_y(tilt_rad);
    b.turned(middle_m * DVec3::Z, tilt, |b| screen.build(b, s));
}

fn stand(b: &mut Builder, s: &mut Sampler, screen: &Screen, gap_m: f64) {
    // The last one is for screens on a wall.
    let stand: Stand =
        s.pick(&[disc, disc, plate, plate, feet, bent_foot, wedge, |_, _, _, _, _| {}]);
    let foot = dvec2(0.35 * screen.height_m, screen.width_m * s.uniform(0.2, 0.35));
    stand(b, s, screen, gap_m, foot);
}

fn disc(b: &mut Builder, s: &mut Sampler, screen: &Screen, gap_m: f64, foot: DVec2) {
    let oval = outline::ellipse(foot * dvec2(0.7, 0.8), b.around(foot.y, 16));
    prism(b, &oval, 0.0, 0.03 * screen.height_m, 0.9);
    neck(b, s, screen, gap_m);
}

fn plate(b: &mut Builder, s: &mut Sampler, screen: &Screen, gap_m: f64, foot: DVec2) {
    let thick_m = 0.03 * screen.height_m;
    block(b, 0.5 * thick_m * DVec3::Z, dvec3(1.2 * foot.x, 1.5 * foot.y, thick_m));
    neck(b, s, screen, gap_m);
}

/// A round or flat neck from the foot to the back of the screen.
fn neck(b: &mut Builder, s: &mut Sampler, screen: &Screen, gap_m: f64) {
    let top_m = gap_m + screen.height_m * s.uniform(0.1, 0.5);
    let back_m = -0.5 * screen.depth_m - 0.02 * screen.height_m;
    let wide_m = screen.width_m * s.uniform(0.05, 0.2);
    let thick_m = screen.height_m * s.uniform(0.03, 0.07);
    let top = dvec3(back_m, 0.0, top_m);
    if s.chance(0.4) {
        rod(b, dvec3(back_m, 0.0, 0.0), top, [0.6 * thick_m; 2]);
    } else {
        bar(b, dvec3(back_m - 0.05 * screen.height_m, 0.0, 0.0), top, wide_m, thick_m);
    }
    let deep_m = 0.04 * screen.height_m + screen.depth_m;
    block(b, top, dvec3(deep_m, 1.2 * wide_m, 2.0 * thick_m));
}

/// Two splayed feet near the ends, as under a television.
fn feet(b: &mut Builder, _: &mut Sampler, screen: &Screen, gap_m: f64, foot: DVec2) {
    let wide_m = 0.03 * screen.width_m;
    for side in [-1.0, 1.0] {
        let y = side * 0.35 * screen.width_m;
        let top = dvec3(0.0, y, gap_m + 0.02 * screen.height_m);
        for reach in [-1.0, 1.0] {
            bar(b, dvec3(reach * foot.x, y + side * 0.02, 0.5 * wide_m), top, wide_m, wide_m);
        }
    }
}

/// A bent sheet of metal that is foot, bow and back support.
fn bent_foot(b: &mut Builder, _: &mut Sampler, screen: &Screen, gap_m: f64, foot: DVec2) {
    let half_m = 0.6 * foot.y;
    let top_m = gap_m + 0.4 * screen.height_m;
    let back_m = -0.5 * screen.depth_m;
    let thick_m = 0.015 * screen.height_m;
    let path = [(foot.x, 0.0), (-0.5 * foot.x, 0.0), (back_m, top_m)];
    for pair in path.windows(2) {
        let at = |(x, z): (f64, f64)| dvec3(x, 0.0, z + thick_m);
        bar(b, at(pair[0]), at(pair[1]), 2.0 * half_m, thick_m);
    }
}

/// A solid foot that narrows upwards.
fn wedge(b: &mut Builder, _: &mut Sampler, screen: &Screen, gap_m: f64, foot: DVec2) {
    let low = outline::rectangle(dvec2(0.6 * foot.x, foot.y));
    let high = outline::rectangle(dvec2(0.5 * screen.depth_m, 0.5 * foot.y));
    let top_m = gap_m + 0.05 * screen.height_m;
    loft(b, &[outline::at_height(&low, 0.0), outline::at_height(&high, top_m)]);
}

/// A deep housing that narrows to the back, on a swivel foot.
fn tube_monitor(b: &mut Builder, s: &mut Sampler) {
    let width_m = s.uniform(0.32, 0.6);
    let height_m = width_m * s.uniform(0.75, 0.95);
    let depth_m = width_m * s.uniform(0.6, 1.05);
    let front_m = depth_m * s.uniform(0.12, 0.35);
    let back = s.uniform(0.45, 0.75);
    let foot_m = height_m * s.uniform(0.05, 0.15);
    cylinder(b, DVec3::ZERO, 0.3 * width_m, 0.5 * foot_m);
    // The column is long enough to end inside the housing.
    cylinder(b, 0.4 * foot_m * DVec3::Z, 0.15 * width_m, 0.6 * foot_m + 0.4 * height_m);
    let half = dvec2(0.5 * height_m, 0.5 * width_m);
    let section = |x: f64, scale: f64| -> Vec<DVec3> {
        let outline = outline::rounded_rectangle(half * scale, 0.08 * height_m * scale, 2);
        // The x of the outline points down, so that the outline is counter-clockwise about +x.
        outline.iter().map(|p| dvec3(x, p.y, foot_m + half.x - p.x)).collect()
    };
    let waist = 0.5 * (1.0 + back);
    let sections = [
        section(-depth_m, 0.9 * back),
        section(-0.85 * depth_m, back),
        section(-front_m - 0.05 * depth_m, waist),
        section(-front_m, 1.0),
        section(0.0, 1.0),
        section(0.0, 0.86),
        section(-0.03 * depth_m, 0.82),
    ];
    b.shifted(0.45 * depth_m * DVec3::X, |b| {
        skin(b, &sections);
        cap_start(b, &sections[0]);
        let glass = dvec3(-0.03 * depth_m, 0.0, foot_m + half.x);
        picture(b, glass, 1.64 * half, s.uniform(0.0, 0.05) * depth_m);
    });
}

/// A bulging picture tube of `size` (height, width) about `centre`.
fn picture(b: &mut Builder, centre: DVec3, size: DVec2, bulge_m: f64) {
    sheet(b, [size.y, size.x], |u, v| {
        let bulge = bulge_m * 16.0 * u * (1.0 - u) * v * (1.0 - v);
        centre + dvec3(bulge, (u - 0.5) * size.y, (v - 0.5) * size.x)
    });
}

/// Two equal screens that face each other a little, on one pole.
fn pair(b: &mut Builder, s: &mut Sampler) {
    let mut screen = Screen::draw(s);
    screen.width_m = s.uniform(0.4, 0.65);
    screen.height_m = screen.width_m / s.uniform(1.25, 1.8);
    let gap_m = screen.height_m * s.uniform(0.2, 0.4);
    let turn_rad = s.uniform(0.05, 0.35);
    let middle_m = gap_m + 0.5 * screen.height_m;
    for side in [-1.0, 1.0] {
        let y = side * 0.52 * screen.width_m * libm::cos(turn_rad);
        let turn = DAffine3::from_rotation_z(-side * turn_rad);
        b.turned(dvec3(0.0, y, middle_m), turn, |b| screen.build(b, s));
    }
    let back_m = -screen.depth_m - 0.04;
    let reach = dvec3(back_m, 0.5 * screen.width_m, middle_m);
    bar(b, reach * dvec3(1.0, -1.0, 1.0), reach, 0.04, 0.04);
    for side in [-1.0, 1.0] {
        block(b, dvec3(0.5 * back_m, side * reach.y, middle_m), dvec3(-back_m, 0.1, 0.1));
    }
    block(b, dvec3(back_m, 0.0, 0.01), dvec3(0.6 * screen.height_m, 0.5 * screen.width_m, 0.02));
    cylinder(b, dvec3(back_m, 0.0, 0.0), 0.022, middle_m);
}
