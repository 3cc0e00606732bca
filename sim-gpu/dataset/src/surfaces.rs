//! Packed sets of points that are spread evenly over each mesh, and of those among them that a
//! sensor could see: clouds between those of ModelNet40 and scans.

use crate::error::DatasetError;
use crate::mesh::{read, warnings};
use crate::packed_sets::{Drawn, classes, write_packed_sets};
use crate::progress::Progress;
use crate::record::{Entry, MeshFailure};
use formats::Split;
use formats::cloud::{normalize_unit_sphere, resample};
use formats::hash::Hashing;
use formats::streams::Stream;
use glam::DVec3;
use sim_gpu::internals::bvh::Builder;
use sim_gpu::internals::mesh::NO_AREA;
use sim_gpu::internals::mesh::frame::{Normalize, Unit, Up};
use sim_gpu::internals::mesh::tree::MeshEntry;
use sim_gpu::internals::sensor::Views;
use sim_gpu::internals::surface_points::{area_uniform, seen_from};
use sim_gpu::internals::target::{Surface, Target};
use std::path::Path;

/// Points to choose from for each point of a seen cloud: a sensor seldom sees less than a quarter
/// of a surface.
const CANDIDATES: usize = 6;

/// The settings of [`write_surfaces`].
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceConfig {
    /// Seed of all random numbers.
    pub seed: u64,
    /// How meshes are scaled into the world.
    pub normalize: Normalize,
    /// The meshes' upward axis; `None` is each format's default.
    pub up: Option<Up>,
    /// Points of each cloud.
    pub points: u32,
    /// Points that a view must see to be included.
    pub min_points: u32,
    /// The viewpoints around each mesh.
    pub views: Views,
}

/// Writes two packed sets for each split into the folder `out`. `surface-SPLIT.npz` has
/// [`SurfaceConfig::points`] points of each mesh, in the unit sphere. `seen-SPLIT.npz` has as many
/// points for each view, of those that the view can see, in the frame of the whole mesh's cloud:
/// hidden parts are missing, but nothing is moved. Views that see too few points are left out.
/// Returns the meshes that cannot be read or have no area.
///
/// # Errors
/// A file that cannot be written.
pub fn write_surfaces(
    out: &Path,
    config: &SurfaceConfig,
    meshes: &[MeshEntry],
    progress: &Progress,
) -> Result<Vec<MeshFailure>, DatasetError> {
    let (n, classes) = (config.points as usize, classes(meshes));
    let mut all_failures = Vec::new();
    for split in Split::ALL {
        let paths = ["surface", "seen"].map(|name| out.join(format!("{name}-{split}.npz")));
        let own: Vec<&MeshEntry> = meshes.iter().filter(|mesh| mesh.split == split).collect();
        let draw = |mesh: &MeshEntry| Ok(draw(mesh, config, progress)?);
        let (_, failures) = write_packed_sets(&paths, n, &classes, &own, draw)?;
        all_failures.extend(failures);
    }
    Ok(all_failures)
}

/// The clouds of one mesh: of set 0 its whole surface, of set 1 what each view sees of it.
fn draw(
    mesh: &MeshEntry,
    config: &SurfaceConfig,
    progress: &Progress,
) -> Result<Vec<Drawn>, MeshFailure> {
    let (record, in_world, kept) =
        read(mesh, config.up, Unit::Metre, config.normalize, Hashing::None)?;
    warnings(&record, None).for_each(|warning| progress.note(warning));
    let surface = Surface::new(in_world, kept);
    let n = config.points as usize;
    let id = Entry::from(mesh).id();
    let seed = config.seed;
    let points =
        area_uniform(&surface, n * (1 + CANDIDATES), Stream::Surface { mesh: &id }.key(seed));
    let points = points.ok_or_else(|| MeshFailure::new(mesh, NO_AREA))?;
    let (own, candidates) = points.split_at(n);
    let rounded = |points: &[DVec3]| -> Vec<[f32; 3]> {
        points.iter().map(|point| point.as_vec3().to_array()).collect()
    };
    let frame = Frame::around(own);
    let mut whole = rounded(own);
    normalize_unit_sphere(&mut whole);
    let mut drawn = vec![Drawn { set: 0, name: id.clone(), points: whole, n_raw: config.points }];
    let poses = config.views.poses(DVec3::ZERO, Stream::SurfaceViews { mesh: &id }.key(seed));
    if poses.is_empty() {
        return Ok(drawn);
    }
    let target = Target::new(surface, Builder::Sah);
    for (pose, view) in poses.iter().zip(0..) {
        let open = seen_from(&target, pose.position_m, candidates);
        let points = candidates.iter().zip(open).filter(|(_, open)| *open);
        let points: Vec<DVec3> = points.map(|(point, _)| frame.apply(*point)).collect();
        let n_raw = points.len() as u32;
        if n_raw >= config.min_points {
            let points =
                resample(&rounded(&points), n, Stream::SurfaceSeen { mesh: &id, view }.key(seed))
                    .unwrap_or_default();
            drawn.push(Drawn { set: 1, name: format!("{id}_v{view}"), points, n_raw });
        }
    }
    Ok(drawn)
}

/// The transform that moves a cloud's mean to 0 and scales its largest radius to 1.
struct Frame {
    mean: DVec3,
    scale: f64,
}

impl Frame {
    fn around(points: &[DVec3]) -> Self {
        let mean = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
        let radius = points.iter().map(|point| point.distance(mean)).fold(0.0, f64::max);
        Self { mean, scale: if radius > 0.0 { radius.recip() } else { 1.0 } }
    }

    fn apply(&self, point: DVec3) -> DVec3 {
        (point - self.mean) * self.scale
    }
}
