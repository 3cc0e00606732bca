//! Poses: walking at any phase of the stride, standing, sitting.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, dvec3};

use super::body::{Leg, Measures, bent};
use crate::primitives::Sampler;

/// The places of a person's joints, metres, and angles, radians.
pub struct Pose {
    /// The middle between the hip joints.
    pub pelvis: DVec3,
    /// The lean of the trunk, forward.
    pub lean_rad: f64,
    /// The rotation of the shoulders to the left.
    pub twist_rad: f64,
    /// The rotation of the head to the left, and downwards.
    pub look_rad: [f64; 2],
    pub legs: [Leg; 2],
    /// The right and the left wrist.
    pub hands: [DVec3; 2],
}

impl Pose {
    /// Draws a pose: six of ten persons walk, a few sit.
    pub fn draw(s: &mut Sampler, measures: &Measures) -> Self {
        let stretched_m = measures.stature_m * (Measures::THIGH + Measures::SHANK + 0.039);
        let mut pose = Self {
            pelvis: stretched_m * DVec3::Z,
            lean_rad: s.uniform(-3.0, 10.0).to_radians(),
            twist_rad: s.uniform(-6.0, 6.0).to_radians(),
            look_rad: [s.uniform(-45.0, 45.0).to_radians(), s.uniform(-10.0, 25.0).to_radians()],
            legs: [Leg { knee: DVec3::ZERO, ankle: DVec3::ZERO, toes: DVec3::X }; 2],
            hands: [DVec3::ZERO; 2],
        };
        let posture = s.uniform(0.0, 1.0);
        if posture < 0.6 {
            pose.walk(s, measures);
        } else if posture < 0.96 {
            pose.stand(s, measures);
        } else {
            pose.sit(s, measures);
        }
        if s.chance(0.4) {
            pose.occupy_hands(s, measures);
        }
        pose
    }

    /// A step in walking, or sometimes in running.
    ///
    /// Hip and knee follow the curves of level walking (Winter 1991): the hip moves from about 20
    /// degrees backwards to 30 forwards, the knee bends by 15 degrees under load and by 60 in the
    /// swing.
    fn walk(&mut self, s: &mut Sampler, measures: &Measures) {
        let phase = s.uniform(0.0, 1.0);
        let running = s.chance(0.05);
        let vigour = if running { 1.5 } else { s.uniform(0.5, 1.15) };
        let bend_rad = if running { 0.3 } else { 0.0 };
        self.lean_rad += if running { 0.15 } else { 0.0 };
        let swing_rad = s.uniform(8.0, 28.0).to_radians() * vigour;
        let elbow_rad = if running { 1.4 } else { s.uniform(0.1, 0.6) };
        for (k, side) in [-1.0, 1.0].into_iter().enumerate() {
            let phase = (phase + 0.5 * k as f64).fract();
            let hip_rad =
                vigour * (4.0 + 23.0 * libm::cos(TAU * phase)).to_radians() + 0.5 * bend_rad;
            let bump = |middle: f64, width: f64| {
                let x = (phase - middle) / width;
                if x.abs() < 1.0 { 0.5 + 0.5 * libm::cos(PI * x) } else { 0.0 }
            };
            let knee_deg = 4.0 + 13.0 * bump(0.14, 0.14) + 58.0 * bump(0.72, 0.25);
            let knee_rad = vigour.min(1.2) * knee_deg.to_radians() + bend_rad;
            // The heel leaves the ground late in the stance.
            let sole_rad = 0.7 * bump(0.62, 0.2) - 0.3 * bump(0.98, 0.12) - 0.3 * bump(-0.02, 0.12);
            self.legs[k] = self.leg(measures, side, [hip_rad, knee_rad, sole_rad]);
            let arm_rad = -swing_rad * libm::cos(TAU * phase) + 0.05;
            self.hands[k] = self.hanging(measures, side, arm_rad, elbow_rad);
        }
        self.twist_rad += 0.1 * vigour * libm::cos(TAU * phase);
    }

    /// The feet are side by side or one ahead of the other.
    fn stand(&mut self, s: &mut Sampler, measures: &Measures) {
        let h = measures.stature_m;
        let lower_m = s.uniform(0.001, 0.008) * h;
        self.pelvis.z -= lower_m;
        for (k, side) in [-1.0, 1.0].into_iter().enumerate() {
            let apart_m = s.uniform(0.035, 0.11) * h;
            let ankle = dvec3(s.uniform(-0.07, 0.07) * h, side * apart_m, 0.039 * h);
            let turned_rad = side * s.uniform(-5.0, 35.0).to_radians();
            let toes = dvec3(libm::cos(turned_rad), libm::sin(turned_rad), 0.0);
            self.legs[k] = self.leg_to(measures, side, ankle, toes);
            let [arm_rad, elbow_rad] = [s.uniform(-0.15, 0.25), s.uniform(0.05, 0.5)];
            self.hands[k] = self.hanging(measures, side, arm_rad, elbow_rad);
        }
    }

    /// The thighs are level, as on a seat, which is not built.
    fn sit(&mut self, s: &mut Sampler, measures: &Measures) {
        let h = measures.stature_m;
        self.pelvis.z = s.uniform(0.26, 0.3) * h;
        self.lean_rad = s.uniform(-15.0, 20.0).to_radians();
        for (k, side) in [-1.0, 1.0].into_iter().enumerate() {
            let apart_m = s.uniform(0.03, 0.12) * h;
            let ankle = dvec3(s.uniform(0.18, 0.3) * h, side * apart_m, 0.039 * h);
            self.legs[k] = self.leg_to(measures, side, ankle, DVec3::X);
            self.hands[k] = self.pelvis + dvec3(0.18 * h, side * 0.06 * h, 0.07 * h);
        }
    }

    /// The leg with these angles of hip, knee and sole in the plane of walking.
    fn leg(&self, measures: &Measures, side: f64, angles_rad: [f64; 3]) -> Leg {
        let [hip_rad, knee_rad, sole_rad] = angles_rad;
        let down = |angle: f64| dvec3(libm::sin(angle), 0.0, -libm::cos(angle));
        let hip = self.pelvis + side * measures.hip_joint_m() * DVec3::Y;
        let knee = hip + measures.stature_m * Measures::THIGH * down(hip_rad);
        let inwards = -0.012 * side * measures.stature_m * DVec3::Y;
        let ankle =
            knee + inwards + measures.stature_m * Measures::SHANK * down(hip_rad - knee_rad);
        let toes = dvec3(libm::cos(sole_rad), 0.1 * side, -libm::sin(sole_rad));
        Leg { knee, ankle, toes }
    }

    /// The leg with its ankle at `ankle`.
    fn leg_to(&self, measures: &Measures, side: f64, ankle: DVec3, toes: DVec3) -> Leg {
        let hip = self.pelvis + side * measures.hip_joint_m() * DVec3::Y;
        let lengths = [Measures::THIGH, Measures::SHANK].map(|share| share * measures.stature_m);
        let [knee, ankle] = bent(hip, ankle, lengths, dvec3(1.0, 0.15 * side, 0.2));
        Leg { knee, ankle, toes }
    }

    /// The wrist of a hanging arm that is swung forward by `arm_rad` and bent by `elbow_rad`.
    fn hanging(&self, measures: &Measures, side: f64, arm_rad: f64, elbow_rad: f64) -> DVec3 {
        let h = measures.stature_m;
        let down = |angle: f64| dvec3(libm::sin(angle), 0.0, -libm::cos(angle));
        let out = side * (0.035 + 0.04 * (measures.girth - 0.9)) * h * DVec3::Y;
        let shoulder = self.pelvis
            + measures.shoulder(side).with_x(measures.neck_m() * libm::sin(self.lean_rad));
        shoulder + out + 0.186 * h * down(arm_rad) + 0.19 * h * down(arm_rad + elbow_rad)
    }

    /// Puts the hands into the pockets, to the ear or before the chest with a telephone, folded,
    /// behind the back, or reached out.
    fn occupy_hands(&mut self, s: &mut Sampler, measures: &Measures) {
        let h = measures.stature_m;
        let ahead_m = measures.neck_m() * libm::sin(self.lean_rad);
        let at = |x: f64, y: f64, z: f64| self.pelvis + h * dvec3(x, y, z) + ahead_m * DVec3::X;
        let side = s.pick(&[-1.0, 1.0]);
        let one = usize::from(side > 0.0);
        let chest_m = 0.11 + 0.1 * (measures.girth - 1.0);
        let reach = dvec3(s.uniform(-0.05, 0.35), side * s.uniform(0.1, 0.4), s.uniform(0.1, 0.4));
        match s.count(0, 6) {
            0 => self.hands = [at(0.0, -0.11, 0.02), at(0.0, 0.11, 0.02)],
            1 => self.hands[one] = at(0.045, 0.055 * side, 0.37),
            2 => self.hands[one] = at(chest_m + 0.07, 0.03 * side, 0.21),
            3 => self.hands = [at(chest_m, 0.05, 0.17), at(chest_m, -0.05, 0.17)],
            4 => self.hands = [at(-0.1, -0.02, 0.03), at(-0.1, 0.02, 0.03)],
            5 => self.hands[one] = at(reach.x, reach.y, reach.z),
            _ => self.hands = [at(chest_m + 0.05, -0.02, 0.13), at(chest_m + 0.05, 0.03, 0.13)],
        }
    }
}
