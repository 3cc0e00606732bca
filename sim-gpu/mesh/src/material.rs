//! Materials: how much light surfaces return.
//!
//! An OBJ file names a material for each face (`usemtl`). A name may get a reflectivity of its own, or
//! one of the table in `assets/materials.toml`. Colours of files are not taken, but for the base colours
//! of glTF where they are asked for: they are those of visible light, and surfaces differ at 905 nm.
//! Black plastic may be bright there.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use edgepuck_assets::MATERIALS;
use serde::Deserialize;

use crate::MeshError;
use crate::named_faces::NamedFaces;

/// The reflection of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// The part of the light that comes back at vertical incidence, 0 to 1.
    #[serde(default = "white")]
    pub reflectivity: f64,
    /// The quality of a retro-reflector, such as a road sign or a licence plate: up to 1, which is
    /// ideal. 0 is a surface that scatters.
    #[serde(default)]
    pub retroreflection: f64,
}

fn white() -> f64 {
    1.0
}

impl Material {
    /// A surface that scatters.
    #[must_use]
    pub const fn diffuse(reflectivity: f64) -> Self {
        Self { reflectivity, retroreflection: 0.0 }
    }

    /// The built-in material of this name: see `assets/materials.toml`.
    #[must_use]
    pub fn builtin(name: &str) -> Option<Self> {
        table().get(name).copied().map(Self::diffuse)
    }

    /// The names of the built-in materials.
    #[must_use]
    pub fn builtin_names() -> Vec<String> {
        table().into_keys().collect()
    }
}

fn table() -> BTreeMap<String, f64> {
    toml::from_str(MATERIALS).expect("invariant: a test parses the table")
}

/// The materials of a mesh could not be loaded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MaterialError {
    /// The mesh cannot be read.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The choice names a material that the mesh does not use.
    #[error("{}: expected a material called \"{name}\", found {}", path.display(), known.join(", "))]
    UnknownName {
        /// The mesh's file.
        path: PathBuf,
        /// The name.
        name: String,
        /// The names that the mesh uses.
        known: Vec<String>,
    },
}

/// The materials of a mesh's triangles.
#[derive(Clone, Debug, PartialEq)]
pub struct Materials {
    all: Vec<Material>,
    /// Indices of `all`, `[n_triangles]`.
    of_triangle: Vec<u32>,
}

impl Materials {
    /// The materials `by_name` of the mesh in the OBJ file at `path`. Other faces get `otherwise`.
    ///
    /// # Errors
    /// If the file is not OBJ or cannot be read, or a name is not used by the mesh.
    pub fn load(
        path: &Path,
        by_name: &BTreeMap<String, Material>,
        otherwise: Material,
    ) -> Result<Self, MaterialError> {
        let NamedFaces { names, of_triangle } = NamedFaces::load(path)?;
        if let Some(name) = by_name.keys().find(|name| !names.contains(name)) {
            let (path, name) = (path.to_owned(), name.clone());
            return Err(MaterialError::UnknownName { path, name, known: names });
        }
        let named = names.iter().map(|name| by_name.get(name).copied().unwrap_or(otherwise));
        let all = std::iter::once(otherwise).chain(named).collect();
        let index = |name: Option<u32>| name.map_or(0, |name| name + 1);
        Ok(Self { all, of_triangle: of_triangle.into_iter().map(index).collect() })
    }

    /// Surfaces that scatter: a reflectivity and the number of triangles in a row that have it.
    #[must_use]
    pub fn of_runs(runs: &[(f64, usize)]) -> Self {
        let all = runs.iter().map(|(reflectivity, _)| Material::diffuse(*reflectivity)).collect();
        let of_triangle =
            runs.iter().zip(0..).flat_map(|((_, n), at)| std::iter::repeat_n(at, *n)).collect();
        Self { all, of_triangle }
    }

    /// The number of triangles.
    #[must_use]
    pub fn n_triangles(&self) -> usize {
        self.of_triangle.len()
    }

    /// The material of triangle `index`.
    #[must_use]
    pub fn of_triangle(&self, index: u32) -> Material {
        self.all[self.of_triangle[index as usize] as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    const OBJ: &str = "mtllib none.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\n\
                       usemtl body\nf 1 2 4 3\nf 1 2\nusemtl tyre # black\nf 2 4 3\n\
                       usemtl body\nf 1 4 3\n";

    fn load(name: &str, reflectivity: f64) -> Result<Vec<f64>, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("car.obj");
        fs::write(&path, OBJ).unwrap();
        let n = crate::load(&path).unwrap().mesh.triangles.len();
        let by_name = [(name.to_owned(), Material::diffuse(reflectivity))].into();
        let materials = Materials::load(&path, &by_name, Material::diffuse(0.9))
            .map_err(|error| error.to_string().replace(folder.path().to_str().unwrap(), ""))?;
        assert_eq!(materials.n_triangles(), n);
        Ok((0..n as u32).map(|triangle| materials.of_triangle(triangle).reflectivity).collect())
    }

    #[test]
    fn triangles_have_the_material_of_their_face() {
        assert_eq!(load("tyre", 0.02).unwrap(), [0.9, 0.9, 0.9, 0.02, 0.9]);
        assert_eq!(load("body", 0.2).unwrap(), [0.9, 0.2, 0.2, 0.9, 0.2]);
    }

    #[test]
    fn unknown_names_and_other_formats_are_errors() {
        let error = load("wheel", 0.1).unwrap_err();
        let expected = "/car.obj: expected a material called \"wheel\", found body, tyre";
        assert_eq!(error, expected);
        let (path, white) = (Path::new("a.stl"), Material::diffuse(1.0));
        let error = Materials::load(path, &BTreeMap::new(), white).unwrap_err();
        assert!(error.to_string().contains("expected an OBJ file"), "{error}");
    }

    #[test]
    fn the_table_holds_reflectivities() {
        assert_eq!(Material::builtin("asphalt"), Some(Material::diffuse(0.17)));
        assert!(Material::builtin("unobtainium").is_none());
        for (name, reflectivity) in table() {
            assert!((0.0..=1.0).contains(&reflectivity), "{name}: {reflectivity}");
        }
    }
}
