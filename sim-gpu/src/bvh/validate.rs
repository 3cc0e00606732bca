//! Checks of the invariants of trees.

use super::{Bounds, Bvh, LEAF, MAX_DEPTH, MAX_LEAF, Node, TwoWide, WIDTH, WideChild};
use glam::Vec3A;

/// Panics unless in both trees every triangle is reached exactly once, every box contains its
/// children, and leaves and paths are within the limits. For tests.
pub fn assert_well_formed(bvh: &Bvh) {
    assert_narrow_well_formed(bvh.two_wide());
    assert_wide_well_formed(bvh);
}

fn assert_narrow_well_formed(bvh: &TwoWide) {
    assert!(!bvh.nodes.is_empty(), "a tree has a root, even over nothing");
    let mut seen = vec![0u32; bvh.triangles.len()];
    let mut visited = vec![false; bvh.nodes.len()];
    let mut stack = vec![(0usize, 1usize, None::<Bounds>)];
    while let Some((at, depth, parent_box)) = stack.pop() {
        assert!(depth <= MAX_DEPTH, "node {at} lies at depth {depth}");
        assert!(!visited[at], "node {at} is reached twice");
        visited[at] = true;
        for (bounds, first, count) in children(&bvh.nodes[at]) {
            if bounds == Bounds::NOWHERE {
                continue;
            }
            if let Some(parent) = parent_box {
                assert!(parent.contains(bounds), "node {at} leaves its parent's box");
            }
            if count == 0 {
                stack.push((first, depth + 1, Some(bounds)));
                continue;
            }
            assert!(count <= MAX_LEAF, "a leaf of node {at} holds {count} triangles");
            for (i, triangle) in bvh.triangles[first..first + count].iter().enumerate() {
                seen[first + i] += 1;
                let corners = [triangle.a, triangle.b, triangle.c];
                assert!(bounds.contains(Bounds::around(&corners)), "node {at} cuts its triangle");
            }
        }
    }
    assert!(visited.iter().all(|&v| v), "a node is never reached");
    assert!(seen.iter().all(|&n| n == 1), "a triangle is not reached exactly once");
}

fn children(node: &Node) -> [(Bounds, usize, usize); 2] {
    let bounds = |min, max| Bounds { min: Vec3A::from_array(min), max: Vec3A::from_array(max) };
    [
        (bounds(node.left_min, node.left_max), node.left as usize, node.left_count as usize),
        (bounds(node.right_min, node.right_max), node.right as usize, node.right_count as usize),
    ]
}

fn assert_wide_well_formed(bvh: &Bvh) {
    let (wide, triangles) = (&bvh.wide, &bvh.two_wide().triangles);
    assert!(!wide.nodes.is_empty(), "a tree has a root, even over nothing");
    let mut found: Vec<(u32, [[f32; 3]; 3])> = Vec::new();
    let (mut nodes_seen, mut leaves_seen) = (vec![0; wide.nodes.len()], vec![0; wide.leaves.len()]);
    let mut stack = vec![(WideChild::ROOT, 1, None::<Bounds>)];
    while let Some((at, depth, bounds)) = stack.pop() {
        assert!(depth <= MAX_DEPTH + 1, "wide node {at:?} lies at depth {depth}");
        if let Some(leaf) = at.leaf() {
            leaves_seen[leaf] += 1;
            let leaf = &wide.leaves[leaf];
            for i in 0..LEAF {
                let triangle = leaf.corners.map(|corner| corner.map(|axis| axis[i]));
                let inside =
                    bounds.is_some_and(|bounds| bounds.contains(Bounds::around(&triangle)));
                assert!(inside, "wide leaf {at:?} leaves its box");
                if let Some(&index) = leaf.indices().get(i) {
                    found.push((index, triangle));
                } else {
                    let [a, b, c] = triangle;
                    assert!(a == b && a == c, "a place of wide leaf {at:?} is not empty");
                }
            }
            continue;
        }
        nodes_seen[at.node()] += 1;
        let node = &wide.nodes[at.node()];
        let children = (0..WIDTH).map(|i| (node.bounds(i), node.children[i]));
        for (inner, child) in children.filter(|(inner, _)| *inner != Bounds::NOWHERE) {
            let inside = bounds.is_none_or(|bounds| bounds.contains(inner));
            assert!(inside, "wide node {at:?} leaves its parent's box");
            stack.push((child, depth + 1, Some(inner)));
        }
    }
    assert!(nodes_seen.iter().all(|&n| n == 1), "a wide node is not reached exactly once");
    assert!(wide.leaves[0].indices().is_empty(), "leaf 0 holds something");
    assert!(leaves_seen[1..].iter().all(|&n| n == 1), "a wide leaf is not reached exactly once");
    let mut expected: Vec<_> = triangles.iter().map(|t| (t.index, [t.a, t.b, t.c])).collect();
    let key = |(index, corners): &(u32, [[f32; 3]; 3])| {
        (*index, corners.map(|corner| corner.map(f32::to_bits)))
    };
    found.sort_unstable_by_key(key);
    expected.sort_unstable_by_key(key);
    assert!(found == expected, "the wide tree holds other triangles");
}
