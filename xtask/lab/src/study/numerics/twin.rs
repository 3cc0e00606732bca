//! A network's chain in f64 by plain loops, with the bound of each value.

use infer_cpu::Precision;
use infer_cpu::sharing::folding_pays;

use super::affine::{Affine, Kind, Rows, gamma};
use super::net::{Chain, Net};

/// The points that a network takes, in f64, and as f32 has them.
pub struct Points {
    /// `[n, 3]`, with the bound of what normalisation leaves of them.
    pub exact: Rows,
    /// What decides who is whose neighbour.
    pub rounded: Vec<[f32; 3]>,
}

/// What a layer gives: pooled, or of the pooled vector.
pub struct Output {
    pub layer: String,
    pub values: Rows,
}

/// Everything that `chain` gives of `points`, layer by layer, in `precision`.
pub fn outputs(net: &Net, chain: &Chain, points: &Points, precision: Precision) -> Vec<Output> {
    let mut rows = points.exact.clone();
    let turn = chain.stn.then(|| transform(net, "feat.stn.", points, precision));
    if chain.edges {
        rows = with_edges(net, points, rows);
    }
    let mut all = Vec::new();
    for (i, name) in chain.convs.iter().enumerate() {
        let last = i + 1 == chain.convs.len();
        let kind = kind(net, chain, i);
        let mut layer = net.affine(name, !last || chain.pooled_relu);
        if let (0, Some(t)) = (i, &turn) {
            layer = layer.after(t, 3);
        }
        if chain.fstn_after == Some(i) {
            let t = transform(net, "feat.fstn.", points, precision);
            let k = layer.inputs;
            if precision == Precision::I8 || folding_pays(points.rounded.len(), layer.outputs) {
                layer = layer.after(&t, k);
            } else {
                let turn = Affine::turn(&t, k).stored(precision, kind);
                rows = turn.through(&rows.taken(precision, kind), precision, kind);
            }
        }
        rows = rows.taken(precision, kind);
        rows = layer.stored(precision, kind).through(&rows, precision, kind);
        let seen = if i == 0 { as_taken(net, chain, &rows, precision) } else { rows.clone() };
        all.push(Output { layer: name.clone(), values: seen.pooled() });
    }
    rows = rows.pooled();
    for (i, name) in chain.fcs.iter().enumerate() {
        let layer = net.affine(name, i + 1 < chain.fcs.len()).stored(precision, Kind::Vector);
        rows = layer.through(&rows, precision, Kind::Vector);
        all.push(Output { layer: name.clone(), values: rows.clone() });
    }
    all
}

/// The first layer as the second takes it: through an identity, as it is measured.
fn as_taken(net: &Net, chain: &Chain, rows: &Rows, precision: Precision) -> Rows {
    let kind = kind(net, chain, 1);
    let identity = Affine::identity(rows.width).stored(precision, kind);
    identity.through(&rows.clone().taken(precision, kind), precision, kind)
}

/// What layer `i` of a chain takes.
fn kind(net: &Net, chain: &Chain, i: usize) -> Kind {
    match i {
        0 => Kind::First,
        _ => Kind::Point { range: net.range(&chain.convs[i - 1]) },
    }
}

/// The matrix of a T-Net, the identity added.
fn transform(net: &Net, prefix: &str, points: &Points, precision: Precision) -> Rows {
    let chains = net.chains();
    let chain = chains.iter().find(|chain| chain.fcs[0].starts_with(prefix));
    let chain = chain.expect("invariant: a T-Net that turns has a chain");
    let all = outputs(net, chain, points, precision);
    let mut matrix = all.last().expect("invariant: a chain has layers").values.clone();
    let k = matrix.width.isqrt();
    (0..k).for_each(|i| matrix.value[i * k + i] += 1.0);
    matrix
}

/// Points with what surrounds them: see `infer-cpu/src/edge.rs`. Who is a neighbour
/// is decided in f32, as there; a maximum over the same neighbours is off by no more
/// than what it is of.
fn with_edges(net: &Net, points: &Points, rows: Rows) -> Rows {
    let layers: Vec<(f32, Affine)> = net
        .card
        .edge_radii
        .iter()
        .zip(1..)
        .map(|(&radius, i): (&f32, usize)| (radius, net.affine(&format!("edge.conv{i}"), true)))
        .collect();
    let width = 3 + layers.iter().map(|(_, layer)| layer.outputs).sum::<usize>();
    let mut out = Rows { width, value: Vec::new(), bound: Vec::new() };
    for i in 0..rows.n() {
        out.value.extend(&rows.value[3 * i..3 * i + 3]);
        out.bound.extend(&rows.bound[3 * i..3 * i + 3]);
        for (radius, layer) in &layers {
            let near = neighbours(&points.rounded, i, *radius);
            let offsets = offsets(&rows, i, &near, f64::from(*radius));
            let features = layer.through(&offsets, Precision::F32, Kind::First).pooled();
            out.value.extend(features.value);
            out.bound.extend(features.bound);
        }
    }
    out
}

fn neighbours(points: &[[f32; 3]], i: usize, radius: f32) -> Vec<usize> {
    let p = points[i];
    let near = |q: &[f32; 3]| {
        let [x, y, z] = [0, 1, 2].map(|k| q[k] - p[k]);
        x * x + y * y + z * z <= radius * radius
    };
    (0..points.len()).filter(|&j| near(&points[j])).collect()
}

/// From point `i` to each of `near`, in radii.
fn offsets(rows: &Rows, i: usize, near: &[usize], radius: f64) -> Rows {
    let mut out = Rows { width: 3, value: Vec::new(), bound: Vec::new() };
    for &j in near {
        for k in 0..3 {
            let (p, q) = (3 * i + k, 3 * j + k);
            let offset = (rows.value[q] - rows.value[p]) / radius;
            out.value.push(offset);
            // The difference, and the quotient of the weights, are rounded.
            let moved = (rows.bound[q] + rows.bound[p]) / radius;
            out.bound.push(moved + gamma(4) * (offset.abs() + moved));
        }
    }
    out
}
