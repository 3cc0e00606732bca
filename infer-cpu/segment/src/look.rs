//! The tree of a set of a stream, and what of it is complete.

use crate::hierarchy::{Steps, Tree};
use crate::open_sets::{OpenSets, STEPS_PER_POINT};
use crate::settings::Settings;

/// The tree of a set. Its memory is reused.
pub struct Look {
    /// The points of the set in the order in which they came.
    pub members: Vec<(u64, u32)>,
    /// The number of each point among them.
    numbers: Vec<u32>,
    pub positions: Vec<[f32; 3]>,
    steps: Steps,
    pub tree: Tree,
    pub nodes: Vec<Looked>,
    /// For each point, whether it is still needed, and from which level on its set is too wide.
    fates: Vec<(bool, u8)>,
}

/// What is known of a node.
#[derive(Clone, Copy)]
pub struct Looked {
    /// It is too wide for an object, or extends all around the sensor.
    pub is_wide: bool,
    /// No later return can be linked to it.
    pub is_passed: bool,
    /// `None` if it is not handed out.
    pub handed: Option<Handed>,
}

/// A node that is handed out.
#[derive(Clone, Copy)]
pub struct Handed {
    /// The place of its first point.
    pub start: usize,
    pub number: usize,
    pub is_part: bool,
}

impl Look {
    /// With room for this many points.
    pub fn new(capacity: u32) -> Self {
        let n = capacity as usize;
        let mut steps = Steps::default();
        const { assert!(STEPS_PER_POINT == 3, "the room of `Steps`") };
        steps.reset(n);
        let mut tree = Tree::default();
        tree.reserve(n);
        Self {
            members: Vec::with_capacity(n),
            numbers: vec![0; n],
            positions: Vec::with_capacity(n),
            steps,
            tree,
            nodes: Vec::with_capacity(n),
            fates: Vec::with_capacity(n),
        }
    }

    /// Finds the nodes of the set of `root`, and what is needed of it after the column `place`.
    pub fn at<T: Copy + Default>(
        &mut self,
        points: &OpenSets<T>,
        root: u32,
        place: u64,
        n_columns: u64,
        settings: &Settings,
    ) {
        let Self { members, numbers, positions, steps, tree, nodes, fates } = self;
        members.clear();
        members.extend(points.members(root).map(|point| (points.slot(point).order, point)));
        members.sort_unstable();
        positions.clear();
        positions.extend(members.iter().map(|&(_, point)| points.slot(point).position));
        for (&(_, point), number) in members.iter().zip(0..) {
            numbers[point as usize] = number;
        }
        steps.reset(members.len());
        for (&(_, point), number) in members.iter().zip(0..) {
            for (level, other) in points.steps(point) {
                steps.add(level, [number, numbers[other as usize]]);
            }
        }
        tree.reset(positions);
        // Small sets may still grow to nodes.
        steps.levels().for_each(|pairs| tree.join_level(pairs, 2));
        tree.finish();
        nodes.clear();
        for node in 0..tree.len() {
            let slots =
                tree.points(node).iter().map(|&point| points.slot(members[point as usize].1));
            let (mut last, mut first, mut least) = (0, u64::MAX, u8::MAX);
            for slot in slots {
                last = last.max(slot.last_place);
                first = first.min(slot.place);
                least = least.min(slot.wide_from);
            }
            let is_wide = tree.extent(node).diagonal_m() > settings.max_size_m
                || place >= first.saturating_add(n_columns)
                || tree.level(node) >= least;
            nodes.push(Looked { is_wide, is_passed: last <= place, handed: None });
        }
        fates.clear();
        fates.extend(members.iter().map(|&(_, point)| {
            let slot = points.slot(point);
            (slot.last_place > place, slot.wide_from)
        }));
        // From the wholes to the parts.
        for (node, known) in nodes.iter().enumerate().rev() {
            let is_top = tree.parent(node).is_none_or(|above| nodes[above].is_wide);
            for &point in tree.points(node) {
                let (is_needed, wide_from) = &mut fates[point as usize];
                if known.is_wide {
                    *wide_from = tree.level(node).min(*wide_from);
                } else if is_top {
                    *is_needed = !known.is_passed;
                }
            }
        }
    }

    /// Removes the points of the set that no later cluster needs.
    pub fn thin<T: Copy + Default>(&self, points: &mut OpenSets<T>, place: u64) {
        let members = self.members.iter().map(|&(_, point)| point);
        let wide_from = |point: u32| {
            let (is_needed, wide_from) = self.fates[self.numbers[point as usize] as usize];
            is_needed.then_some(wide_from)
        };
        points.thin(members, wide_from, place);
    }
}
