//! Wavefront OBJ: its positions and its faces. Groups, materials, normals and
//! texture coordinates have no part in where a beam ends.

use glam::DVec3;

use super::error::{Malformed, ParseError};
use super::tokens::{coordinate, integer};
use super::triangle_mesh::{Mesh, Parsed};

/// Reads an OBJ file from its bytes.
///
/// All objects become one mesh; it has the vertices that faces name, in the
/// order in which they are first named. Polygons become fans around their
/// first corner; faces of fewer than three corners are dropped and counted.
pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, ParseError> {
    let mut obj = Obj::default();
    let mut lines = bytes.split(|&byte| byte == b'\n').zip(1..);
    while let Some((line, number)) = lines.next() {
        let mut line = line.trim_ascii_end();
        let mut joined = Vec::new();
        // A backslash at its end continues a line on the next one.
        while let Some(head) = line.strip_suffix(b"\\").filter(|_| !line.starts_with(b"#")) {
            joined.extend_from_slice(head);
            joined.push(b' ');
            line = lines.next().map_or(b"", |(line, _)| line.trim_ascii_end());
        }
        if !joined.is_empty() {
            joined.extend_from_slice(line);
            line = &joined;
        }
        obj.add(line, number).map_err(|cause| cause.at(number))?;
    }
    obj.finish()
}

/// What was read so far.
#[derive(Default)]
struct Obj {
    /// Its vertices are all positions of the file.
    parsed: Parsed,
    /// Indices as written that named no position when they were read, with the
    /// line and the position they stand for: it may still follow.
    ahead: Vec<(usize, i64, i64)>,
}

impl Obj {
    fn add(&mut self, line: &[u8], number: usize) -> Result<(), Malformed> {
        let data = line.split(|&byte| byte == b'#').next().unwrap_or_default();
        let mut words = data.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        let keyword = words.next();
        let words: Vec<_> = words.collect();
        match keyword {
            Some(b"v") => self.add_position(&words),
            Some(b"f") => self.add_face(&words, number),
            _ => Ok(()),
        }
    }

    /// x, y, z and, if nothing but it follows, the weight; colours are left out.
    fn add_position(&mut self, words: &[&[u8]]) -> Result<(), Malformed> {
        let &[x, y, z, ref others @ ..] = words else {
            let cause = format!("expected 3 coordinates of a vertex, found {}", words.len());
            return Err(Malformed::Syntax(cause));
        };
        let mut position = DVec3::new(coordinate(x)?, coordinate(y)?, coordinate(z)?);
        if let [weight] = others {
            let divisor = coordinate(weight)?;
            if divisor == 0.0 {
                return Err(Malformed::expected("a weight other than 0", weight));
            }
            position /= divisor;
        }
        self.parsed.mesh.vertices.push(position);
        Ok(())
    }

    /// A corner's position is what stands before its first slash: counted from
    /// 1, or from -1 backwards.
    fn add_face(&mut self, words: &[&[u8]], line: usize) -> Result<(), Malformed> {
        let n_positions = self.parsed.mesh.vertices.len() as i64;
        let mut corners = Vec::with_capacity(words.len());
        for word in words.iter().filter(|_| words.len() >= 3) {
            let index = word.split(|&byte| byte == b'/').next().unwrap_or_default();
            let index = integer(index, "a vertex index")?;
            let position = if index < 0 { n_positions.saturating_add(index) } else { index - 1 };
            if !(0..n_positions).contains(&position) {
                self.ahead.push((line, index, position));
            }
            corners.push(position as u32);
        }
        self.parsed.add_face(&corners);
        Ok(())
    }

    /// Checks the indices against all positions, and keeps the vertices that
    /// faces name.
    fn finish(self) -> Result<Parsed, ParseError> {
        let Mesh { vertices, triangles } = self.parsed.mesh;
        let is_missing = |position: i64| !(0..vertices.len() as i64).contains(&position);
        if let Some(&(line, index, _)) = self.ahead.iter().find(|ahead| is_missing(ahead.2)) {
            let (found, n_vertices) = (index.to_string(), vertices.len() as u64);
            return Err(Malformed::IndexOutOfRange { found, n_vertices }.at(line));
        }
        let mesh = Mesh::of_named(triangles, vertices.len(), |position| vertices[position]);
        Ok(Parsed { mesh, ..self.parsed })
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
        // Companions that point nowhere have no part in a beam's way.
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
            ("f 1 /2 3\n", "line 4: expected a vertex index, found \"\""),
            ("v 0 0\n", "line 4: expected 3 coordinates of a vertex, found 2"),
            ("#\nv 0 x 0\n", "line 5: expected a finite coordinate, found \"x\""),
            ("v 1 1 1 0\n", "line 4: expected a weight other than 0, found \"0\""),
            ("\n\nv 0 NaN 0\n", "line 6: expected a finite coordinate, found \"NaN\""),
            ("v 0 -inf 0\n", "line 4: expected a finite coordinate, found \"-inf\""),
        ];
        fails(parse, bad_lines.map(|(lines, message)| (format!("{CORNERS}{lines}"), message)));
        let too_early = "line 1: index -1 is out of range: there are 3 vertices";
        fails(parse, [(format!("f -1 -1 -1\n{CORNERS}"), too_early)]);
    }
}
