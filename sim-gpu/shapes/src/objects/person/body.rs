//! The parts of a body of a given stature and girth.

use crate::primitives::*;

/// The measures of a body, metres. Lengths of segments are shares of the stature (Drillis and
/// Contini 1966, as given by Winter, Biomechanics and Motor Control of Human Movement).
pub struct Measures {
    pub stature_m: f64,
    /// Breadths and depths over those of a slim adult of this stature.
    pub girth: f64,
    /// The thickness of the clothes on the trunk, the arms and the legs.
    pub cloth_m: [f64; 3],
    /// The height of the head over the stature: 0.13 in adults, more in children.
    head_share: f64,
}

#[derive(Clone, Copy)]
pub struct Leg {
    pub knee: DVec3,
    pub ankle: DVec3,
    /// The direction of the foot.
    pub toes: DVec3,
}

impl Measures {
    /// Lengths of thigh, shank, upper arm and forearm with the fist, over the stature.
    pub const THIGH: f64 = 0.245;
    pub const SHANK: f64 = 0.246;
    const UPPER_ARM: f64 = 0.186;
    const FOREARM: f64 = 0.19;

    pub fn draw(s: &mut Sampler, stature_m: f64) -> Self {
        let girth = s.uniform(0.9, 1.15) + if s.chance(0.2) { s.uniform(0.0, 0.3) } else { 0.0 };
        let coat_m = if s.chance(0.4) { s.uniform(0.02, 0.045) } else { s.uniform(0.005, 0.02) };
        Self {
            stature_m,
            girth,
            cloth_m: [coat_m, 0.7 * coat_m, s.uniform(0.003, 0.025)],
            head_share: 0.13 + 0.09 * (1.55 - stature_m).max(0.0),
        }
    }

    /// The height of the neck over the hip joints, along the spine.
    pub fn neck_m(&self) -> f64 {
        self.stature_m * (0.47 - self.head_share - 0.03)
    }

    /// The right (-1) or left (1) shoulder joint, relative to the pelvis.
    pub fn shoulder(&self, side: f64) -> DVec3 {
        let y = self.stature_m * 0.108 * (0.5 + 0.5 * self.girth);
        dvec3(0.0, side * y, self.neck_m() - 0.052 * self.stature_m)
    }

    /// Half the distance between the hip joints.
    pub fn hip_joint_m(&self) -> f64 {
        0.05 * self.stature_m
    }

    /// The trunk from the crotch to the neck, upright above the middle of the hip joints.
    pub fn trunk(&self, b: &mut Builder) {
        let h = self.stature_m;
        let neck_m = self.neck_m();
        // Share of the height between hip joints and neck; half depth, half breadth and forward
        // shift over the stature.
        let stout = (self.girth - 1.0).max(0.0);
        let sections = [
            (-0.17, 0.045, 0.07, -0.004),
            (0.0, 0.068, 0.098, -0.006),
            (0.17, 0.066, 0.093, 0.0),
            (0.4, 0.058 + 0.05 * stout, 0.08 + 0.02 * stout, 0.004 + 0.03 * stout),
            (0.66, 0.068, 0.094, 0.004),
            (0.8, 0.066, 0.106, 0.0),
            (0.92, 0.052, 0.09, -0.004),
            (1.0, 0.034, 0.045, -0.004),
        ];
        let sections = sections.map(|(share, deep, broad, ahead)| {
            let cloth_m = if share < 1.0 { self.cloth_m[0] } else { 0.005 };
            let half = dvec2(deep, broad) * h * self.girth + DVec2::splat(cloth_m);
            let ring = outline::superellipse(half, 2.4, 12);
            ring.iter().map(|p| (p + DVec2::X * ahead * h).extend(share * neck_m)).collect()
        });
        loft(b, &sections);
    }

    /// Half the height of the head.
    pub fn head_m(&self) -> f64 {
        0.5 * self.head_share * self.stature_m
    }

    /// The middle of the head, relative to the foot of the neck.
    pub fn head_middle(&self) -> DVec3 {
        let up_m = self.head_m() + 0.03 * self.stature_m;
        dvec3(0.012 * self.stature_m, 0.0, up_m)
    }

    /// Neck and head above the foot of the neck. A head is about 0.23 m high, 0.195 m long and
    /// 0.155 m broad (DIN 33402).
    pub fn head(&self, b: &mut Builder) {
        let half_m = self.head_m();
        let middle = self.head_middle();
        let r = 0.45 * half_m + 0.003;
        rod(b, -0.03 * DVec3::Z, middle - 0.4 * half_m * DVec3::Z, [1.15 * r, r]);
        ellipsoid(b, middle, half_m * dvec3(0.86, 0.69, 1.0));
    }

    pub fn leg(&self, b: &mut Builder, hip: DVec3, leg: Leg) {
        let h = self.stature_m * (0.5 + 0.5 * self.girth);
        let cloth_m = self.cloth_m[2];
        let [thigh, middle, knee, calf, ankle] =
            [0.052, 0.046, 0.034, 0.033, 0.024].map(|share| share * h + cloth_m);
        let along = |from: DVec3, to: DVec3, t: f64| from.lerp(to, t);
        rod(b, hip, along(hip, leg.knee, 0.5), [thigh, middle]);
        rod(b, along(hip, leg.knee, 0.5), along(hip, leg.knee, 1.04), [middle, knee]);
        let calf_at = along(leg.knee, leg.ankle, 0.35);
        rod(b, along(leg.knee, leg.ankle, -0.04), calf_at, [knee, calf]);
        rod(b, calf_at, leg.ankle, [calf, ankle]);
        self.foot(b, leg);
    }

    /// A shoe: 0.16 of the stature long, from behind the heel to the toes.
    fn foot(&self, b: &mut Builder, leg: Leg) {
        let h = self.stature_m;
        let toes = leg.toes.normalize_or(DVec3::X);
        let across = DVec3::Z.cross(toes).normalize_or(DVec3::Y);
        let up = toes.cross(across);
        let section = |ahead: f64, half: f64, high: f64| {
            let middle = leg.ankle + toes * ahead * h - up * 0.039 * h;
            let corner = |side: f64, z: f64| middle + across * side * half * h + up * z * h;
            vec![corner(-1.0, 0.0), corner(-1.0, high), corner(1.0, high), corner(1.0, 0.0)]
        };
        let sections = [
            section(-0.045, 0.019, 0.045),
            section(0.02, 0.024, 0.052),
            section(0.085, 0.03, 0.03),
            section(0.115, 0.018, 0.02),
        ];
        loft(b, &sections);
    }

    /// An arm from the shoulder to the fist at `hand`, or as close to it as the arm reaches. The
    /// elbow points to `elbow_side`.
    pub fn arm(&self, b: &mut Builder, shoulder: DVec3, hand: DVec3, elbow_side: DVec3) {
        let h = self.stature_m;
        let lengths = [Self::UPPER_ARM * h, Self::FOREARM * h];
        let [elbow, hand] = bent(shoulder, hand, lengths, elbow_side);
        let stout = 0.5 + 0.5 * self.girth;
        let [upper, middle, lower] =
            [0.031, 0.027, 0.018].map(|share| share * h * stout + self.cloth_m[1]);
        rod(b, shoulder, elbow, [upper, middle]);
        rod(b, shoulder.lerp(elbow, 0.96), hand, [middle, lower]);
        ellipsoid(b, shoulder, DVec3::splat(upper));
        let fist = hand + 0.02 * h * (hand - elbow).normalize_or(DVec3::X);
        let tip = hand + 0.05 * h * (hand - elbow).normalize_or(DVec3::X);
        rod(b, hand, fist, [0.016 * h, 0.024 * h]);
        rod(b, fist, tip, [0.024 * h, 0.014 * h]);
    }
}

/// The joint between two segments of `lengths_m` from `root` to `tip`, bent towards `side`, and the
/// tip. If the segments do not reach the tip, it is moved closer.
pub fn bent(root: DVec3, tip: DVec3, lengths_m: [f64; 2], side: DVec3) -> [DVec3; 2] {
    let [first, second] = lengths_m;
    let along = (tip - root).normalize_or(DVec3::NEG_Z);
    let shortest = (first - second).abs() + 0.05 * (first + second);
    let distance = root.distance(tip).clamp(shortest, 0.999 * (first + second));
    let foot = (first * first - second * second + distance * distance) / (2.0 * distance);
    let height = (first * first - foot * foot).max(0.0).sqrt();
    let out = (side - side.dot(along) * along).normalize_or(along.any_orthonormal_vector());
    [root + foot * along + height * out, root + distance * along]
}
