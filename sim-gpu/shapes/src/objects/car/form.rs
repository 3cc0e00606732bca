//! The measures of a car, which all of its parts are fitted to.

use glam::DVec2;

use crate::primitives::Sampler;

/// What is built on the chassis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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

/// The ranges of a style. Lengths are metres.
///
/// Outer sizes span the makers' data sheets of the European segments A (Fiat 500,
/// 3.55 x 1.63 x 1.49) to E (BMW 5, 4.94 x 1.87 x 1.48), J (Suzuki Jimny to Range Rover),
/// M (VW Touran, 4.53 x 1.83 x 1.66) and vans (VW Transporter, 4.90 x 1.90 x 1.97; Mercedes
/// Sprinter, 5.93 x 2.02 x 2.6). Proportions within are
/// estimates for these styles.
struct Ranges {
    length: [f64; 2],
    width: [f64; 2],
    height: [f64; 2],
    /// From the nose to the foot of the windscreen, over the length.
    bonnet: [f64; 2],
    /// How far the windscreen's head is behind its foot.
    screen: [f64; 2],
    /// From the tail to the rear edge of the roof.
    roof: [f64; 2],
    /// From the tail to the foot of the rear window.
    tail: [f64; 2],
    /// The height of the windows' lower edge over that of the car.
    belt: [f64; 2],
    /// The height of the bonnet's front edge over that of the windows' lower edge.
    nose: [f64; 2],
}

impl Style {
    fn ranges(self) -> Ranges {
        let [length, width, height, bonnet, screen, roof, tail, belt, nose] = match self {
            Self::Hatchback => [
                [3.4, 4.4],
                [1.6, 1.82],
                [1.42, 1.58],
                [0.2, 0.26],
                [0.6, 0.9],
                [0.35, 0.75],
                [0.1, 0.25],
                [0.62, 0.68],
                [0.74, 0.84],
            ],
            Self::Sedan => [
                [4.2, 5.15],
                [1.68, 1.9],
                [1.4, 1.51],
                [0.24, 0.29],
                [0.65, 0.9],
                [1.05, 1.5],
                [0.35, 0.65],
                [0.63, 0.69],
                [0.73, 0.82],
            ],
            Self::Estate => [
                [4.2, 5.0],
                [1.68, 1.88],
                [1.42, 1.55],
                [0.23, 0.28],
                [0.65, 0.9],
                [0.25, 0.6],
                [0.08, 0.2],
                [0.62, 0.68],
                [0.73, 0.83],
            ],
            Self::Suv => [
                [3.9, 5.05],
                [1.7, 2.0],
                [1.58, 1.92],
                [0.22, 0.28],
                [0.35, 0.8],
                [0.15, 0.6],
                [0.06, 0.2],
                [0.6, 0.67],
                [0.82, 0.93],
            ],
            Self::Minivan => [
                [3.9, 4.9],
                [1.66, 1.92],
                [1.58, 1.85],
                [0.15, 0.21],
                [0.75, 1.15],
                [0.12, 0.4],
                [0.05, 0.15],
                [0.58, 0.64],
                [0.74, 0.84],
            ],
            Self::Van => [
                [4.5, 6.0],
                [1.9, 2.1],
                [1.9, 2.8],
                [0.1, 0.16],
                [0.6, 0.95],
                [0.05, 0.14],
                [0.04, 0.08],
                [0.46, 0.58],
                [0.72, 0.86],
            ],
            Self::PickUp => [
                [4.9, 5.5],
                [1.75, 2.03],
                [1.62, 1.95],
                [0.21, 0.27],
                [0.4, 0.65],
                [1.55, 2.3],
                [1.4, 2.1],
                [0.6, 0.65],
                [0.84, 0.93],
            ],
            Self::Coupe => [
                [4.0, 4.8],
                [1.7, 1.9],
                [1.25, 1.42],
                [0.27, 0.32],
                [0.75, 0.95],
                [1.0, 1.6],
                [0.2, 0.5],
                [0.65, 0.71],
                [0.72, 0.8],
            ],
        };
        Ranges { length, width, height, bonnet, screen, roof, tail, belt, nose }
    }

    /// Whether the sides go straight up to a tall roof.
    pub fn is_boxy(self) -> bool {
        self == Self::Van
    }
}

/// A car's measures in metres. The car reaches from -`half.x` to `half.x`.
#[derive(Clone, Debug)]
pub struct Form {
    pub style: Style,
    /// Half the length and half the width without mirrors.
    pub half: DVec2,
    pub height_m: f64,
    /// The underside of the body.
    pub sill_m: f64,
    /// The upper edge of the nose.
    pub nose_m: f64,
    /// The line of the bonnet, the windows' lower edges and the boot, from the rear
    /// to the front, as points (x, z).
    pub top_line: Vec<DVec2>,
    /// x of the foot and the head of the windscreen.
    pub screen: [f64; 2],
    /// x of the foot and the head of the rear window.
    pub rear: [f64; 2],
    /// Half the width of the roof over half the width of the car.
    pub roof_share: f64,
    pub wheel_m: f64,
    /// x of the rear axle and the front axle.
    pub axles: [f64; 2],
}

impl Form {
    pub fn draw(s: &mut Sampler) -> Self {
        use Style::{Coupe, Estate, Hatchback, Minivan, PickUp, Sedan, Suv, Van};
        let style = s.weighted(&[
            (6, Hatchback),
            (5, Sedan),
            (3, Estate),
            (5, Suv),
            (2, Minivan),
            (3, Van),
            (2, PickUp),
            (1, Coupe),
        ]);
        let ranges = style.ranges();
        let mut within = |[low, high]: [f64; 2]| s.uniform(low, high);
        let size = [ranges.length, ranges.width, ranges.height].map(&mut within);
        let [length_m, width_m, height_m] = size;
        let half_m = length_m / 2.0;
        let foot = half_m - length_m * within(ranges.bonnet);
        let head = foot - within(ranges.screen);
        let rear_foot = -half_m + within(ranges.tail);
        let rear_head = (-half_m + within(ranges.roof)).max(rear_foot + 0.03);
        let belt_m = (height_m * within(ranges.belt)).min(1.35);
        let nose_m = belt_m * within(ranges.nose);
        let tail_m = belt_m + within([-0.01, 0.08]);
        // Wheels of 175/65 R14 (0.29 m) to 275/65 R18 (0.4 m).
        let tall = matches!(style, Suv | PickUp | Van);
        let wheel_m = if tall { within([0.33, 0.39]) } else { within([0.285, 0.34]) };
        let front_overhang_m = within([0.68, 0.98]);
        let rear_overhang_m = length_m * within([0.15, 0.23]);
        Self {
            style,
            half: DVec2::new(half_m, width_m / 2.0),
            height_m,
            sill_m: if tall { within([0.2, 0.28]) } else { within([0.14, 0.21]) },
            nose_m,
            top_line: top_line(half_m, [rear_foot, foot], [tail_m, belt_m, nose_m]),
            screen: [foot, head],
            rear: [rear_foot, rear_head],
            roof_share: if style.is_boxy() { within([0.82, 0.92]) } else { within([0.68, 0.8]) },
            wheel_m,
            axles: [-half_m + rear_overhang_m, half_m - front_overhang_m],
        }
    }

    /// The height of the bonnet, the windows' lower edge or the boot at `x`.
    pub fn top_m(&self, x: f64) -> f64 {
        let ahead = self.top_line.partition_point(|p| p.x <= x);
        let ahead = ahead.clamp(1, self.top_line.len() - 1);
        let [from, to] = [self.top_line[ahead - 1], self.top_line[ahead]];
        let share = ((x - from.x) / (to.x - from.x)).clamp(0.0, 1.0);
        from.lerp(to, share).y
    }

    /// Where the pillar between the front doors and what is behind them stands.
    pub fn middle_pillar_x(&self) -> f64 {
        let [rear, front] = self.axles;
        rear + 0.47 * (front - rear)
    }
}

/// A convex bonnet that falls to a rounded nose, and a boot that falls a little to
/// the tail.
fn top_line(
    half_m: f64,
    [rear, screen]: [f64; 2],
    [tail_m, belt_m, nose_m]: [f64; 3],
) -> Vec<DVec2> {
    let nose_x = half_m - 0.16;
    let fall_m = belt_m - nose_m;
    let middle = 0.5 * (nose_x + screen);
    vec![
        DVec2::new(-half_m, tail_m - 0.05),
        DVec2::new(rear.max(-half_m + 0.02), tail_m),
        DVec2::new(screen, belt_m),
        DVec2::new(middle, belt_m - 0.36 * fall_m),
        DVec2::new(nose_x, nose_m),
        DVec2::new(half_m, nose_m - 0.1),
    ]
}
