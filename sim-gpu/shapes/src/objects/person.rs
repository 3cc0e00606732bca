//! Persons who walk, stand or sit, with clothes and things that they carry or push.

pub(super) mod body;
mod carried;
mod clothes;
mod pose;

use crate::primitives::{Builder, DAffine3, DVec3, Sampler, dvec3};
use body::Measures;
use pose::Pose;

/// Builds a grown-up person.
///
/// Stature is normally distributed about 1.75 m for men and 1.62 m for women, with a standard
/// deviation of 0.07 m (NCD Risk Factor Collaboration, eLife 2016: means by country of 1.60 to 1.83
/// m and 1.49 to 1.70 m).
pub fn build(b: &mut Builder, s: &mut Sampler) {
    let mean_m = s.pick(&[1.75, 1.62]);
    let stature_m = (mean_m + 0.07 * normal(s)).clamp(1.45, 2.0);
    figure(b, s, stature_m);
}

/// Builds a child of 0.9 to 1.5 m: three to twelve years (WHO growth standards: medians of 0.95 m
/// at three and 1.5 m at twelve years).
pub fn child(b: &mut Builder, s: &mut Sampler) {
    let stature_m = s.uniform(0.9, 1.5);
    figure(b, s, stature_m);
}

/// A number of mean 0 and standard deviation 1: the sum of twelve uniform numbers.
fn normal(s: &mut Sampler) -> f64 {
    (0..12).map(|_| s.uniform(-0.5, 0.5)).sum()
}

/// A person of stature `stature_m` in any pose.
fn figure(b: &mut Builder, s: &mut Sampler, stature_m: f64) {
    let measures = Measures::draw(s, stature_m);
    let mut pose = Pose::draw(s, &measures);
    let carried = carried::draw(s, &measures, &mut pose);
    let trunk = DAffine3::from_translation(pose.pelvis)
        * DAffine3::from_rotation_z(pose.twist_rad)
        * DAffine3::from_rotation_y(pose.lean_rad);
    b.place(trunk, |b| {
        measures.trunk(b);
        clothes::above_waist(b, s, &measures);
    });
    let neck = trunk.transform_point3(DVec3::Z * measures.neck_m());
    let head = DAffine3::from_translation(neck)
        * DAffine3::from_rotation_z(pose.look_rad[0])
        * DAffine3::from_rotation_y(pose.look_rad[1]);
    b.place(head, |b| {
        measures.head(b);
        clothes::on_head(b, s, &measures);
    });
    for (side, leg) in [-1.0, 1.0].into_iter().zip(pose.legs) {
        measures.leg(b, pose.pelvis + side * measures.hip_joint_m() * DVec3::Y, leg);
    }
    clothes::below_waist(b, s, &measures, &pose);
    for (side, hand) in [-1.0, 1.0].into_iter().zip(pose.hands) {
        let shoulder = trunk.transform_point3(measures.shoulder(side));
        measures.arm(b, shoulder, hand, dvec3(-0.7, 0.5 * side, -0.7));
    }
    carried::build(b, s, &carried, &measures, trunk);
}
