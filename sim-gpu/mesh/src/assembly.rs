//! Meshes and the places where a file puts them: what a glTF scene and a robot are.

use formats::plausible::Warning;
use glam::DAffine3;

use super::triangle_mesh::{Parsed, TriangleMesh};

/// The meshes of a file, and where it puts them.
#[derive(Clone, Debug, Default)]
pub struct Assembly {
    /// The meshes, in the axes of their files; parts share them.
    pub meshes: Vec<AssembledMesh>,
    /// What stands somewhere, at least one.
    pub parts: Vec<Part>,
    /// The materials that the faces of meshes name.
    pub colours: Vec<BaseColour>,
    /// What is probably wrong with the file, and what of it is left out.
    pub warnings: Vec<Warning>,
}

/// A mesh of an [`Assembly`].
#[derive(Clone, Debug, Default)]
pub struct AssembledMesh {
    /// Its triangles.
    pub mesh: TriangleMesh,
    /// Luminances, 0 to 1, of base colours times vertices' colours, and the number of triangles in a row
    /// that have them.
    pub colours: Vec<(f64, usize)>,
}

/// A mesh at a place.
#[derive(Clone, Debug)]
pub struct Part {
    /// The index of its mesh.
    pub mesh: usize,
    /// Its name in the file, or its place there.
    pub name: String,
    /// The name of the mesh, or of what it belongs to.
    pub label: Option<String>,
    /// From the mesh to the world; all finite.
    pub world_from_mesh: DAffine3,
}

/// The colour of a material in visible light.
#[derive(Clone, Debug, PartialEq)]
pub struct BaseColour {
    /// The material's name in the file, or its place there.
    pub name: String,
    /// The luminance of its factor: 0 is black, 1 white.
    pub luminance: f64,
    /// Whether an image is multiplied by the factor.
    pub has_image: bool,
}

impl Assembly {
    /// All parts as one mesh, where they stand; `None` if it has more than `most` vertices or
    /// triangles.
    pub(super) fn flattened(self, most: usize) -> Option<Parsed> {
        let mut parsed = Parsed::default();
        parsed.warnings = self.warnings;
        for part in self.parts {
            let TriangleMesh { vertices, triangles } =
                self.meshes[part.mesh].mesh.moved(&part.world_from_mesh);
            let first = parsed.mesh.vertices.len() as u32;
            parsed.mesh.vertices.extend(vertices);
            let moved = |corners: [u32; 3]| corners.map(|corner| first + corner);
            parsed.mesh.triangles.extend(triangles.into_iter().map(moved));
            if parsed.mesh.vertices.len().max(parsed.mesh.triangles.len()) > most {
                return None;
            }
        }
        Some(parsed)
    }
}

impl TriangleMesh {
    /// The same mesh through this map. Of a mirror image, the outside stays outside.
    #[must_use]
    pub fn moved(&self, by: &DAffine3) -> Self {
        let is_mirrored = by.matrix3.determinant() < 0.0;
        let corners = |&[a, b, c]: &[u32; 3]| if is_mirrored { [a, c, b] } else { [a, b, c] };
        Self {
            vertices: self.vertices.iter().map(|vertex| by.transform_point3(*vertex)).collect(),
            triangles: self.triangles.iter().map(corners).collect(),
        }
    }
}
