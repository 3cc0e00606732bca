//! Trees of complete clusters, until they are classified.

use std::ops::Range;
use std::time::Instant;

use edgepuck_segment::StreamCluster;
use formats::geometry::Trajectory;
use glam::Vec3;

/// The most clusters and points that are usually complete at once: those of the first turn, whose
/// ground is known at its end. More take more memory.
pub const USUAL_NODES: usize = 4096;
const USUAL_POINTS: usize = 1 << 17;

/// The time and the ring of a point.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tag {
    /// Unix time in seconds.
    pub time_s: f64,
    /// When its packet arrived.
    pub moment: Option<Instant>,
    pub ring: u16,
}

/// Trees of complete clusters that are not reported yet.
pub struct Waiting {
    pub points: Vec<[f32; 3]>,
    pub tags: Vec<Tag>,
    pub nodes: Vec<Node>,
}

pub struct Node {
    pub points: Range<usize>,
    pub parent: Option<usize>,
    pub is_part: bool,
    pub ground_z_m: Option<f32>,
    /// The time of the sensor's pose in whose frame the points are.
    pub pose_s: f64,
    pub turn: u64,
}

impl Waiting {
    pub fn new() -> Self {
        Self {
            points: Vec::with_capacity(USUAL_POINTS),
            tags: Vec::with_capacity(USUAL_POINTS),
            nodes: Vec::with_capacity(USUAL_NODES),
        }
    }

    pub fn clear(&mut self) {
        self.points.clear();
        self.tags.clear();
        self.nodes.clear();
    }

    /// Whether a node has points of several rings.
    pub fn has_rings(&self, node: usize) -> bool {
        let tags = &self.tags[self.nodes[node].points.clone()];
        tags.iter().any(|tag| tag.ring != tags[0].ring)
    }

    /// The first and the last point of a node.
    pub fn span(&self, node: usize) -> [Tag; 2] {
        let tags = &self.tags[self.nodes[node].points.clone()];
        let by_time = |a: &&Tag, b: &&Tag| a.time_s.total_cmp(&b.time_s);
        [tags.iter().min_by(by_time), tags.iter().max_by(by_time)]
            .map(|tag| tag.copied().unwrap_or_default())
    }

    /// Adds clusters of a turn. If the sensor moves, the points are transformed into its frame at
    /// the time of the last point.
    pub fn push(
        &mut self,
        cluster: &StreamCluster<'_, Tag>,
        turn: u64,
        motion: Option<&Trajectory>,
    ) {
        let (start, n_nodes) = (self.points.len(), self.nodes.len());
        self.points.extend_from_slice(cluster.points);
        self.tags.extend_from_slice(cluster.tags);
        let pose_s = cluster.tags.iter().fold(f64::NEG_INFINITY, |last, tag| last.max(tag.time_s));
        if let Some(motion) = motion {
            let pose = motion.at_unnormalized(pose_s);
            for (point, tag) in self.points[start..].iter_mut().zip(cluster.tags) {
                let in_world =
                    motion.at_unnormalized(tag.time_s).to_world(Vec3::from(*point).as_dvec3());
                *point = pose.from_world(in_world).as_vec3().to_array();
            }
        }
        self.nodes.extend(cluster.nodes.iter().map(|node| Node {
            points: start + node.points.start..start + node.points.end,
            parent: node.parent.map(|parent| n_nodes + parent),
            is_part: node.is_part,
            ground_z_m: node.ground_z_m,
            pose_s,
            turn,
        }));
    }
}
