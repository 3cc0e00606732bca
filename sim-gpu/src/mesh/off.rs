//! ASCII OFF, as Geomview defines it and as ModelNet and others bend it.
//!
//! Source: the Geomview manual, section "OFF: Object File Format". Read as
//! ModelNet40 needs it: the keyword may be glued to the counts
//! (`OFF490 518 0`, 2,862 of its 12,311 files); comments, blank lines and any
//! of the three line ends occur anywhere; the number of edges may be missing;
//! whatever stands on a line after what is needed (colours, normals, texture
//! coordinates) is ignored, and so is all that follows the last face.

use glam::DVec3;

use super::error::{Malformed, ParseError, Part, excerpt};
use super::tokens::{Tokens, short};
use super::triangle_mesh::{Mesh, Parsed};

/// The bytes of the shortest lines that hold a vertex, `0 0 0`, and a triangle,
/// `3 0 0 0`, with their ends: a file cannot hold more of them than fit.
const SHORTEST_VERTEX: usize = 6;
const SHORTEST_TRIANGLE: usize = 8;

/// Reads an ASCII OFF file from its bytes.
///
/// Polygons become fans around their first corner. Faces of fewer than three
/// corners are dropped and counted.
pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, ParseError> {
    let mut tokens = Tokens::new(bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes));
    let (n_vertices, n_faces) = header(&mut tokens)?;
    if n_vertices > u64::from(u32::MAX) {
        return Err(tokens.fault(Malformed::TooManyVertices(n_vertices)));
    }
    let vertices = vertices(&mut tokens, n_vertices)?;
    let (triangles, dropped_faces) = faces(&mut tokens, n_vertices, n_faces)?;
    if triangles.is_empty() {
        return Err(Malformed::NoTriangle.into());
    }
    Ok(Parsed { mesh: Mesh { vertices, triangles }, dropped_faces })
}

/// The keyword and the counts of vertices and faces.
fn header(tokens: &mut Tokens<'_>) -> Result<(u64, u64), ParseError> {
    if !tokens.seek_data() {
        return Err(Malformed::Empty.into());
    }
    let keyword = tokens.next().unwrap_or_default();
    // Before it at most the letters of every variant there is.
    let found = keyword.windows(3).position(|part| part == b"OFF" || part == b"off");
    let Some(at) = found.filter(|&at| at <= "STCN4n".len()) else {
        return Err(tokens.fault(Malformed::WrongStart {
            format: "an OFF file",
            found: excerpt(&keyword[..keyword.len().min(16)]),
        }));
    };
    let (kind, glued) = (&keyword[..at], &keyword[at + 3..]);
    check_kind(kind).map_err(|cause| tokens.fault(cause))?;

    let first = if glued.is_empty() { tokens.next() } else { Some(glued) };
    if first.is_some_and(|token| token.eq_ignore_ascii_case(b"BINARY")) {
        return Err(tokens.fault(Malformed::Unsupported("binary OFF".into())));
    }
    let first = match first {
        Some(token) => token,
        None if tokens.next_data_line() => tokens.next().unwrap_or_default(),
        None => return Err(tokens.fault(short("counts", 0, 2))),
    };
    let n_vertices = tokens.count(first, Part::Vertices)?;
    let second = tokens.next().ok_or_else(|| tokens.fault(short("counts", 1, 2)))?;
    Ok((n_vertices, tokens.count(second, Part::Faces)?))
}

/// Accepts the prefixes of `OFF` that leave x, y, z the first three numbers.
fn check_kind(kind: &[u8]) -> Result<(), Malformed> {
    let rest = kind.strip_prefix(b"ST").unwrap_or(kind);
    let rest = rest.strip_prefix(b"C").unwrap_or(rest);
    match rest.strip_prefix(b"N").unwrap_or(rest) {
        b"" => Ok(()),
        b"4" | b"n" | b"4n" => {
            Err(Malformed::Unsupported(format!("{}OFF, not of three dimensions,", excerpt(kind))))
        }
        _ => Err(Malformed::WrongStart {
            format: "an OFF file",
            found: format!("{}OFF", excerpt(kind)),
        }),
    }
}

fn vertices(tokens: &mut Tokens<'_>, promised: u64) -> Result<Vec<DVec3>, ParseError> {
    let mut vertices = Vec::with_capacity(tokens.room(promised, SHORTEST_VERTEX));
    for held in 0..promised {
        if !tokens.next_data_line() {
            let cause = Malformed::Truncated { part: Part::Vertices, held, promised };
            return Err(tokens.fault(cause));
        }
        let mut position = [0.0; 3];
        for (axis, coordinate) in position.iter_mut().enumerate() {
            *coordinate = tokens.coordinate(axis)?;
        }
        vertices.push(DVec3::from_array(position));
    }
    Ok(vertices)
}

fn faces(
    tokens: &mut Tokens<'_>,
    n_vertices: u64,
    promised: u64,
) -> Result<(Vec<[u32; 3]>, usize), ParseError> {
    let mut triangles = Vec::with_capacity(tokens.room(promised, SHORTEST_TRIANGLE));
    let mut dropped = 0;
    for held in 0..promised {
        if !tokens.next_data_line() {
            return Err(tokens.fault(Malformed::Truncated { part: Part::Faces, held, promised }));
        }
        let token = tokens.next().unwrap_or_default();
        let n_corners = tokens.integer(token, "a number of corners")?;
        if n_corners < 3 {
            dropped += 1;
            continue;
        }
        let first = tokens.corner(0, n_corners, n_vertices)?;
        let mut last = tokens.corner(1, n_corners, n_vertices)?;
        for nth in 2..n_corners {
            let corner = tokens.corner(nth, n_corners, n_vertices)?;
            triangles.push([first, last, corner]);
            last = corner;
        }
    }
    Ok((triangles, dropped))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIANGLE: &str = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

    fn read(text: &str) -> Result<Parsed, ParseError> {
        parse(text.as_bytes())
    }

    /// The mesh of one triangle, from a file that varies only in form.
    #[track_caller]
    fn is_the_triangle(text: &str) {
        let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
        let mesh = Mesh { vertices, triangles: vec![[0, 1, 2]] };
        assert_eq!(read(text), Ok(Parsed { mesh, dropped_faces: 0 }), "{text:?}");
    }

    #[track_caller]
    fn fails(text: &str, line: usize, message: &str) {
        let error = read(text).expect_err(text);
        assert_eq!(error.to_string(), format!("line {line}: {message}"), "{text:?}");
    }

    #[test]
    fn the_header_may_be_glued_split_or_lack_the_edges() {
        for header in
            ["OFF\n3 1 0\n", "OFF3 1 0\n", "OFF 3 1 0\n", "OFF\n3 1\n", "OFF3 1\n", "off\n3 1 3\n"]
        {
            is_the_triangle(&format!("{header}{TRIANGLE}"));
        }
        is_the_triangle(&format!("\u{FEFF}OFF\n3 1 0\n{TRIANGLE}"));
        is_the_triangle(&format!(
            "\n # made by hand\n\nOFF # keyword\n\n# counts\n3 1 0\n{TRIANGLE}"
        ));
    }

    #[test]
    fn line_ends_comments_and_blank_lines_do_not_matter() {
        let text = format!("OFF\n3 1 0\n{TRIANGLE}");
        is_the_triangle(&text.replace('\n', "\r\n"));
        is_the_triangle(&text.replace('\n', "\r"));
        is_the_triangle(&text.replace('\n', " \t\n"));
        is_the_triangle(&text.replace('\n', "\n\n  \n"));
        is_the_triangle(&text.replace('\n', " # 4 5 6\n# 7\n"));
        is_the_triangle(text.trim_end());
        is_the_triangle(&format!("{text}\n# the end\n17 trailing tokens\n"));
    }

    #[test]
    fn columns_after_what_is_needed_are_ignored() {
        is_the_triangle("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 255 0 0\n");
        is_the_triangle("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 0.5 0.5 0.5 1\n");
        is_the_triangle("COFF\n3 1 0\n0 0 0 255 0 0 255\n1 0 0 1 2 3 4\n0 1 0 5 6 7 8\n3 0 1 2\n");
        is_the_triangle("NOFF\n3 1 0\n0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1\n3 0 1 2\n");
        is_the_triangle("CNOFF 3 1 0\n0 0 0 0 0 1 9 9 9 9\n1 0 0\n0 1 0\n3 0 1 2\n");
        is_the_triangle("STOFF 3 1 0\n0 0 0 .5 .5\n1 0 0 1 1\n0 1 0 0 0\n3 0 1 2\n");
    }

    #[test]
    fn numbers_come_in_every_spelling() {
        is_the_triangle("OFF\n3 1 0\n-0 .0 0.\n+1 0e5 0\n0 10E-1 0\n3 00 01 +2\n");
    }

    #[test]
    fn polygons_become_fans_and_smaller_faces_are_counted() {
        let text = "OFF\n5 4 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n\
                    5 0 1 2 3 4\n1 0\n2 0 1\n4 4 3 2 1 0.1 0.2 0.3\n";
        let parsed = read(text).unwrap();
        let fans = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [4, 3, 2], [4, 2, 1]];
        assert_eq!(parsed.mesh.triangles, fans);
        assert_eq!(parsed.dropped_faces, 2);
    }

    #[test]
    fn other_files_are_named_for_what_they_begin_with() {
        fails("solid cube\n", 1, "not an OFF file: it begins with \"solid\"");
        fails("\n\nXOFF 3 1 0\n", 3, "not an OFF file: it begins with \"XOFF\"");
        fails("\u{7f}ELF\u{1}\u{2}", 1, "not an OFF file: it begins with \" ELF  \"");
        fails("4OFF 3 1 0\n", 1, "4OFF, not of three dimensions, is not supported");
        fails("nOFF 3 3 1 0\n", 1, "nOFF, not of three dimensions, is not supported");
        fails("OFF BINARY\n\0\0", 1, "binary OFF is not supported");
        assert_eq!(read(" \n# only a comment\n"), Err(Malformed::Empty.into()));
    }

    #[test]
    fn a_truncated_file_says_how_far_it_came() {
        let message = "truncated: the header promises 3 vertices, the file holds 1";
        fails("OFF\n3 1 0\n0 0 0\n", 4, message);
        let message = "truncated: the header promises 2 faces, the file holds 1";
        fails("OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2", 6, message);
        fails("OFF\n3 1 0\n0 0 0\n1 0", 4, "the line holds 2 of 3 coordinates of a vertex");
        fails("OFF3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1", 5, "the line holds 2 of 3 corners of a face");
        fails("OFF", 1, "the line holds 0 of 2 counts");
        fails("OFF\n3", 2, "the line holds 1 of 2 counts");
    }

    #[test]
    fn a_promise_of_billions_allocates_what_the_file_can_hold() {
        let message = "truncated: the header promises 4000000000 vertices, the file holds 1";
        fails("OFF\n4000000000 9000000000000000000 0\n0 0 0\n", 4, message);
        let message = "9000000000000000000 vertices are too many: indices have 32 bits";
        fails("OFF\n9000000000000000000 1 0\n0 0 0\n", 2, message);
        let message = "the line holds 3 of 4000000000 corners of a face";
        fails("OFF3 1 0\n0 0 0\n1 0 0\n0 1 0\n4000000000 0 1 2\n", 5, message);
    }

    #[test]
    fn bad_numbers_are_named_with_their_line() {
        fails("OFF\n-3 1 0\n", 2, "-3 is a negative number of vertices");
        fails("OFF\n3 -1 0\n", 2, "-1 is a negative number of faces");
        fails("OFF\n3.5 1 0\n", 2, "\"3.5\" is not a count");
        fails("OFF\n3 1 0\n0 0 zero\n", 3, "\"zero\" is not a coordinate");
        fails("OFF\n3 1 0\n0 nan 0\n", 3, "coordinate nan is not finite");
        fails("OFF\n3 1 0\n\n0 0 -inf\n", 4, "coordinate -inf is not finite");
        fails("OFF\n3 1 0\n0 0 1e999\n", 3, "coordinate 1e999 is not finite");
    }

    #[test]
    fn bad_indices_are_named_with_their_line() {
        let with = |face: &str| format!("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n{face}\n");
        fails(&with("3 0 1 3"), 6, "index 3 is out of range: there are 3 vertices");
        fails(&with("3 0 -1 2"), 6, "index -1 is out of range: there are 3 vertices");
        let message = "index 4294967296 is out of range: there are 3 vertices";
        fails(&with("3 0 1 4294967296"), 6, message);
        fails(&with("3 0 1 2.0"), 6, "\"2.0\" is not a vertex index");
        fails(
            &with("3 0 1 12345678901234567890"),
            6,
            "\"12345678901234567890\" is not a vertex index",
        );
        fails(&with("three 0 1 2"), 6, "\"three\" is not a number of corners");
    }

    #[test]
    fn a_mesh_without_a_triangle_is_none() {
        assert_eq!(read("OFF\n0 0 0\n"), Err(Malformed::NoTriangle.into()));
        assert_eq!(read("OFF\n2 1 0\n0 0 0\n1 0 0\n2 0 1\n"), Err(Malformed::NoTriangle.into()));
    }
}
