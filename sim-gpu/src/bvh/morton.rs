//! Linear BVH: Lauterbach et al., "Fast BVH construction on GPUs", 2009. Triangles are sorted along
//! a Morton curve; each node splits where the highest differing bit of its codes changes.

use super::node::{Child, with_root};
use super::sah::extent;
use super::{Bounds, HALVING_DEPTH, MAX_LEAF, Node, Primitive};
use glam::Vec3A;

/// Bits of a Morton code per axis.
const BITS: u32 = 10;

pub(super) fn build(primitives: &mut [Primitive]) -> Vec<Node> {
    let (_, centres) = extent(primitives);
    let mut keys: Vec<(u32, u32)> = primitives
        .iter()
        .zip(0..)
        .map(|(p, i)| (code(p.bounds().doubled_centre(), centres), i))
        .collect();
    // The index breaks ties, so that the tree is the same on every run.
    keys.sort_unstable();
    let sorted: Vec<Primitive> = keys.iter().map(|&(_, i)| primitives[i as usize]).collect();
    primitives.copy_from_slice(&sorted);
    let codes: Vec<u32> = keys.iter().map(|&(code, _)| code).collect();

    let mut nodes = Vec::with_capacity(primitives.len());
    let root = subtree(primitives, &codes, 0, 0, &mut nodes);
    with_root(nodes, root)
}

/// Appends the subtree over `primitives`, whose first is number `first` in leaf order, to `nodes`,
/// and returns its entry in the parent.
fn subtree(
    primitives: &[Primitive],
    codes: &[u32],
    first: u32,
    depth: usize,
    nodes: &mut Vec<Node>,
) -> Child {
    if primitives.len() <= MAX_LEAF {
        let bounds = primitives.iter().fold(Bounds::EMPTY, |b, p| b.union(p.bounds()));
        return Child { bounds, first, count: primitives.len() as u32 };
    }
    let middle = split(codes, depth);
    // Parents stand before their children: the collapse to wide nodes relies on it.
    let at = nodes.len();
    nodes.push(Node::new(Child::NONE, Child::NONE));
    let (left, right) = primitives.split_at(middle);
    let (left_codes, right_codes) = codes.split_at(middle);
    let left = subtree(left, left_codes, first, depth + 1, nodes);
    let right = subtree(right, right_codes, first + middle as u32, depth + 1, nodes);
    nodes[at] = Node::new(left, right);
    Child { bounds: left.bounds.union(right.bounds), first: at as u32, count: 0 }
}

/// The place where the highest differing bit changes, or half way if no bit differs.
fn split(codes: &[u32], depth: usize) -> usize {
    // Codes are sorted, so that the first and the last differ in the highest bit that any two do.
    let differing = codes[0] ^ codes[codes.len() - 1];
    if differing == 0 || depth >= HALVING_DEPTH {
        return codes.len() / 2;
    }
    let bit = 1 << (31 - differing.leading_zeros());
    // Codes are sorted and agree in all higher bits.
    codes.partition_point(|code| code & bit == 0)
}

/// The Morton code of a doubled centre within the bounds of all of them.
fn code(centre: Vec3A, centres: Bounds) -> u32 {
    let cells = (1 << BITS) as f32;
    // A flat mesh has no size on some axis: 0 / MIN_POSITIVE is 0, and 0 / 0 would be NaN.
    let size = (centres.max - centres.min).max(Vec3A::splat(f32::MIN_POSITIVE));
    let at = (centre - centres.min) / size * cells;
    let spread = |axis: usize| spread_bits((at[axis] as u32).min((1 << BITS) - 1));
    spread(0) << 2 | spread(1) << 1 | spread(2)
}

/// Spreads the ten low bits of `x`, with two zeros between neighbours.
fn spread_bits(mut x: u32) -> u32 {
    x = (x | x << 16) & 0x0300_00FF;
    x = (x | x << 8) & 0x0300_F00F;
    x = (x | x << 4) & 0x030C_30C3;
    (x | x << 2) & 0x0924_9249
}

#[cfg(test)]
mod tests {
    use super::spread_bits;

    #[test]
    fn bits_are_spread_by_three() {
        for bit in 0..10 {
            assert_eq!(spread_bits(1 << bit), 1 << (3 * bit));
        }
        assert_eq!(spread_bits(0x3FF), 0x0924_9249);
    }
}
