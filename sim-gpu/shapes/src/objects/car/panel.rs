//! Walls of vehicles: panels with panes, and edges with wheel arches.

use glam::{DVec3, dvec3};

use crate::primitives::Builder;

/// An upright line of a wall, and the panel between it and the next one.
#[derive(Clone, Copy)]
pub struct Column {
    pub foot: DVec3,
    pub head: DVec3,
    /// The lower and the upper end of the pane, as shares of the height; `None` for sheet metal.
    pub pane: Option<[f64; 2]>,
}

/// The wall through `columns`, which run counter-clockwise seen from above.
pub fn wall(b: &mut Builder, columns: &[Column]) {
    for pair in columns.windows(2) {
        let strip = |b: &mut Builder, low: f64, high: f64| {
            let row = |t| pair.iter().map(|c| c.foot.lerp(c.head, t)).collect();
            if high > low {
                b.grid(&[row(low), row(high)], false);
            }
        };
        let Some([low, high]) = pair[0].pane else {
            strip(b, 0.0, 1.0);
            continue;
        };
        strip(b, 0.0, low);
        b.glass(|b| strip(b, low, high));
        strip(b, high, 1.0);
    }
}

/// The lid over one side's `edge` (y below 0, from the rear to the front) and its mirror image. It
/// is `crown_m` higher in the middle of its widest row.
pub fn lid(b: &mut Builder, edge: &[DVec3], crown_m: f64) {
    let widest_m = edge.iter().map(|p| p.y.abs()).fold(0.0, f64::max);
    let row = |p: &DVec3| {
        if p.y.abs() < 1e-9 {
            return vec![*p];
        }
        let rise_m = crown_m * (p.y / widest_m).powi(2);
        [-1.0, -0.5, 0.5, 1.0f64]
            .map(|share| dvec3(p.x, share * p.y, p.z + rise_m * (1.0 - share * share)))
            .to_vec()
    };
    let rows: Vec<_> = edge.iter().map(row).collect();
    if rows.len() > 1 {
        b.grid(&rows, false);
    }
}

/// The opening for a wheel in a vehicle's side.
#[derive(Clone, Copy)]
pub struct Arch {
    /// x of the axle.
    pub x: f64,
    pub z: f64,
    pub radius_m: f64,
}

impl Arch {
    /// The x at which a side needs columns for a round opening.
    pub fn stations(&self) -> impl Iterator<Item = f64> {
        let Self { x, radius_m, .. } = *self;
        let round =
            (0..=6).map(move |k| x - radius_m * libm::cos(f64::from(k) * 30f64.to_radians()));
        round.chain([x - radius_m - 0.02, x + radius_m + 0.02])
    }
}

/// The height of a side's lower edge at `x`: `sill_m`, or the edge of a wheel arch.
pub fn lower_edge_m(arches: &[Arch], sill_m: f64, x: f64) -> f64 {
    arches
        .iter()
        .map(|arch| (arch.z, arch.radius_m.powi(2) - (x - arch.x).powi(2)))
        // The tolerance keeps rounding from closing the ends of the opening.
        .filter(|(_, square)| *square > -1e-9)
        .map(|(z, square)| z + square.max(0.0).sqrt())
        .fold(sill_m, f64::max)
}

/// `stations` within `low..high` in ascending order, without those less than a centimetre above
/// another.
pub fn in_order(stations: impl IntoIterator<Item = f64>, [low, high]: [f64; 2]) -> Vec<f64> {
    let mut xs: Vec<f64> = stations.into_iter().filter(|x| (low..high).contains(x)).collect();
    xs.sort_by(f64::total_cmp);
    xs.dedup_by(|later, earlier| *later - *earlier < 0.01);
    xs
}
