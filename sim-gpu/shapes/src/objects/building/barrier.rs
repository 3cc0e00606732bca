use crate::primitives::*;

pub const MAKES: Makes = &[(4, guard_rail), (3, concrete), (2, boards), (2, crowd), (1, filled)];

/// A steel beam with two waves, 0.31 m high and 0.08 m deep (AASHTO M 180), its top 0.75 m up (EN
/// 1317 systems; 0.79 m in the USA), on posts 1.33 to 4 m apart.
fn guard_rail(b: &mut Builder, s: &mut Sampler) {
    let long_m = s.uniform(4.0, 10.0);
    let top_m = s.uniform(0.7, 0.82);
    let wave = [
        (0.0, 0.156),
        (0.081, 0.115),
        (0.081, 0.07),
        (0.0, 0.02),
        (0.0, -0.02),
        (0.081, -0.07),
        (0.081, -0.115),
        (0.0, -0.156),
    ];
    let back = wave.iter().rev().map(|&(x, z)| (x - 0.004, z));
    let outline: Vec<_> = wave.into_iter().chain(back).map(DVec2::from).collect();
    skin(b, &along_y(&outline, [0.0, long_m], top_m - 0.156));
    let n = (long_m / s.pick(&[1.33, 2.0, 4.0])).round().max(1.0);
    let post = dvec3(0.15, 0.1, top_m - 0.03);
    let block_out_m = s.pick(&[0.0, 0.15]);
    for k in 0..=n as usize {
        let y = (0.05 + 0.9 * k as f64 / n) * long_m;
        block(b, dvec3(-block_out_m - 0.075, y, 0.5 * post.z), post);
        if block_out_m > 0.0 {
            block(b, dvec3(-0.08, y, top_m - 0.156), dvec3(0.16, 0.1, 0.3));
        }
    }
}

/// A concrete barrier with sloping sides: the New Jersey profile, 0.81 m high, 0.61 m wide at its
/// foot and 0.15 m at its top (FHWA), or a plain block.
fn concrete(b: &mut Builder, s: &mut Sampler) {
    let long_m = s.uniform(1.5, 8.0);
    let scale = s.uniform(0.85, 1.3);
    let jersey = [(0.305, 0.0), (0.305, 0.075), (0.127, 0.33), (0.076, 0.81)];
    let plain = [(0.2, 0.0), (0.2, 0.2), (0.15, 0.6), (0.13, 0.9)];
    let half = s.pick(&[jersey, jersey, plain]);
    let left = half.iter().rev().map(|&(x, z)| dvec2(-x, z));
    let right = half.iter().map(|&(x, z)| dvec2(x, z));
    let section: Vec<_> = right.chain(left).map(|p| scale * p).collect();
    let gap_m = s.pick(&[0.0, 0.02, 0.1]);
    let n = s.pick(&[1, 1, 2, 3]);
    for piece in 0..n {
        let pitch_m = long_m / n as f64;
        let from_m = piece as f64 * pitch_m;
        loft(b, &along_y(&section, [from_m, from_m + pitch_m - gap_m], 0.0));
    }
}

/// An outline in (x, z), `up_m` above the ground, at both `ends_m` along y.
fn along_y(outline: &[DVec2], ends_m: [f64; 2], up_m: f64) -> [Vec<DVec3>; 2] {
    ends_m.map(|y| outline.iter().map(|p| dvec3(p.x, y, p.y + up_m)).collect())
}

/// Striped boards on a stand at a road work: one at 1 m (RSA), or up to three at 0.5 to 1.5 m
/// (MUTCD, type 3), with or without lamps.
fn boards(b: &mut Builder, s: &mut Sampler) {
    let half_m = 0.5 * s.uniform(1.2, 3.0);
    let tops = s.pick(&[vec![1.0], vec![0.9, 0.45], vec![1.5, 1.0, 0.5]]);
    let board = dvec3(0.03, 2.0 * half_m, s.uniform(0.15, 0.3));
    for top_m in &tops {
        block(b, dvec3(0.03, 0.0, top_m - 0.5 * board.z), board);
    }
    for y in [-0.8 * half_m, 0.8 * half_m] {
        let post = dvec3(0.04, 0.06, tops[0]);
        block(b, dvec3(0.0, y, 0.5 * post.z), post);
        block(b, dvec3(0.0, y, 0.05), dvec3(s.uniform(0.5, 1.0), 0.3, 0.1));
        if s.chance(0.5) {
            cylinder(b, dvec3(0.0, y, tops[0]), 0.09, 0.3);
        }
    }
}

/// A crowd barrier: 1.1 m high, 2 to 2.5 m long, of tubes with bars.
fn crowd(b: &mut Builder, s: &mut Sampler) {
    let half_m = 0.5 * s.uniform(2.0, 2.5);
    let at = |y: f64, z: f64| dvec3(0.0, y * half_m, z);
    let frame = [at(-1.0, 0.2), at(1.0, 0.2), at(1.0, 1.1), at(-1.0, 1.1), at(-1.0, 0.2)];
    frame.windows(2).for_each(|ends| rod(b, ends[0], ends[1], [0.02, 0.02]));
    let n = s.count(12, 20);
    for bar in 1..n {
        let y = 2.0 * bar as f64 / n as f64 - 1.0;
        block(b, at(y, 0.65), dvec3(0.014, 0.014, 0.9));
    }
    for y in [-0.8, 0.8] {
        let foot = at(y, 0.02);
        rod(b, foot - 0.3 * DVec3::X, foot + 0.3 * DVec3::X, [0.02, 0.02]);
        rod(b, foot, at(y, 0.2), [0.02, 0.02]);
    }
}

/// Plastic barriers filled with water, in a row.
fn filled(b: &mut Builder, s: &mut Sampler) {
    let size = dvec3(s.uniform(0.4, 0.6), s.uniform(1.0, 2.0), s.uniform(0.55, 1.1));
    for piece in 0..s.count(1, 4) {
        let y = piece as f64 * (size.y + 0.04);
        let section = |share: f64, z: f64| {
            let outline = outline::rectangle(dvec2(0.5 * share * size.x, 0.5 * size.y));
            outline.iter().map(|p| dvec3(p.x, p.y + y, z)).collect::<Vec<_>>()
        };
        let heights = [(1.0, 0.0), (1.0, 0.25), (0.5, 0.55), (0.4, 1.0)];
        let sections = heights.map(|(share, z)| section(share, z * size.z));
        loft(b, &sections);
    }
}
