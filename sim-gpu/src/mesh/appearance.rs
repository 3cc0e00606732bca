//! The colours of an OBJ file and its MTL files.
//!
//! The geometry is read without them ([`super::load()`]); this is a second pass, if materials are
//! requested.

use std::path::{Path, PathBuf};

use formats::foreign::foreign;

use super::error::{Malformed, MeshError, ParseError};
use super::file::read;
use super::format::MeshFormat;
use super::obj::{self, for_each_line, index, words};
use super::polygon::fan;
use super::tokens::without_mark;
use super::triangle_mesh::recut;

#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Appearance {
    /// The rests of the lines `mtllib`, each of which names one or more MTL files.
    pub libraries: Vec<String>,
    /// The names of the materials, in the order of their first use.
    pub names: Vec<String>,
    /// The index of the material's name, by triangle of the mesh.
    pub materials: Vec<Option<u32>>,
    /// The vertices of the file at the corners, by triangle.
    pub vertices: Vec<[u32; 3]>,
    /// The indices of texture coordinates at the corners, by triangle.
    pub textures: Vec<[Option<u32>; 3]>,
    /// The colour of each vertex of the file, if any: red, green and blue, sRGB.
    pub colours: Vec<Option<[f64; 3]>>,
    /// `vt`: coordinates from the lower left corner of an image, whose sides are 1.
    pub texture_coordinates: Vec<[f64; 2]>,
    current: Option<u32>,
}

/// A material of an MTL file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Colour {
    pub name: String,
    pub library: PathBuf,
    /// `Kd`: red, green and blue, sRGB, 0 to 1.
    pub diffuse: Option<[f64; 3]>,
    /// `map_Kd`: the image of its colours.
    pub image: Option<ColourMap>,
}

/// An image of colours, and how it lies on the surface.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ColourMap {
    pub image: PathBuf,
    /// `-s`: texture coordinates are multiplied by it.
    pub scale: [f64; 2],
    /// `-o`: it is then added to texture coordinates.
    pub offset: [f64; 2],
    /// `-mm`: a part x of a colour, 0 to 1, becomes base + gain x.
    pub base: f64,
    pub gain: f64,
    /// `-clamp on`: the image does not repeat.
    pub is_clamped: bool,
    /// `-t`: the coordinates are disturbed at random, which is not done.
    pub is_turbulent: bool,
}

impl ColourMap {
    /// An image as it is.
    pub fn of(image: PathBuf) -> Self {
        let (scale, offset, base, gain) = ([1.0; 2], [0.0; 2], 0.0, 1.0);
        Self { image, scale, offset, base, gain, is_clamped: false, is_turbulent: false }
    }
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
        let mut found = Self::default();
        let mut parsed = obj::read(without_mark(bytes), |key, rest| found.add(key, rest))?;
        parsed.cut_polygons(|triangles, cuts| recut(&mut found.textures[triangles], cuts));
        found.vertices = parsed.mesh.triangles;
        Ok(found)
    }

    fn add(&mut self, key: &[u8], rest: &[u8]) -> Result<(), Malformed> {
        match key {
            b"mtllib" => self.libraries.push(text(rest)),
            b"usemtl" => self.current = Some(self.place_of(text(rest))),
            b"v" => self.colours.push(colour_of(rest)),
            b"vt" => self.texture_coordinates.push(texture_coordinate(rest)?),
            b"f" => {
                let textures = words(rest).map(|word| self.texture(word));
                let textures: Vec<_> = textures.collect::<Result<_, _>>()?;
                self.textures.extend(fan(&textures));
                self.materials.resize(self.textures.len(), self.current);
            }
            _ => {}
        }
        Ok(())
    }

    fn place_of(&mut self, name: String) -> u32 {
        let place = self.names.iter().position(|known| *known == name).unwrap_or_else(|| {
            self.names.push(name);
            self.names.len() - 1
        });
        place as u32
    }

    /// The index of the texture coordinates of a corner, if it has some.
    fn texture(&self, corner: &[u8]) -> Result<Option<u32>, Malformed> {
        let word = corner.split(|&byte| byte == b'/').nth(1).filter(|word| !word.is_empty());
        let n = self.texture_coordinates.len();
        let outside = |word| Malformed::expected(&format!("an index of 1..={n} vt"), word);
        word.map(|word| index(word, n, n)?.ok_or_else(|| outside(word))).transpose()
    }
}

/// The materials in the MTL file at `path`.
pub(crate) fn colours(path: &Path) -> Result<Vec<Colour>, MeshError> {
    parse_colours(&read(path)?, path).map_err(malformed(path))
}

fn parse_colours(bytes: &[u8], library: &Path) -> Result<Vec<Colour>, ParseError> {
    if let Some(found) = foreign(bytes) {
        return Err(Malformed::Syntax(format!("expected materials, found {found}")).into());
    }
    let mut colours: Vec<Colour> = Vec::new();
    for_each_line(without_mark(bytes), |key, value| {
        match (key, colours.last_mut()) {
            (b"newmtl", _) => {
                let (name, library) = (text(value), library.to_owned());
                colours.push(Colour { name, library, diffuse: None, image: None });
            }
            (b"Kd", Some(colour)) => colour.diffuse = Some(srgb(value)?),
            (b"map_Kd", Some(colour)) => colour.image = Some(colour_map(value, library)?),
            (b"Kd" | b"map_Kd", None) => {
                return Err(Malformed::expected("newmtl and a name before it", key));
            }
            _ => {}
        }
        Ok(())
    })?;
    Ok(colours)
}

/// Reads the options and the file of `map_Kd`, as the specification of MTL lists them.
fn colour_map(value: &[u8], library: &Path) -> Result<ColourMap, Malformed> {
    let mut map = ColourMap::of(PathBuf::new());
    let mut rest = value;
    while rest.starts_with(b"-") {
        let option = next_word(&mut rest);
        // Of three numbers, the last two may be missing.
        let (least, most) = match option {
            b"-s" | b"-o" | b"-t" => (1, 3),
            b"-mm" => (2, 2),
            b"-bm" | b"-boost" | b"-texres" => (1, 1),
            b"-blendu" | b"-blendv" | b"-cc" | b"-clamp" | b"-imfchan" | b"-type" => (0, 0),
            _ => return Err(Malformed::expected("an option of map_Kd", option)),
        };
        let mut given = Vec::new();
        while given.len() < most {
            let mut after = rest;
            let number =
                numbers(next_word(&mut after)).and_then(|numbers| numbers.first().copied());
            let Some(number) = number else { break };
            given.push(number);
            rest = after;
        }
        let pair = |missing: f64| [given[0], *given.get(1).unwrap_or(&missing)];
        match option {
            _ if given.len() < least => {
                let expected = format!("{least} numbers after {}", text(option));
                return Err(Malformed::expected(&expected, rest));
            }
            b"-s" => map.scale = pair(1.0),
            b"-o" => map.offset = pair(0.0),
            b"-mm" => [map.base, map.gain] = pair(1.0),
            b"-t" => map.is_turbulent = given.iter().any(|number| *number != 0.0),
            b"-clamp" => map.is_clamped = next_word(&mut rest) == b"on",
            // The others say how to filter the image, or are for other maps.
            _ if most == 0 => drop(next_word(&mut rest)),
            _ => {}
        }
    }
    if rest.is_empty() {
        return Err(Malformed::expected("a file as map_Kd", value));
    }
    map.image = library.with_file_name(file_name(&text(rest)));
    Ok(map)
}

/// The path of a file by its name in another file, where Windows has backslashes.
pub(crate) fn file_name(name: &str) -> PathBuf {
    name.replace('\\', "/").into()
}

/// Takes the first word of a line, which begins with one, and the blanks after it.
fn next_word<'a>(line: &mut &'a [u8]) -> &'a [u8] {
    let end = line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len());
    let (word, rest) = line.split_at(end);
    *line = rest.trim_ascii_start();
    word
}

fn malformed(path: &Path) -> impl Fn(ParseError) -> MeshError {
    |ParseError { line, cause }| MeshError::Malformed { path: path.into(), line, cause }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_keep_their_textures_and_materials_when_a_polygon_is_cut() {
        let obj = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 2 1 0\nv 0 4 0\nvt 9\nvt 0\nvt 1\nvt 2\nvt 3\nvt 4\n\
                   f 1 2 3\nusemtl a\nf 1/2 2/3 3/4 4/5 5/6\n";
        let found = Appearance::parse(obj.as_bytes()).unwrap();
        assert_eq!(found.materials, [None, Some(0), Some(0), Some(0)]);
        assert_eq!(found.textures[0], [None; 3]);
        assert_ne!(found.vertices[1..], [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
        for (vertices, textures) in found.vertices.iter().zip(&found.textures).skip(1) {
            assert_eq!(*textures, vertices.map(|vertex| Some(vertex + 1)));
        }
    }
}
