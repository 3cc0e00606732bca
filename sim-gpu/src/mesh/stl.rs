//! STL, binary and ASCII, through the crate stl_io.
//!
//! Its corners carry no indices; those of equal position become one vertex.

use std::io::{Cursor, Read, Seek};

use glam::DVec3;

use super::error::{Malformed, ParseError, Part, excerpt};
use super::line_feeder::LineFeeder;
use super::triangle_mesh::{Mesh, Parsed};

/// Binary STL: 80 bytes of any text, the number of triangles (u32), and for
/// each triangle twelve f32 and a u16. Little-endian throughout.
const HEADER: usize = 80;
const PREFIX: usize = HEADER + 4;
const TRIANGLE: usize = 50;

/// Reads an STL file from its bytes.
pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, ParseError> {
    let begins_solid = begins_with_word(bytes, b"solid");
    let promised = bytes.as_chunks::<4>().0.get(HEADER / 4).copied().map(u32::from_le_bytes);
    let whole = promised.is_some_and(|promised| binary_length(promised) == bytes.len() as u64);
    let binary = whole || !begins_solid || bytes[..bytes.len().min(PREFIX)].contains(&0);
    if !binary {
        return parse_ascii(bytes);
    }
    let Some(promised) = promised else {
        let found = excerpt(&bytes[..bytes.len().min(16)]);
        return Err(Malformed::WrongStart { format: "an STL file", found }.into());
    };
    if binary_length(promised) > bytes.len() as u64 {
        let held = ((bytes.len() - PREFIX) / TRIANGLE) as u64;
        let promised = u64::from(promised);
        return Err(Malformed::Truncated { part: Part::Faces, held, promised }.into());
    }
    // stl_io takes any file that begins with "solid" for ASCII, though some
    // programs begin the header of their binary files so.
    let mut content = bytes.to_vec();
    content[..HEADER].fill(0);
    Ok(read(&mut Cursor::new(content)).map_err(syntax)?)
}

fn binary_length(n_triangles: u32) -> u64 {
    PREFIX as u64 + TRIANGLE as u64 * u64::from(n_triangles)
}

fn parse_ascii(bytes: &[u8]) -> Result<Parsed, ParseError> {
    let text = one_solid(bytes);
    let mut feeder = LineFeeder::new(&text);
    let parsed = read(&mut feeder);
    parsed.map_err(|error| syntax(error).at(feeder.line()))
}

/// The text as stl_io reads it: in lower case, with all solids in one, its
/// name replaced, each line in its place.
fn one_solid(bytes: &[u8]) -> Vec<u8> {
    let mut text = Vec::with_capacity(bytes.len() + 64);
    let mut is_open = false;
    text.extend_from_slice(b"solid mesh");
    for line in bytes.split(|&byte| byte == b'\n') {
        let is_start = begins_with_word(line, b"solid");
        let is_end = begins_with_word(line, b"endsolid");
        is_open = (is_open || is_start) && !is_end;
        if !is_start && !is_end {
            text.extend(line.iter().map(u8::to_ascii_lowercase));
        }
        text.push(b'\n');
    }
    if !is_open {
        text.extend_from_slice(b"endsolid");
    }
    text
}

fn begins_with_word(line: &[u8], word: &[u8]) -> bool {
    let line = line.trim_ascii_start();
    line.get(..word.len()).is_some_and(|head| head.eq_ignore_ascii_case(word))
        && line.get(word.len()).is_none_or(u8::is_ascii_whitespace)
}

fn read<R: Read + Seek>(source: &mut R) -> std::io::Result<Parsed> {
    let indexed = stl_io::create_stl_reader(source)?.as_indexed_triangles()?;
    let vertices =
        indexed.vertices.iter().map(|vertex| DVec3::from_array(vertex.0.map(f64::from))).collect();
    let triangles =
        indexed.faces.iter().map(|face| face.vertices.map(|index| index as u32)).collect();
    Ok(Parsed { mesh: Mesh { vertices, triangles }, dropped_faces: 0 })
}

fn syntax(error: std::io::Error) -> Malformed {
    Malformed::Syntax(error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    const FACET: &str = "facet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 1 0 0\n  \
                         vertex 0 1 0\n endloop\nendfacet\n";

    fn binary(header: &[u8], promised: u32, triangles: &[[[f32; 3]; 3]]) -> Vec<u8> {
        let mut bytes = header.to_vec();
        bytes.resize(HEADER, b' ');
        bytes.extend(promised.to_le_bytes());
        for corners in triangles {
            let normal = [0.0; 3];
            let numbers = [&normal, &corners[0], &corners[1], &corners[2]].into_iter().flatten();
            bytes.extend(numbers.flat_map(|number| number.to_le_bytes()));
            bytes.extend([0; 2]);
        }
        bytes
    }

    const TRIANGLE: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    #[track_caller]
    fn is_the_triangle(bytes: &[u8]) {
        let mesh = parse(bytes).unwrap().mesh;
        assert_eq!(mesh.vertices, [DVec3::ZERO, DVec3::X, DVec3::Y]);
        assert_eq!(mesh.triangles, [[0, 1, 2]]);
    }

    #[track_caller]
    fn fails(bytes: &[u8], message: &str) {
        let error = parse(bytes).expect_err(message).to_string();
        assert!(error.starts_with(message), "{error}");
    }

    #[test]
    fn text_is_read_whatever_its_name_case_and_line_ends() {
        for name in [" mesh", "", " two words", " caf\u{e9}"] {
            is_the_triangle(format!("solid{name}\n{FACET}endsolid{name}\n").as_bytes());
        }
        is_the_triangle(format!("SOLID A\r\n{}ENDSOLID A", FACET.to_uppercase()).as_bytes());
    }

    #[test]
    fn all_solids_of_a_text_are_read() {
        let second = FACET.replace("0 1 0", "0 0 1");
        let text = format!("solid a\n{FACET}endsolid a\nsolid b\n{second}endsolid b\n");
        let mesh = parse(text.as_bytes()).unwrap().mesh;
        assert_eq!(mesh.vertices, [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z]);
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 1, 3]]);
    }

    #[test]
    fn a_binary_file_is_known_by_its_length_whatever_it_begins_with() {
        is_the_triangle(&binary(b"made by a program", 1, &[TRIANGLE]));
        is_the_triangle(&binary(b"solid made by another", 1, &[TRIANGLE]));
    }

    #[test]
    fn equal_positions_become_one_vertex() {
        let second = [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]];
        let mesh = parse(&binary(b"", 2, &[TRIANGLE, second])).unwrap().mesh;
        assert_eq!(mesh.vertices.len(), 4);
        assert_eq!(mesh.triangles, [[0, 1, 2], [2, 1, 3]]);
    }

    #[test]
    fn a_promise_of_billions_is_checked_against_the_file() {
        let message = "truncated: the header promises 4294967295 faces, the file holds 1";
        fails(&binary(b"", u32::MAX, &[TRIANGLE]), message);
        let message = "truncated: the header promises 2 faces, the file holds 1";
        fails(&binary(b"solid\0", 2, &[TRIANGLE]), message);
    }

    #[test]
    fn errors_name_their_cause_and_in_text_their_line() {
        fails(b"OFF\n", "not an STL file: it begins with \"OFF \"");
        let text = format!("solid a\n{FACET}endsolid a\n");
        fails(text.replace("1 0 0", "1 0 x").as_bytes(), "line 5: ");
        fails(text.replace("1 0 0", "1 nan 0").as_bytes(), "line 5: ");
        fails(&text.as_bytes()[..text.len() - 11], "line 9: EOF while expecting facet");
        fails(&text.as_bytes()[..60], "line 5: ");
    }
}
