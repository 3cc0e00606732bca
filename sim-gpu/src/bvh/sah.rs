//! Binned surface area heuristic: Wald, "On fast construction of SAH-based
//! bounding volume hierarchies", RT 2007.

use super::node::{Child, with_root};
use super::{Bounds, HALVING_DEPTH, MAX_LEAF, Node, Primitive};
use glam::Vec3A;

/// Bins per axis of nodes above [`FEW`] triangles, and of nodes below.
const BINS: usize = 16;
const BINS_OF_FEW: usize = 8;
const FEW: usize = 64;

/// Nodes of at most this many triangles try every split along every axis, which takes less time
/// than filling bins.
const EXACT: usize = 8;

/// Cost of a triangle test in units of a node visit.
const TRIANGLE_COST: f32 = 1.0;

/// Subtrees of more triangles than this, and of more than this part of all, are built in parallel. To
/// join the nodes of two tasks copies them, so that a larger tree has larger tasks.
const PARALLEL_ABOVE: usize = 8192;
const PARALLEL_PART: usize = 256;

pub(super) fn build(primitives: &mut [Primitive]) -> Vec<Node> {
    let mut nodes = Vec::with_capacity(primitives.len() / 2 + 1);
    let alone = PARALLEL_ABOVE.max(primitives.len() / PARALLEL_PART);
    let root = subtree(primitives, 0, (0, alone), &mut nodes);
    with_root(nodes, root)
}

/// Appends the subtree over `primitives`, whose first is number `first` in leaf order, to `nodes`,
/// and returns its entry in the parent. Up to `alone` triangles are one task.
fn subtree(
    primitives: &mut [Primitive],
    first: u32,
    (depth, alone): (usize, usize),
    nodes: &mut Vec<Node>,
) -> Child {
    let (bounds, centres) = extent(primitives);
    let leaf = Child { bounds, first, count: primitives.len() as u32 };
    if primitives.len() <= 1 {
        return leaf;
    }
    // Unbalanced splits all the way down would exceed the depth of the casters' stacks.
    let middle = if depth >= HALVING_DEPTH {
        if primitives.len() <= MAX_LEAF {
            return leaf;
        }
        halve(primitives, centres)
    } else if primitives.len() <= EXACT {
        let (middle, cost) = split_exactly(primitives);
        // Areas stand for probabilities of a visit; a split also costs one visit of this node.
        let leaf_cost = TRIANGLE_COST * primitives.len() as f32 * bounds.half_area();
        if primitives.len() <= MAX_LEAF && leaf_cost <= cost + bounds.half_area() {
            return leaf;
        }
        middle
    } else {
        split_between_bins(primitives, centres)
    };
    let (left, right) = primitives.split_at_mut(middle);
    // Parents stand before their children: the collapse to wide nodes relies on it.
    let at = nodes.len();
    nodes.push(Node::new(Child::NONE, Child::NONE));
    let right_first = first + middle as u32;
    // A task must be worth its scheduling on both sides.
    let below = (depth + 1, alone);
    let (left, right) = if left.len().min(right.len()) > alone {
        in_parallel((left, first), (right, right_first), below, nodes)
    } else {
        let left = subtree(left, first, below, nodes);
        (left, subtree(right, right_first, below, nodes))
    };
    nodes[at] = Node::new(left, right);
    Child { bounds, first: at as u32, count: 0 }
}

/// Builds both subtrees in parallel and appends them to `nodes`, left before right.
fn in_parallel(
    left: (&mut [Primitive], u32),
    right: (&mut [Primitive], u32),
    below: (usize, usize),
    nodes: &mut Vec<Node>,
) -> (Child, Child) {
    let build = |(primitives, first): (&mut [Primitive], u32)| {
        let mut nodes = Vec::with_capacity(primitives.len() / 2);
        let child = subtree(primitives, first, below, &mut nodes);
        (child, nodes)
    };
    let (left, right) = rayon::join(|| build(left), || build(right));
    let mut append = |(mut child, subtree): (Child, Vec<Node>)| {
        // Each subtree numbered its nodes from 0; triangles have their final places already.
        let base = nodes.len() as u32;
        nodes.extend(subtree.iter().map(|node| node.moved(base, 0)));
        if child.count == 0 {
            child.first += base;
        }
        child
    };
    (append(left), append(right))
}

/// The bounds of the primitives, and of their doubled centres.
pub(super) fn extent(primitives: &[Primitive]) -> (Bounds, Bounds) {
    primitives.iter().fold((Bounds::EMPTY, Bounds::EMPTY), |(bounds, centres), p| {
        (bounds.union(p.bounds()), centres.with(p.bounds().doubled_centre()))
    })
}

#[derive(Clone, Copy)]
struct Split {
    axis: usize,
    last_left_bin: usize,
    last_bin: usize,
    cost: f32,
    origin: f32,
    bins_per_unit: f32,
}

impl Split {
    /// Repeats the arithmetic of [`best_split`], so that no primitive falls into another bin.
    fn is_left(&self, primitive: &Primitive) -> bool {
        let centre = primitive.bounds().doubled_centre()[self.axis];
        let bin = ((centre - self.origin) * self.bins_per_unit) as usize;
        bin.min(self.last_bin) <= self.last_left_bin
    }
}

/// Moves the left side of the cheapest split between bins to the front, and returns its size. If
/// no split separates the centres, halves the primitives instead.
fn split_between_bins(primitives: &mut [Primitive], centres: Bounds) -> usize {
    let split = if primitives.len() <= FEW {
        best_split::<BINS_OF_FEW>(primitives, centres)
    } else {
        best_split::<BINS>(primitives, centres)
    };
    let middle = split.map_or(0, |split| partition(primitives, |p| split.is_left(p)));
    if middle == 0 || middle == primitives.len() { halve(primitives, centres) } else { middle }
}

/// Sorts `primitives` along the axis of the cheapest split, and returns the size of the left side
/// and the cost. Triangle numbers break ties, so that the tree is the same on every run.
fn split_exactly(primitives: &mut [Primitive]) -> (usize, f32) {
    let sort = |primitives: &mut [Primitive], axis: usize| {
        primitives.sort_unstable_by(|p, q| {
            let centre = |p: &Primitive| p.bounds().doubled_centre()[axis];
            centre(p).total_cmp(&centre(q)).then(p.triangle.cmp(&q.triangle))
        });
    };
    let (mut best_axis, mut best) = (0, (1, f32::INFINITY));
    for axis in 0..3 {
        sort(primitives, axis);
        // A bin for each primitive: every boundary between two of them is a split.
        let mut bins = [(Bounds::EMPTY, 1); EXACT];
        bins.iter_mut().zip(&*primitives).for_each(|(bin, p)| bin.0 = p.bounds());
        let (last_left, cost) = cheapest_boundary(&bins[..primitives.len()]);
        if cost < best.1 {
            (best_axis, best) = (axis, (last_left + 1, cost));
        }
    }
    // They are still sorted along the last axis.
    if best_axis != 2 {
        sort(primitives, best_axis);
    }
    best
}

/// The cheapest split between bins on any axis; `None` if all centres agree.
fn best_split<const BINS: usize>(primitives: &[Primitive], centres: Bounds) -> Option<Split> {
    let size = centres.max - centres.min;
    // 0 along axes on which all centres agree, which are skipped below.
    let bins_per_unit = Vec3A::from_array(size.to_array().map(|s| {
        let scale = BINS as f32 / s;
        if scale.is_finite() { scale } else { 0.0 }
    }));
    let mut bins = [[(Bounds::EMPTY, 0u32); BINS]; 3];
    for p in primitives {
        let at = (p.bounds().doubled_centre() - centres.min) * bins_per_unit;
        for (axis, bins) in bins.iter_mut().enumerate() {
            // The highest centre lies at the end of the last bin.
            let (bounds, count) = &mut bins[(at[axis] as usize).min(BINS - 1)];
            *bounds = bounds.union(p.bounds());
            *count += 1;
        }
    }
    (0..3)
        .filter(|&axis| bins_per_unit[axis] > 0.0)
        .map(|axis| {
            let (last_left_bin, cost) = cheapest_boundary(&bins[axis]);
            let origin = centres.min[axis];
            let bins_per_unit = bins_per_unit[axis];
            Split { axis, last_left_bin, last_bin: BINS - 1, cost, origin, bins_per_unit }
        })
        .min_by(|p, q| p.cost.total_cmp(&q.cost))
}

/// The last bin on the left of the cheapest boundary between at most [`BINS`] bins, and its cost:
/// the sum over both sides of area times triangles.
#[inline]
fn cheapest_boundary(bins: &[(Bounds, u32)]) -> (usize, f32) {
    // Two sweeps: right sides are summed from the right, then left sides from the left.
    let mut right_cost = [0.0; BINS];
    let (mut bounds, mut count) = (Bounds::EMPTY, 0);
    for i in (1..bins.len()).rev() {
        bounds = bounds.union(bins[i].0);
        count += bins[i].1;
        right_cost[i] = bounds.half_area() * count as f32;
    }
    let (mut bounds, mut count) = (Bounds::EMPTY, 0);
    let mut best = (0, f32::INFINITY);
    for i in 0..bins.len() - 1 {
        bounds = bounds.union(bins[i].0);
        count += bins[i].1;
        let cost = TRIANGLE_COST * (bounds.half_area() * count as f32 + right_cost[i + 1]);
        if cost < best.1 {
            best = (i, cost);
        }
    }
    best
}

/// Moves the primitives that satisfy `is_left` to the front, and returns their number.
fn partition(primitives: &mut [Primitive], is_left: impl Fn(&Primitive) -> bool) -> usize {
    // The order within each side does not matter: it is the same on every run.
    let mut left = 0;
    for i in 0..primitives.len() {
        if is_left(&primitives[i]) {
            primitives.swap(i, left);
            left += 1;
        }
    }
    left
}

/// Moves the half with the lower centres along the longest axis to the front. Triangle numbers
/// break ties, so that the tree is the same on every run.
fn halve(primitives: &mut [Primitive], centres: Bounds) -> usize {
    let size = (centres.max - centres.min).to_array();
    let axis = (0..3).max_by(|&i, &j| size[i].total_cmp(&size[j])).unwrap_or(0);
    let middle = primitives.len() / 2;
    primitives.select_nth_unstable_by(middle, |p, q| {
        let centre = |p: &Primitive| p.bounds().doubled_centre()[axis];
        centre(p).total_cmp(&centre(q)).then(p.triangle.cmp(&q.triangle))
    });
    middle
}

#[cfg(test)]
mod tests {
    use crate::bvh::{Builder, Bvh, assert_well_formed};
    use formats::rng::StreamKey;

    /// Small triangles at random places of a grid, so that many centres agree.
    fn soup(n: u64) -> Vec<[[f32; 3]; 3]> {
        let key = StreamKey::new(1, "soup", 0);
        let at = |i: u64| (8.0 * key.unit(i)).floor() as f32 / 8.0;
        let corner = |i: u64, far: f32| [at(3 * i), at(3 * i + 1) + far, at(3 * i + 2)];
        (0..n).map(|i| [corner(i, 0.0), corner(i, 0.1), corner(i + 1, 0.0)]).collect()
    }

    #[test]
    fn every_number_of_triangles_gives_a_good_tree() {
        for n in (0..=130).chain([1000, 20_000]) {
            let corners = soup(n);
            let indices: Vec<u32> = (0..n as u32).collect();
            for builder in [Builder::Sah, Builder::Morton] {
                assert_well_formed(&Bvh::build(builder, &indices, |nth| corners[nth]));
            }
        }
    }

    #[test]
    fn triangles_at_one_place_are_halved() {
        let corners = vec![[[0.0; 3], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0]]; 1000];
        let indices: Vec<u32> = (0..1000).collect();
        assert_well_formed(&Bvh::build(Builder::Sah, &indices, |nth| corners[nth]));
    }
}
