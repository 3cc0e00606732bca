//! Flat screens in their housings.

use crate::primitives::{Builder, DVec3, Sampler, block, block_between, board, cushion, dvec3};

/// A screen that faces +x, with its width along y and its middle at the origin.
#[derive(Clone, Copy)]
pub struct Screen {
    pub width_m: f64,
    pub height_m: f64,
    pub depth_m: f64,
    housing: Housing,
}

type Housing = fn(&mut Builder, &mut Sampler, DVec3);

impl Screen {
    pub fn draw(s: &mut Sampler) -> Self {
        let width_m = s.log_uniform(0.35, 1.3);
        let ratio = s.pick(&[4.0 / 3.0, 1.25, 1.6, 16.0 / 9.0, 16.0 / 9.0, 21.0 / 9.0]);
        let portrait = width_m < 0.6 && s.chance(0.1);
        let height_m = width_m / ratio;
        let depth_m = width_m * s.log_uniform(0.015, 0.12);
        let housing = s.pick(&[framed, framed, framed_with_box, slab, rounded, bent]);
        if portrait {
            Self { width_m: height_m, height_m: width_m, depth_m, housing }
        } else {
            Self { width_m, height_m, depth_m, housing }
        }
    }

    pub fn build(self, b: &mut Builder, s: &mut Sampler) {
        (self.housing)(b, s, dvec3(self.depth_m, self.width_m, self.height_m));
    }
}

fn slab(b: &mut Builder, _: &mut Sampler, size: DVec3) {
    block(b, DVec3::ZERO, size);
}

fn rounded(b: &mut Builder, _: &mut Sampler, size: DVec3) {
    cushion(b, DVec3::ZERO, size, 0.4 * size.x);
}

/// A frame, and a screen that lies a little behind its front.
fn framed(b: &mut Builder, s: &mut Sampler, size: DVec3) {
    let frame_m = size.z * s.uniform(0.02, 0.08);
    let chin_m = frame_m * s.uniform(1.0, 2.5);
    let half = size / 2.0;
    let back = -half.x;
    for side in [-1.0, 1.0] {
        let outer = dvec3(half.x, side * half.y, half.z);
        block_between(b, dvec3(back, side * (half.y - frame_m), -half.z), outer);
    }
    let inner_m = half.y - frame_m;
    block_between(b, dvec3(back, -inner_m, half.z - frame_m), dvec3(half.x, inner_m, half.z));
    block_between(b, dvec3(back, -inner_m, -half.z), dvec3(half.x, inner_m, -half.z + chin_m));
    let glass = dvec3(half.x - 0.2 * size.x, inner_m, half.z - frame_m);
    block_between(b, dvec3(back, -inner_m, -half.z + chin_m), glass);
}

/// A framed screen with a housing for its electronics behind it.
fn framed_with_box(b: &mut Builder, s: &mut Sampler, size: DVec3) {
    framed(b, s, size);
    let inner = size * dvec3(1.0, s.uniform(0.4, 0.75), s.uniform(0.4, 0.7));
    cushion(b, -0.8 * size.x * DVec3::X, inner, 0.2 * size.x);
}

/// A screen that is bent about an upright axis, with its ends towards the viewer.
fn bent(b: &mut Builder, _: &mut Sampler, size: DVec3) {
    let sag_m = 0.12 * size.y;
    board(b, [size.y, size.z], -size.x * DVec3::X, |u, v| {
        let across = 2.0 * u - 1.0;
        let x = 0.5 * size.x + sag_m * across * across;
        dvec3(x, 0.5 * across * size.y, (v - 0.5) * size.z)
    });
}
