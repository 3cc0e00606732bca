//! The measures of a car. All parts of the car are built from them.

use std::sync::LazyLock;

use glam::{DVec2, dvec2};
use serde::Deserialize;

use crate::primitives::Sampler;

/// The table `styles.toml`, which states the sources of its numbers.
static STYLES: LazyLock<Styles> = LazyLock::new(|| {
    toml::from_str(include_str!("styles.toml")).expect("invariant: the table is in the program")
});

#[derive(Deserialize)]
struct Styles {
    style: Vec<Ranges>,
}

#[derive(Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Style {
    Hatchback,
    Sedan,
    Estate,
    Suv,
    Minivan,
    Van,
    PickUp,
    Coupe,
}

/// The ranges of a style's measures.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Ranges {
    name: Style,
    weight: usize,
    length_m: [f64; 2],
    width_m: [f64; 2],
    height_m: [f64; 2],
    /// The distance from the nose to the foot of the windscreen, over the length of the car.
    bonnet: [f64; 2],
    /// The distance along x from the foot of the windscreen back to its head.
    screen_m: [f64; 2],
    /// The distance from the tail to the rear edge of the roof.
    roof_m: [f64; 2],
    /// The distance from the tail to the foot of the rear window.
    tail_m: [f64; 2],
    /// The height of the windows' lower edge, over the height of the car.
    belt: [f64; 2],
    /// The height of the bonnet's front edge, over that of the windows' lower edge.
    nose: [f64; 2],
}

impl Style {
    /// Whether the sides rise straight to a tall roof.
    pub fn is_boxy(self) -> bool {
        self == Self::Van
    }
}

/// The measures of a car, metres. The car extends from -`half.x` to `half.x`.
pub struct Form {
    pub style: Style,
    /// Half the length, and half the width without the mirrors.
    pub half: DVec2,
    pub height_m: f64,
    /// The height of the body's underside.
    pub sill_m: f64,
    /// The height of the nose's upper edge.
    pub nose_m: f64,
    /// The upper edge of the body from the rear to the front, as points (x, z): the boot, the lower
    /// edge of the windows, and the bonnet.
    pub top_line: Vec<DVec2>,
    /// x of the windscreen's foot and head.
    pub screen: [f64; 2],
    /// x of the rear window's foot and head.
    pub rear: [f64; 2],
    /// The width of the roof over the width of the car.
    pub roof_share: f64,
    pub wheel_m: f64,
    /// x of the rear axle and of the front axle.
    pub axles: [f64; 2],
}

impl Form {
    pub fn draw(s: &mut Sampler) -> Self {
        let weighted: Vec<_> = STYLES.style.iter().map(|ranges| (ranges.weight, ranges)).collect();
        let ranges = s.weighted(&weighted);
        let style = ranges.name;
        let size = [ranges.length_m, ranges.width_m, ranges.height_m].map(|range| s.within(range));
        let [length_m, width_m, height_m] = size;
        let half_m = length_m / 2.0;
        let screen_foot = half_m - length_m * s.within(ranges.bonnet);
        let screen_head = screen_foot - s.within(ranges.screen_m);
        let rear_foot = -half_m + s.within(ranges.tail_m);
        let rear_head = (-half_m + s.within(ranges.roof_m)).max(rear_foot + 0.03);
        let belt_m = (height_m * s.within(ranges.belt)).min(1.35);
        let nose_m = belt_m * s.within(ranges.nose);
        let boot_m = belt_m + s.uniform(-0.01, 0.08);
        // Tyres from 175/65 R14 (0.29 m) to 275/65 R18 (0.4 m).
        let is_tall = matches!(style, Style::Suv | Style::PickUp | Style::Van);
        let wheel_m = if is_tall { s.uniform(0.33, 0.39) } else { s.uniform(0.285, 0.34) };
        let front_overhang_m = s.uniform(0.68, 0.98);
        let rear_overhang_m = length_m * s.uniform(0.15, 0.23);
        Self {
            style,
            half: dvec2(half_m, width_m / 2.0),
            height_m,
            sill_m: if is_tall { s.uniform(0.2, 0.28) } else { s.uniform(0.14, 0.21) },
            nose_m,
            top_line: top_line(half_m, [rear_foot, screen_foot], [boot_m, belt_m, nose_m]),
            screen: [screen_foot, screen_head],
            rear: [rear_foot, rear_head],
            roof_share: if style.is_boxy() { s.uniform(0.82, 0.92) } else { s.uniform(0.68, 0.8) },
            wheel_m,
            axles: [-half_m + rear_overhang_m, half_m - front_overhang_m],
        }
    }

    /// The height of the body's upper edge at `x`: of the boot, the windows' lower edge or the
    /// bonnet.
    pub fn top_m(&self, x: f64) -> f64 {
        let next = self.top_line.partition_point(|p| p.x <= x).clamp(1, self.top_line.len() - 1);
        let [from, to] = [self.top_line[next - 1], self.top_line[next]];
        let share = ((x - from.x) / (to.x - from.x)).clamp(0.0, 1.0);
        from.lerp(to, share).y
    }

    /// x of the pillar behind the front doors.
    pub fn middle_pillar_x(&self) -> f64 {
        let [rear, front] = self.axles;
        rear + 0.47 * (front - rear)
    }
}

/// The upper edge of the body: a boot that falls a little to the tail, and a convex bonnet that
/// falls to a rounded nose. The arguments are half the length, x of the windows' lower edge at its
/// rear and front ends, and the heights of the boot, of that edge and of the nose.
fn top_line(
    half_m: f64,
    [rear_x, screen_x]: [f64; 2],
    [boot_m, belt_m, nose_m]: [f64; 3],
) -> Vec<DVec2> {
    let nose_x = half_m - 0.16;
    let bonnet_x = 0.5 * (nose_x + screen_x);
    let bonnet_m = belt_m - 0.36 * (belt_m - nose_m);
    [
        (-half_m, boot_m - 0.05),
        (rear_x.max(-half_m + 0.02), boot_m),
        (screen_x, belt_m),
        (bonnet_x, bonnet_m),
        (nose_x, nose_m),
        (half_m, nose_m - 0.1),
    ]
    .map(DVec2::from)
    .to_vec()
}
