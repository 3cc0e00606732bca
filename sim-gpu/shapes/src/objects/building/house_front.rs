//! Fronts of houses with recessed windows, entrances, bays and balconies.
//!
//! Storeys are 2.6 to 3.6 m high, sills 0.8 to 1 m, doors 2 to 2.2 m (usual measures of housing,
//! for example in Neufert's Architects' Data).

use super::opening::{Filling, Opening, Rect, blank};
use crate::primitives::*;

/// The measures of a front that faces +x and runs along y from 0.
struct Front {
    n_bays: usize,
    bay_m: f64,
    n_storeys: usize,
    storey_m: f64,
    /// The height of the ground floor above the ground.
    plinth_m: f64,
    recess_m: f64,
    window: DVec2,
    sill_m: f64,
    filling: Filling,
    /// The filling of wide openings in the ground floor, of a shop or of garages; `None` for
    /// windows.
    wide_below: Option<Filling>,
}

pub fn build(b: &mut Builder, s: &mut Sampler) {
    let front = Front::draw(s);
    let door = s.count(0, front.n_bays - 1);
    for storey in 0..front.n_storeys {
        for bay in 0..front.n_bays {
            front.cell(b, s, storey, bay, storey == 0 && bay == door);
        }
    }
    let wide_m = front.wide_m();
    let y = (door as f64 + 0.5) * front.bay_m;
    b.shifted(y * DVec3::Y, |b| entrance(b, s, front.plinth_m));
    if front.plinth_m > 0.0 {
        block_between(b, dvec3(-0.3, 0.0, 0.0), dvec3(0.06, wide_m, front.plinth_m));
    }
    side_walls(b, s, &front);
    stand_out(b, s, &front, door);
    roof(b, s, &front);
}

impl Front {
    fn draw(s: &mut Sampler) -> Self {
        let n_storeys = s.weighted(&[(3, 1), (4, 2), (2, 3)]);
        let bay_m = s.uniform(1.8, 3.2);
        let n_bays = (s.uniform(6.0, 15.0) / bay_m).ceil().clamp(2.0, 7.0) as usize;
        let window = dvec2(s.uniform(0.45, 0.7) * bay_m, s.uniform(1.0, 1.7));
        let wide = s.chance(0.25);
        let below = s.pick(&[Filling::Glass, Filling::Solid]);
        Self {
            n_bays,
            bay_m,
            n_storeys,
            storey_m: s.uniform(2.6, 3.6),
            plinth_m: s.pick(&[0.0, 0.2, 0.5, 0.8]),
            recess_m: s.uniform(0.05, 0.3),
            window,
            sill_m: s.uniform(0.75, 0.95),
            filling: s.pick(&[Filling::Glass, Filling::Panes]),
            wide_below: if wide { Some(below) } else { None },
        }
    }

    fn wide_m(&self) -> f64 {
        self.n_bays as f64 * self.bay_m
    }

    fn high_m(&self) -> f64 {
        self.plinth_m + self.n_storeys as f64 * self.storey_m
    }

    /// Adds the wall of one bay of one storey.
    fn cell(&self, b: &mut Builder, s: &mut Sampler, storey: usize, bay: usize, door: bool) {
        let floor_m = self.plinth_m + storey as f64 * self.storey_m;
        let low = dvec2(bay as f64 * self.bay_m, floor_m);
        let cell = Rect { low, high: low + dvec2(self.bay_m, self.storey_m) };
        let middle = cell.middle().x;
        let hole = |wide_m: f64, sill_m: f64, high_m: f64| {
            let low = dvec2(middle - 0.5 * wide_m, floor_m + sill_m);
            Rect { low, high: low + dvec2(wide_m, high_m) }
        };
        let (hole, filling) = match self.wide_below {
            _ if door => (hole(s.uniform(0.95, 1.2), 0.001, 2.1), Filling::Solid),
            Some(filling) if storey == 0 => (hole(0.88 * self.bay_m, 0.1, 2.2), filling),
            _ if s.chance(0.1) => return blank(b, cell),
            _ => {
                // One window of seven has its blind or shutter down.
                let filling = if s.chance(0.15) { Filling::Solid } else { self.filling };
                (hole(self.window.x, self.sill_m, self.window.y), filling)
            }
        };
        Opening { hole, recess_m: self.recess_m, frame_m: 0.07, filling }.build(b, cell);
        if !door && storey > 0 {
            let sill = dvec3(0.1, hole.size_m().x + 0.1, 0.05);
            block(b, dvec3(0.04, middle, hole.low.y - 0.02), sill);
        }
    }
}

/// The steps to the door, a handrail, and a canopy.
fn entrance(b: &mut Builder, s: &mut Sampler, plinth_m: f64) {
    let half_m = s.uniform(0.6, 1.1);
    let n = (plinth_m / 0.17).round() as usize;
    for step in 0..n {
        let high_m = plinth_m * (step + 1) as f64 / n as f64;
        let out_m = 0.3 * (n - step) as f64 + 0.5;
        block_between(b, dvec3(0.0, -half_m, 0.0), dvec3(out_m, half_m, high_m));
    }
    if n > 1 && s.chance(0.6) {
        let out_m = 0.3 * n as f64 + 0.4;
        let top = dvec3(0.5, half_m, plinth_m + 0.9);
        let low = dvec3(out_m, half_m, 0.9);
        rod(b, top, low, [0.02, 0.02]);
        for end in [top, low] {
            rod(b, end.with_z(0.0), end, [0.02, 0.02]);
        }
    }
    if s.chance(0.4) {
        let size = dvec3(s.uniform(0.6, 1.4), 2.2 * half_m, 0.12);
        block(b, dvec3(0.5 * size.x, 0.0, plinth_m + 2.4), size);
    }
}

/// The two side walls, one of which is longer.
fn side_walls(b: &mut Builder, s: &mut Sampler, front: &Front) {
    let deep_m = [s.uniform(0.3, 8.0), s.uniform(0.3, 1.0)];
    let turn_rad = std::f64::consts::FRAC_PI_2;
    let wall = |long_m: f64| {
        let low = dvec2(-0.5 * long_m, 0.0);
        Rect { low, high: dvec2(0.5 * long_m, front.high_m()) }
    };
    for (deep_m, side) in deep_m.into_iter().zip([1.0, 0.0]) {
        let middle = dvec3(-0.5 * deep_m, side * front.wide_m(), 0.0);
        let turned = DAffine3::from_rotation_z((2.0 * side - 1.0) * turn_rad);
        b.turned(middle, turned, |b| blank(b, wall(deep_m)));
    }
}

/// A bay or a balcony, and a downpipe.
fn stand_out(b: &mut Builder, s: &mut Sampler, front: &Front, door: usize) {
    let free = (door + 1 + s.count(0, front.n_bays - 2)) % front.n_bays;
    let y = (free as f64 + 0.5) * front.bay_m;
    if front.n_storeys > 1 && s.chance(0.35) {
        let z = front.plinth_m + front.storey_m;
        b.shifted(dvec3(0.0, y, z), |b| balcony(b, s, 0.9 * front.bay_m));
    } else if s.chance(0.3) {
        b.shifted(y * DVec3::Y, |b| bay(b, s, front));
    }
    if s.chance(0.6) {
        cylinder(b, dvec3(0.1, front.wide_m() - 0.2, 0.0), 0.05, front.high_m());
    }
}

/// A slab with a railing of bars or a parapet (1 m high).
fn balcony(b: &mut Builder, s: &mut Sampler, wide_m: f64) {
    let out_m = s.uniform(0.8, 1.6);
    block(b, dvec3(0.5 * out_m, 0.0, -0.08), dvec3(out_m, wide_m, 0.16));
    if s.chance(0.5) {
        return block(b, dvec3(out_m, 0.0, 0.5), dvec3(0.08, wide_m, 1.0));
    }
    let half_m = 0.5 * wide_m;
    for z in [0.1, 1.0] {
        let corners = [(0.0, -half_m), (out_m, -half_m), (out_m, half_m), (0.0, half_m)];
        let corners = corners.map(|(x, y)| dvec3(x, y, z));
        corners.windows(2).for_each(|ends| rod(b, ends[0], ends[1], [0.02, 0.02]));
    }
    let n = (wide_m / 0.12).round() as usize;
    for bar in 0..=n {
        let y = wide_m * (bar as f64 / n as f64 - 0.5);
        block(b, dvec3(out_m, y, 0.5), dvec3(0.015, 0.015, 1.0));
    }
}

/// A bay that begins at the ground, with a window in front.
fn bay(b: &mut Builder, s: &mut Sampler, front: &Front) {
    let out_m = s.uniform(0.5, 1.2);
    let half_m = 0.45 * front.bay_m;
    let high_m = front.plinth_m + front.storey_m;
    let low = dvec3(0.0, -half_m, 0.0);
    let below_m = front.plinth_m + front.sill_m;
    block_between(b, low, dvec3(out_m, half_m, below_m));
    block_between(b, low.with_z(high_m - 0.5), dvec3(out_m, half_m, high_m));
    for y in [-half_m + 0.1, half_m - 0.1] {
        block(b, dvec3(out_m - 0.1, y, 0.5 * high_m), dvec3(0.2, 0.2, high_m));
    }
    b.glass(|b| {
        let size = dvec3(0.02, 2.0 * half_m, high_m - 0.5 - below_m);
        block(b, dvec3(out_m - 0.1, 0.0, below_m + 0.5 * size.z), size);
    });
}

/// The eaves, or the parapet of a flat roof.
fn roof(b: &mut Builder, s: &mut Sampler, front: &Front) {
    let [wide_m, high_m] = [front.wide_m(), front.high_m()];
    let out_m = s.uniform(0.05, 0.7);
    if s.chance(0.5) {
        let size = dvec3(out_m + 0.3, wide_m + 0.2, 0.3);
        return block(b, dvec3(0.5 * out_m, 0.5 * wide_m, high_m + 0.15), size);
    }
    let slope = s.uniform(0.5, 1.1);
    let row = |x: f64| {
        let z = high_m - slope * x;
        vec![dvec3(x, 0.0, z), dvec3(x, wide_m, z)]
    };
    b.grid(&[row(out_m), row(-2.0)], false);
}
