//! Runs a chain of layers in f64, with the bound of each value.

use super::affine::{Affine, Kind, Rows, gamma};
use super::{Chain, Network};
use anyhow::{Context, Result, ensure};
use infer_cpu::Precision;
use infer_cpu::sharing::folding_pays;

/// The points that a network takes, in f64 and rounded to f32.
pub struct Points {
    /// `[n, 3]`, with the bound of what normalisation leaves of them.
    pub exact: Rows,
    /// The coordinates by which neighbours are found.
    pub rounded: Vec<[f32; 3]>,
}

/// The outputs of each layer of `chain` for `points`, in `precision`: pooled over the
/// points, or of the pooled vector. Fails where layers do not follow each other.
pub fn outputs(
    network: &Network,
    chain: &Chain,
    points: &Points,
    precision: Precision,
) -> Result<Vec<Rows>> {
    let mut rows = points.exact.clone();
    let turn = match chain.stn {
        true => Some(transform(network, "feat.stn.", points, precision)?),
        false => None,
    };
    if chain.edges {
        rows = with_edges(network, points, rows)?;
    }
    let mut all = Vec::new();
    for (i, name) in chain.convs.iter().enumerate() {
        let last = i + 1 == chain.convs.len();
        let kind = kind(network, chain, i);
        let mut layer = network.affine(name, !last || chain.pooled_relu)?;
        if let (0, Some(t)) = (i, &turn) {
            layer = layer.after(t, 3);
        }
        if chain.fstn_after == Some(i) {
            let t = transform(network, "feat.fstn.", points, precision)?;
            let k = layer.inputs;
            if precision == Precision::I8 || folding_pays(points.rounded.len(), layer.outputs) {
                layer = layer.after(&t, k);
            } else {
                rows = Affine::transform(&t, k).through(rows, precision, kind);
            }
        }
        check(name, &layer, &rows)?;
        rows = layer.through(rows, precision, kind);
        let seen = rows.clone();
        let seen = if i == 0 { as_taken(network, chain, seen, precision) } else { seen };
        all.push(seen.pooled());
    }
    rows = rows.pooled();
    for (i, name) in chain.fcs.iter().enumerate() {
        let layer = network.affine(name, i + 1 < chain.fcs.len())?;
        check(name, &layer, &rows)?;
        rows = layer.through(rows, precision, Kind::Vector);
        all.push(rows.clone());
    }
    Ok(all)
}

fn check(name: &str, layer: &Affine, rows: &Rows) -> Result<()> {
    let (expected, found) = (layer.inputs, rows.width);
    ensure!(expected == found, "{name}: expected {expected} inputs, found {found}");
    Ok(())
}

/// The first layer's outputs as the second takes them: through an identity, as they are measured.
fn as_taken(network: &Network, chain: &Chain, rows: Rows, precision: Precision) -> Rows {
    Affine::identity(rows.width).through(rows, precision, kind(network, chain, 1))
}

fn kind(network: &Network, chain: &Chain, i: usize) -> Kind {
    match i {
        0 => Kind::First,
        _ => Kind::Point { range: network.range(&chain.convs[i - 1]) },
    }
}

fn transform(
    network: &Network,
    prefix: &str,
    points: &Points,
    precision: Precision,
) -> Result<Rows> {
    let chains = network.chains();
    let chain =
        chains.iter().find(|chain| chain.fcs.first().is_some_and(|fc| fc.starts_with(prefix)));
    let chain = chain.with_context(|| format!("{prefix}: expected a T-Net"))?;
    let mut all = outputs(network, chain, points, precision)?;
    let mut matrix = all.pop().context("a T-Net has layers")?;
    let k = matrix.width.isqrt();
    ensure!(k * k == matrix.width, "{prefix}: expected a square, found {} values", matrix.width);
    (0..k).for_each(|i| matrix.value[i * k + i] += 1.0);
    Ok(matrix)
}

/// Points with their EdgeConv features. Neighbours are found in f32, as `infer-cpu`
/// finds them; a maximum over the same neighbours is off by no more than its operands.
fn with_edges(network: &Network, points: &Points, rows: Rows) -> Result<Rows> {
    let mut layers: Vec<(f32, Affine)> = Vec::new();
    for (radius, i) in network.card.edge_radii.iter().zip(1..) {
        layers.push((*radius, network.affine(&format!("edge.conv{i}"), true)?));
    }
    let width = 3 + layers.iter().map(|(_, layer)| layer.outputs).sum::<usize>();
    let mut out = Rows { width, ..Rows::default() };
    for i in 0..rows.n() {
        out.value.extend(&rows.value[3 * i..3 * i + 3]);
        out.bound.extend(&rows.bound[3 * i..3 * i + 3]);
        for (radius, layer) in &layers {
            let near = neighbours(&points.rounded, i, *radius);
            let offsets = offsets(&rows, i, &near, f64::from(*radius));
            let features = layer.clone().through(offsets, Precision::F32, Kind::First).pooled();
            out.value.extend(features.value);
            out.bound.extend(features.bound);
        }
    }
    Ok(out)
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
    let mut out = Rows { width: 3, ..Rows::default() };
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
