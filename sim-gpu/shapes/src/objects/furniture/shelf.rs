use crate::primitives::{Builder, DVec3, Sampler, block, block_between, dvec3};

/// The measures of a shelf that is open to +x, with its width along y.
struct Frame {
    half_deep_m: f64,
    half_wide_m: f64,
    high_m: f64,
    board_m: f64,
}

/// Builds a shelf that faces +x: 0.7 to 2.2 m high, 0.4 to 1.8 m wide, 0.25 to 0.6 m deep, with
/// side boards or, as in a store, with posts.
pub fn build(b: &mut Builder, s: &mut Sampler) {
    let frame = Frame {
        half_deep_m: s.uniform(0.125, 0.3),
        half_wide_m: s.uniform(0.2, 0.9),
        high_m: s.uniform(0.7, 2.2),
        board_m: s.uniform(0.015, 0.035),
    };
    let n = (frame.high_m / s.uniform(0.28, 0.5)).round().max(2.0) as usize;
    frame.sides(b, s.chance(0.7));
    let rear = dvec3(-frame.half_deep_m, -frame.half_wide_m, 0.0);
    if s.chance(0.5) {
        block_between(b, rear, dvec3(0.01 - frame.half_deep_m, frame.half_wide_m, frame.high_m));
    }
    let fullness = s.uniform(0.0, 1.0);
    for level in 0..=n {
        let z = 0.06 + (frame.high_m - 0.07) * level as f64 / n as f64;
        let board = dvec3(2.0 * frame.half_deep_m, 2.0 * frame.half_wide_m, frame.board_m);
        block(b, z * DVec3::Z, board);
        if level < n && s.chance(fullness) {
            frame.fill(b, s, z + 0.5 * frame.board_m, 0.85 * frame.high_m / n as f64);
        }
    }
}

impl Frame {
    /// Adds side boards, or a post at each corner.
    fn sides(&self, b: &mut Builder, boards: bool) {
        let thick_m = if boards { self.board_m } else { 0.035 };
        for y in [-self.half_wide_m, self.half_wide_m] {
            if boards {
                let size = dvec3(2.0 * self.half_deep_m, thick_m, self.high_m);
                block(b, dvec3(0.0, y, 0.5 * self.high_m), size);
                continue;
            }
            for x in [-self.half_deep_m, self.half_deep_m] {
                block(b, dvec3(x, y, 0.5 * self.high_m), dvec3(thick_m, thick_m, self.high_m));
            }
        }
    }

    /// Puts books and boxes up to `room_m` high on the board at `z`.
    fn fill(&self, b: &mut Builder, s: &mut Sampler, z: f64, room_m: f64) {
        let mut y = -self.half_wide_m + self.board_m;
        while y < 0.8 * self.half_wide_m {
            // Books of one height are one block.
            let wide_m = s.uniform(0.05, 0.35).min(self.half_wide_m - self.board_m - y);
            let size = dvec3(
                self.half_deep_m * s.uniform(0.9, 1.7),
                wide_m,
                room_m * s.uniform(0.5, 0.95),
            );
            let x = 0.5 * size.x - self.half_deep_m + 0.02;
            block(b, dvec3(x, y + 0.5 * wide_m, z + 0.5 * size.z), size);
            y += wide_m + s.pick(&[0.0, 0.0, 0.1, 0.4]);
        }
    }
}
