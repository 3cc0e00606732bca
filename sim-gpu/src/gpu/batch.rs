//! The meshes and views of one dispatch, in shared buffers.

use super::compose::reads_random_bits;
use crate::aim::{Aim, MOST_DIRECTIONS};
use crate::bvh::{Bvh, LeafTriangle, Node, TwoWide};
use crate::effects::Effects;
use crate::fixed_frame::FixedFrame;
use crate::job::CastJob;
use crate::ray::SENT;
use crate::sensor::Directions;
use crate::target::Target;
use bytemuck::{Pod, Zeroable};
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

/// The frame of a sensor and an object, and the places of its rays and beams in their buffers.
/// `shaders/aim.wgsl` declares the same record; a test compares sizes and offsets. The fields of a
/// `FixedFrame` are 0 if the rays are sent.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct View {
    /// The first row of the rotation.
    pub turn_x: [i32; 3],
    /// The root node of the object's tree.
    pub root: u32,
    /// The second row of the rotation.
    pub turn_y: [i32; 3],
    /// The number of the first ray.
    pub first_ray: u32,
    /// The third row of the rotation.
    pub turn_z: [i32; 3],
    /// Where its word or words are.
    pub first_word: u32,
    /// The sensor's position, the low halves.
    pub origin_low: [u32; 3],
    /// The pattern's first direction among all directions, or `u32::MAX` if the rays are sent.
    pub first_direction: u32,
    /// The sensor's position, the high halves.
    pub origin_high: [u32; 3],
    /// The reach, its low half.
    pub reach_low: u32,
    /// The reach, its high half.
    pub reach_high: u32,
    /// The object's reflectivity, 0 to 1.
    pub reflectivity: f32,
    pub(super) _padding: [u32; 2],
}

impl From<&FixedFrame> for View {
    fn from(fixed: &FixedFrame) -> Self {
        let [turn_x, turn_y, turn_z] = fixed.turn;
        let (low, high) = (|x: i64| x as u32, |x: i64| (x >> 32) as u32);
        Self {
            turn_x,
            turn_y,
            turn_z,
            origin_low: fixed.origin.map(low),
            origin_high: fixed.origin.map(high),
            reach_low: low(fixed.reach),
            reach_high: high(fixed.reach),
            ..Self::default()
        }
    }
}

/// The limits of one dispatch.
#[derive(Clone, Copy, Debug)]
pub struct BatchLimits {
    /// The size limit of a binding, bytes.
    pub binding_bytes: usize,
    /// Rays per dispatch.
    pub rays: usize,
}

impl BatchLimits {
    /// Whether `target` alone fits.
    #[must_use]
    pub fn holds(&self, target: &Target) -> bool {
        // Without a tree for a GPU that would be too large.
        if target.surface.len() * size_of::<LeafTriangle>() > self.binding_bytes {
            return false;
        }
        let TwoWide { nodes, triangles } = target.bvh.two_wide();
        size_of_val(&nodes[..]) <= self.binding_bytes
            && size_of_val(&triangles[..]) <= self.binding_bytes
    }
}

/// The buffers of one dispatch, on their way to the adapter.
#[derive(Default)]
pub struct Batch {
    /// The trees of all targets, which follow each other in the buffers.
    pub trees: Vec<Arc<Bvh>>,
    n_nodes: usize,
    n_triangles: usize,
    /// The rays of all jobs, one job after another: eight words for each ray that is sent, and the
    /// beam of each ray that the shader makes.
    pub rays: Vec<u32>,
    /// The number of rays.
    pub n_rays: usize,
    /// The view of each job, or part of a job.
    pub views: Vec<View>,
    /// The directions of the patterns of rays that the shader makes.
    pub directions: Vec<Directions>,
    /// The key in two words, the beam and padding, for each ray; empty unless an effect reads it.
    pub streams: Vec<[u32; 4]>,
    bases: HashMap<*const Bvh, u32>,
}

impl Batch {
    /// Whether `rays` more rays of `job` fit; its target must fit an empty batch.
    #[must_use]
    pub fn has_room(&self, job: &CastJob, rays: usize, limits: &BatchLimits) -> bool {
        let view_bytes = (self.views.len() + 1) * size_of::<View>();
        if self.n_rays + rays > limits.rays
            || view_bytes > limits.binding_bytes
            || !self.has_room_for_directions(job)
        {
            return false;
        }
        let target = &job.target;
        self.bases.contains_key(&Arc::as_ptr(&target.bvh)) || {
            let nodes = self.n_nodes + target.bvh.two_wide().nodes.len();
            let triangles = self.n_triangles + target.bvh.two_wide().triangles.len();
            nodes * size_of::<Node>() <= limits.binding_bytes
                && triangles * size_of::<LeafTriangle>() <= limits.binding_bytes
        }
    }

    /// Whether the directions of `job` fit, or are here already.
    fn has_room_for_directions(&self, job: &CastJob) -> bool {
        let Aim::ByCaster { directions, .. } = &job.aim else { return true };
        let is_here = self.directions.iter().any(|here| here.is_shared_with(directions));
        let others: usize = self.directions.iter().map(|here| here.len()).sum();
        is_here || others + directions.len() <= MOST_DIRECTIONS
    }

    /// Adds rays `range` of `job`.
    pub fn push(&mut self, job: &CastJob, range: Range<usize>, effects: &Effects) {
        let view = match &job.aim {
            Aim::Rays(_) => View { first_direction: SENT, ..View::default() },
            Aim::ByCaster { fixed, directions, .. } => {
                View { first_direction: self.first_direction(directions), ..fixed.into() }
            }
        };
        let root = self.root_of(&job.target);
        let (first_ray, first_word) = (self.n_rays as u32, self.rays.len() as u32);
        let reflectivity = job.reflectivity;
        self.views.push(View { root, first_ray, first_word, reflectivity, ..view });
        self.rays.extend_from_slice(match &job.aim {
            Aim::Rays(rays) => bytemuck::cast_slice(&rays[range.clone()]),
            Aim::ByCaster { .. } => &job.beams[range.clone()],
        });
        self.n_rays += range.len();
        if reads_random_bits(effects) {
            let [low, high] = job.stream.0;
            self.streams.extend(job.beams[range].iter().map(|&beam| [low, high, beam, 0]));
        }
    }

    /// The index of the first of `directions` among all. They are added only once.
    fn first_direction(&mut self, directions: &Directions) -> u32 {
        let mut first = 0;
        for here in &self.directions {
            if here.is_shared_with(directions) {
                return first;
            }
            first += here.len() as u32;
        }
        self.directions.push(directions.clone());
        first
    }

    /// The root of the tree of `target`, which is there only once.
    fn root_of(&mut self, target: &Target) -> u32 {
        *self.bases.entry(Arc::as_ptr(&target.bvh)).or_insert_with(|| {
            let root = self.n_nodes as u32;
            let TwoWide { nodes, triangles } = target.bvh.two_wide();
            self.n_nodes += nodes.len();
            self.n_triangles += triangles.len();
            self.trees.push(Arc::clone(&target.bvh));
            root
        })
    }

    /// The nodes and the triangles of all trees, one after another.
    #[must_use]
    pub fn joined_trees(&self) -> (Vec<Node>, Vec<LeafTriangle>) {
        let mut nodes = Vec::with_capacity(self.n_nodes);
        let mut triangles: Vec<LeafTriangle> = Vec::with_capacity(self.n_triangles);
        for tree in self.trees.iter().map(|tree| tree.two_wide()) {
            let (node_base, triangle_base) = (nodes.len() as u32, triangles.len() as u32);
            nodes.extend(tree.nodes.iter().map(|n| n.moved(node_base, triangle_base)));
            triangles.extend_from_slice(&tree.triangles);
        }
        (nodes, triangles)
    }
}
