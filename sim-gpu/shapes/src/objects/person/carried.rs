use super::body::Measures;
use super::pose::Pose;
use crate::objects::car::wheel;
use crate::primitives::*;

/// A thing that a person carries, and the place of the hand that holds it.
pub enum Carried {
    Nothing,
    Backpack,
    ShoulderBag,
    HandBag(DVec3),
    /// A box that both arms hold in front of the chest.
    Box(DVec3),
    Umbrella(DVec3),
    /// A suitcase on wheels that the hand pulls.
    Suitcase(DVec3),
    Pram(DVec3),
}

/// Draws the thing that a person carries, and moves the hands of `pose` to it.
pub fn draw(s: &mut Sampler, measures: &Measures, pose: &mut Pose) -> Carried {
    let h = measures.stature_m;
    let grown_up = h > 1.45;
    let one = s.count(0, 1);
    let side = if one == 1 { 1.0 } else { -1.0 };
    let at = |x: f64, y: f64, z: f64| pose.pelvis + h * dvec3(x, y, z);
    let drawn = s.uniform(0.0, 1.0);
    if drawn < 0.16 {
        Carried::Backpack
    } else if drawn < 0.27 {
        Carried::ShoulderBag
    } else if drawn < 0.37 {
        pose.hands[one] = at(s.uniform(-0.05, 0.08), 0.14 * side, -0.05);
        Carried::HandBag(pose.hands[one])
    } else if drawn < 0.4 {
        let held = at(0.22, 0.0, 0.14);
        pose.hands = [held - 0.1 * h * DVec3::Y, held + 0.1 * h * DVec3::Y];
        Carried::Box(held)
    } else if drawn < 0.42 {
        pose.hands[one] = at(0.12, 0.08 * side, 0.2);
        Carried::Umbrella(pose.hands[one])
    } else if drawn < 0.44 && grown_up {
        pose.hands[one] = at(-0.1, 0.15 * side, -0.03);
        Carried::Suitcase(pose.hands[one])
    } else if drawn < 0.465 && grown_up {
        let handle = dvec3(pose.pelvis.x + 0.27 * h, pose.pelvis.y, 1.02);
        pose.hands = [handle - 0.2 * DVec3::Y, handle + 0.2 * DVec3::Y];
        Carried::Pram(handle)
    } else {
        Carried::Nothing
    }
}

/// Builds the thing. `trunk` is the frame of the trunk.
pub fn build(b: &mut Builder, s: &mut Sampler, it: &Carried, measures: &Measures, trunk: DAffine3) {
    let h = measures.stature_m;
    match *it {
        Carried::Nothing => {}
        Carried::Backpack => b.place(trunk, |b| {
            let size = dvec3(s.uniform(0.07, 0.14), s.uniform(0.14, 0.2), s.uniform(0.2, 0.3));
            let x = -0.068 * h * measures.girth - measures.cloth_m[0] - 0.45 * h * size.x;
            let z = measures.neck_m() - (0.04 + 0.5 * size.z) * h;
            soft(b, dvec3(x, 0.0, z), h * size);
        }),
        Carried::ShoulderBag => b.place(trunk, |b| {
            let y = s.pick(&[-1.0, 1.0]) * (0.1 * h * measures.girth + measures.cloth_m[0] + 0.05);
            let size = dvec3(s.uniform(0.25, 0.4), s.uniform(0.08, 0.14), s.uniform(0.2, 0.32));
            soft(b, dvec3(s.uniform(-0.1, 0.06), y, s.uniform(-0.05, 0.1)), size * (h / 1.7));
        }),
        Carried::HandBag(hand) => {
            let size = dvec3(s.uniform(0.25, 0.45), s.uniform(0.06, 0.18), s.uniform(0.25, 0.4));
            let size = size * (h / 1.7);
            let hang_m = 0.1 * h + 0.5 * size.z;
            soft(b, hand - hang_m * DVec3::Z, size);
        }
        Carried::Box(held) => {
            let size = dvec3(s.uniform(0.2, 0.35), s.uniform(0.3, 0.5), s.uniform(0.15, 0.4));
            block(b, held + 0.06 * h * DVec3::X, size);
        }
        Carried::Umbrella(hand) => umbrella(b, s, hand, h),
        Carried::Suitcase(hand) => {
            let foot = dvec3(hand.x - 0.45, hand.y, 0.0);
            b.turned(foot, DAffine3::from_rotation_y(0.5), |b| {
                let size = dvec3(0.24, s.uniform(0.35, 0.48), s.uniform(0.5, 0.7));
                soft(b, (0.5 * size.z + 0.05) * DVec3::Z, size);
            });
            rod(b, foot + 0.5 * DVec3::Z, hand, [0.015, 0.015]);
        }
        Carried::Pram(handle) => pram(b, s, handle),
    }
}

/// A bag of `size` about `middle` with rounded edges.
fn soft(b: &mut Builder, middle: DVec3, size: DVec3) {
    cushion(b, middle, size, 0.25 * size.min_element());
}

/// An umbrella of 0.9 to 1.2 m on a stick.
fn umbrella(b: &mut Builder, s: &mut Sampler, hand: DVec3, h: f64) {
    let radius_m = s.uniform(0.42, 0.6);
    let top_m = 0.4 * h;
    rod(b, hand - 0.1 * DVec3::Z, hand + top_m * DVec3::Z, [0.01, 0.01]);
    let canopy = Profile::from(radius_m, -0.22).curve(&[(0.6 * radius_m, -0.06), (0.0, 0.0)]);
    b.shifted(hand + top_m * DVec3::Z, |b| canopy.revolve(b, Section::Polygon(8)));
}

/// A pram or a push-chair, about 0.6 m wide with a handle at 1 m.
fn pram(b: &mut Builder, s: &mut Sampler, handle: DVec3) {
    let half_y = s.uniform(0.22, 0.29);
    let wheel_m = s.uniform(0.09, 0.15);
    let middle = handle + dvec3(s.uniform(0.45, 0.6), 0.0, 0.0);
    rod(b, handle - half_y * DVec3::Y, handle + half_y * DVec3::Y, [0.02, 0.02]);
    b.mirrored_y(|b| {
        let y = half_y * DVec3::Y;
        let front = middle.with_z(wheel_m) + 0.35 * DVec3::X;
        let rear = middle.with_z(wheel_m) - 0.22 * DVec3::X;
        rod(b, handle + y, front + y, [0.014, 0.014]);
        rod(b, middle.with_z(0.6) + y + 0.2 * DVec3::X, rear + y, [0.014, 0.014]);
        for axle in [front, rear] {
            b.shifted(axle + y, |b| wheel::wheel(b, [wheel_m, 0.05, 0.01], 1.0));
        }
    });
    // The tub, and a hood over its rear end.
    let section = |x, low, high| outline::upright(middle.x + x, half_y * 0.85, [low, high]);
    skin(b, &[section(-0.32, 0.55, 0.8), section(-0.1, 0.42, 0.8), section(0.4, 0.5, 0.78)]);
    if s.chance(0.7) {
        ellipsoid(b, dvec3(middle.x - 0.12, middle.y, 0.82), dvec3(0.26, 0.85 * half_y, 0.26));
    }
}
