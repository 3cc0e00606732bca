use super::body::Body;
use super::form::{Form, Style};
use super::wheel;
use crate::primitives::{Builder, DAffine3, DVec3, Sampler, bar, block, cushion, dvec3};

/// Builds the mirrors, and sometimes rails, a rack, a box or a spare wheel.
pub fn build(b: &mut Builder, s: &mut Sampler, form: &Form, body: &Body) {
    mirrors(b, s, form, body);
    let roof_y = 0.82 * form.roof_share * form.half.y;
    let roof_m = form.height_m - 0.04;
    let [front, rear] = [form.screen[1] - 0.25, form.rear[1] + 0.2];
    match form.style {
        Style::Estate | Style::Suv | Style::Minivan if s.chance(0.4) => b.mirrored_y(|b| {
            let rail = |x: f64| dvec3(x, roof_y, roof_m + 0.03);
            bar(b, rail(rear), rail(front), 0.04, 0.05);
        }),
        Style::Van if s.chance(0.15) => rack(b, [rear, front], roof_y, roof_m),
        _ => {}
    }
    if !form.style.is_boxy() && front - rear > 1.2 && s.chance(0.05) {
        let size = dvec3(s.uniform(1.2, 1.9), s.uniform(0.6, 0.9), s.uniform(0.3, 0.42));
        cushion(b, dvec3(0.5 * (front + rear), s.uniform(-0.2, 0.2), roof_m + 0.28), size, 0.1);
    }
    if form.style == Style::Suv && s.chance(0.12) {
        let at = dvec3(0.12 - form.half.x, s.uniform(-0.2, 0.1), form.top_m(form.rear[0]));
        b.turned(at - 0.12 * DVec3::Z, DAffine3::from_rotation_z(90f64.to_radians()), |b| {
            b.shifted(0.2 * DVec3::Y, |b| wheel::wheel(b, [form.wheel_m, 0.22, 0.02], 1.0));
        });
    }
}

/// Outside mirrors are about 0.2 m wide and 0.13 m high; those of vans are upright.
fn mirrors(b: &mut Builder, s: &mut Sampler, form: &Form, body: &Body) {
    let boxy = form.style.is_boxy();
    let x = form.screen[0] - s.uniform(0.25, 0.5);
    let height_m = if boxy { s.uniform(0.25, 0.4) } else { s.uniform(0.11, 0.17) };
    let size = dvec3(0.09, s.uniform(0.16, 0.24), height_m);
    let lift_m = 0.5 * height_m + s.uniform(-0.02, 0.06);
    let at = dvec3(x, body.shoulder_y(x) + 0.04 + 0.5 * size.y, form.top_m(x) + lift_m);
    b.mirrored_y(|b| {
        block(b, at, size);
        block(b, at - dvec3(0.0, 0.5 * size.y, 0.4 * height_m), dvec3(0.05, 0.14, 0.04));
    });
}

fn rack(b: &mut Builder, [rear, front]: [f64; 2], roof_y: f64, roof_m: f64) {
    for k in 0..4 {
        let x = rear + f64::from(k) / 3.0 * (front - rear);
        let at = |side: f64| dvec3(x, side * roof_y, roof_m + 0.15);
        bar(b, at(-1.0), at(1.0), 0.04, 0.04);
    }
    b.mirrored_y(|b| {
        let at = |x: f64| dvec3(x, roof_y, roof_m + 0.17);
        bar(b, at(rear), at(front), 0.03, 0.06);
    });
}
