//! What surfaces are made of: how much light they return.
//!
//! An OBJ file names a material for each face (`usemtl`). Its colour (`Kd` in the MTL file)
//! is what a screen shows, not what a sensor at 905 nm measures: black plastic may be bright
//! there. So a name may be given a reflectivity of its own, or one of the table in
//! `assets/materials.toml`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use edgepuck_assets::MATERIALS;
use serde::Deserialize;

use crate::config::{InvalidValue, within};
use crate::mesh::{Colour, MaterialNames, MeshError, colours, material_names};

/// How a surface returns light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// The part of the light that comes back at vertical incidence, 0 to 1.
    pub reflectivity: f64,
    /// How well it reflects light back to where it came from, as road signs and licence
    /// plates do: above 0, 1 being ideal. 0 is a surface that scatters.
    pub retroreflection: f64,
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

    /// Checks both numbers, under names that begin with `key`.
    ///
    /// # Errors
    /// On the first that is not within 0 to 1.
    pub fn validate(&self, key: &str) -> Result<(), InvalidValue> {
        within(&format!("{key}.reflectivity"), self.reflectivity, 0.0..=1.0)?;
        within(&format!("{key}.retroreflection"), self.retroreflection, 0.0..=1.0)
    }
}

fn table() -> BTreeMap<String, f64> {
    toml::from_str(MATERIALS).expect("invariant: a test parses the table")
}

/// Which materials are wanted for a mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MaterialChoice {
    /// Whether diffuse colours are taken from the mesh's MTL file.
    pub from_mtl: bool,
    /// Materials by name, which come before those of the MTL file.
    pub by_name: BTreeMap<String, Material>,
}

impl MaterialChoice {
    /// Whether all of a mesh is of one material.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        *self == Self::default()
    }
}

/// A material as TOML holds it.
#[derive(Clone, Debug, Deserialize)]
#[serde(
    untagged,
    expecting = "expected the name of a built-in material, or a table of reflectivity and \
                 retroreflection as material"
)]
pub(crate) enum MaterialTable {
    Builtin(String),
    Own(OwnMaterial),
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct OwnMaterial {
    #[serde(default = "white")]
    reflectivity: f64,
    #[serde(default)]
    retroreflection: f64,
}

fn white() -> f64 {
    1.0
}

impl MaterialTable {
    pub(crate) fn material(self, key: &str) -> Result<Material, InvalidValue> {
        match self {
            Self::Own(OwnMaterial { reflectivity, retroreflection }) => {
                let material = Material { reflectivity, retroreflection };
                material.validate(key)?;
                Ok(material)
            }
            Self::Builtin(name) => Material::builtin(&name).ok_or_else(|| {
                let known: Vec<String> = table().into_keys().collect();
                let cause = format!("expected one of {}, found \"{name}\"", known.join(", "));
                InvalidValue::new(key, cause)
            }),
        }
    }
}

/// Why a mesh's materials cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum MaterialError {
    /// The mesh cannot be read.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A material was named that the mesh does not use.
    #[error("{}: expected a material called \"{name}\", found {}", path.display(), known.join(", "))]
    UnknownName {
        /// The mesh's file.
        path: PathBuf,
        /// The name.
        name: String,
        /// The names that the mesh uses.
        known: Vec<String>,
    },
    /// A material of an MTL file has no colour that can be used.
    #[error("{}: material {name}: {cause}", path.display())]
    Colour {
        /// The MTL file.
        path: PathBuf,
        /// The material.
        name: String,
        /// Why.
        cause: &'static str,
    },
}

/// The materials of a mesh's triangles.
#[derive(Clone, Debug, PartialEq)]
pub struct Materials {
    materials: Vec<Material>,
    /// Indices into `materials`, `[n_triangles]`.
    of_triangle: Vec<u32>,
}

impl Materials {
    /// The materials that `choice` gives the mesh in the OBJ file at `path`; what has none
    /// is `otherwise`.
    ///
    /// # Errors
    /// A file that is not OBJ or cannot be read; a name that the mesh does not use; an MTL
    /// file that is missing or malformed, or has a colour or a texture that cannot be used.
    pub fn load(
        path: &Path,
        choice: &MaterialChoice,
        otherwise: Material,
    ) -> Result<Self, MaterialError> {
        let MaterialNames { libraries, names, of_triangle } = material_names(path)?;
        if let Some(name) = choice.by_name.keys().find(|name| !names.contains(name)) {
            let (path, name) = (path.to_owned(), name.clone());
            return Err(MaterialError::UnknownName { path, name, known: names });
        }
        let known = if choice.from_mtl { read_libraries(path, &libraries)? } else { vec![] };
        let mut materials = vec![otherwise];
        for name in &names {
            let colour = known.iter().find(|(_, colour)| colour.name == *name);
            materials.push(match (choice.by_name.get(name), colour) {
                (Some(material), _) => *material,
                (None, Some((library, colour))) => diffuse(library, colour)?,
                (None, None) => otherwise,
            });
        }
        Ok(Self { materials, of_triangle })
    }

    /// The material of triangle `index` of the mesh.
    #[must_use]
    pub fn of(&self, index: u32) -> Material {
        self.materials[self.of_triangle[index as usize] as usize]
    }
}

/// The colours in the MTL files that the OBJ file at `path` names, and where each stands.
fn read_libraries(path: &Path, libraries: &[String]) -> Result<Vec<(PathBuf, Colour)>, MeshError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut found = Vec::new();
    for library in libraries {
        let path = folder.join(library);
        found.extend(colours(&path)?.into_iter().map(|colour| (path.clone(), colour)));
    }
    Ok(found)
}

/// The material of a colour: its luminance.
fn diffuse(library: &Path, colour: &Colour) -> Result<Material, MaterialError> {
    let failed = |cause| {
        let (path, name) = (library.to_owned(), colour.name.clone());
        Err(MaterialError::Colour { path, name, cause })
    };
    match colour.diffuse {
        _ if colour.has_image => failed(
            "map_Kd names an image, which is not read; give the material a reflectivity by name",
        ),
        None => failed("expected a colour Kd, found none"),
        Some(srgb) => Ok(Material::diffuse(luminance(srgb))),
    }
}

/// The luminance of an sRGB colour in linear light: IEC 61966-2-1 for each part, and the
/// weights of ITU-R BT.709.
fn luminance(srgb: [f64; 3]) -> f64 {
    let [r, g, b] =
        srgb.map(
            |part| {
                if part <= 0.04045 { part / 12.92 } else { ((part + 0.055) / 1.055).powf(2.4) }
            },
        );
    (0.2126 * r + 0.7152 * g + 0.0722 * b).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    const OBJ: &str = "mtllib car parts.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\n\
                       usemtl body\nf 1 2 4 3\nf 1 2\nusemtl tyre # black\nf 2 4 3\n\
                       usemtl body\nf 1 4 3\n";
    const MTL: &str = "newmtl body\nKd 0.5 0.5 0.5\nnewmtl tyre\nKd 1 0 0\n";

    fn load(obj: &str, mtl: &str, choice: &MaterialChoice) -> Result<Vec<f64>, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("car.obj");
        fs::write(&path, obj).unwrap();
        fs::write(folder.path().join("car parts.mtl"), mtl).unwrap();
        let n = crate::mesh::load(&path).unwrap().mesh.triangles.len() as u32;
        let materials = Materials::load(&path, choice, Material::diffuse(0.9))
            .map_err(|error| error.to_string().replace(folder.path().to_str().unwrap(), ""))?;
        assert_eq!(materials.of_triangle.len(), n as usize);
        Ok((0..n).map(|triangle| materials.of(triangle).reflectivity).collect())
    }

    fn by_name(name: &str, reflectivity: f64) -> MaterialChoice {
        let by_name = [(name.to_owned(), Material::diffuse(reflectivity))].into();
        MaterialChoice { from_mtl: false, by_name }
    }

    #[test]
    fn triangles_have_the_material_of_their_face() {
        // Half of sRGB's range is 21.4 % of the light.
        let grey = luminance([0.5; 3]);
        assert!((grey - 0.214_041).abs() < 1e-6, "{grey}");
        let mtl = MaterialChoice { from_mtl: true, ..MaterialChoice::default() };
        assert_eq!(load(OBJ, MTL, &mtl).unwrap(), [0.9, grey, grey, 0.2126, grey]);
        let named = by_name("tyre", 0.02);
        assert_eq!(load(OBJ, "", &named).unwrap(), [0.9, 0.9, 0.9, 0.02, 0.9]);
        let both = MaterialChoice { from_mtl: true, ..named };
        assert_eq!(load(OBJ, MTL, &both).unwrap(), [0.9, grey, grey, 0.02, grey]);
    }

    #[test]
    fn what_cannot_be_used_is_named() {
        let mtl = MaterialChoice { from_mtl: true, ..MaterialChoice::default() };
        for (text, choice, expected) in [
            (
                MTL,
                by_name("wheel", 0.1),
                "/car.obj: expected a material called \"wheel\", found body, tyre",
            ),
            (
                "newmtl body\nKd 0.5 2 0\n",
                mtl.clone(),
                "/car parts.mtl:2: expected one or three numbers within 0..=1 as Kd",
            ),
            (
                "newmtl body\nKd nan 0 0\n",
                mtl.clone(),
                "/car parts.mtl:2: expected one or three numbers within 0..=1 as Kd",
            ),
            ("newmtl body\nKd 0.5 0.5\n", mtl.clone(), "/car parts.mtl:2: expected one or three"),
            ("Kd 1 1 1\n", mtl.clone(), "/car parts.mtl:1: expected newmtl and a name before it"),
            ("newmtl body\n", mtl.clone(), "material body: expected a colour Kd, found none"),
            ("newmtl body\nKd 1 1 1\nmap_Kd a.png\n", mtl.clone(), "map_Kd names an image"),
        ] {
            let error = load(OBJ, text, &choice).unwrap_err();
            assert!(error.contains(expected), "{error}");
        }
        let missing = OBJ.replace("car parts", "none");
        assert!(load(&missing, "", &mtl).unwrap_err().starts_with("/none.mtl: cannot be read"));
        let error = Materials::load(Path::new("a.stl"), &mtl, Material::diffuse(1.0)).unwrap_err();
        assert!(error.to_string().contains("expected an OBJ file"), "{error}");
    }

    #[test]
    fn the_table_holds_reflectivities() {
        assert_eq!(Material::builtin("asphalt"), Some(Material::diffuse(0.17)));
        assert!(Material::builtin("unobtainium").is_none());
        for (name, reflectivity) in table() {
            Material::diffuse(reflectivity).validate(&name).unwrap();
        }
    }
}
