//! What every tree must hold, whoever built it.

use super::{Bounds, Bvh, MAX_DEPTH, MAX_LEAF, Node};
use glam::Vec3A;

/// Panics unless every triangle is reached exactly once, every box holds what
/// lies below it, no leaf is larger than allowed and no path is too long for
/// the casters' stacks. For tests.
///
/// # Panics
/// With a message that names the node.
pub fn assert_well_formed(bvh: &Bvh) {
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
                assert!(bounds.contains(Bounds::of(&corners)), "node {at} cuts its triangle");
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
