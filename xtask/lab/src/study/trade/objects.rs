//! The objects that are scanned, and the places they are scanned from.

use crate::study::meshes;
use anyhow::{Context, Result, ensure};
use formats::rng::StreamKey;
use glam::DVec3;
use sim_gpu::internals::mesh::frame::Normalize;
use sim_gpu::internals::mesh::tree::{MeshEntry, discover};
use sim_gpu::internals::pose::Pose;
use sim_gpu::internals::sensor::Views;
use sim_gpu::internals::target::Target;
use std::collections::BTreeSet;
use std::path::Path;

/// Keys all random numbers of the chain.
pub const SEED: u64 = 0;

/// A mesh in the unit sphere, and its class.
pub struct Object {
    /// Its class's name.
    pub class: String,
    /// Class and name.
    id: String,
    /// What rays are cast at.
    pub target: Target,
}

/// One scan to be made: an object from one of its sides.
pub struct Place<'a> {
    /// The object.
    pub object: &'a Object,
    /// Where the sensor stands.
    pub pose: Pose,
    /// Keys its noise.
    pub stream: StreamKey,
}

/// The test objects of the tree at `folder`, at most `per_class` of each class.
pub fn read(folder: &Path, per_class: u32) -> Result<Vec<Object>> {
    let mut entries = discover(folder, SEED)?;
    meshes::keep_at_most([0, per_class], &mut entries);
    let classes: BTreeSet<&str> = entries.iter().map(|entry| entry.class.as_str()).collect();
    ensure!(
        classes.len() > 1,
        "{}: expected test meshes of at least two classes",
        folder.display()
    );
    let object = |entry: &MeshEntry| {
        let target = Target::load(&entry.path, Normalize::default())
            .with_context(|| format!("cannot scan {}", entry.relative))?;
        let id = format!("{}/{}", entry.class, entry.name);
        Ok(Object { class: entry.class.clone(), id, target })
    };
    entries.iter().map(object).collect()
}

/// The four sides of gen-dataset's rotating set, from `distance_m`.
pub fn places(objects: &[Object], distance_m: f64) -> Vec<Place<'_>> {
    let views = Views { distance_m, ..Views::ROTATING };
    let of_object = objects.iter().flat_map(|object| {
        let poses = views.poses(DVec3::ZERO, StreamKey::new(SEED, "trade", 0));
        poses.into_iter().zip(0..).map(move |(pose, view)| {
            // As gen-dataset keys its set `rotational`.
            let stream = StreamKey::new(SEED, &format!("rotational/{}", object.id), view);
            Place { object, pose, stream }
        })
    });
    of_object.collect()
}
