//! STL, binary and ASCII.
//!
//! Corners have no indices; corners at the same position become one vertex.

use std::collections::HashMap;

use formats::plausible::Warning;
use glam::DVec3;

use super::error::{Malformed, ParseError};
use super::tokens::{lines, without_mark};
use super::triangle_mesh::Parsed;

/// Binary STL, little-endian: 80 bytes of text, the number of triangles (u32), and for each
/// triangle the normal and the corners as twelve f32, and a u16.
const HEADER: usize = 80;
const PREFIX: usize = HEADER + 4;
const TRIANGLE: usize = 50;

/// The lines of a facet in ASCII, and the number of numbers at the end of each. Normals are not
/// used, and some programs write NaN for those of triangles without area.
const FACET: [(&str, usize); 7] = [
    ("facet", 0),
    ("outer loop", 0),
    ("vertex", 3),
    ("vertex", 3),
    ("vertex", 3),
    ("endloop", 0),
    ("endfacet", 0),
];

pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, ParseError> {
    let text = without_mark(bytes);
    // Some programs write no space before the name.
    let begins_solid = begins(text, "solid");
    let promised = bytes.as_chunks::<4>().0.get(HEADER / 4).copied().map(u32::from_le_bytes);
    let whole = promised.is_some_and(|promised| binary_length(promised) == bytes.len() as u64);
    // Some programs begin the header of their binary files with "solid".
    let binary = whole || !begins_solid || bytes[..bytes.len().min(PREFIX)].contains(&0);
    if !binary {
        return parse_ascii(text);
    }
    let Some(promised) = promised else {
        return Err(Malformed::expected("an STL file", bytes).into());
    };
    let (triangles, _) = bytes[PREFIX..].as_chunks::<TRIANGLE>();
    let held = triangles.len();
    if binary_length(promised) > bytes.len() as u64 {
        let (held, promised) = (held as u64, u64::from(promised));
        return Err(Malformed::Truncated { part: "faces", held, promised }.into());
    }
    let mut corners = Corners::default();
    if held > promised as usize {
        if promised == 0 {
            let cause = format!("the header promises 0 triangles, the file holds {held}");
            return Err(Malformed::Syntax(cause).into());
        }
        let (promised, held) = (promised.into(), held as u64);
        corners.parsed.warnings.push(Warning::MoreTriangles { promised, held });
    }
    for (face, triangle) in (1..).zip(&triangles[..promised as usize]) {
        let (numbers, _) = triangle.as_chunks::<4>();
        let (positions, _) = numbers[3..].as_chunks::<3>();
        for position in positions.iter().map(|position| position.map(f32::from_le_bytes)) {
            if position.iter().any(|number| !number.is_finite()) {
                let expected = format!("face {face} of {promised}: expected finite coordinates");
                return Err(Malformed::Syntax(format!("{expected}, found {position:?}")).into());
            }
            corners.push(position);
        }
    }
    Ok(corners.parsed)
}

fn binary_length(n_triangles: u32) -> u64 {
    PREFIX as u64 + TRIANGLE as u64 * u64::from(n_triangles)
}

/// Reads all solids of a text, whatever their names, in upper or lower case.
fn parse_ascii(bytes: &[u8]) -> Result<Parsed, ParseError> {
    let mut corners = Corners::default();
    // The number of lines of the current facet, and whether a solid is open.
    let (mut n_read, mut is_open, mut last) = (0, false, 0);
    for (number, line) in lines(bytes) {
        let line = line.trim_ascii();
        if line.is_empty() {
            continue;
        }
        last = number;
        let is_start = begins(line, "solid");
        if is_start || begins(line, "endsolid") {
            is_open = is_start;
            continue;
        }
        let (keywords, n_numbers) = FACET[n_read];
        let position = numbers(line, keywords, n_numbers).map_err(|cause| cause.at(number))?;
        if keywords == "vertex" {
            corners.push([position[0], position[1], position[2]]);
        }
        n_read = (n_read + 1) % FACET.len();
    }
    if n_read > 0 || is_open {
        let expected = if n_read > 0 { FACET[n_read].0 } else { "endsolid" };
        let cause = format!("expected `{expected}`, found the end of the file");
        return Err(Malformed::Syntax(cause).at(last));
    }
    Ok(corners.parsed)
}

/// The `n` numbers of a line that begins with `keywords`. After `facet`, anything may follow.
fn numbers(line: &[u8], keywords: &str, n: usize) -> Result<Vec<f32>, Malformed> {
    let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    let are_there = keywords
        .split(' ')
        .all(|key| words.next().is_some_and(|word| word.eq_ignore_ascii_case(key.as_bytes())));
    if are_there && keywords == "facet" {
        return Ok(Vec::new());
    }
    let number =
        |word| std::str::from_utf8(word).ok()?.parse().ok().filter(|x: &f32| x.is_finite());
    let numbers: Option<Vec<f32>> = words.map(number).collect();
    numbers.filter(|numbers| are_there && numbers.len() == n).ok_or_else(|| {
        let then = if n == 0 { String::new() } else { format!(" and {n} finite numbers") };
        Malformed::expected(&format!("`{keywords}`{then}"), line)
    })
}

fn begins(line: &[u8], word: &str) -> bool {
    let head = line.trim_ascii_start().get(..word.len());
    head.is_some_and(|head| head.eq_ignore_ascii_case(word.as_bytes()))
}

#[derive(Default)]
struct Corners {
    parsed: Parsed,
    /// The vertex at each position, keyed by its bits.
    vertices: HashMap<[u32; 3], u32>,
    /// The vertices of the incomplete triangle.
    open: Vec<u32>,
}

impl Corners {
    fn push(&mut self, position: [f32; 3]) {
        let vertices = &mut self.parsed.mesh.vertices;
        let vertex = *self.vertices.entry(position.map(f32::to_bits)).or_insert_with(|| {
            vertices.push(DVec3::from_array(position.map(f64::from)));
            vertices.len() as u32 - 1
        });
        self.open.push(vertex);
        if self.open.len() == 3 {
            self.parsed.add_face(&self.open);
            self.open.clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use test_support::said::faults;

    use super::super::testing::{fails, is_the_triangle};
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

    #[test]
    fn text_is_read_whatever_its_name_case_and_line_ends() {
        for name in [" mesh", "", " two words", " caf\u{e9}"] {
            is_the_triangle(parse, format!("solid{name}\n{FACET}endsolid{name}\n"));
        }
        is_the_triangle(parse, format!("solid a\n{FACET}endsolidAssimpScene"));
        is_the_triangle(parse, format!("solidA\n{FACET}endsolidA\nsolid B\nendsolidB"));
        is_the_triangle(parse, format!("SOLID A\r\n{}ENDSOLID A", FACET.to_uppercase()));
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
        is_the_triangle(parse, binary(b"made by a program", 1, &[TRIANGLE]));
        is_the_triangle(parse, binary(b"solid made by another", 1, &[TRIANGLE]));
    }

    #[test]
    fn equal_positions_become_one_vertex() {
        let second = [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]];
        let mesh = parse(&binary(b"", 2, &[TRIANGLE, second])).unwrap().mesh;
        assert_eq!(mesh.vertices.len(), 4);
        assert_eq!(mesh.triangles, [[0, 1, 2], [2, 1, 3]]);
    }

    #[test]
    fn normals_are_ignored() {
        for normal in ["nan nan nan", "-nan(ind) 0 0", "1.#QNAN 0 0", "inf 0 0", ""] {
            let facet = FACET.replace("0 0 1", normal);
            is_the_triangle(parse, format!("solid a\n{facet}endsolid a\n"));
        }
    }

    #[test]
    fn more_triangles_than_the_header_promises_are_a_warning() {
        let parsed = parse(&binary(b"", 1, &[TRIANGLE; 3])).unwrap();
        assert_eq!(parsed.mesh.triangles.len(), 1);
        assert_eq!(parsed.warnings, [Warning::MoreTriangles { promised: 1, held: 3 }]);
        // An attribute after the triangles is not one.
        let attribute = [binary(b"", 1, &[TRIANGLE]), vec![0; 49]].concat();
        is_the_triangle(parse, attribute);
        let cause = "the header promises 0 triangles, the file holds 4";
        fails(parse, [(binary(b"", 0, &[TRIANGLE; 4]), cause)]);
    }

    #[test]
    fn a_promise_of_billions_is_checked_against_the_file() {
        let cases = [
            (binary(b"", u32::MAX, &[TRIANGLE]), "truncated: expected 4294967295 faces, found 1"),
            (binary(b"solid\0", 2, &[TRIANGLE]), "truncated: expected 2 faces, found 1"),
        ];
        fails(parse, cases);
    }

    #[test]
    fn faults_are_named_with_their_lines() {
        fails(parse, faults(include_str!("stl_faults.txt")));
    }
}
