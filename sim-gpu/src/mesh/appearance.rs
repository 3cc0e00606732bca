//! The colours of an OBJ file and its MTL files.
//!
//! The geometry is read without them ([`super::load()`]); this is a second pass, if materials are
//! requested. (tobj's own reader of MTL panics if a colour lacks a number.)

use std::path::{Path, PathBuf};

use super::error::{Malformed, MeshError, ParseError};
use super::format::MeshFormat;
use super::load::read;
use super::obj::{data, for_each_line, words};

#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Appearance {
    /// The MTL files, as the OBJ file names them.
    pub libraries: Vec<String>,
    /// The names of the materials, in the order of their first use.
    pub names: Vec<String>,
    /// By triangle of the mesh.
    pub triangles: Vec<Face>,
    /// The colour of each vertex of the file, if any: red, green and blue, sRGB.
    pub colours: Vec<Option<[f64; 3]>>,
    /// `vt`: coordinates from the lower left corner of an image, whose sides are 1.
    pub texture_coordinates: Vec<[f64; 2]>,
}

/// The colouring of one triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Face {
    /// The index of its material's name.
    pub material: Option<u32>,
    pub vertices: [u32; 3],
    pub texture: Option<[u32; 3]>,
}

/// A material of an MTL file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Colour {
    pub name: String,
    pub library: PathBuf,
    /// `Kd`: red, green and blue, sRGB, 0 to 1.
    pub diffuse: Option<[f64; 3]>,
    /// `map_Kd`: the image of its colours.
    pub image: Option<PathBuf>,
}

impl Appearance {
    pub fn load(path: &Path) -> Result<Self, MeshError> {
        if MeshFormat::from_path(path) != Some(MeshFormat::Obj) {
            let cause = "expected an OBJ file, whose faces have colours, found another format";
            return Err(malformed(path)(Malformed::Syntax(cause.to_owned()).into()));
        }
        Self::parse(&read(path)?).map_err(malformed(path))
    }

    fn parse(bytes: &[u8]) -> Result<Self, ParseError> {
        let (mut found, mut current) = (Self::default(), None);
        for_each_line(bytes, |number, line, _| {
            match keyed(line) {
                (b"mtllib", library) => found.libraries.push(text(library)),
                (b"usemtl", name) => current = Some(found.place_of(text(name))),
                (b"v", position) => found.colours.push(colour_of(position)),
                (b"vt", at) => {
                    let at = texture_coordinate(at).map_err(|cause| cause.at(number))?;
                    found.texture_coordinates.push(at);
                }
                (b"f", corners) => {
                    found.add_face(corners, current).map_err(|cause| cause.at(number))?;
                }
                _ => {}
            }
            Ok(())
        })?;
        Ok(found)
    }

    fn place_of(&mut self, name: String) -> u32 {
        let place = self.names.iter().position(|known| *known == name).unwrap_or_else(|| {
            self.names.push(name);
            self.names.len() - 1
        });
        place as u32
    }

    /// Appends a face as the reader of the geometry does: as a fan around its first corner.
    fn add_face(&mut self, corners: &[u8], material: Option<u32>) -> Result<(), Malformed> {
        let (mut vertices, mut textures) = (Vec::new(), Vec::new());
        for corner in words(corners) {
            let mut parts = corner.split(|&byte| byte == b'/');
            let vertex = parts.next().unwrap_or_default();
            vertices.push(index(vertex, self.colours.len())?);
            if let Some(texture) = parts.next().filter(|part| !part.is_empty()) {
                textures.push(index(texture, self.texture_coordinates.len())?);
            }
        }
        let has_texture = textures.len() == vertices.len();
        self.triangles.extend((2..vertices.len()).map(|i| Face {
            material,
            vertices: [vertices[0], vertices[i - 1], vertices[i]],
            texture: has_texture.then(|| [textures[0], textures[i - 1], textures[i]]),
        }));
        Ok(())
    }
}

/// The materials in the MTL file at `path`.
pub(crate) fn colours(path: &Path) -> Result<Vec<Colour>, MeshError> {
    parse_colours(&read(path)?, path).map_err(malformed(path))
}

fn parse_colours(bytes: &[u8], library: &Path) -> Result<Vec<Colour>, ParseError> {
    let mut colours: Vec<Colour> = Vec::new();
    for_each_line(bytes, |number, line, _| {
        let (key, value) = keyed(line);
        match (key, colours.last_mut()) {
            (b"newmtl", _) => {
                let (name, library) = (text(value), library.to_owned());
                colours.push(Colour { name, library, diffuse: None, image: None });
            }
            (b"Kd", Some(colour)) => {
                colour.diffuse = Some(srgb(value).map_err(|cause| cause.at(number))?);
            }
            (b"map_Kd", Some(colour)) => {
                if value.starts_with(b"-") {
                    return Err(
                        Malformed::expected("a file without options as map_Kd", value).at(number)
                    );
                }
                let folder = library.parent().unwrap_or(Path::new(""));
                colour.image = Some(folder.join(text(value).replace('\\', "/")));
            }
            (b"Kd" | b"map_Kd", None) => {
                let cause = Malformed::expected("newmtl and a name before it", line);
                return Err(cause.at(number));
            }
            _ => {}
        }
        Ok(())
    })?;
    Ok(colours)
}

fn malformed(path: &Path) -> impl Fn(ParseError) -> MeshError {
    |ParseError { line, cause }| MeshError::Malformed { path: path.into(), line, cause }
}

/// The first word and the rest of a line.
fn keyed(line: &[u8]) -> (&[u8], &[u8]) {
    let data = data(line).trim_ascii();
    let end = data.iter().position(u8::is_ascii_whitespace).unwrap_or(data.len());
    (&data[..end], data[end..].trim_ascii())
}

/// A name, which may hold spaces.
fn text(name: &[u8]) -> String {
    String::from_utf8_lossy(name).into_owned()
}

/// The words of a line as numbers, if all are finite.
fn numbers(value: &[u8]) -> Option<Vec<f64>> {
    let number = |word| std::str::from_utf8(word).ok()?.parse().ok();
    words(value).map(|word| number(word).filter(|x: &f64| x.is_finite())).collect()
}

/// The colour after a position, as MeshLab and others write it.
fn colour_of(position: &[u8]) -> Option<[f64; 3]> {
    match numbers(position)?[..] {
        [_, _, _, red, green, blue] => Some([red, green, blue]),
        _ => None,
    }
}

fn texture_coordinate(value: &[u8]) -> Result<[f64; 2], Malformed> {
    match numbers(value).unwrap_or_default()[..] {
        [u] => Ok([u, 0.0]),
        [u, v] | [u, v, _] => Ok([u, v]),
        _ => Err(Malformed::expected("one to three finite numbers as vt", value)),
    }
}

fn srgb(value: &[u8]) -> Result<[f64; 3], Malformed> {
    let parts = numbers(value).unwrap_or_default();
    let is_fit = parts.iter().all(|part| (0.0..=1.0).contains(part));
    match parts[..] {
        [red, green, blue] if is_fit => Ok([red, green, blue]),
        // Green and blue default to red.
        [grey] if is_fit => Ok([grey; 3]),
        _ => Err(Malformed::expected("one or three numbers within 0..=1 as Kd", value)),
    }
}

/// Converts an index of an OBJ file, from 1 or, if negative, from the end, to one from 0.
fn index(word: &[u8], n: usize) -> Result<u32, Malformed> {
    let number: Option<i64> = std::str::from_utf8(word).ok().and_then(|word| word.parse().ok());
    let found = match number {
        Some(number @ 1..) => Some(number - 1),
        Some(number @ ..=-1) => Some(number + n as i64),
        _ => None,
    };
    let fits = found.filter(|&found| (0..n as i64).contains(&found));
    fits.map(|found| found as u32)
        .ok_or_else(|| Malformed::expected(&format!("an index within 1..={n}"), word))
}
