//! A mesh that instances share, with the BVH over it.

use super::Error;
use crate::bvh::Builder;
use crate::target::{Surface, Target};
use edgepuck_mesh::frame::{Normalize, Unit, Up, WorldMesh, to_world, z_up};
use edgepuck_mesh::unit_frame::bounding_box;
use edgepuck_mesh::{LoadedMesh, TriangleMesh, check, flat, load, load_bytes};
use formats::plausible::Warning;
use glam::{DAffine3, DVec3};
use std::path::Path;
use std::sync::{Arc, OnceLock};

/// A triangle mesh, z up, in metres.
///
/// A clone shares the vertices and the BVH, which the first scan builds: one mesh may stand at many
/// places of a [`Scene`](crate::Scene).
///
/// ```
/// # use sim_gpu::Mesh;
/// let tetrahedron = Mesh::from_triangles(
///     vec![[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 2.0]],
///     vec![[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]],
/// )?;
/// assert_eq!(tetrahedron.bounds_m(), [[0.0, 0.0, 0.0], [4.0, 3.0, 2.0]]);
/// let largest = |mesh: &Mesh| {
///     let radii = mesh.vertices().iter().map(|vertex| vertex.length());
///     radii.fold(0.0, f64::max)
/// };
/// assert!((largest(&tetrahedron.unit_sphere()) - 1.0).abs() < 1e-12);
/// # Ok::<(), sim_gpu::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Mesh {
    /// This or `ready` is there from the start; the other is made of it.
    triangles: Arc<OnceLock<TriangleMesh>>,
    /// Whether casters see it around the middle of its bounding box, so that a mesh far from its
    /// origin keeps its digits in f32.
    recentres: bool,
    ready: Arc<OnceLock<Ready>>,
    centre: DVec3,
    scale: f64,
    warnings: Vec<Warning>,
}

/// A mesh that can be cast at.
#[derive(Debug)]
struct Ready {
    target: Target,
    mesh_from_target: DAffine3,
}

impl Mesh {
    /// Reads an OBJ, OFF, PLY, STL or glTF file. The y axis of OBJ and glTF points up, the z axis of all
    /// others. The file's unit is taken for a metre, and the mesh stays where the file has it.
    ///
    /// # Errors
    /// The file cannot be read, or is not what its extension says: with the file and the line.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Error> {
        Self::read_in(path.as_ref(), None, Unit::Metre)
    }

    /// As [`Mesh::read`], from the bytes of a file of this name, whose extension is that of its format.
    /// The file must not refer to other files: the buffers of a glTF file are inside of it.
    ///
    /// ```
    /// # use sim_gpu::Mesh;
    /// let error = Mesh::from_bytes("a.off", b"OFF\n3 1 0\n0 0 zero\n").unwrap_err();
    /// assert_eq!(error.to_string(), "a.off:3: expected a finite coordinate, found \"zero\"");
    /// ```
    ///
    /// # Errors
    /// As [`Mesh::read`].
    pub fn from_bytes(name: &str, bytes: &[u8]) -> Result<Self, Error> {
        let name = Path::new(name);
        let LoadedMesh { mesh, format, warnings, .. } = load_bytes(name, bytes)?;
        Ok(Self::upright(mesh, format.default_up()).with_warnings(name, warnings))
    }

    /// As [`Mesh::read`], of a file whose upward axis or unit may be another.
    #[doc(hidden)]
    pub fn read_in(path: &Path, up: Option<Up>, unit: Unit) -> Result<Self, Error> {
        let LoadedMesh { mesh, format, warnings, .. } = load(path)?;
        let mesh = Self::upright(mesh.in_metres(unit), up.unwrap_or(format.default_up()));
        Ok(mesh.with_warnings(path, warnings))
    }

    /// A mesh of these vertices, `[n][3]` in metres, z up, and these triangles, `[m][3]` indices of
    /// vertices.
    ///
    /// # Errors
    /// There is no triangle; a coordinate is not finite; an index has no vertex.
    pub fn from_triangles(
        vertices: Vec<[f64; 3]>,
        triangles: Vec<[u32; 3]>,
    ) -> Result<Self, Error> {
        Self::from_triangles_in(vertices, triangles, Up::Z, Unit::Metre)
    }

    /// As [`Mesh::from_triangles`], of arrays whose upward axis or unit may be another.
    #[doc(hidden)]
    pub fn from_triangles_in(
        vertices: Vec<[f64; 3]>,
        triangles: Vec<[u32; 3]>,
        up: Up,
        unit: Unit,
    ) -> Result<Self, Error> {
        let vertices = vertices.into_iter().map(|v| z_up(DVec3::from_array(v), up)).collect();
        Self::try_from(TriangleMesh { vertices, triangles }.in_metres(unit))
    }

    /// The same mesh, scaled about its origin: 0.001 for a file in millimetres.
    ///
    /// # Errors
    /// The factor is not a finite number above 0, or a coordinate becomes too large.
    pub fn scaled(&self, factor: f64) -> Result<Self, Error> {
        crate::config::positive("factor", factor)?;
        let vertices = self.vertices().iter().map(|vertex| *vertex * factor).collect();
        let triangles = self.triangles().to_vec();
        Self::try_from(TriangleMesh { vertices, triangles })
    }

    /// The same mesh with the mean of its vertices at the origin and its farthest vertex at radius
    /// 1, as point clouds of ModelNet are.
    #[must_use]
    pub fn unit_sphere(&self) -> Self {
        self.normalized(Normalize::UnitSphere)
    }

    /// The vertices, metres, `[n]`.
    #[must_use]
    pub fn vertices(&self) -> &[DVec3] {
        &self.triangle_mesh().vertices
    }

    /// The triangles as indices of vertices, `[m][3]`.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangle_mesh().triangles
    }

    /// The least and the largest coordinates of the vertices, metres.
    #[must_use]
    pub fn bounds_m(&self) -> [[f64; 3]; 2] {
        let (low, high) = bounding_box(self.vertices().iter().copied());
        [low.to_array(), high.to_array()]
    }

    /// What became the origin when the mesh was scaled to a unit sphere or box, in the units that
    /// it had before; 0 for all other meshes.
    #[must_use]
    pub fn centre(&self) -> [f64; 3] {
        self.centre.to_array()
    }

    /// The factor by which it was scaled to a unit sphere or box; 1 for all other meshes.
    #[must_use]
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// What is probably wrong with the file that it was read from, such as polygons that cross
    /// themselves: with the file.
    #[must_use]
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    pub(super) fn with_warnings(mut self, file: &Path, warnings: Vec<Warning>) -> Self {
        self.warnings.extend(warnings.into_iter().map(|warning| warning.of(file.display())));
        self
    }

    /// The mesh as `normalize` has it; [`Normalize::None`] leaves it as it is.
    #[doc(hidden)]
    #[must_use]
    pub fn normalized(&self, normalize: Normalize) -> Self {
        if normalize == Normalize::None {
            return self.clone();
        }
        let WorldMesh { mesh, centre, scale } = to_world(self.triangle_mesh(), Up::Z, normalize);
        let warnings = self.warnings.clone();
        Self { centre, scale, recentres: false, warnings, ..Self::of(mesh) }
    }

    /// A mesh that is cast at as `target`, which stands `centre` away from where the mesh does.
    #[doc(hidden)]
    #[must_use]
    pub fn from_target(target: Target, centre: DVec3) -> Self {
        let ready = Ready { target, mesh_from_target: DAffine3::from_translation(centre) };
        Self::with(OnceLock::new(), OnceLock::from(ready))
    }

    /// What casters take, built by the first who asks.
    #[doc(hidden)]
    #[must_use]
    pub fn target(&self) -> &Target {
        &self.ready().target
    }

    pub(super) fn mesh_from_target(&self) -> &DAffine3 {
        &self.ready().mesh_from_target
    }

    fn ready(&self) -> &Ready {
        // Outside of `get_or_init`: building the BVH may run another task of the pool, which may
        // want the same mesh.
        self.ready.get().unwrap_or_else(|| {
            let mesh = self.triangle_mesh();
            let (mesh, centre) = if self.recentres {
                let world = to_world(mesh, Up::Z, Normalize::None);
                (world.mesh, world.centre)
            } else {
                (mesh.clone(), DVec3::ZERO)
            };
            let target = Target::new(Surface::of_mesh(mesh), Builder::Sah);
            let mesh_from_target = DAffine3::from_translation(centre);
            self.ready.get_or_init(|| Ready { target, mesh_from_target })
        })
    }

    fn triangle_mesh(&self) -> &TriangleMesh {
        self.triangles.get_or_init(|| {
            let Ready { target, mesh_from_target } = self.ready();
            let surface = &target.surface;
            let in_mesh = |vertex: &DVec3| {
                mesh_from_target.transform_point3(surface.frame.to_object(*vertex))
            };
            let vertices = surface.vertices().iter().map(in_mesh).collect();
            TriangleMesh { vertices, triangles: surface.triangles().to_vec() }
        })
    }

    fn with(triangles: OnceLock<TriangleMesh>, ready: OnceLock<Ready>) -> Self {
        let (triangles, ready) = (Arc::new(triangles), Arc::new(ready));
        let (centre, scale, warnings) = (DVec3::ZERO, 1.0, vec![]);
        Self { triangles, recentres: true, ready, centre, scale, warnings }
    }

    fn of(triangles: TriangleMesh) -> Self {
        Self::with(OnceLock::from(triangles), OnceLock::new())
    }

    pub(super) fn upright(mut mesh: TriangleMesh, up: Up) -> Self {
        mesh.vertices.iter_mut().for_each(|vertex| *vertex = z_up(*vertex, up));
        Self::of(mesh)
    }
}

impl TryFrom<TriangleMesh> for Mesh {
    type Error = Error;

    fn try_from(mesh: TriangleMesh) -> Result<Self, Error> {
        let wrong = |error: edgepuck_mesh::ParseError| {
            crate::config::InvalidValue::new("mesh", error.to_string())
        };
        check(&mesh).map_err(wrong)?;
        let warnings = flat(&mesh).into_iter().collect();
        Ok(Self { warnings, ..Self::of(mesh) })
    }
}

impl From<&Mesh> for Mesh {
    fn from(mesh: &Mesh) -> Self {
        mesh.clone()
    }
}
