//! The same test for one triangle, line by line as in `shaders/intersect.wgsl`.

use super::{Candidates4, DISPLACEMENT, EDGE_ROUNDING, Shear, intersect4};
use crate::bvh::{Builder, Bvh};
use crate::ray::NO_HIT;
use formats::rng::StreamKey;
use glam::Vec3;

struct Rows {
    x: Vec3,
    y: Vec3,
    z: Vec3,
}

fn rows(direction: Vec3) -> Rows {
    let size = direction.abs();
    let (ex, ey, ez, d) = if size.x > size.y && size.x > size.z {
        (Vec3::Y, Vec3::Z, Vec3::X, Vec3::new(direction.y, direction.z, direction.x))
    } else if size.y > size.z {
        (Vec3::Z, Vec3::X, Vec3::Y, Vec3::new(direction.z, direction.x, direction.y))
    } else {
        (Vec3::X, Vec3::Y, Vec3::Z, direction)
    };
    let per_z = 1.0 / d.z;
    Rows { x: ex - ez * (d.x * per_z), y: ey - ez * (d.y * per_z), z: ez * per_z }
}

fn row(r: Vec3, p: Vec3) -> f32 {
    r.x * p.x + r.y * p.y + r.z * p.z
}

fn edge(px: f32, py: f32, qx: f32, qy: f32) -> f32 {
    px * qy - py * qx
}

fn within(edge: f32, x: f32, y: f32) -> bool {
    edge * edge <= DISPLACEMENT * DISPLACEMENT * (x * x + y * y)
}

/// Distance, error and rival.
fn intersect(
    origin: Vec3,
    direction: Vec3,
    corners: [[f32; 3]; 3],
    longest: f32,
) -> Option<[f32; 3]> {
    let shear = rows(direction);
    let [a, b, c] = corners.map(|corner| Vec3::from_array(corner) - origin);
    let (ax, ay) = (row(shear.x, a), row(shear.y, a));
    let (bx, by) = (row(shear.x, b), row(shear.y, b));
    let (cx, cy) = (row(shear.x, c), row(shear.y, c));
    let u = edge(bx, by, cx, cy);
    let v = -edge(ax, ay, cx, cy);
    let w = edge(ax, ay, bx, by);
    let (least, most) = (u.min(v).min(w), u.max(v).max(w));
    let margin = 2.0 * DISPLACEMENT * longest;
    if least < -margin && most > margin {
        return None;
    }
    let near_u = within(u, cx - bx, cy - by);
    let near_v = within(v, cx - ax, cy - ay);
    let near_w = within(w, bx - ax, by - ay);
    let near_edge = near_u || near_v || near_w;
    let left = (u < 0.0 && !near_u) || (v < 0.0 && !near_v) || (w < 0.0 && !near_w);
    let right = (u > 0.0 && !near_u) || (v > 0.0 && !near_v) || (w > 0.0 && !near_w);
    if left && right {
        return None;
    }
    let (az, bz, cz) = (row(shear.z, a), row(shear.z, b), row(shear.z, c));
    let determinant = u + v + w;
    let (first, last) = (az.min(bz).min(cz), az.max(bz).max(cz));
    let (t, error) = if determinant == 0.0 {
        (first, DISPLACEMENT + (last - first))
    } else {
        let slope_x = edge(by - ay, bz - az, cy - ay, cz - az);
        let slope_y = edge(bz - az, bx - ax, cz - az, cx - ax);
        let slope = (slope_x.abs() + slope_y.abs()) / determinant.abs();
        let rounding = EDGE_ROUNDING * longest * longest * (last - first) / determinant.abs();
        ((u * az + v * bz + w * cz) / determinant, DISPLACEMENT * (1.0 + slope) + rounding)
    };
    let rival = if near_edge || t < error { t - error } else { NO_HIT };
    (t + error >= 0.0).then_some([t, error, rival])
}

/// Coordinates on a coarse grid, so that edges, corners and flat triangles are
/// met exactly; some of them are 0.
fn grid(key: StreamKey, i: u64) -> Vec3 {
    Vec3::from_array(
        [0, 1, 2].map(|axis| (16.0 * key.unit(3 * i + axis)).floor() as f32 / 8.0 - 1.0),
    )
}

#[test]
fn each_lane_does_what_one_triangle_does() {
    let (on_grid, anywhere) = (StreamKey::new(1, "grid", 0), StreamKey::new(1, "anywhere", 0));
    let point = |i: u64| match i % 7 {
        0 => Vec3::from_array([0, 1, 2].map(|axis| anywhere.unit(3 * i + axis) as f32 - 0.5)),
        _ => grid(on_grid, i),
    };
    let (mut met, mut missed) = (0, 0);
    for i in 0..20_000u64 {
        let n = 1 + (i % 4) as usize;
        let corners: Vec<[[f32; 3]; 3]> = (0..n as u64)
            .map(|t| [0, 1, 2].map(|c| point(17 * i + 3 * t + c).to_array()))
            .collect();
        let origin = point(17 * i + 13) * 2.0;
        let Some(direction) = (point(17 * i + 14) - origin).try_normalize() else { continue };
        let bvh = Bvh::build(Builder::Morton, &[0, 1, 2, 3][..n], |nth| corners[nth]);
        let leaf = &bvh.wide.leaves[1];
        let lanes = intersect4(origin, &Shear::along(direction), leaf);
        for lane in 0..4 {
            let corner = |c: usize| leaf.corners[c].map(|axis| axis[lane]);
            let corners = [0, 1, 2].map(corner);
            let expected = intersect(origin, direction, corners, leaf.longest[lane]);
            let of_lane = |found: Candidates4| {
                let met = found.met & (1 << lane) != 0;
                met.then_some([found.t[lane], found.error[lane], found.rival[lane]])
            };
            let found = lanes.and_then(of_lane);
            let bits = |v: [f32; 3]| v.map(f32::to_bits);
            assert_eq!(found.map(bits), expected.map(bits), "case {i}, lane {lane}");
            if found.is_some() {
                met += 1
            } else {
                missed += 1
            }
            assert!(lane < n || found.is_none(), "a lane without a triangle is hit");
        }
    }
    assert!(met > 1000 && missed > 1000, "{met} met, {missed} missed");
}

/// Rays that pass near no side of slivers up to 10,000 times as long as wide, steep along the ray: the crossing
/// in f64 is within the bound.
#[test]
fn the_error_bounds_the_distance_of_slivers() {
    let key = StreamKey::new(2, "slivers", 0);
    let (mut n, mut beyond_displacement) = (0, 0);
    for i in 0..200_000u64 {
        let unit = |k: u64| key.unit(16 * i + k) as f32;
        let point = |k: u64| Vec3::new(unit(k), unit(k + 1), unit(k + 2)) - 0.5;
        let (a, along) = (point(0) * 0.5, point(3).normalize_or(Vec3::X));
        let across = along.any_orthonormal_vector() * 10f32.powf(-4.0 * unit(6));
        let corners = [a, a + along, a + along * unit(7) + across];
        let [p, q] = [unit(8), unit(9)];
        let (p, q) = if p + q > 1.0 { (1.0 - p, 1.0 - q) } else { (p, q) };
        let inside = a + (corners[1] - a) * p + (corners[2] - a) * q;
        let Some(back) = (point(10)).try_normalize() else { continue };
        let (origin, direction) = (inside + back * 2.0, -back);
        let leaf = &Bvh::build(Builder::Morton, &[0], |_| corners.map(|corner| corner.to_array()))
            .wide
            .leaves[1];
        let corner = |c: usize| leaf.corners[c].map(|axis| axis[0]);
        let canonical = [0, 1, 2].map(corner);
        let Some([t, error, rival]) = intersect(origin, direction, canonical, leaf.longest[0])
        else {
            continue;
        };
        if rival < NO_HIT {
            continue;
        }
        let [a, b, c] = canonical.map(|corner| Vec3::from_array(corner).as_dvec3());
        let normal = (b - a).cross(c - a);
        let from = origin.as_dvec3();
        let expected = normal.dot(a - from) / normal.dot(direction.as_dvec3());
        let off = (f64::from(t) - expected).abs();
        assert!(off <= f64::from(error), "case {i}: {off} beyond {error}");
        n += 1;
        beyond_displacement += u32::from(off > f64::from(DISPLACEMENT));
    }
    assert!(n > 10_000 && beyond_displacement > 100, "{n} rays, {beyond_displacement}");
}
