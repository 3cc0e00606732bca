//! The cuts of a sweep at several widths at once.

mod best_cut;
mod steps;
mod tree;

use crate::height_grid::HeightGrid;
use crate::image::{Columns, RangeImage};
use crate::settings::Settings;
pub use best_cut::BestCut;
pub(crate) use steps::{Steps, find_steps, most_columns};
pub(crate) use tree::Tree;

/// The clusters of a sweep at seven widths, from the narrowest to the widest: a tree, in which each
/// cluster holds those of which it is made. Made by
/// [`Segmenter::hierarchy`](crate::Segmenter::hierarchy).
///
/// No single width is right: some part two persons who walk together, and others part a car at its
/// windows. What the clusters show decides (Hu, Held and Ramanan, "Learning to Optimally Segment
/// Point Clouds", RA-L 2020).
#[derive(Default)]
pub struct Hierarchy {
    tree: Tree,
    steps: Steps,
    /// For each node, the height of the ground under it.
    ground_z_m: Vec<Option<f32>>,
    best: BestCut,
}

/// A cluster of a hierarchy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node<'a> {
    /// Indices of the points in the sweep.
    pub points: &'a [u32],
    /// Height of the ground under the middle of the points' bounding box, in metres in the sensor's
    /// frame; `None` where it is unknown.
    pub ground_z_m: Option<f32>,
    /// The horizontal diagonal of that box, metres.
    pub diagonal_m: f32,
    /// The number of the smallest node that holds this one and more.
    pub parent: Option<usize>,
}

impl Hierarchy {
    /// The number of nodes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.tree.len()
    }

    /// Whether there is no node.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The nodes. A node comes after those of which it is made.
    pub fn nodes(&self) -> impl ExactSizeIterator<Item = Node<'_>> {
        (0..self.len()).map(|node| self.node(node))
    }

    pub(crate) fn node(&self, node: usize) -> Node<'_> {
        Node {
            points: self.tree.points(node),
            ground_z_m: self.ground_z_m[node],
            diagonal_m: self.tree.extent(node).diagonal_m(),
            parent: self.tree.parent(node),
        }
    }

    /// Removes all nodes.
    pub(crate) fn clear(&mut self) {
        self.tree.reset(&[]);
        self.ground_z_m.clear();
    }

    /// Makes the nodes of the returns in `image`, those of `points` that are not ground.
    pub(crate) fn build(
        &mut self,
        image: &RangeImage,
        points: &[[f32; 3]],
        settings: &Settings,
        ground: &HeightGrid,
    ) {
        let Self { tree, steps, ground_z_m, .. } = self;
        steps.reset(points.len());
        for column in 0..Columns::n_columns(image) {
            let width = settings.column_width_deg.to_radians();
            find_steps(image, column, width, |level, pair| steps.add(level, pair));
        }
        tree.reset(points);
        steps.levels().for_each(|pairs| tree.join_level(pairs, settings.min_points));
        tree.finish();
        let z_m = |node| {
            let [x, y] = tree.extent(node).middle();
            ground.z_m(x, y)
        };
        ground_z_m.clear();
        ground_z_m.extend((0..tree.len()).map(z_m));
    }

    /// The nodes of the best cut, as [`BestCut::find`] has them.
    pub(crate) fn cut(&mut self, worths: &[f64], margin: f64) -> &[usize] {
        let Self { tree, best, .. } = self;
        best.find(worths, |node| tree.parent(node), margin)
    }
}
