//! Wavefront OBJ, through the crate tobj.
//!
//! tobj is given positions and faces only. Groups, materials, normals and texture coordinates do
//! not matter to a beam, but would split the mesh into several models, or make it fail. Lines keep
//! their numbers, so that errors can name them.

use std::io::{BufRead, Cursor};

use glam::DVec3;
use tobj::{LoadError, LoadOptions};

use super::error::{Malformed, ParseError, excerpt};
use super::triangle_mesh::{Parsed, TriangleMesh};

/// All objects become one mesh. It has the vertices that faces refer to, in the order of their
/// first use.
pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, ParseError> {
    let geometry = Geometry::parse(bytes)?;
    let options = LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..LoadOptions::default()
    };
    let mut text = Cursor::new(&geometry.text);
    let no_materials = |_: &std::path::Path| Err(LoadError::OpenFileFailed);
    let models = match tobj::load_obj_buf(&mut text, &options, no_materials) {
        Ok((models, _)) => models,
        Err(error) => return Err(geometry.blame(error, text.position() as usize)),
    };
    let mut parsed = Parsed { dropped_faces: geometry.dropped_faces, ..Parsed::default() };
    for model in models {
        append(&mut parsed.mesh, &model.mesh);
    }
    Ok(parsed)
}

fn append(mesh: &mut TriangleMesh, model: &tobj::Mesh) {
    let base = mesh.vertices.len() as u32;
    mesh.vertices.extend(model.positions.as_chunks().0.iter().copied().map(DVec3::from_array));
    let corners = model.indices.as_chunks::<3>().0;
    mesh.triangles.extend(corners.iter().map(|corners| corners.map(|index| base + index)));
}

/// Calls a function for each line, with its number from 1 and the number of lines of the file that
/// it takes: a backslash at the end continues a line on the next one.
pub(super) fn for_each_line(
    bytes: &[u8],
    mut take: impl FnMut(usize, &[u8], usize) -> Result<(), ParseError>,
) -> Result<(), ParseError> {
    let mut lines = bytes.split(|&byte| byte == b'\n').enumerate();
    while let Some((number, line)) = lines.next() {
        let mut line = line.trim_ascii_end();
        let mut joined = Vec::new();
        let mut n_lines = 1;
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
        take(number + 1, line, n_lines)?;
    }
    Ok(())
}

/// The part of a line before a comment.
pub(super) fn data(line: &[u8]) -> &[u8] {
    line.split(|&byte| byte == b'#').next().unwrap_or_default()
}

pub(super) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    data(line).split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

/// The positions and faces of an OBJ file as text, on their lines in the file.
struct Geometry {
    text: Vec<u8>,
    n_vertices: u64,
    dropped_faces: usize,
}

impl Geometry {
    fn parse(bytes: &[u8]) -> Result<Self, ParseError> {
        let mut geometry =
            Self { text: Vec::with_capacity(bytes.len()), n_vertices: 0, dropped_faces: 0 };
        for_each_line(bytes, |number, line, n_lines| {
            geometry.add(line).map_err(|cause| cause.at(number))?;
            geometry.text.resize(geometry.text.len() + n_lines, b'\n');
            Ok(())
        })?;
        Ok(geometry)
    }

    fn add(&mut self, line: &[u8]) -> Result<(), Malformed> {
        let mut words = words(line);
        match words.next() {
            Some(b"v") => self.add_position(&words.collect::<Vec<_>>()),
            Some(b"f") => {
                self.add_face(words);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Adds x, y, z and, if nothing else follows, the weight; not colours.
    fn add_position(&mut self, words: &[&[u8]]) -> Result<(), Malformed> {
        self.n_vertices += 1;
        let kept = if words.len() == 4 { words } else { &words[..words.len().min(3)] };
        self.text.push(b'v');
        for word in kept {
            // tobj parses words such as "nan" as numbers.
            if word.iter().any(|byte| matches!(byte, b'n' | b'N')) {
                return Err(Malformed::expected("a finite coordinate", word));
            }
            self.text.push(b' ');
            self.text.extend_from_slice(word);
        }
        Ok(())
    }

    /// Adds the indices of positions: the parts of the words before a slash.
    fn add_face<'a>(&mut self, words: impl Iterator<Item = &'a [u8]>) {
        let start = self.text.len();
        self.text.push(b'f');
        let mut n_corners = 0;
        for word in words {
            self.text.push(b' ');
            let position = word.split(|&byte| byte == b'/').next().unwrap_or_default();
            // Dropping it would silently change the number of corners.
            self.text.extend_from_slice(if position.is_empty() { b"?" } else { position });
            n_corners += 1;
        }
        if n_corners < 3 {
            self.text.truncate(start);
            self.dropped_faces += 1;
        }
    }

    /// Converts tobj's error, and finds its line: that of the last of the `n_read` bytes, except
    /// for errors that tobj detects after the last line.
    fn blame(&self, error: LoadError, n_read: usize) -> ParseError {
        match error {
            LoadError::FaceVertexOutOfBounds => self.first_out_of_range(),
            _ => {
                let lines = self.text[..n_read].split_inclusive(|&byte| byte == b'\n');
                let (line, number) = lines.zip(1..).last().unwrap_or_default();
                let line = excerpt(line.trim_ascii_end());
                Malformed::Syntax(format!("{error} in {line:?}")).at(number)
            }
        }
    }

    /// The error of the first face with an index that is 0 or out of range. Indices from the start
    /// may refer to all positions of the file, indices from the end to those before the face.
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

#[cfg(test)]
mod tests {
    use super::super::testing::{fails, is_the_triangle};
    use super::*;

    const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

    #[test]
    fn indices_count_from_either_end_and_may_have_companions() {
        is_the_triangle(parse, format!("{CORNERS}f 1 2 3\n"));
        is_the_triangle(parse, format!("{CORNERS}f -3 -2 -1\n"));
        is_the_triangle(parse, format!("{CORNERS}vt 0 0\nvn 0 0 1\nf 1/1/1 2//1 3/1\n"));
        // Invalid indices of texture coordinates and normals are ignored.
        is_the_triangle(parse, format!("{CORNERS}vt bad\nf 1/7/-9 2//8 3/-5\n"));
    }

    #[test]
    fn weights_divide_and_colours_are_ignored() {
        is_the_triangle(parse, "v 0 0 0 2\nv 2 0 0 2\nv 0 .5 0 .5\nf 1 2 3");
        is_the_triangle(parse, "v 0 0 0 1 .5 0\nv 1 0 0 1 2 3 4\nv 0 1 0 9 9\nf 1 2 3");
    }

    #[test]
    fn line_ends_comments_and_continuations_do_not_matter() {
        is_the_triangle(
            parse,
            format!("# C:\\meshes\\\n{CORNERS}f 1 2 3 # 4").replace('\n', "\r\n"),
        );
        is_the_triangle(parse, format!("{CORNERS}f 1 \\\n2 \\\r\n3\n"));
        let mut latin = b"# na\xEFve\no caf\xE9\n".to_vec();
        latin.extend_from_slice(format!("{CORNERS}f 1 2 3\n").as_bytes());
        is_the_triangle(parse, latin);
    }

    #[test]
    fn objects_groups_and_materials_share_their_vertices() {
        let text = format!(
            "mtllib none.mtl\no a\n{CORNERS}usemtl red\nf 1 2 3\ng b\nusemtl\nv 0 0 1\nf 1 3 4\n"
        );
        let mesh = parse(text.as_bytes()).unwrap().mesh;
        assert_eq!(mesh.vertices, [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z]);
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn polygons_become_fans_and_smaller_faces_are_counted() {
        let text = format!("{CORNERS}v 0 0 1\nv 1 1 1\nf 1 2 3 4 5\nf 1\nf 2 3\nl 1 2\np 1\n");
        let parsed = parse(text.as_bytes()).unwrap();
        assert_eq!(parsed.mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
        assert_eq!(parsed.dropped_faces, 2);
    }

    #[test]
    fn errors_name_their_line() {
        let bad_lines = [
            ("\nf 1 2 4\n", "line 5: index 4 is out of range: there are 3 vertices"),
            ("f 1 2 3\n\nf 1 2 0\n", "line 6: index 0 is out of range: there are 3 vertices"),
            ("f 1 2 -4\n", "line 4: index -4 is out of range: there are 3 vertices"),
            ("f 1 /2 3\n", "line 4: face parse error in \"f 1 ? 3\""),
            ("v 0 0\n", "line 4: position parse error in \"v 0 0\""),
            ("#\nv 0 x 0\n", "line 5: position parse error in \"v 0 x 0\""),
            ("v 1 1 1 0\n", "line 4: scaling (w) by zero in \"v 1 1 1 0\""),
            ("\n\nv 0 NaN 0\n", "line 6: expected a finite coordinate, found \"NaN\""),
            ("v 0 -inf 0\n", "line 4: expected a finite coordinate, found \"-inf\""),
        ];
        fails(parse, bad_lines.map(|(lines, message)| (format!("{CORNERS}{lines}"), message)));
        let too_early = "line 1: index -1 is out of range: there are 3 vertices";
        fails(parse, [(format!("f -1 -1 -1\n{CORNERS}"), too_early)]);
    }
}
