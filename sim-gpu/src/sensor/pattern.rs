//! All beams of a sensor, and the selection of those that can hit an object.

use crate::lanes::each;
use glam::DVec3;
use std::ops::Deref;
use std::sync::Arc;

use super::MAX_RAYS;
use super::coherence::coherent_order;
use super::cone::{BlockCone, Cone};
use super::footprint::{disc, rays_of};

/// Rays of one block share a bounding cone.
const BLOCK_RAYS: usize = 64;
/// Blocks of one group share a bounding cone.
const GROUP_BLOCKS: usize = 32;

/// Unit vectors. A clone shares them, so that casters recognize them.
#[derive(Clone, Debug, PartialEq)]
pub struct Directions(Arc<[DVec3]>);

impl Directions {
    /// Whether these are the same vectors in memory.
    #[must_use]
    pub fn is_shared_with(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Deref for Directions {
    type Target = [DVec3];

    fn deref(&self) -> &[DVec3] {
        &self.0
    }
}

impl<'a> IntoIterator for &'a Directions {
    type Item = &'a DVec3;
    type IntoIter = std::slice::Iter<'a, DVec3>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.iter()
    }
}

/// The rays of one revolution or image, in firing order.
#[derive(Clone, Debug, PartialEq)]
pub struct BeamPattern {
    /// Unit vectors in the sensor frame, `[n_rays]`.
    pub directions: Directions,
    /// Rank by elevation, 0 from below; for a camera the row from below, `[n_rays]`.
    pub ring: Vec<u16>,
    /// Time since the start of the revolution, `[n_rays]`.
    pub time_s: Vec<f64>,
    /// Starts of the rays in the sensor frame, metres, `[n_rays]`; empty if all are the origin.
    pub starts_m: Vec<DVec3>,
    /// Rays of each beam, which are neighbours, the axis first; 1 for beams without width.
    pub rays_per_beam: u32,
    /// A permutation, `[n_rays]`, whose neighbours point alike and traverse a tree together.
    pub order: Vec<u32>,
    /// Bounding cones of each [`BLOCK_RAYS`] rays of `order`.
    blocks: Vec<BlockCone>,
    /// Bounding cones of each [`GROUP_BLOCKS`] blocks.
    groups: Vec<BlockCone>,
}

impl BeamPattern {
    /// A pattern of rays in firing order that start at the sensor's origin. The three lists must
    /// have the same length, below 2^32, and directions unit length.
    #[must_use]
    pub fn new(directions: Vec<DVec3>, ring: Vec<u16>, time_s: Vec<f64>) -> Self {
        let order = coherent_order(&directions);
        Self::ordered(directions, ring, time_s, order)
    }

    /// As [`BeamPattern::new`], for rays that are coherent in this `order`.
    fn ordered(directions: Vec<DVec3>, ring: Vec<u16>, time_s: Vec<f64>, order: Vec<u32>) -> Self {
        debug_assert!(directions.len() == ring.len() && directions.len() == time_s.len());
        let bound = |rays: &[u32]| BlockCone::around(rays.iter().map(|&i| directions[i as usize]));
        let blocks = order.chunks(BLOCK_RAYS).map(bound).collect();
        let groups = order.chunks(BLOCK_RAYS * GROUP_BLOCKS).map(bound).collect();
        let directions = Directions(directions.into());
        let (starts_m, rays_per_beam) = (Vec::new(), 1);
        Self { directions, ring, time_s, starts_m, rays_per_beam, order, blocks, groups }
    }

    /// The same beams with a width: each is sampled by `samples` rays of equal power in a Gaussian
    /// beam with these full angles of divergence, horizontal and vertical.
    pub(crate) fn widened(&self, samples: u32, divergence_deg: [f64; 2]) -> Result<Self, String> {
        let n_rays = self.len() as u64 * u64::from(samples);
        if n_rays > MAX_RAYS {
            return Err(format!("expected at most {MAX_RAYS} rays, found {n_rays}"));
        }
        if samples == 1 {
            return Ok(self.clone());
        }
        let disc = disc(samples);
        let directions = self.directions.iter().flat_map(|&d| rays_of(d, &disc, divergence_deg));
        // The rays of a beam stay neighbours: they are more coherent than any two beams.
        let order = self.order.iter().flat_map(|&beam| beam * samples..(beam + 1) * samples);
        let mut widened = Self::ordered(
            directions.collect(),
            for_each_ray(&self.ring, samples),
            for_each_ray(&self.time_s, samples),
            order.collect(),
        );
        widened.starts_m = for_each_ray(&self.starts_m, samples);
        widened.rays_per_beam = samples;
        Ok(widened)
    }

    /// The number, in firing order, of the beam that a ray belongs to.
    #[must_use]
    pub fn beam_of(&self, ray: u32) -> u32 {
        ray / self.rays_per_beam
    }

    /// The start of ray number `beam` in the sensor frame, metres; `None` if it is the origin.
    #[must_use]
    pub fn start(&self, beam: u32) -> Option<DVec3> {
        starts(&self.starts_m, [beam]).map(|[start]| start)
    }

    /// The time of the last ray, seconds.
    #[must_use]
    pub fn last_s(&self) -> f64 {
        self.time_s.iter().fold(0.0, |last, &time_s| time_s.max(last))
    }

    /// The largest distance of the start of a ray from the sensor, metres.
    #[must_use]
    pub fn farthest_start_m(&self) -> f64 {
        self.starts_m.iter().fold(0.0, |farthest, start| start.length().max(farthest))
    }

    /// Number of rays.
    #[must_use]
    pub fn len(&self) -> usize {
        self.directions.len()
    }

    /// Whether there is no ray.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.directions.is_empty()
    }

    /// The indices of the rays within `cone`, in the order of `order`.
    ///
    /// Every ray whose angle to the axis is at most the half angle is among them. Rays up to 1e-9
    /// rad outside, or up to 4e-15 in the cosine (1e-7 rad for a cone thinner than that), may be.
    /// A half angle of pi or more, or NaN, gives all rays.
    #[must_use]
    pub fn within(&self, cone: &Cone) -> Vec<u32> {
        let Some(widened) = cone.widened() else { return self.order.clone() };
        let mut found = Vec::new();
        let groups = self.groups.iter().zip(self.blocks.chunks(GROUP_BLOCKS));
        let rays = self.order.chunks(BLOCK_RAYS * GROUP_BLOCKS);
        for ((group, blocks), rays) in groups.zip(rays) {
            if widened.misses(group) {
                continue;
            }
            for (block, rays) in blocks.iter().zip(rays.chunks(BLOCK_RAYS)) {
                if widened.misses(block) {
                    continue;
                }
                let holds = |&ray: &u32| widened.holds(self.directions[ray as usize]);
                found.extend(rays.iter().copied().filter(holds));
            }
        }
        found
    }
}

/// Repeats the value of each beam for each of its rays.
fn for_each_ray<T: Copy>(of_beam: &[T], samples: u32) -> Vec<T> {
    of_beam.iter().flat_map(|&value| std::iter::repeat_n(value, samples as usize)).collect()
}

/// The starts of some rays, from [`BeamPattern::starts_m`]; `None` if all rays start at the
/// sensor's origin.
#[inline(always)]
pub(crate) fn starts<const N: usize>(starts_m: &[DVec3], beams: [u32; N]) -> Option<[DVec3; N]> {
    (!starts_m.is_empty()).then(|| each(|lane: usize| starts_m[beams[lane] as usize]))
}
