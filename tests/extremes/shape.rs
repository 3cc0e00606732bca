use edgepuck_mesh::TriangleMesh;
use glam::{DQuat, DVec3, dvec3};
use serde::Deserialize;
use tests::meshes;

#[derive(Clone, Deserialize)]
#[serde(tag = "shape", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Shape {
    /// A mesh without triangles.
    Empty {},
    /// A cube from -1 to 1.
    Cube {},
    /// Two triangles from -1 to 1 in the plane z = 0.
    Square {},
    /// The cube with n x n squares on each face.
    TiledCube { n: u32 },
    /// A wavy torus with 2 n^2 triangles.
    Torus { n: u32 },
    /// A unit sphere with 20 * 4^level triangles.
    Icosphere { level: u32 },
    /// n random triangles in the cube.
    Soup { n: u32, size: f64 },
    /// Listed triangles.
    Triangles { vertices: Vec<DVec3>, triangles: Vec<[u32; 3]> },
    /// Slivers from one apex at -x to tips at x = 1, with a number and a spacing.
    Fan { slivers: u32, apart: f64 },
    /// Different squares that overlap in a plane.
    Layers {},
    /// Several meshes together.
    Together { parts: Vec<Shape> },
    /// A cube with this half side around the origin.
    SmallCube { half: f64 },
}

impl Shape {
    pub fn mesh(&self) -> TriangleMesh {
        match self {
            Self::Empty {} => TriangleMesh::default(),
            Self::Cube {} => meshes::cube(),
            Self::Square {} => square(),
            Self::TiledCube { n } => meshes::tiled_cube(*n),
            Self::Torus { n } => meshes::torus(*n),
            Self::Icosphere { level } => meshes::icosphere(*level),
            Self::Soup { n, size } => meshes::soup(*n, *size),
            Self::Triangles { vertices, triangles } => {
                TriangleMesh { vertices: vertices.clone(), triangles: triangles.clone() }
            }
            Self::Fan { slivers, apart } => fan(*slivers, *apart),
            Self::Layers {} => layers(),
            Self::Together { parts } => {
                meshes::together(&parts.iter().map(Self::mesh).collect::<Vec<_>>())
            }
            Self::SmallCube { half } => meshes::cuboid(DVec3::splat(-half), DVec3::splat(*half)),
        }
    }
}

fn square() -> TriangleMesh {
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let vertices = corners.map(|(x, y)| dvec3(x, y, 0.0)).to_vec();
    TriangleMesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]] }
}

fn fan(slivers: u32, apart: f64) -> TriangleMesh {
    let tip = |i: u32| dvec3(1.0, (f64::from(i) - f64::from(slivers) / 2.0) * apart, 0.0);
    TriangleMesh {
        vertices: (0..=slivers).map(tip).chain([-DVec3::X]).collect(),
        triangles: (0..slivers).map(|i| [slivers + 1, i, i + 1]).collect(),
    }
}

fn layers() -> TriangleMesh {
    let turned = |angle: f64, size: f64| {
        meshes::mapped(&square(), |v| DQuat::from_rotation_z(angle) * v * size)
    };
    meshes::together(&[square(), turned(0.4, 0.9), turned(1.1, 0.8), turned(0.0, 0.5)])
}
