//! Many meshes and views laid side by side for one dispatch.

use super::compose::{reads, reads_random_bits};
use crate::bvh::{Bvh, LeafTriangle, Node};
use crate::effects::{Effects, RayInput};
use crate::job::CastJob;
use crate::ray::TraceRay;
use crate::target::Target;
use std::collections::HashMap;
use std::sync::Arc;

/// What one dispatch can hold.
#[derive(Clone, Copy, Debug)]
pub struct BatchLimits {
    /// Bytes that one binding can show.
    pub binding_bytes: usize,
    /// Rays per dispatch.
    pub rays: usize,
}

impl BatchLimits {
    /// Whether `target` alone fits.
    #[must_use]
    pub fn holds(&self, target: &Target) -> bool {
        size_of_val(&target.bvh.nodes[..]) <= self.binding_bytes
            && size_of_val(&target.bvh.triangles[..]) <= self.binding_bytes
    }
}

/// The buffers of one dispatch, on their way to the adapter.
#[derive(Default)]
pub struct Batch {
    /// The trees of all targets, one after another.
    pub nodes: Vec<Node>,
    /// Their triangles.
    pub triangles: Vec<LeafTriangle>,
    /// The rays of all jobs, one job after another.
    pub rays: Vec<TraceRay>,
    /// Key, key, beam and nothing per ray; empty unless an effect reads it.
    pub streams: Vec<[u32; 4]>,
    /// Reflectivity per ray; empty unless an effect reads it.
    pub reflectivities: Vec<f32>,
    bases: HashMap<*const Bvh, u32>,
}

impl Batch {
    /// Whether `rays` more rays of `target` fit beside what is here. What fits
    /// no batch at all is for the caller to keep away.
    #[must_use]
    pub fn has_room(&self, target: &Target, rays: usize, limits: &BatchLimits) -> bool {
        if self.rays.len() + rays > limits.rays {
            return false;
        }
        self.bases.contains_key(&Arc::as_ptr(&target.bvh)) || {
            let nodes = self.nodes.len() + target.bvh.nodes.len();
            let triangles = self.triangles.len() + target.bvh.triangles.len();
            nodes * size_of::<Node>() <= limits.binding_bytes
                && triangles * size_of::<LeafTriangle>() <= limits.binding_bytes
        }
    }

    /// Adds rays `range` of `job`.
    pub fn push(&mut self, job: &CastJob, range: std::ops::Range<usize>, effects: &Effects) {
        let root = self.root_of(&job.target);
        let rays = &job.rays[range.clone()];
        self.rays.extend(rays.iter().map(|ray| TraceRay { root: ray.root + root, ..*ray }));
        if reads_random_bits(effects) {
            let [low, high] = job.stream.0;
            self.streams.extend(job.beams[range].iter().map(|&beam| [low, high, beam, 0]));
        }
        if reads(effects, RayInput::Reflectivity) {
            self.reflectivities.resize(self.rays.len(), job.reflectivity);
        }
    }

    /// Where the tree of `target` starts; it is copied here once.
    fn root_of(&mut self, target: &Target) -> u32 {
        let (nodes, triangles) = (&mut self.nodes, &mut self.triangles);
        *self.bases.entry(Arc::as_ptr(&target.bvh)).or_insert_with(|| {
            let (node_base, triangle_base) = (nodes.len() as u32, triangles.len() as u32);
            nodes.extend(target.bvh.nodes.iter().map(|n| n.moved(node_base, triangle_base)));
            triangles.extend_from_slice(&target.bvh.triangles);
            node_base
        })
    }
}
