use crate::primitives::{Builder, DVec3, Sampler, block, dvec3, rod};

/// A stretch of fence along y about the origin.
struct Stretch {
    long_m: f64,
    high_m: f64,
    /// Half the width of the posts.
    post_m: f64,
    apart_m: f64,
}

/// Builds a fence, 0.6 to 2.2 m high and 2 to 8 m long.
pub fn build(b: &mut Builder, s: &mut Sampler) {
    let stretch = Stretch {
        long_m: s.uniform(2.0, 8.0),
        high_m: s.log_uniform(0.6, 2.2),
        post_m: s.uniform(0.02, 0.08),
        apart_m: s.uniform(1.6, 3.0),
    };
    stretch.posts(b);
    match s.count(0, 6) {
        0 | 1 => pickets(b, s, &stretch),
        2 | 3 => bars(b, s, &stretch),
        4 => planks(b, s, &stretch),
        _ => wire(b, s, &stretch),
    }
    if s.chance(0.25) {
        // A low wall that carries the fence.
        let high_m = s.uniform(0.1, 0.4) * stretch.high_m;
        block(b, 0.5 * high_m * DVec3::Z, dvec3(0.2, stretch.long_m, high_m));
    }
}

impl Stretch {
    fn posts(&self, b: &mut Builder) {
        let n = (self.long_m / self.apart_m).ceil();
        let size = dvec3(2.0 * self.post_m, 2.0 * self.post_m, self.high_m + 0.05);
        for k in 0..=n as usize {
            let y = (k as f64 / n - 0.5) * self.long_m;
            block(b, dvec3(0.0, y, 0.5 * size.z), size);
        }
    }

    /// Adds level rails `at` these shares of the height.
    fn rails(&self, b: &mut Builder, at: &[f64], thick_m: f64) {
        for share in at {
            block(b, share * self.high_m * DVec3::Z, dvec3(thick_m, self.long_m, 1.5 * thick_m));
        }
    }

    /// Adds upright boards of `size` at a distance of `pitch_m`, except where `missing` is true.
    fn uprights(&self, b: &mut Builder, pitch_m: f64, size: DVec3, missing: impl Fn(f64) -> bool) {
        let n = (self.long_m / pitch_m) as usize;
        for k in 0..n {
            let y = ((k as f64 + 0.5) / n as f64 - 0.5) * self.long_m;
            if !missing(y) {
                block(b, dvec3(size.x, y, self.high_m - 0.5 * size.z), size);
            }
        }
    }
}

/// Upright boards on two rails, with or without gaps; a few may be missing.
fn pickets(b: &mut Builder, s: &mut Sampler, stretch: &Stretch) {
    let wide_m = s.uniform(0.07, 0.18);
    let pitch_m = wide_m * s.pick(&[1.02, 1.3, 1.8]);
    let size = dvec3(0.025, wide_m, s.uniform(0.88, 0.98) * stretch.high_m);
    let gap_m = s.uniform(-2.0, 2.0) * stretch.long_m;
    stretch.rails(b, &[0.2, 0.8], 0.05);
    stretch.uprights(b, pitch_m, size, |y| (y - gap_m).abs() < 0.2);
}

/// Upright bars of iron 0.08 to 0.14 m apart between two rails.
fn bars(b: &mut Builder, s: &mut Sampler, stretch: &Stretch) {
    let thick_m = s.uniform(0.015, 0.03);
    let size = dvec3(thick_m, thick_m, 0.95 * stretch.high_m);
    stretch.rails(b, &[0.12, 0.9], 0.03);
    stretch.uprights(b, s.uniform(0.08, 0.14), size, |_| false);
}

/// Level planks: a ranch fence with few of them, or a screen with many.
fn planks(b: &mut Builder, s: &mut Sampler, stretch: &Stretch) {
    let n = s.pick(&[2, 3, 4, 9]);
    let pitch_m = stretch.high_m / n as f64;
    let size = dvec3(0.03, stretch.long_m, pitch_m * s.uniform(0.4, 0.97));
    for plank in 0..n {
        let z = (plank as f64 + 0.5) * pitch_m;
        block(b, dvec3(0.03, 0.0, z), size);
    }
}

/// Wire: welded mats, or mesh. The wires of mesh are thicker and further apart than real ones, so
/// that they stop the same fraction of the beams.
fn wire(b: &mut Builder, s: &mut Sampler, stretch: &Stretch) {
    let [half_m, high_m] = [0.5 * stretch.long_m, stretch.high_m];
    // Mesh of 50 mm with wires of 3 mm covers about 12 %, the same as 10 mm wires at 0.16 m.
    let pitch_m = s.uniform(0.1, 0.16);
    let r = s.uniform(0.003, 0.006);
    let slant_m = if s.chance(0.5) { high_m } else { 0.0 };
    let n = ((2.0 * half_m + slant_m) / pitch_m) as usize;
    for k in 0..n {
        let y = -half_m + k as f64 * pitch_m;
        for slant_m in [slant_m, -slant_m] {
            let foot = if slant_m < 0.0 { y } else { y - slant_m };
            strand(b, foot, slant_m, [half_m, high_m], r);
        }
    }
    stretch.rails(b, &[0.03, 0.97], 2.0 * r);
    if slant_m == 0.0 {
        stretch.rails(b, &[0.2, 0.35, 0.5, 0.65, 0.8], 2.0 * r);
    }
    rod(b, dvec3(0.0, -half_m, high_m), dvec3(0.0, half_m, high_m), [0.02, 0.02]);
}

/// A wire that rises from `foot` by `slant_m` along y, cut at the ends of the fence: two crossed
/// strips.
fn strand(b: &mut Builder, foot: f64, slant_m: f64, [half_m, high_m]: [f64; 2], r: f64) {
    let share = |y: f64| if slant_m == 0.0 { 0.0 } else { (y - foot) / slant_m };
    let ends = [share(-half_m), share(half_m)];
    let [low, high] = [ends[0].min(ends[1]).max(0.0), ends[0].max(ends[1]).min(1.0)];
    let high = if slant_m == 0.0 { 1.0 } else { high };
    if high - low < 0.01 {
        return;
    }
    let at = |share: f64| dvec3(0.0, foot + share * slant_m, share * high_m);
    for half in [r * DVec3::X, r * DVec3::Y] {
        let row = |share: f64| vec![at(share) - half, at(share) + half];
        b.grid(&[row(low), row(high)], false);
    }
}
