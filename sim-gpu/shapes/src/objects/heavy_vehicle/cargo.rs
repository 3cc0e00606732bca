//! Bodies on the frame of a lorry, and their loads.

use crate::primitives::*;

/// The space for a body, from `rear_x` to `front_x`, and from the upper side of the frame at
/// `deck_m` up to `top_m`.
pub struct Space {
    pub rear_x: f64,
    pub front_x: f64,
    pub half_width_m: f64,
    pub deck_m: f64,
    pub top_m: f64,
}

/// Builds a body or a load in a space.
pub type Cargo = fn(&Space, &mut Builder, &mut Sampler);

impl Space {
    fn length_m(&self) -> f64 {
        self.front_x - self.rear_x
    }

    fn at(&self, along: f64, across: f64, z: f64) -> DVec3 {
        dvec3(self.rear_x + along * self.length_m(), across * self.half_width_m, z)
    }

    /// A closed box with smooth sides or with ribs, and sometimes with a tail lift.
    pub fn closed(&self, b: &mut Builder, s: &mut Sampler) {
        block_between(b, self.at(0.0, -1.0, self.deck_m), self.at(1.0, 1.0, self.top_m));
        if s.chance(0.3) {
            let ribs = (self.length_m() / 0.6).round() as usize;
            b.mirrored_y(|b| {
                for k in 0..=ribs {
                    let foot = self.at(k as f64 / ribs as f64, 1.0, self.deck_m);
                    bar(b, foot, foot.with_z(self.top_m), 0.06, 0.08);
                }
            });
        }
        if s.chance(0.3) {
            let low = dvec3(self.rear_x - 0.1, -0.95 * self.half_width_m, self.deck_m - 0.35);
            let high = dvec3(self.rear_x - 0.02, 0.95 * self.half_width_m, self.deck_m + 1.4);
            block_between(b, low, high);
        }
        if s.chance(0.25) {
            // A cooling unit on the front wall.
            let low = self.at(1.0, -0.75, self.top_m - 1.0);
            block_between(b, low, self.at(1.0, 0.75, self.top_m - 0.1) + 0.3 * DVec3::X);
        }
    }

    /// A dumper's skip, open above, empty or filled.
    pub fn skip(&self, b: &mut Builder, s: &mut Sampler) {
        let top_m = (self.deck_m + s.uniform(0.8, 1.6)).min(self.top_m);
        let floor_m = self.deck_m + 0.12;
        let ring = |share: f64, x_share: [f64; 2], z: f64| {
            let [rear, front] = x_share;
            vec![
                self.at(rear, -share, z),
                self.at(front, -share, z),
                self.at(front, share, z),
                self.at(rear, share, z),
            ]
        };
        let [foot, rim] = [ring(0.9, [0.02, 0.97], floor_m), ring(1.0, [0.0, 1.0], top_m)];
        b.grid(&[foot.clone(), rim], true);
        cap(b, &foot);
        let ribs = (self.length_m() / 0.8).round() as usize;
        b.mirrored_y(|b| {
            for k in 1..ribs {
                let along = k as f64 / ribs as f64;
                bar(b, self.at(along, 0.92, floor_m), self.at(along, 1.0, top_m), 0.08, 0.1);
            }
        });
        if s.chance(0.6) {
            // A guard over the cab.
            block_between(
                b,
                self.at(1.0, -0.95, top_m),
                self.at(1.0, 0.95, top_m) + dvec3(0.9, 0.0, 0.06),
            );
        }
        if s.chance(0.6) {
            let heap_m = s.uniform(-0.2, 0.5) + top_m;
            let heap = [ring(0.97, [0.02, 0.98], top_m - 0.3), ring(0.3, [0.3, 0.7], heap_m)];
            b.grid(&heap, true);
            cap(b, &heap[1]);
        }
    }

    /// A platform, with or without low side boards, with or without a load.
    pub fn platform(&self, b: &mut Builder, s: &mut Sampler) {
        let floor_m = self.deck_m + 0.15;
        block_between(b, self.at(0.0, -1.0, self.deck_m), self.at(1.0, 1.0, floor_m));
        block_between(
            b,
            self.at(1.0, -1.0, floor_m) - 0.06 * DVec3::X,
            self.at(1.0, 1.0, floor_m + s.uniform(0.5, 1.5)),
        );
        if s.chance(0.6) {
            let high = floor_m + s.uniform(0.35, 0.8);
            b.mirrored_y(|b| {
                block_between(b, self.at(0.0, 0.975, floor_m), self.at(1.0, 1.0, high));
            });
            block_between(
                b,
                self.at(0.0, -1.0, floor_m),
                self.at(0.0, 1.0, high) + 0.04 * DVec3::X,
            );
        }
        match s.count(0, 4) {
            0 => {
                // Pipes or logs.
                let r = s.uniform(0.1, 0.3);
                let rows = (0.85 * self.half_width_m / r) as usize;
                for layer in 0..s.count(1, 3).min(rows) {
                    for k in 0..rows - layer {
                        let y = (2.0 * k as f64 + layer as f64 - rows as f64 + 1.0) * r;
                        let z = floor_m + r * (1.0 + 1.7 * layer as f64);
                        let [from, to] =
                            [0.05, 0.9].map(|along| self.at(along, 0.0, z) + y * DVec3::Y);
                        rod(b, from, to, [r, r]);
                    }
                }
            }
            1 | 2 => {
                for _ in 0..s.count(2, 6) {
                    let size = dvec3(s.uniform(0.6, 1.6), s.uniform(0.6, 1.4), s.uniform(0.4, 1.5));
                    let along = s.uniform(0.15, 0.85);
                    block(b, self.at(along, s.uniform(-0.4, 0.4), floor_m + 0.5 * size.z), size);
                }
            }
            _ => {}
        }
    }

    /// A tank of round or oval section.
    pub fn tank(&self, b: &mut Builder, s: &mut Sampler) {
        let half_z = s.uniform(0.7, 1.0).min(0.5 * (self.top_m - self.deck_m));
        let half_y = (half_z * s.uniform(1.0, 1.35)).min(self.half_width_m);
        let z = self.deck_m + 0.1 + half_z;
        let ring = |along: f64, share: f64| {
            let ring = outline::superellipse(share * dvec2(half_y, half_z), 2.4, 20);
            outline::across_x(&ring, self.at(along, 0.0, z))
        };
        loft(b, &[ring(0.0, 0.75), ring(0.04, 1.0), ring(0.96, 1.0), ring(1.0, 0.75)]);
        block(b, self.at(0.5, 0.0, z + half_z + 0.05), dvec3(0.7 * self.length_m(), 0.6, 0.12));
    }

    /// The drum of a concrete mixer, with its mouth to the rear, and its chute.
    pub fn mixer(&self, b: &mut Builder, s: &mut Sampler) {
        let r = s.uniform(1.0, 1.1);
        let [low, high] = [self.deck_m + 0.15, self.deck_m + 0.7];
        let axis = |along: f64| self.at(along, 0.0, high + along * (low - high) + r);
        let drum = [(0.08, 0.45), (0.4, 0.9), (0.62, 1.0), (0.8, 0.95), (0.95, 0.5)];
        let sections = drum.map(|(along, share)| {
            outline::across_x(&outline::ellipse(DVec2::splat(share * r), 20), axis(along))
        });
        loft(b, &sections);
        for along in [0.1, 0.92] {
            let top = axis(along).z;
            block_between(b, self.at(along, -0.5, self.deck_m), self.at(along + 0.03, 0.5, top));
        }
        rod(b, self.at(0.03, 0.0, high + 0.7), self.at(-0.1, 0.3, self.deck_m - 0.1), [0.2, 0.15]);
    }

    /// A refuse collector's body with its rounded hopper.
    pub fn refuse(&self, b: &mut Builder, s: &mut Sampler) {
        let top_m = (self.deck_m + s.uniform(2.0, 2.5)).min(self.top_m);
        let size = dvec3(0.74 * self.length_m(), 2.0 * self.half_width_m, top_m - self.deck_m);
        cushion(b, self.at(0.63, 0.0, 0.5 * (self.deck_m + top_m)), size, 0.12);
        let section = |along: f64, low: f64, high: f64| {
            outline::upright(self.at(along, 0.0, 0.0).x, self.half_width_m, [low, high])
        };
        let sections = [
            section(0.0, 0.7, self.deck_m + 0.6),
            section(0.06, 0.55, top_m - 0.5),
            section(0.26, self.deck_m - 0.2, top_m),
        ];
        loft(b, &sections);
    }
}
