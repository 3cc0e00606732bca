use std::ops::Range;

use super::shell::Shell;
use crate::objects::car::panel::Arch;
use crate::objects::car::wheel;
use crate::primitives::{Builder, Sampler, block, block_between, dvec3, outline};

/// The measures of a bus, metres.
///
/// Sources are makers' data sheets: Mercedes Citaro, 12.14 or 18.13 x 2.55 x 3.12; MAN Lion's
/// Coach, 12.1 to 13.9 x 2.55 x 3.87; midibuses of 7 to 9.5 m.
struct Bus {
    length_m: f64,
    height_m: f64,
    half_width_m: f64,
    sill_m: f64,
    waist_m: f64,
    lintel_m: f64,
    wheel_m: f64,
    /// The length of a second section behind a joint; 0 without one.
    trailer_m: f64,
    floor_m: f64,
    door_side: f64,
    is_coach: bool,
}

impl Bus {
    fn draw(s: &mut Sampler) -> Self {
        let is_coach = s.chance(0.3);
        let is_midi = !is_coach && s.chance(0.2);
        let is_articulated = !is_coach && !is_midi && s.chance(0.2);
        let length_m = match (is_coach, is_midi) {
            (true, _) => s.uniform(10.0, 13.9),
            (_, true) => s.uniform(7.0, 9.5),
            _ => s.uniform(10.5, 12.5),
        };
        let height_m = if is_coach { s.uniform(3.4, 3.9) } else { s.uniform(2.85, 3.3) };
        let waist_m = if is_coach { s.uniform(1.7, 2.0) } else { s.uniform(0.95, 1.45) };
        Self {
            length_m: if is_articulated { 10.2 } else { length_m },
            height_m,
            half_width_m: if is_midi { s.uniform(1.1, 1.25) } else { s.uniform(1.245, 1.275) },
            sill_m: s.uniform(0.28, 0.38),
            waist_m,
            lintel_m: (waist_m + s.uniform(1.05, 1.35)).min(height_m - 0.3),
            wheel_m: if is_midi { s.uniform(0.38, 0.45) } else { s.uniform(0.47, 0.51) },
            trailer_m: if is_articulated { s.uniform(6.3, 6.8) } else { 0.0 },
            floor_m: if is_coach { 1.25 } else { 0.4 },
            // Two thirds of all people live where traffic keeps to the right.
            door_side: s.pick(&[-1.0, -1.0, 1.0]),
            is_coach,
        }
    }

    /// Windows of about `pane_m` with pillars of 0.1 m between them, on the interval `from..to`
    /// except at `doors`, which are ordered from the rear to the front.
    fn windows(doors: &[Range<f64>], [mut from, to]: [f64; 2], pane_m: f64) -> Vec<Range<f64>> {
        let mut windows = Vec::new();
        for (end, next) in doors.iter().map(|d| (d.start, d.end)).chain([(to, to)]) {
            let n = ((end - from) / pane_m).round().max(1.0);
            let step_m = (end - from) / n;
            if step_m > 0.4 {
                let starts = (0..n as u32).map(|k| from + step_m * f64::from(k));
                windows.extend(starts.map(|x| x + 0.05..x + step_m - 0.05));
            }
            from = next;
        }
        windows
    }

    fn arch(&self, x: f64) -> Arch {
        Arch { x, z: self.wheel_m, radius_m: self.wheel_m + 0.08 }
    }

    fn shell(
        &self,
        s: &mut Sampler,
        [rear_x, front_x]: [f64; 2],
        axles: &[f64],
        doors: Vec<Range<f64>>,
    ) -> Shell {
        Shell {
            rear_x,
            front_x,
            half_width_m: self.half_width_m,
            sill_m: self.sill_m,
            waist_m: self.waist_m,
            roof_m: self.height_m - 0.08,
            lintel_m: self.lintel_m,
            arches: axles.iter().map(|&x| self.arch(x)).collect(),
            rake_m: 0.0,
            bow_m: 0.02,
            inset_m: s.uniform(0.02, 0.1),
            windows: Self::windows(&doors, [rear_x + 0.3, front_x - 0.45], s.uniform(1.15, 1.9)),
            doors: (self.door_side, doors),
            has_rear_window: s.chance(0.75),
            has_windscreen: false,
        }
    }
}

/// Builds a bus within Directive 96/53/EC's limits: 13.5 m with two axles, 18.75 m articulated,
/// 2.55 m wide.
pub fn build(b: &mut Builder, s: &mut Sampler) {
    let bus = Bus::draw(s);
    let rear_x = -bus.length_m;
    let front_axle = -s.uniform(2.5, 2.8) * (bus.length_m / 12.0).min(1.0);
    let rear_axle = rear_x + s.uniform(2.6, 3.4) * (bus.length_m / 12.0).min(1.0);
    let mut axles = vec![rear_axle, front_axle];
    if bus.is_coach && bus.length_m > 12.5 {
        axles.push(rear_axle - 1.35);
    }
    let doors = doors(s, &bus, [rear_axle, front_axle]);
    let mut shell = bus.shell(s, [rear_x, 0.0], &axles, doors);
    shell.bow_m = s.uniform(0.08, 0.3);
    shell.rake_m = s.uniform(0.0, 0.35);
    shell.has_windscreen = true;
    shell.build(b);
    inside(b, s, &bus, [rear_x, -0.5]);
    wheels(b, &bus, &axles);
    mirrors(b, s, &bus);
    if bus.trailer_m > 0.0 {
        trailer(b, s, &bus);
    }
    if s.chance(0.6) {
        let length_m = s.uniform(1.5, 3.5);
        let at = dvec3(-s.uniform(0.3, 0.7) * bus.length_m, 0.0, bus.height_m + 0.06);
        block(b, at, dvec3(length_m, s.uniform(1.3, 1.9), s.uniform(0.16, 0.3)));
    }
}

/// The doors from the rear to the front: 1.2 m wide ones before the front axle, in the middle and
/// near the rear. Coaches have the first and perhaps the second, 0.8 m wide.
fn doors(s: &mut Sampler, bus: &Bus, [rear_axle, front_axle]: [f64; 2]) -> Vec<Range<f64>> {
    let door = |middle: f64, width_m: f64| middle - 0.5 * width_m..middle + 0.5 * width_m;
    let first = 0.5 * (front_axle + bus.wheel_m - 0.35);
    let middle = 0.5 * (rear_axle + front_axle) + s.uniform(-0.5, 0.8);
    if bus.is_coach {
        return vec![door(middle, 0.8), door(first, 0.85)];
    }
    let mut doors = vec![door(middle, 1.25), door(first, 1.2)];
    let behind = 0.5 * (rear_axle - bus.wheel_m - bus.length_m);
    if bus.length_m > 11.0 && s.chance(0.3) {
        doors.insert(0, door(behind, 0.9));
    }
    doors
}

fn wheels(b: &mut Builder, bus: &Bus, axles: &[f64]) {
    for &x in axles {
        for side in [-1.0, 1.0] {
            let at = dvec3(x, side * (bus.half_width_m - 0.05), bus.wheel_m);
            b.shifted(at, |b| wheel::wheel(b, [bus.wheel_m, 0.29, 0.08], side));
        }
    }
}

/// Floor, engine, rows of seats, a driver's place.
fn inside(b: &mut Builder, s: &mut Sampler, bus: &Bus, [rear_x, front_x]: [f64; 2]) {
    let y = bus.half_width_m - 0.35;
    let low = dvec3(rear_x + 0.2, -y, bus.sill_m + 0.02);
    block_between(b, low, dvec3(front_x, y, bus.floor_m.max(bus.sill_m + 0.05)));
    let seat_m = if bus.is_coach { bus.floor_m } else { bus.floor_m + 0.15 };
    let pitch_m = s.uniform(0.75, 1.05);
    let rows = ((front_x - rear_x - 2.0) / pitch_m) as usize;
    for row in 0..rows {
        let x = rear_x + 0.5 + pitch_m * row as f64;
        for side in [-1.0, 1.0] {
            if s.chance(0.8) {
                // The back and the cushion are thin, so that sheets represent them.
                let y = side * 0.7 * bus.half_width_m - 0.42;
                b.surface([1, 1], |u, v| {
                    dvec3(x - 0.12 * v, y + 0.84 * u, seat_m + 0.4 + 0.75 * v)
                });
                b.surface([1, 1], |u, v| dvec3(x + 0.42 * v, y + 0.84 * u, seat_m + 0.42));
            }
        }
    }
    let driver = dvec3(front_x - 1.0, -bus.door_side * 0.55 * bus.half_width_m, bus.floor_m + 1.0);
    block(b, driver, dvec3(0.14, 0.5, 0.9));
    let dash = dvec3(front_x + 0.05, 0.0, 0.85 * bus.waist_m);
    block(b, dash, dvec3(0.3, 1.8 * bus.half_width_m, 0.3 * bus.waist_m));
}

/// Mirrors in front of the windscreen's upper corners, or at the sides.
fn mirrors(b: &mut Builder, s: &mut Sampler, bus: &Bus) {
    let size = dvec3(0.12, 0.22, s.uniform(0.35, 0.6));
    let ahead_m = s.uniform(-0.2, 0.3);
    let at = dvec3(ahead_m, bus.half_width_m + 0.12, bus.lintel_m - s.uniform(0.2, 0.6));
    b.mirrored_y(|b| {
        block(b, at, size);
        let arm = dvec3(-0.3 * ahead_m.abs() - 0.1, -0.12, 0.5 * size.z);
        block(b, at + arm, dvec3(0.3, 0.08, 0.06));
    });
}

/// The rear section of an articulated bus, and the bellows in front of it.
fn trailer(b: &mut Builder, s: &mut Sampler, bus: &Bus) {
    let front_x = -bus.length_m - 1.1;
    let rear_x = front_x - bus.trailer_m;
    let axle = rear_x + 0.45 * bus.trailer_m;
    let door = 0.5 * (axle + front_x);
    bus.shell(s, [rear_x, front_x], &[axle], vec![door - 0.6..door + 0.6]).build(b);
    inside(b, s, bus, [rear_x, front_x - 0.3]);
    wheels(b, bus, &[axle]);
    let folds = 8;
    let half_y = bus.half_width_m - 0.06;
    let row = |k: usize| {
        let inset_m = if k.is_multiple_of(2) { 0.0 } else { 0.08 };
        let x = front_x + 1.1 * k as f64 / folds as f64;
        let [y, top] = [half_y - inset_m, bus.height_m - 0.12 - inset_m];
        outline::upright(x, y, [0.45, top])
    };
    let rows: Vec<_> = (0..=folds).map(row).collect();
    b.grid(&rows, false);
}
