use super::Contacts;
use crate::objects::person::body::{Leg, Measures, bent};
use crate::primitives::{Builder, DAffine3, DVec3, Sampler, cushion, dvec3, ellipsoid};

/// Builds a rider on the saddle, with hands on the grips and feet on the pedals or rests. The rider
/// of a motorcycle wears a full helmet.
pub fn build(b: &mut Builder, s: &mut Sampler, contacts: Contacts, motorised: bool) {
    // The stature at which stretched legs reach from the saddle to the lower pedal.
    let reach_m = contacts.saddle.z - contacts.soles.map(|p| p.z).into_iter().fold(1.0, f64::min);
    let fitting_m = (reach_m / (Measures::THIGH + Measures::SHANK + 0.02)).clamp(1.5, 1.92);
    let stature_m = if motorised { s.uniform(1.6, 1.9) } else { fitting_m };
    let measures = Measures::draw(s, stature_m);
    let h = stature_m;
    let pelvis = contacts.saddle + dvec3(0.02, 0.0, 0.05 * h);
    let lean_rad = lean_rad(s, &measures, pelvis, contacts.grip);
    let trunk = DAffine3::from_translation(pelvis) * DAffine3::from_rotation_y(lean_rad);
    b.place(trunk, |b| {
        measures.trunk(b);
        if s.chance(0.15) {
            let at = dvec3(-0.09 * h - 0.06, 0.0, measures.neck_m() - 0.18 * h);
            cushion(b, at, dvec3(0.16, 0.3, 0.42), 0.05);
        }
    });
    let neck = trunk.transform_point3(DVec3::Z * measures.neck_m());
    let bowed = DAffine3::from_rotation_y(0.4 * lean_rad + s.uniform(-0.1, 0.2));
    b.turned(neck, bowed, |b| {
        measures.head(b);
        let half_m = measures.head_m();
        if motorised {
            ellipsoid(b, measures.head_middle(), half_m * dvec3(1.2, 1.08, 1.2));
        } else if s.chance(0.5) {
            let at = measures.head_middle() + 0.4 * half_m * DVec3::Z;
            ellipsoid(b, at, half_m * dvec3(1.1, 0.88, 0.75));
        }
    });
    for (side, sole) in [-1.0, 1.0].into_iter().zip(contacts.soles) {
        let hip = pelvis + side * measures.hip_joint_m() * DVec3::Y;
        let ankle = sole + dvec3(-0.07 * h, 0.0, 0.039 * h);
        let lengths = [Measures::THIGH, Measures::SHANK].map(|share| share * h);
        let [knee, ankle] = bent(hip, ankle, lengths, dvec3(1.0, 0.2 * side, 0.3));
        let toes = dvec3(1.0, 0.05 * side, -0.1);
        measures.leg(b, hip, Leg { knee, ankle, toes });
        let shoulder = trunk.transform_point3(measures.shoulder(side));
        let grip = contacts.grip * dvec3(1.0, side, 1.0);
        let wrist = grip - dvec3(0.04 * h, 0.0, -0.01 * h);
        measures.arm(b, shoulder, wrist, dvec3(-0.3, 0.5 * side, -0.8));
    }
}

/// The lean of the trunk at which slightly bent arms reach the grips.
fn lean_rad(s: &mut Sampler, measures: &Measures, pelvis: DVec3, grip: DVec3) -> f64 {
    let arm_m = s.uniform(0.82, 0.96) * 0.376 * measures.stature_m;
    let shoulder = measures.shoulder(1.0);
    let gap_m = |lean_rad: f64| {
        let trunk = DAffine3::from_translation(pelvis) * DAffine3::from_rotation_y(lean_rad);
        (trunk.transform_point3(shoulder).distance(grip) - arm_m).abs()
    };
    let angles = (0..=32).map(|k| (f64::from(k) * 2.0).to_radians());
    angles.min_by(|a, b| gap_m(*a).total_cmp(&gap_m(*b))).unwrap_or(0.3)
}
