//! Models of objects: each is built once and placed many times.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use edgepuck_mesh::frame::{Normalize, to_world};
use edgepuck_mesh::unit_frame::bounding_box;
use edgepuck_mesh::{MeshFormat, TriangleMesh};
use edgepuck_shapes::objects::{Object, ObjectKind, object, stand};
use formats::plausible::Warning;
use formats::streams::Stream;
use glam::DVec3;
use sim_gpu::Mesh;
use sim_gpu::internals::bvh::Builder;
use sim_gpu::internals::target::{Surface, Target};

use crate::error::SceneError;
use crate::recipe::Objects;

/// The mesh of an object, which all instances of the object share.
pub(crate) struct Model {
    pub(crate) mesh: Mesh,
    pub(crate) glass: Range<u32>,
    /// Length, width and height.
    pub(crate) size_m: DVec3,
}

impl Model {
    pub(crate) fn built_in(kind: ObjectKind, seed: u64, variant: u32) -> Self {
        let Object { mesh, glass } = object(kind, seed, variant);
        Self::new(mesh, glass)
    }

    fn new(mesh: TriangleMesh, glass: Range<u32>) -> Self {
        let (low, high) = bounding_box(mesh.vertices.iter().copied());
        Self { mesh: shared(mesh, Builder::Sah), glass, size_m: high - low }
    }

    /// A user's mesh, scaled to `height_m`; `None` if the mesh is flat.
    fn scaled(mut mesh: TriangleMesh, height_m: f64) -> Option<Self> {
        let (low, high) = bounding_box(mesh.vertices.iter().copied());
        let scale = height_m / (high.z - low.z);
        if !(scale.is_normal() && scale > 0.0) {
            return None;
        }
        stand(&mut mesh);
        mesh.vertices.iter_mut().for_each(|vertex| *vertex *= scale);
        Some(Self::new(mesh, 0..0))
    }
}

/// A mesh that instances share, with a hierarchy over all its triangles.
pub(crate) fn shared(mesh: TriangleMesh, builder: Builder) -> Mesh {
    let kept = (0..mesh.triangles.len() as u32).collect();
    Mesh::from_target(Target::new(Surface::new(mesh, kept), builder), DVec3::ZERO)
}

/// The files of the user's meshes, and what is probably wrong with them.
#[derive(Default)]
pub(crate) struct UserFiles {
    pub(crate) files: Vec<PathBuf>,
    pub(crate) warnings: Vec<Warning>,
}

/// Reads the user's meshes for the entry `objects`, from a folder in `meshes`.
pub(crate) fn user_models(
    objects: &Objects,
    meshes: Option<&Path>,
    seed: u64,
    read: &mut UserFiles,
) -> Result<Vec<OnceLock<Model>>, SceneError> {
    let name = objects.meshes.as_deref().unwrap_or_default();
    let missing =
        |folder: &Path, cause: String| SceneError::NoMeshes { folder: folder.to_path_buf(), cause };
    let Some(meshes) = meshes else {
        return Err(missing(Path::new(name), "found no --meshes".to_owned()));
    };
    let folder = meshes.join(name);
    let files = mesh_files(&folder).map_err(|error| missing(&folder, format!("found: {error}")))?;
    if files.is_empty() {
        return Err(missing(&folder, "found none".to_owned()));
    }
    let span = objects.height_m.unwrap_or([1.0, 1.0].into());
    let stream = Stream::MeshHeights { folder: name }.key(seed);
    let models = files.iter().zip(0..).map(|(file, n)| {
        let loaded = edgepuck_mesh::load(file)?;
        read.warnings.extend(loaded.warnings.into_iter().map(|it| it.of(file.display())));
        let world = to_world(&loaded.mesh, loaded.format.default_up(), Normalize::None);
        let model = Model::scaled(world.mesh, span.at(stream.unit(n)));
        let flat = || SceneError::FlatMesh { file: file.clone() };
        read.files.push(file.clone());
        Ok(OnceLock::from(model.ok_or_else(flat)?))
    });
    models.collect()
}

/// The mesh files in `folder`, sorted by name.
fn mesh_files(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder)?;
    let mut files =
        entries.map(|entry| Ok(entry?.path())).collect::<std::io::Result<Vec<PathBuf>>>()?;
    files.retain(|file| MeshFormat::from_path(file).is_some());
    files.sort();
    Ok(files)
}
