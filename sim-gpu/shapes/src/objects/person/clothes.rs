use super::body::{Leg, Measures};
use super::pose::Pose;
use crate::primitives::*;

/// A hood on a trunk that is upright above the middle of the hip joints.
pub fn above_waist(b: &mut Builder, s: &mut Sampler, measures: &Measures) {
    let h = measures.stature_m;
    if s.chance(0.15) {
        // A hood or a thick collar that lies on the shoulders.
        let at = dvec3(-0.045 * h, 0.0, measures.neck_m() - 0.01 * h);
        ellipsoid(b, at, h * dvec3(0.045, 0.065, 0.035));
    }
}

/// A skirt or the lower part of a coat around the thighs.
pub fn below_waist(b: &mut Builder, s: &mut Sampler, measures: &Measures, pose: &Pose) {
    let h = measures.stature_m;
    // Persons who sit or run wear trousers.
    let [right, left] = pose.legs;
    let upright = right.knee.z.max(left.knee.z) < pose.pelvis.z - 0.15 * h;
    if !s.chance(0.3) || !upright {
        return;
    }
    let length_m = s.uniform(0.18, 0.42) * h;
    let flare = s.uniform(1.0, 1.35);
    let at_hem = |leg: &Leg| {
        let hip = pose.pelvis;
        hip.lerp(leg.knee, (length_m / (Measures::THIGH * h)).min(1.4)).x - hip.x
    };
    let [a, c] = [at_hem(&right), at_hem(&left)];
    let [behind, ahead] = [a.min(c), a.max(c)];
    let half = dvec2(0.07, 0.1) * h * measures.girth + DVec2::splat(measures.cloth_m[0] + 0.01);
    let ring = |half: DVec2, x: f64, z: f64| {
        let outline = outline::ellipse(half, 12);
        outline.iter().map(|p| pose.pelvis + (p + DVec2::X * x).extend(z)).collect()
    };
    let hem = dvec2(0.5 * (ahead - behind) + 0.06 * h, half.y * flare);
    let middle = 0.5 * (behind + ahead);
    skin(
        b,
        &[
            ring(hem, middle, -length_m),
            ring(half.lerp(hem, 0.45), 0.5 * middle, -0.45 * length_m),
            ring(half, 0.0, 0.03 * h),
        ],
    );
}

/// Hair, a hat, a cap or a hood on the head, above the foot of the neck.
pub fn on_head(b: &mut Builder, s: &mut Sampler, measures: &Measures) {
    let half_m = measures.head_m();
    let middle = measures.head_middle();
    let worn = s.uniform(0.0, 1.0);
    if worn < 0.25 {
        // Long hair, open or as a tail.
        let down = s.uniform(0.3, 1.2) * half_m;
        let radii = half_m * dvec3(0.45, s.uniform(0.4, 0.75), 1.1);
        ellipsoid(b, middle - dvec3(0.6 * half_m, 0.0, down), radii);
    } else if worn < 0.33 {
        let brim_m = s.uniform(1.1, 1.7) * half_m;
        frustum(b, middle + 0.45 * half_m * DVec3::Z, [brim_m, brim_m], 0.02);
        frustum(
            b,
            middle + 0.45 * half_m * DVec3::Z,
            [0.85 * half_m, 0.75 * half_m],
            0.75 * half_m,
        );
    } else if worn < 0.45 {
        ellipsoid(b, middle + 0.3 * half_m * DVec3::Z, half_m * dvec3(0.95, 0.8, 0.85));
    } else if worn < 0.55 {
        ellipsoid(b, middle - 0.15 * half_m * DVec3::X, half_m * dvec3(1.05, 0.95, 1.2));
    } else if worn < 0.75 {
        // Hair that adds to the volume of the head.
        let radii = half_m * dvec3(0.9, s.uniform(0.74, 0.95), 0.9);
        ellipsoid(b, middle + half_m * dvec3(-0.15, 0.0, 0.2), radii);
    }
}
