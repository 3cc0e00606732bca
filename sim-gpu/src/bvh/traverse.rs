//! The search through a tree that all users on the CPU share.

use super::{MAX_DEPTH, Node};
use std::ops::Range;

/// Visits the leaves below node `root` that matter, nearer children first, and
/// gives `visit` the places of each leaf's triangles.
///
/// `enter` says how far away the box of these two corners begins, or infinity
/// if nothing in it matters. It sees `state` as earlier leaves left it, and so
/// can leave out what lies behind the best one found.
///
/// Both children's boxes are tested before either leaf is visited, the left
/// leaf comes before the right one, and of two nodes at the same distance the
/// left one comes first: `shaders/traverse.wgsl` has the same order.
#[inline]
pub fn traverse<State, Distance: PartialOrd + Copy + From<f32>>(
    nodes: &[Node],
    root: u32,
    state: &mut State,
    enter: impl Fn(&State, [f32; 3], [f32; 3]) -> Distance,
    mut visit: impl FnMut(&mut State, Range<usize>),
) {
    // A sentinel instead of an `Option` keeps the choice of the nearer child
    // free of branches.
    let never = Distance::from(f32::INFINITY);
    let leaf = |first: u32, count: u32| first as usize..(first + count) as usize;
    let mut stack = [0u32; MAX_DEPTH];
    let mut height = 0;
    let mut at = root;
    loop {
        let node = &nodes[at as usize];
        let mut left = enter(state, node.left_min, node.left_max);
        let mut right = enter(state, node.right_min, node.right_max);
        if left < never && node.left_count > 0 {
            visit(state, leaf(node.left, node.left_count));
            left = never;
        }
        if right < never && node.right_count > 0 {
            visit(state, leaf(node.right, node.right_count));
            right = never;
        }
        let left_first = left <= right;
        let (near, far) = if left_first { (left, right) } else { (right, left) };
        if near < never {
            at = if left_first { node.left } else { node.right };
            if far < never {
                stack[height] = if left_first { node.right } else { node.left };
                height += 1;
            }
        } else if height > 0 {
            height -= 1;
            at = stack[height];
        } else {
            return;
        }
    }
}
