//! The mesh that all formats are read into.

use glam::DVec3;

/// A triangle mesh in f64.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions in the file's units, `[n_vertices]`, all finite.
    pub vertices: Vec<DVec3>,
    /// Corners as indices into `vertices`, `[n_triangles, 3]`, in the file's
    /// order; all in range.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// The mesh of `triangles`, whose corners are indices below `n` of vertices
    /// at `position`. It has those that are named, in the order in which they
    /// are first named.
    pub(crate) fn of_named(
        mut triangles: Vec<[u32; 3]>,
        n: usize,
        position: impl Fn(usize) -> DVec3,
    ) -> Self {
        const NOT_NAMED: u32 = u32::MAX;
        let mut numbers = vec![NOT_NAMED; n];
        let mut vertices = Vec::new();
        for corner in triangles.as_flattened_mut() {
            let number = &mut numbers[*corner as usize];
            if *number == NOT_NAMED {
                *number = vertices.len() as u32;
                vertices.push(position(*corner as usize));
            }
            *corner = *number;
        }
        Self { vertices, triangles }
    }
}

/// What a format's parser makes of a file's bytes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parsed {
    /// The mesh, with a triangle, finite vertices and indices in range once it was checked.
    pub mesh: Mesh,
    /// Faces of fewer than three corners, which were left out.
    pub dropped_faces: usize,
}

impl Parsed {
    /// Appends a face as a fan around its first corner, or counts it as dropped
    /// if it has fewer than three.
    pub(super) fn add_face(&mut self, corners: &[u32]) {
        self.dropped_faces += usize::from(corners.len() < 3);
        let sides = corners.windows(2).skip(1);
        self.mesh.triangles.extend(sides.map(|side| [corners[0], side[0], side[1]]));
    }
}
