//! Materials: how much light surfaces return.
//!
//! An OBJ file names a material for each face (`usemtl`), whose colour is in an MTL file (`Kd`,
//! `map_Kd`), or gives its vertices colours. Colours describe visible light, and surfaces differ at
//! 905 nm: black plastic may be bright there. A name may therefore get a reflectivity of its own,
//! or one of the table in `assets/materials.toml`.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use edgepuck_assets::MATERIALS;
use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::config::{InvalidValue, within};
use crate::mesh::{Appearance, Colour, MeshError, colours, file_name};
use texture::Texture;

mod texture;

/// The reflection of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// The part of the light that comes back at vertical incidence, 0 to 1.
    pub reflectivity: f64,
    /// The quality of a retro-reflector, such as a road sign or a licence plate: up to 1, which is
    /// ideal. 0 is a surface that scatters.
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
    pub fn validate(&self, key: &str) -> Result<(), InvalidValue> {
        within(&format!("{key}.reflectivity"), self.reflectivity, 0.0..=1.0)?;
        within(&format!("{key}.retroreflection"), self.retroreflection, 0.0..=1.0)
    }
}

fn table() -> BTreeMap<String, f64> {
    toml::from_str(MATERIALS).expect("invariant: a test parses the table")
}

formats::named! {
    /// The source of the colours of an OBJ file's faces.
    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum ColourSource: "source of colours" {
        /// The materials of its MTL files: `Kd` and `map_Kd`.
        Mtl = "mtl",
        /// Its vertices: `v x y z red green blue`.
        Vertices = "vertices",
    }
}

/// The choice of the materials of a mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MaterialChoice {
    /// The source of colours, if they are used.
    pub colours: Option<ColourSource>,
    /// Materials by name, which take precedence over colours.
    pub by_name: BTreeMap<String, Material>,
}

impl MaterialChoice {
    /// Whether a mesh has a single material.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        *self == Self::default()
    }
}

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
    /// A material has no usable colour.
    #[error("{}: material {name}: {cause}", path.display())]
    Colour {
        /// The MTL file.
        path: PathBuf,
        /// The material.
        name: String,
        /// Why.
        cause: String,
    },
    /// The colour of a vertex is not within 0 to 1.
    #[error(
        "{}: vertex {vertex}: expected three numbers within 0..=1 as its colour, found {found:?}",
        path.display()
    )]
    Vertex {
        /// The OBJ file.
        path: PathBuf,
        /// The vertex, from 1.
        vertex: u32,
        /// Its numbers.
        found: [f64; 3],
    },
}

/// The materials of a mesh's triangles.
#[derive(Clone, Debug, PartialEq)]
pub struct Materials {
    even: Vec<Material>,
    textures: Vec<Texture>,
    /// `[n_triangles]`.
    of_triangle: Vec<Paint>,
    /// What is doubtful about the files, for the user.
    #[doc(hidden)]
    pub warnings: Vec<String>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Paint {
    /// One material, by its index in `even`.
    Even(u32),
    /// The reflectivities of its corners.
    Corners([f32; 3]),
    /// An image, by its index in `textures`, and the corners' places in it.
    Textured(u32, [[f32; 2]; 3]),
}

impl Materials {
    /// Loads the materials that `choice` selects for the mesh in the OBJ file at `path`. Faces
    /// without one get `otherwise`.
    ///
    /// # Errors
    /// If a file is not OBJ or cannot be read, a name is not used by the mesh, an MTL file is
    /// missing or malformed, or a colour or an image cannot be used.
    #[doc(hidden)]
    pub fn load(
        path: &Path,
        choice: &MaterialChoice,
        otherwise: Material,
    ) -> Result<Self, MaterialError> {
        let appearance = Appearance::load(path)?;
        if let Some(name) = choice.by_name.keys().find(|name| !appearance.names.contains(name)) {
            let (path, name) = (path.to_owned(), name.clone());
            return Err(MaterialError::UnknownName { path, name, known: appearance.names });
        }
        let from_mtl = choice.colours == Some(ColourSource::Mtl);
        let mut warnings = vec![];
        let known = if from_mtl {
            read_libraries(path, &appearance.libraries, &mut warnings)?
        } else {
            vec![]
        };
        let mut materials =
            Self { even: vec![otherwise], textures: vec![], of_triangle: vec![], warnings };
        let mut named = Vec::new();
        for name in &appearance.names {
            let (own, colour) = (choice.by_name.get(name), known.iter().find(|c| c.name == *name));
            if from_mtl && own.is_none() && colour.is_none() {
                let warning = format!("material {name} is not in its MTL files");
                materials.warnings.push(warning);
            }
            named.push(materials.add(own, colour)?);
        }
        let from_vertices = choice.colours == Some(ColourSource::Vertices);
        let missing = match choice.colours {
            Some(ColourSource::Mtl) if appearance.names.is_empty() => Some("materials (usemtl)"),
            Some(ColourSource::Vertices) if appearance.colours.iter().all(Option::is_none) => {
                Some("colours of vertices (v x y z red green blue)")
            }
            _ => None,
        };
        materials.warnings.extend(missing.map(|missing| {
            let all = otherwise.reflectivity;
            format!("expected {missing}, found none: all faces have the reflectivity {all}")
        }));
        for (triangle, material) in appearance.materials.iter().enumerate() {
            let paint = match material.map(|place| &named[place as usize]) {
                Some(Named::Even(place)) => Paint::Even(*place),
                Some(Named::Textured(place, colour)) => {
                    Paint::Textured(*place, corners_in_image(&appearance, triangle, colour)?)
                }
                _ if from_vertices => painted(path, &appearance, triangle)?,
                _ => Paint::Even(0),
            };
            materials.of_triangle.push(paint);
        }
        Ok(materials)
    }

    /// Adds the material of a name: its `own`, or else its `colour`.
    fn add<'a>(
        &mut self,
        own: Option<&Material>,
        colour: Option<&'a Colour>,
    ) -> Result<Named<'a>, MaterialError> {
        let material = match (own, colour) {
            (Some(material), _) => *material,
            (None, None) => return Ok(Named::Nothing),
            (None, Some(colour)) => match &colour.image {
                Some(map) => {
                    let kd = colour.diffuse.unwrap_or([1.0; 3]);
                    let failed = |cause| unfit(colour, format!("{}: {cause}", map.image.display()));
                    let texture = Texture::load(map, |srgb| tinted(srgb, kd)).map_err(failed)?;
                    if map.is_turbulent {
                        let cause = "map_Kd -t: turbulence is not applied";
                        self.warnings.push(format!("material {}: {cause}", colour.name));
                    }
                    self.textures.push(texture);
                    return Ok(Named::Textured(self.textures.len() as u32 - 1, colour));
                }
                None => {
                    let missing = || unfit(colour, "expected a colour Kd, found none".to_owned());
                    Material::diffuse(luminance(colour.diffuse.ok_or_else(missing)?))
                }
            },
        };
        self.even.push(material);
        Ok(Named::Even(self.even.len() as u32 - 1))
    }

    /// Surfaces that scatter: a reflectivity and the number of triangles in a row that have it.
    pub(crate) fn of_runs(runs: &[(f64, usize)]) -> Self {
        let even = runs.iter().map(|(reflectivity, _)| Material::diffuse(*reflectivity)).collect();
        let runs = runs.iter().zip(0..);
        let of_triangle =
            runs.flat_map(|((_, n), place)| std::iter::repeat_n(Paint::Even(place), *n)).collect();
        Self { even, textures: vec![], of_triangle, warnings: vec![] }
    }

    pub(crate) fn len(&self) -> usize {
        self.of_triangle.len()
    }

    /// The material of triangle `index` at a point; `barycentric` is called only if it matters.
    #[must_use]
    #[doc(hidden)]
    pub fn at(&self, index: u32, barycentric: impl FnOnce() -> DVec3) -> Material {
        match self.of_triangle[index as usize] {
            Paint::Even(place) => self.even[place as usize],
            Paint::Corners(corners) => {
                let reflectivity = DVec3::from_array(corners.map(f64::from)).dot(barycentric());
                Material::diffuse(reflectivity.clamp(0.0, 1.0))
            }
            Paint::Textured(place, corners) => {
                let share = barycentric().to_array();
                let [u, v] = [0, 1].map(|axis| {
                    corners.iter().zip(share).map(|(at, share)| f64::from(at[axis]) * share).sum()
                });
                Material::diffuse(self.textures[place as usize].at(u, v).clamp(0.0, 1.0))
            }
        }
    }
}

enum Named<'a> {
    Nothing,
    Even(u32),
    Textured(u32, &'a Colour),
}

/// Reads the MTL files that the lines `mtllib` name, of which some may be missing.
fn read_libraries(
    path: &Path,
    lines: &[String],
    warnings: &mut Vec<String>,
) -> Result<Vec<Colour>, MeshError> {
    let (mut known, mut missing) = (None::<Vec<Colour>>, None);
    for file in lines.iter().flat_map(|names| library_files(path, names)) {
        match colours(&file) {
            Ok(found) => known.get_or_insert_default().extend(found),
            Err(MeshError::Read { source, path }) if source.kind() == io::ErrorKind::NotFound => {
                let error = MeshError::Read { source, path };
                warnings.push(error.to_string());
                missing.get_or_insert(error);
            }
            Err(error) => return Err(error),
        }
    }
    match (known, missing) {
        (None, Some(error)) => Err(error),
        (known, _) => Ok(known.unwrap_or_default()),
    }
}

/// The files of a line `mtllib` of the OBJ file at `path`: one, if there is a file of this name,
/// or several, whose names end in `.mtl`.
fn library_files(path: &Path, names: &str) -> Vec<PathBuf> {
    let file = |name: &str| path.with_file_name(file_name(name.trim()));
    if file(names).is_file() {
        return vec![file(names)];
    }
    let (mut files, mut name) = (Vec::new(), String::new());
    for word in names.split_inclusive(char::is_whitespace) {
        name += word;
        if word.trim_end().to_ascii_lowercase().ends_with(".mtl") {
            files.push(file(&std::mem::take(&mut name)));
        }
    }
    files.extend((!name.is_empty()).then(|| file(&name)));
    files
}

fn unfit(colour: &Colour, cause: String) -> MaterialError {
    MaterialError::Colour { path: colour.library.clone(), name: colour.name.clone(), cause }
}

fn corners_in_image(
    appearance: &Appearance,
    triangle: usize,
    colour: &Colour,
) -> Result<[[f32; 2]; 3], MaterialError> {
    let missing = || unfit(colour, "map_Kd: a face has no texture coordinates".to_owned());
    let mut corners = [[0.0; 2]; 3];
    for (corner, index) in corners.iter_mut().zip(appearance.textures[triangle]) {
        let index = index.ok_or_else(missing)? as usize;
        *corner = appearance.texture_coordinates[index].map(|x| x as f32);
    }
    Ok(corners)
}

/// The reflectivities of the corners of a triangle by their colours, if all have one.
fn painted(path: &Path, appearance: &Appearance, triangle: usize) -> Result<Paint, MaterialError> {
    let mut corners = [0.0; 3];
    for (corner, vertex) in corners.iter_mut().zip(appearance.vertices[triangle]) {
        let Some(found) = appearance.colours[vertex as usize] else { return Ok(Paint::Even(0)) };
        if !found.iter().all(|part| (0.0..=1.0).contains(part)) {
            return Err(MaterialError::Vertex { path: path.to_owned(), vertex: vertex + 1, found });
        }
        *corner = luminance(found) as f32;
    }
    Ok(Paint::Corners(corners))
}

/// The luminance of an sRGB colour in linear light, with the weights of ITU-R BT.709.
fn luminance(srgb: [f64; 3]) -> f64 {
    tinted(srgb, [1.0; 3])
}

/// As [`luminance`], multiplied by another colour, `tint`.
fn tinted(srgb: [f64; 3], tint: [f64; 3]) -> f64 {
    let weights = [0.2126, 0.7152, 0.0722];
    let parts = srgb.iter().zip(tint).zip(weights);
    parts.map(|((&part, tint), weight)| linear(part) * linear(tint) * weight).sum::<f64>().min(1.0)
}

/// Linear light of a part of an sRGB colour: IEC 61966-2-1.
fn linear(part: f64) -> f64 {
    if part <= 0.04045 { part / 12.92 } else { libm::pow((part + 0.055) / 1.055, 2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    const OBJ: &str = "mtllib car parts.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\n\
                       usemtl body\nf 1 2 4 3\nf 1 2\nusemtl tyre # black\nf 2 4 3\n\
                       usemtl body\nf 1 4 3\n";
    const WHITE: Material = Material::diffuse(1.0);
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
        Ok((0..n)
            .map(|triangle| materials.at(triangle, || DVec3::splat(1.0 / 3.0)).reflectivity)
            .collect())
    }

    fn from(source: ColourSource) -> MaterialChoice {
        MaterialChoice { colours: Some(source), ..MaterialChoice::default() }
    }

    fn by_name(name: &str, reflectivity: f64) -> MaterialChoice {
        let by_name = [(name.to_owned(), Material::diffuse(reflectivity))].into();
        MaterialChoice { colours: None, by_name }
    }

    #[test]
    fn triangles_have_the_material_of_their_face() {
        // An sRGB value of 0.5 is 21.4 % of the light.
        let grey = luminance([0.5; 3]);
        assert!((grey - 0.214_041).abs() < 1e-6, "{grey}");
        let mtl = from(ColourSource::Mtl);
        assert_eq!(load(OBJ, MTL, &mtl).unwrap(), [0.9, grey, grey, 0.2126, grey]);
        let named = by_name("tyre", 0.02);
        assert_eq!(load(OBJ, "", &named).unwrap(), [0.9, 0.9, 0.9, 0.02, 0.9]);
        let both = MaterialChoice { by_name: named.by_name, ..mtl };
        assert_eq!(load(OBJ, MTL, &both).unwrap(), [0.9, grey, grey, 0.02, grey]);
    }

    #[test]
    fn errors_name_their_place() {
        let mtl = from(ColourSource::Mtl);
        let unread = if cfg!(feature = "textures") {
            "a.png: cannot be read: "
        } else {
            "a.png: this build reads no images"
        };
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
            ("newmtl body\nmap_Kd a.png\n", mtl.clone(), unread),
            (
                "newmtl body\nmap_Kd -q 1 a.png\n",
                mtl.clone(),
                ":2: expected an option of map_Kd, found \"-q\"",
            ),
            (
                "newmtl body\nmap_Kd -mm 1 a.png\n",
                mtl.clone(),
                ":2: expected 2 numbers after -mm, found \"a.png\"",
            ),
            (
                "newmtl body\nmap_Kd -clamp on\n",
                mtl.clone(),
                ":2: expected a file as map_Kd, found \"-clamp on\"",
            ),
            (
                "version https://git-lfs.github.com/spec/v1\n",
                mtl.clone(),
                "/car parts.mtl: expected materials, found a Git LFS pointer",
            ),
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
    fn vertices_give_their_colours_to_the_points_between_them() {
        let obj =
            "v 0 0 0 1 1 1\nv 1 0 0 0 0 0\nv 0 1 0 0.5 0.5 0.5\nv 1 1 0\nf 1 2 3\nf -3 -2 -1\n";
        let vertices = from(ColourSource::Vertices);
        let [coloured, plain] = load(obj, "", &vertices).unwrap()[..] else { panic!("two") };
        assert!((coloured - (1.0 + luminance([0.5; 3])) / 3.0).abs() < 1e-7, "{coloured}");
        assert_eq!(plain, 0.9, "a vertex without a colour");
        let error = load(&obj.replace("1 1 1", "255 1 1"), "", &vertices).unwrap_err();
        assert!(
            error.contains("/car.obj: vertex 1: expected three numbers within 0..=1"),
            "{error}"
        );
    }

    #[test]
    fn colours_that_a_mesh_lacks_are_missed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.obj");
        let warnings = |corner: &str, source| {
            fs::write(&path, format!("v 0 0 0\nv 1 0 0\n{corner}\nf 1 2 3\n")).unwrap();
            Materials::load(&path, &from(source), WHITE).unwrap().warnings
        };
        let white = "found none: all faces have the reflectivity 1";
        let materials = format!("expected materials (usemtl), {white}");
        assert_eq!(warnings("v 0 1 0 1 0 0", ColourSource::Mtl), [materials]);
        let colours = format!("expected colours of vertices (v x y z red green blue), {white}");
        assert_eq!(warnings("v 0 1 0", ColourSource::Vertices), [colours]);
        assert!(warnings("v 0 1 0 1 0 0", ColourSource::Vertices).is_empty());
    }

    #[test]
    fn some_libraries_may_be_missing() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str| folder.path().join(name);
        fs::write(file("a b.mtl"), "\u{FEFF}newmtl body\rKd 1 1 1\r").unwrap();
        let absent = format!("{}: cannot be read: ", file("other.mtl").display());
        for (names, expected) in [
            ("a b.mtl other.mtl", vec![&*absent, "material tyre is not in its MTL files"]),
            ("other.mtl\t.\\a b.mtl", vec![&absent, "material tyre is not in its MTL files"]),
            (".\\a b.mtl", vec!["material tyre is not in its MTL files"]),
        ] {
            fs::write(file("a.obj"), OBJ.replace("car parts.mtl", names)).unwrap();
            let otherwise = Material::diffuse(0.9);
            let all = Materials::load(&file("a.obj"), &from(ColourSource::Mtl), otherwise).unwrap();
            let found = [1, 3].map(|triangle| all.at(triangle, || DVec3::ZERO).reflectivity);
            assert_eq!(found, [1.0, 0.9], "{names}");
            assert_eq!(all.warnings.len(), expected.len(), "{:?}", all.warnings);
            let begins = all.warnings.iter().zip(expected).all(|(w, start)| w.starts_with(start));
            assert!(begins, "{:?}", all.warnings);
        }
        fs::write(file("a.obj"), OBJ.replace("car parts.mtl", "c.mtl d.mtl")).unwrap();
        let error = Materials::load(&file("a.obj"), &from(ColourSource::Mtl), WHITE).unwrap_err();
        assert!(error.to_string().contains("c.mtl: cannot be read"), "{error}");
    }

    #[cfg(feature = "textures")]
    #[test]
    fn an_image_colours_the_faces_of_its_material() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str| folder.path().join(name);
        // Black on the left, white on the right.
        let pixels = image::GrayImage::from_raw(2, 1, vec![0, 255]).unwrap();
        fs::create_dir(file("in")).unwrap();
        for name in ["stripes.png", "in/my stripes.png", "stripes.bmp", "stripes.tga"] {
            image::DynamicImage::from(pixels.clone()).to_rgb8().save(file(name)).unwrap();
        }
        let corners = "vt 0.25 0.5\nvt 0.75 0.5\nvt 1.25 0.5\n";
        let obj =
            format!("mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n{corners}usemtl a\nf 1/1 2/2 3/3\n");
        fs::write(file("a.obj"), &obj).unwrap();
        let load = |map: &str| {
            fs::write(file("m.mtl"), format!("newmtl a\nKd 1 0 0\nmap_Kd {map}\n")).unwrap();
            Materials::load(&file("a.obj"), &from(ColourSource::Mtl), WHITE)
        };
        // The red part of white, and of a grey of 0.5.
        let (red, grey) = (0.2126, 0.2126 * linear(0.5));
        let others = "-blendu on -blendv off -bm 1 -boost 2 -cc on -clamp off -imfchan l -o 0 -s 1 1 \
                      -t 0 0 0 -texres 64 -type sphere stripes.png";
        for (map, expected) in [
            ("stripes.png", [0.0, red, 0.0, 0.5 * red]),
            (others, [0.0, red, 0.0, 0.5 * red]),
            ("in\\my stripes.png", [0.0, red, 0.0, 0.5 * red]),
            ("stripes.bmp", [0.0, red, 0.0, 0.5 * red]),
            ("stripes.tga", [0.0, red, 0.0, 0.5 * red]),
            // u becomes 2 u + 0.25: 0.75, 1.75, 2.75 and 1.25.
            ("-s 2 1 1 -o 0.25 0 stripes.png", [red, red, red, 0.0]),
            ("-o 0.5 stripes.png", [red, 0.0, red, 0.5 * red]),
            ("-clamp on stripes.png", [0.0, red, red, 0.5 * red]),
            ("-mm 0.5 0.5 stripes.png", [grey, red, grey, 0.5 * (red + grey)]),
            ("-mm 0 2 stripes.png", [0.0, red, 0.0, 0.5 * red]),
        ] {
            let all = load(map).unwrap();
            assert_eq!(all.warnings, Vec::<String>::new());
            let places = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(0.5, 0.5, 0.0)];
            let found = places.map(|place| all.at(0, || place).reflectivity);
            for (found, expected) in found.iter().zip(expected) {
                assert!((found - expected).abs() < 1e-7, "{map}: {found}, not {expected}");
            }
        }
        let turbulent = load("-t 0.1 stripes.png").unwrap();
        assert_eq!(turbulent.warnings, ["material a: map_Kd -t: turbulence is not applied"]);
        fs::write(file("a.obj"), obj.replace("1/1", "1")).unwrap();
        let error = load("stripes.png").unwrap_err();
        assert!(error.to_string().ends_with("a face has no texture coordinates"), "{error}");
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
