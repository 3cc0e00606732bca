//! The names of the materials of an OBJ file's faces.
//!
//! The geometry is read without them ([`super::load()`]); this is a second pass, if materials are
//! requested.

use std::path::Path;

use super::error::{Malformed, MeshError};
use super::file::read;
use super::format::MeshFormat;
use super::obj;
use super::tokens::without_mark;

/// The materials of the faces of an OBJ file, by their names (`usemtl`).
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct NamedFaces {
    /// The names, in the order of their first use.
    pub names: Vec<String>,
    /// The index of the name, by triangle of the mesh.
    pub of_triangle: Vec<Option<u32>>,
}

impl NamedFaces {
    pub fn load(path: &Path) -> Result<Self, MeshError> {
        if MeshFormat::from_path(path) != Some(MeshFormat::Obj) {
            let cause = "expected an OBJ file, whose faces name materials, found another format";
            let cause = Malformed::Syntax(cause.to_owned());
            return Err(MeshError::Malformed { path: path.into(), line: None, cause });
        }
        let bytes = read(path)?;
        let (mut found, mut current) = (Self::default(), None);
        let add = |key: &[u8], rest: &[u8]| match key {
            b"usemtl" => current = Some(found.index_of(rest)),
            b"f" => {
                // A polygon is cut into as many triangles as a fan has.
                let n_triangles = obj::words(rest).count().saturating_sub(2);
                let n = found.of_triangle.len() + n_triangles;
                found.of_triangle.resize(n, current);
            }
            _ => {}
        };
        obj::read(without_mark(&bytes), add).map_err(|error| error.of(path))?;
        Ok(found)
    }

    /// The index of a name, which may hold spaces.
    fn index_of(&mut self, name: &[u8]) -> u32 {
        let name = String::from_utf8_lossy(name).into_owned();
        let place = self.names.iter().position(|known| *known == name).unwrap_or_else(|| {
            self.names.push(name);
            self.names.len() - 1
        });
        place as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn materials_stay_with_the_triangles_of_a_polygon_that_is_cut() {
        // A triangle, a concave polygon of 5 corners that a fan does not cover, and a triangle.
        let obj = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 2 1 0\nv 0 4 0\n\
                   f 1 2 3\nusemtl a\nf 1 2 3 4 5\nusemtl b\nf 1 2 4\n";
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.obj");
        std::fs::write(&path, obj).unwrap();
        let found = NamedFaces::load(&path).unwrap();
        assert_eq!(found.names, ["a", "b"]);
        assert_eq!(found.of_triangle, [None, Some(0), Some(0), Some(0), Some(1)]);
        let triangles = crate::load(&path).unwrap().mesh.triangles;
        assert_eq!([triangles[0], triangles[4]], [[0, 1, 2], [0, 1, 3]]);
        assert_ne!(triangles[1..4], [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
    }
}
