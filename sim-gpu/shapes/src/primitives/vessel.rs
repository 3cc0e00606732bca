//! Hollow bodies with an open mouth: bowls, cups, vases, shades.

use glam::{DVec2, dvec2};

use super::revolve::revolve;
use super::{Builder, Profile, Sampler, Section};

#[derive(Clone, Copy, Debug)]
pub enum Wall {
    /// One sheet without thickness.
    Sheet,
    /// Two sheets at this distance, joined at the mouth.
    Solid(f64),
}

impl Wall {
    /// Draws a wall as in CAD models: one in three is a sheet, the others are 2 to 8 % of
    /// `radius_m` thick.
    pub fn draw(s: &mut Sampler, radius_m: f64) -> Self {
        let thickness_m = radius_m * s.uniform(0.02, 0.08);
        if s.chance(0.35) { Self::Sheet } else { Self::Solid(thickness_m) }
    }
}

/// A vessel, described by its outer profile from the foot to the mouth.
#[derive(Clone, Debug)]
pub struct Vessel {
    /// The outer profile. It begins on the axis if the vessel has a bottom.
    pub outside: Profile,
    pub wall: Wall,
    pub section: Section,
    /// Twist of the section, radians per metre of height.
    pub twist_rad: f64,
    /// Below this height, a foot or a stem, the vessel is not hollow.
    pub hollow_from_m: f64,
}

impl Vessel {
    pub fn new(outside: Profile, wall: Wall, section: Section) -> Self {
        Self { outside, wall, section, twist_rad: 0.0, hollow_from_m: f64::NEG_INFINITY }
    }

    /// Adds the vessel. It stands at the height where its profile begins.
    pub fn build(&self, b: &mut Builder) {
        let mut profile = self.outside.sample(b);
        if let Wall::Solid(thickness_m) = self.wall {
            let floor_m = self.hollow_from_m.max(profile[0].y) + thickness_m;
            profile.extend(inside(&profile, thickness_m, floor_m));
        }
        revolve(b, &profile, self.section, self.twist_rad);
    }
}

/// The inner face of a wall: `outside` moved inwards, from the mouth down to the closed floor at
/// `floor_m`. A vessel without a bottom has no floor.
fn inside(outside: &[DVec2], thickness_m: f64, floor_m: f64) -> Vec<DVec2> {
    let last = outside.len() - 1;
    let has_bottom = outside[0].x == 0.0;
    let mut points: Vec<DVec2> = Vec::with_capacity(outside.len());
    for i in (0..=last).rev() {
        let along = outside[(i + 1).min(last)] - outside[i.saturating_sub(1)];
        // A mouth's rim is level.
        let inwards =
            if i == last { DVec2::NEG_X } else { along.perp().normalize_or(DVec2::NEG_X) };
        let point = outside[i] + thickness_m * inwards;
        if has_bottom && point.y <= floor_m {
            if let Some(&above) = points.last() {
                let share = (above.y - floor_m) / (above.y - point.y);
                points.push(above.lerp(point, share));
            }
            break;
        }
        // A neck that is narrower than its walls leaves no hollow.
        points.push(dvec2(point.x.max(0.25 * thickness_m), point.y));
    }
    if has_bottom {
        points.push(dvec2(0.0, points.last().map_or(floor_m, |lowest| lowest.y)));
    }
    points
}
