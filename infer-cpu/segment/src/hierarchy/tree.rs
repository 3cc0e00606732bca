//! The tree of the sets that steps of ascending width join.

use crate::segmentation::Extent;
use crate::sets::root;

const NONE: u32 = u32::MAX;

/// Joins points to sets, level by level, and notes each set of enough points as a node.
#[derive(Default)]
pub struct Tree {
    parents: Vec<u32>,
    /// The next point of the same set, or [`NONE`].
    next: Vec<u32>,
    /// The state of each set, at the index of its root.
    sets: Vec<Set>,
    /// Roots of the sets that the current level has joined.
    joined: Vec<u32>,
    nodes: Vec<Record>,
    /// The points of all nodes. Those of a node are consecutive.
    members: Vec<u32>,
    /// The number of levels so far.
    n_levels: u8,
}

#[derive(Clone, Copy)]
struct Set {
    extent: Extent,
    first: u32,
    last: u32,
    /// The largest nodes in it, as a list.
    nodes: [u32; 2],
}

#[derive(Clone, Copy)]
struct Record {
    extent: Extent,
    /// Its first point; in the end, the place of that among the members.
    first: u32,
    /// The next node of the same parent, or [`NONE`].
    sibling: u32,
    parent: u32,
    level: u8,
}

impl Tree {
    /// Begins with a set for each of `points`.
    pub fn reset(&mut self, points: &[[f32; 3]]) {
        let numbers = 0..points.len() as u32;
        self.parents.clear();
        self.parents.extend(numbers.clone());
        self.next.clear();
        self.next.resize(points.len(), NONE);
        self.sets.clear();
        let set = |(&at, first): (&[f32; 3], u32)| {
            let extent = Extent::at(at);
            Set { extent, first, last: first, nodes: [NONE; 2] }
        };
        self.sets.extend(points.iter().zip(numbers).map(set));
        self.joined.clear();
        self.members.clear();
        self.nodes.clear();
        self.reserve(points.len());
        self.n_levels = 0;
    }

    /// Makes room for the sets of `n` points.
    pub fn reserve(&mut self, n: usize) {
        let Self { parents, next, sets, joined, nodes, members, .. } = self;
        for points in [parents, next, members] {
            points.reserve(n.saturating_sub(points.len()));
        }
        sets.reserve(n.saturating_sub(sets.len()));
        // Each node and each change joins two sets.
        joined.reserve(n);
        nodes.reserve(n);
    }

    /// Joins the sets of each pair. Sets that have changed and have `min_points` or more are nodes,
    /// with those before them as children.
    pub fn join_level(&mut self, pairs: &[[u32; 2]], min_points: usize) {
        self.joined.clear();
        for &[a, b] in pairs {
            self.join(a, b);
        }
        for i in 0..self.joined.len() {
            let root = self.joined[i];
            let set = &mut self.sets[root as usize];
            let before = self.nodes.get(set.nodes[0] as usize);
            let is_known = before.is_some_and(|node| node.extent.count == set.extent.count);
            let is_set = self.parents[root as usize] == root;
            if !is_set || is_known || set.extent.count < min_points {
                continue;
            }
            let number = self.nodes.len() as u32;
            let [child, _] = std::mem::replace(&mut set.nodes, [number; 2]);
            let Set { extent, first, .. } = *set;
            let mut at = child;
            while at != NONE {
                self.nodes[at as usize].parent = number;
                at = self.nodes[at as usize].sibling;
            }
            let level = self.n_levels;
            self.nodes.push(Record { extent, first, sibling: NONE, parent: NONE, level });
        }
        self.n_levels += 1;
    }

    /// Joins two sets. The points of each stay consecutive.
    fn join(&mut self, a: u32, b: u32) {
        let [a, b] = [a, b].map(|point| root(&mut self.parents, point));
        if a == b {
            return;
        }
        let count = |root: u32| self.sets[root as usize].extent.count;
        let (root, other) = if count(a) >= count(b) { (a, b) } else { (b, a) };
        self.parents[other as usize] = root;
        let other = self.sets[other as usize];
        let set = &mut self.sets[root as usize];
        self.next[set.last as usize] = other.first;
        set.last = other.last;
        set.extent.add(&other.extent);
        set.nodes = match (set.nodes, other.nodes) {
            (own, [NONE, _]) => own,
            ([NONE, _], others) => others,
            ([first, last], [next, end]) => {
                self.nodes[last as usize].sibling = next;
                [first, end]
            }
        };
        self.joined.push(root);
    }

    /// Ends the tree: lists the points of its nodes.
    pub fn finish(&mut self) {
        let Self { sets, next, nodes, members, parents, .. } = self;
        // `last` becomes the place of a point among the members: no set grows any more.
        for root in 0..parents.len() {
            if parents[root] != root as u32 || sets[root].nodes[0] == NONE {
                continue;
            }
            let mut point = sets[root].first;
            while point != NONE {
                sets[point as usize].last = members.len() as u32;
                members.push(point);
                point = next[point as usize];
            }
        }
        for node in nodes {
            node.first = sets[node.first as usize].last;
        }
    }

    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    pub fn extent(&self, node: usize) -> &Extent {
        &self.nodes[node].extent
    }

    /// The points of a node.
    pub fn points(&self, node: usize) -> &[u32] {
        let first = self.first(node);
        &self.members[first..first + self.nodes[node].extent.count]
    }

    /// The place of a node's first point among those of all nodes: those of its parts lie within.
    pub fn first(&self, node: usize) -> usize {
        self.nodes[node].first as usize
    }

    /// The smallest node that holds this one and more.
    pub fn parent(&self, node: usize) -> Option<usize> {
        let parent = self.nodes[node].parent;
        (parent != NONE).then_some(parent as usize)
    }

    /// The level of the steps that joined a node, from 0.
    pub fn level(&self, node: usize) -> u8 {
        self.nodes[node].level
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Pseudo-random numbers below `n`: the multiplier and the increment of Knuth's MMIX.
    fn numbers(n: u64) -> impl FnMut() -> u32 {
        let mut state = 1u64;
        move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            ((state >> 33) % n) as u32
        }
    }

    /// The sets of 40 points that the pairs join, by repeated merging.
    fn sets(pairs: &[[u32; 2]]) -> BTreeSet<Vec<u32>> {
        let mut labels: Vec<u32> = (0..40).collect();
        for &[a, b] in pairs {
            let (from, to) = (labels[a as usize], labels[b as usize]);
            labels.iter_mut().filter(|label| **label == from).for_each(|label| *label = to);
        }
        (0..40).map(|of| (0..40).filter(|&i| labels[i as usize] == of).collect()).collect()
    }

    #[test]
    fn the_nodes_are_the_sets_of_each_level_and_hold_those_before() {
        let mut number = numbers(40);
        for least in [1, 2, 5] {
            let levels: Vec<Vec<[u32; 2]>> =
                (0..4).map(|_| (0..9).map(|_| [number(), number()]).collect()).collect();
            let mut tree = Tree::default();
            tree.reset(&[[0.0; 3]; 40]);
            let (mut pairs, mut expected) = (Vec::new(), BTreeSet::new());
            for level in &levels {
                tree.join_level(level, least);
                pairs.extend(level);
                // A point that no pair names is in no set.
                let joined = sets(&pairs).into_iter().filter(|set| set.len() >= least.max(2));
                expected.extend(joined);
            }
            tree.finish();
            let points = |node| {
                let mut points = tree.points(node).to_vec();
                points.sort_unstable();
                points
            };
            let found: BTreeSet<_> = (0..tree.len()).map(points).collect();
            assert_eq!(found, expected);
            assert_eq!(found.len(), tree.len(), "a set is one node");
            for node in 0..tree.len() {
                let whole = points(node);
                let parts: Vec<_> =
                    (0..tree.len()).filter(|&part| tree.parent(part) == Some(node)).collect();
                assert!(parts.iter().all(|&part| part < node));
                let held: Vec<_> = parts.iter().flat_map(|&part| points(part)).collect();
                let distinct: BTreeSet<_> = held.iter().collect();
                assert_eq!(distinct.len(), held.len(), "parts do not overlap");
                assert!(held.iter().all(|point| whole.contains(point)));
                // The parts are the largest nodes within.
                let within = |&other: &usize| {
                    other != node && points(other).iter().all(|point| whole.contains(point))
                };
                let largest = (0..node).filter(within).filter(|&other| {
                    !(0..node).filter(within).any(|more| {
                        more != other && points(other).iter().all(|p| points(more).contains(p))
                    })
                });
                assert_eq!(parts, largest.collect::<Vec<_>>());
            }
            let roots = (0..tree.len()).filter(|&node| tree.parent(node).is_none());
            let roots: usize = roots.map(|root| tree.points(root).len()).sum();
            let all: BTreeSet<_> = found.iter().flatten().collect();
            assert_eq!(roots, all.len());
        }
    }
}
