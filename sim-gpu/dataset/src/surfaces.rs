//! Packed sets of points spread evenly over each mesh, and of those among them
//! that a sensor could see: what lies between ModelNet40's clouds and scans.

use super::error::DatasetError;
use super::mesh::{failed, failure, read};
use super::record::{Entry, MeshFailure};
use formats::Split;
use formats::cloud::{normalize_unit_sphere, resample};
use formats::hash::Hashing;
use formats::packed::PackedWriter;
use formats::rng::StreamKey;
use glam::DVec3;
use rayon::prelude::*;
use sim_gpu::internals::bvh::Builder;
use sim_gpu::internals::mesh::frame::{Normalize, Up};
use sim_gpu::internals::mesh::tree::MeshEntry;
use sim_gpu::internals::sensor::Views;
use sim_gpu::internals::surface_points::{area_uniform, seen_from};
use sim_gpu::internals::target::{Surface, Target};
use std::collections::BTreeSet;
use std::path::Path;

/// Meshes whose clouds wait to be written.
const MESHES_AT_ONCE: usize = 256;

/// Points that are looked at for each that is wanted: a sensor seldom sees less
/// than a quarter of a surface.
const LOOKED_AT: usize = 6;

/// What is to be drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceConfig {
    /// Keys every random number.
    pub seed: u64,
    /// How meshes are scaled into the world.
    pub normalize: Normalize,
    /// The meshes' upward axis; `None` is each format's default.
    pub up: Option<Up>,
    /// Points of each cloud.
    pub points: u32,
    /// Views that see fewer points are left out.
    pub min_points: u32,
    /// From where meshes are looked at.
    pub views: Views,
}

/// A mesh's clouds.
struct Drawn {
    /// Points of all of it, mean 0 and largest radius 1.
    whole: Vec<[f32; 3]>,
    /// Of what each view sees, in the frame of `whole`, with the number of
    /// points that were seen.
    seen: Vec<(Vec<[f32; 3]>, u32)>,
}

/// Writes `surface-SPLIT.npz` into the folder `out`: of each mesh
/// [`SurfaceConfig::points`] points, in the unit sphere; and
/// `seen-SPLIT.npz`: for each view as many points of
/// those that it can see, in the frame of the whole mesh's cloud: what is
/// missing is missing, but nothing is moved. Views that see too few points are
/// left out; with no view `seen-SPLIT.npz` is empty, and nothing is built for it.
/// Returns the meshes that could not be read or have no area.
///
/// # Errors
/// A file that cannot be written.
pub fn write_surfaces(
    out: &Path,
    config: &SurfaceConfig,
    meshes: &[MeshEntry],
) -> Result<Vec<MeshFailure>, DatasetError> {
    let classes: BTreeSet<&str> = meshes.iter().map(|mesh| mesh.class.as_str()).collect();
    let classes: Vec<String> = classes.into_iter().map(str::to_owned).collect();
    let mut failures = Vec::new();
    for split in Split::ALL {
        let of_split: Vec<&MeshEntry> = meshes.iter().filter(|mesh| mesh.split == split).collect();
        let writer = |name: &str| {
            let path = out.join(format!("{name}-{split}.npz"));
            PackedWriter::create(&path, config.points as usize, classes.clone())
        };
        let (mut surface, mut seen) = (writer("surface")?, writer("seen")?);
        for some in of_split.chunks(MESHES_AT_ONCE) {
            let drawn: Vec<_> = some.par_iter().map(|mesh| draw(mesh, config)).collect();
            for (mesh, drawn) in some.iter().zip(drawn) {
                let Drawn { whole, seen: views } = match drawn {
                    Ok(drawn) => drawn,
                    Err(failure) => {
                        failures.push(failure);
                        continue;
                    }
                };
                let label = classes.partition_point(|class| *class < mesh.class);
                let id = Entry::from(*mesh).id();
                surface.push(&whole, label, &id, config.points)?;
                for ((points, n_raw), view) in views.iter().zip(0..) {
                    if *n_raw >= config.min_points {
                        seen.push(points, label, &format!("{id}_v{view}"), *n_raw)?;
                    }
                }
            }
        }
        surface.finish(Hashing::None)?;
        seen.finish(Hashing::None)?;
    }
    Ok(failures)
}

fn draw(mesh: &MeshEntry, config: &SurfaceConfig) -> Result<Drawn, MeshFailure> {
    let (record, in_world, kept) = read(mesh, config.up, config.normalize, Hashing::None)
        .map_err(|error| failure(mesh, &error))?;
    let surface = Surface::new(in_world, kept);
    let n = config.points as usize;
    let id = record.entry.id();
    let key = |name: &str, index| StreamKey::new(config.seed, &format!("{name}/{id}"), index);
    let points = area_uniform(&surface, n * (1 + LOOKED_AT), key("surface", 0));
    let Some(points) = points else {
        return Err(failed(mesh, None, "no triangle with an area".to_owned()));
    };
    let (own, looked_at) = points.split_at(n);
    let rounded = |points: &[DVec3]| -> Vec<[f32; 3]> {
        points.iter().map(|point| point.as_vec3().to_array()).collect()
    };
    let frame = Frame::of(own);
    let mut whole = rounded(own);
    normalize_unit_sphere(&mut whole);
    let poses = config.views.poses(DVec3::ZERO, key("views", 0));
    if poses.is_empty() {
        return Ok(Drawn { whole, seen: Vec::new() });
    }
    let target = Target::new(surface, Builder::Sah);
    let seen = poses.iter().zip(0..).map(|(pose, view)| {
        let open = seen_from(&target, pose.position_m, looked_at);
        let points = looked_at.iter().zip(open).filter(|(_, open)| *open);
        let points: Vec<DVec3> = points.map(|(point, _)| frame.apply(*point)).collect();
        let cloud = resample(&rounded(&points), n, key("seen", view)).unwrap_or_default();
        (cloud, points.len() as u32)
    });
    let seen = seen.collect();
    Ok(Drawn { whole, seen })
}

/// What moves a cloud's mean to 0 and scales its largest radius to 1.
struct Frame {
    mean: DVec3,
    scale: f64,
}

impl Frame {
    fn of(points: &[DVec3]) -> Self {
        let mean = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
        let radius = points.iter().map(|point| point.distance(mean)).fold(0.0, f64::max);
        Self { mean, scale: if radius > 0.0 { radius.recip() } else { 1.0 } }
    }

    fn apply(&self, point: DVec3) -> DVec3 {
        (point - self.mean) * self.scale
    }
}
