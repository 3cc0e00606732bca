//! The clusters that are complete.

use std::ops::Range;

use super::Stream;
use super::columns::WINDOW;
use crate::look::{Handed, Look};
use crate::open_sets::NONE;

/// How far the beams turn until the clusters of a set that is too wide for one are looked for again,
/// degrees.
const PATIENCE_DEG: f32 = 10.0;

/// Clusters that are complete, and those of which they are made: parts of a
/// [`Hierarchy`](crate::Hierarchy).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StreamCluster<'a, T> {
    /// Metres, in the sensor's frame.
    pub points: &'a [[f32; 3]],
    /// The tag of each point.
    pub tags: &'a [T],
    /// A node comes after those of which it is made. No node holds those without a parent.
    pub nodes: &'a [StreamNode],
}

/// A node of a [`StreamCluster`].
#[derive(Clone, Debug, PartialEq)]
pub struct StreamNode {
    /// The places of its points.
    pub points: Range<usize>,
    /// The place of the smallest node that holds this one and more.
    pub parent: Option<usize>,
    /// Whether it is of something too wide for a cluster, such as a wall.
    pub is_part: bool,
    /// Height of the ground under the middle of the points' bounding box, in metres in the sensor's
    /// frame; `None` where it is unknown.
    pub ground_z_m: Option<f32>,
}

/// The memory of a [`StreamCluster`].
pub struct Complete<T> {
    points: Vec<[f32; 3]>,
    tags: Vec<T>,
    nodes: Vec<StreamNode>,
}

impl<T> Complete<T> {
    pub fn new(capacity: usize) -> Self {
        Self {
            points: Vec::with_capacity(capacity),
            tags: Vec::with_capacity(capacity),
            nodes: Vec::with_capacity(capacity),
        }
    }
}

impl<T: Copy + Default> Stream<T> {
    /// Reports the clusters that no column after `place` can be linked to.
    pub(super) fn report_complete(
        &mut self,
        place: u64,
        each: &mut impl FnMut(StreamCluster<'_, T>),
    ) {
        let n_columns = self.waiting.len() as u64;
        let patience = (PATIENCE_DEG / self.settings.column_width_deg) as u64;
        // Only the sets of these points can have become complete with this column.
        let mut next = std::mem::replace(&mut self.due[place as usize % WINDOW], NONE);
        while next != NONE {
            let point = next;
            next = self.points.slot(point).link;
            let Some(root) = self.points.root(point) else { continue };
            let set = self.points.set(root);
            let is_complete = set.last_place == place;
            // A wide set, such as a wall, may grow without end: its small nodes are reported and its
            // points forgotten before it is complete, but not at every column.
            let is_wide = set.is_thinned
                || set.extent.diagonal_m() > self.settings.max_size_m
                || place >= set.first_place + n_columns;
            if is_complete && set.extent.count < self.settings.min_points {
                self.points.remove_set(root);
            } else if is_complete || is_wide && place >= set.seen_place + patience {
                self.look.at(&self.points, root, place, n_columns, &self.settings);
                self.hand_out(each);
                match is_complete {
                    true => self.points.remove_set(root),
                    false => self.look.thin(&mut self.points, place),
                }
            }
        }
    }

    /// Hands out what is complete of the set that was looked at.
    fn hand_out(&mut self, each: &mut impl FnMut(StreamCluster<'_, T>)) {
        let Self { look, complete: Complete { points, tags, nodes }, ground, settings, .. } = self;
        let Look { members, positions, tree, nodes: looked, .. } = look;
        points.clear();
        tags.clear();
        nodes.clear();
        // From the wholes to the parts: a node within one that is handed out shares its points.
        for node in (0..looked.len()).rev() {
            let extent = tree.extent(node);
            if extent.count < settings.min_points {
                continue;
            }
            looked[node].handed = match tree.parent(node) {
                Some(above) if !looked[above].is_wide => looked[above].handed.map(|whole| {
                    let start = whole.start + tree.first(node) - tree.first(above);
                    Handed { start, ..whole }
                }),
                above => (looked[node].is_passed && !looked[node].is_wide).then(|| {
                    let start = points.len();
                    let own = tree.points(node).iter().map(|&point| point as usize);
                    points.extend(own.clone().map(|point| positions[point]));
                    tags.extend(own.map(|point| self.points.slot(members[point].1).tag));
                    Handed { start, number: 0, is_part: above.is_some() }
                }),
            };
        }
        // Numbers count from the parts to the wholes, as in a hierarchy.
        let handed = looked.iter_mut().filter_map(|looked| looked.handed.as_mut());
        handed.zip(0..).for_each(|(handed, number)| handed.number = number);
        for (node, known) in looked.iter().enumerate() {
            let Some(Handed { start, is_part, .. }) = known.handed else { continue };
            let [x, y] = tree.extent(node).middle();
            let above = tree.parent(node).and_then(|above| looked[above].handed);
            nodes.push(StreamNode {
                points: start..start + tree.extent(node).count,
                parent: above.map(|above| above.number),
                is_part,
                ground_z_m: ground.as_ref().and_then(|ground| ground.z_m(x, y)),
            });
        }
        if !nodes.is_empty() {
            each(StreamCluster { points, tags, nodes });
        }
    }
}
