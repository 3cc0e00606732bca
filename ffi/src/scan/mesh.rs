use std::ffi::c_char;
use std::mem::MaybeUninit;

use sim_gpu::Mesh;

use crate::pointers;
use crate::status::{EdgepuckStatus, Failure};

/// A triangle mesh. Both sides of a triangle are solid.
pub struct EdgepuckMesh {
    pub(crate) mesh: Mesh,
}

/// Reads the OBJ, OFF, PLY, STL or glTF file at path (UTF-8 on Windows), in metres. The y axis of OBJ
/// and glTF points up, and (x, y, z) becomes (x, -z, y); the z axis of all others points up. Writes the
/// mesh to out, or null if it fails. Pass it to edgepuck_mesh_free in the end.
///
/// # Safety
///
/// path is null or a NUL-terminated string.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn edgepuck_mesh_read(
    path: *const c_char,
    out: Option<&mut MaybeUninit<Option<Box<EdgepuckMesh>>>>,
) -> EdgepuckStatus {
    pointers::make(out, || {
        // SAFETY: null or NUL-terminated, as required above.
        let mesh = Mesh::read(unsafe { pointers::path(path, "path") }?);
        Ok(EdgepuckMesh { mesh: mesh.map_err(Failure::of(EdgepuckStatus::BadMesh))? })
    })
}

/// Makes a mesh of n_vertices vertices, x y z after x y z, in metres, z up, and n_triangles triangles,
/// three indices of vertices each, which it copies. Writes the mesh to out, or null if it fails. Pass it
/// to edgepuck_mesh_free in the end.
///
/// # Safety
///
/// vertices is null or 3 * n_vertices numbers can be read there; triangles is null or 3 * n_triangles
/// numbers can be read there.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn edgepuck_mesh_new(
    vertices: *const f64,
    n_vertices: usize,
    triangles: *const u32,
    n_triangles: usize,
    out: Option<&mut MaybeUninit<Option<Box<EdgepuckMesh>>>>,
) -> EdgepuckStatus {
    pointers::make(out, || {
        // SAFETY: null or long enough, as required above.
        let (vertices, triangles): (&[[f64; 3]], &[[u32; 3]]) = unsafe {
            let vertices = pointers::slice(vertices.cast(), n_vertices, "vertices")?;
            (vertices, pointers::slice(triangles.cast(), n_triangles, "triangles")?)
        };
        let mesh = Mesh::from_triangles(vertices.to_vec(), triangles.to_vec());
        Ok(EdgepuckMesh { mesh: mesh.map_err(Failure::of(EdgepuckStatus::BadMesh))? })
    })
}

/// Frees a mesh, of which instances may still stand in scenes; null has no effect.
#[unsafe(no_mangle)]
pub extern "C" fn edgepuck_mesh_free(mesh: Option<Box<EdgepuckMesh>>) {
    pointers::free(mesh);
}
