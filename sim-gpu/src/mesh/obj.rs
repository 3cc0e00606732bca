//! Wavefront OBJ, through the crate tobj.
//!
//! tobj sees positions and faces only: groups, materials, normals and texture
//! coordinates have no part in where a beam ends, and yet would split the mesh
//! into models of their own vertices, or fail it. The lines keep their numbers
//! on the way, so that an error can name its line.

use std::io::{BufRead, BufReader};

use glam::DVec3;
use tobj::{LoadError, LoadOptions};

use super::Mesh;
use super::error::{Malformed, ParseError, excerpt};
use super::line_feeder::LineFeeder;
use super::load::Parsed;

/// Reads an OBJ file from its bytes.
///
/// All objects become one mesh; it has the vertices that faces name, in the
/// order in which they are first named. Polygons become fans around their
/// first corner; faces of fewer than three corners are dropped and counted.
pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, ParseError> {
    let geometry = Geometry::of(bytes)?;
    let options = LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..LoadOptions::default()
    };
    let mut feeder = LineFeeder::new(&geometry.text);
    let no_materials = |_: &std::path::Path| Err(LoadError::OpenFileFailed);
    let models = tobj::load_obj_buf(&mut BufReader::new(&mut feeder), &options, no_materials);
    let models = match models {
        Ok((models, _)) => models,
        Err(error) => return Err(geometry.blame(error, feeder.line())),
    };
    let mut parsed = Parsed { dropped_faces: geometry.dropped_faces, ..Parsed::default() };
    for model in models {
        append(&mut parsed.mesh, &model.mesh);
    }
    Ok(parsed)
}

fn append(mesh: &mut Mesh, model: &tobj::Mesh) {
    let base = mesh.vertices.len() as u32;
    mesh.vertices.extend(model.positions.as_chunks().0.iter().copied().map(DVec3::from_array));
    let corners = model.indices.as_chunks::<3>().0;
    mesh.triangles.extend(corners.iter().map(|corners| corners.map(|index| base + index)));
}

/// The positions and faces of an OBJ file, each on the line it came from.
struct Geometry {
    text: Vec<u8>,
    n_vertices: u64,
    dropped_faces: usize,
}

impl Geometry {
    fn of(bytes: &[u8]) -> Result<Self, ParseError> {
        let mut geometry =
            Self { text: Vec::with_capacity(bytes.len()), n_vertices: 0, dropped_faces: 0 };
        let mut lines = bytes.split(|&byte| byte == b'\n').enumerate();
        while let Some((number, line)) = lines.next() {
            let mut line = line.trim_ascii_end();
            let mut joined = Vec::new();
            let mut n_lines = 1;
            // A backslash at its end continues a line on the next one.
            while let Some(head) = line.strip_suffix(b"\\").filter(|_| !line.starts_with(b"#")) {
                joined.extend_from_slice(head);
                joined.push(b' ');
                line = lines.next().map_or(b"", |(_, line)| line.trim_ascii_end());
                n_lines += 1;
            }
            if !joined.is_empty() {
                joined.extend_from_slice(line);
                line = &joined;
            }
            geometry.add(line).map_err(|cause| cause.at(number + 1))?;
            geometry.text.resize(geometry.text.len() + n_lines, b'\n');
        }
        Ok(geometry)
    }

    fn add(&mut self, line: &[u8]) -> Result<(), Malformed> {
        let data = line.split(|&byte| byte == b'#').next().unwrap_or_default();
        let mut words = data.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        match words.next() {
            Some(b"v") => self.add_position(&words.collect::<Vec<_>>()),
            Some(b"f") => {
                self.add_face(words);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// x, y, z and, if nothing but it follows, the weight; colours are left out.
    fn add_position(&mut self, words: &[&[u8]]) -> Result<(), Malformed> {
        self.n_vertices += 1;
        let kept = if words.len() == 4 { words } else { &words[..words.len().min(3)] };
        self.text.push(b'v');
        for word in kept {
            // tobj takes words such as "nan" for numbers.
            if word.iter().any(|byte| matches!(byte, b'n' | b'N')) {
                return Err(Malformed::NotFinite { found: excerpt(word) });
            }
            self.text.push(b' ');
            self.text.extend_from_slice(word);
        }
        Ok(())
    }

    /// The indices into the positions: what stands before a slash.
    fn add_face<'a>(&mut self, words: impl Iterator<Item = &'a [u8]>) {
        let start = self.text.len();
        self.text.push(b'f');
        let mut n_corners = 0;
        for word in words {
            self.text.push(b' ');
            let position = word.split(|&byte| byte == b'/').next().unwrap_or_default();
            // An empty index would change the corner count in silence.
            self.text.extend_from_slice(if position.is_empty() { b"/" } else { position });
            n_corners += 1;
        }
        if n_corners < 3 {
            self.text.truncate(start);
            self.dropped_faces += 1;
        }
    }

    /// tobj's error in our words, with the line it is about: `last_line`,
    /// unless tobj finds out only after the last line.
    fn blame(&self, error: LoadError, last_line: usize) -> ParseError {
        match error {
            LoadError::FaceVertexOutOfBounds => self.first_out_of_range(),
            _ => {
                let line = self.text.split(|&byte| byte == b'\n').nth(last_line - 1);
                let line = excerpt(line.unwrap_or_default());
                Malformed::Syntax(format!("{error} in {line:?}")).at(last_line)
            }
        }
    }

    /// The first face with an index that is 0, or beyond the positions (all of
    /// the file for one counted from the start, those above it for one counted
    /// backwards).
    fn first_out_of_range(&self) -> ParseError {
        let mut above = 0;
        for (number, line) in self.text.lines().map_while(Result::ok).enumerate() {
            above += i128::from(line.starts_with('v'));
            for word in line.split(' ').skip(1).filter(|_| line.starts_with('f')) {
                let index: i128 = word.parse().unwrap_or_default();
                let n_vertices = i128::from(self.n_vertices);
                if index == 0 || index > n_vertices || -index > above {
                    let cause = Malformed::IndexOutOfRange {
                        found: word.to_owned(),
                        n_vertices: self.n_vertices,
                    };
                    return cause.at(number + 1);
                }
            }
        }
        Malformed::Syntax(LoadError::FaceVertexOutOfBounds.to_string()).into()
    }
}
