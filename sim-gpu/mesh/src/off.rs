//! ASCII OFF, as Geomview defines it, with the deviations of ModelNet and others.
//!
//! Source: the Geomview manual, section "OFF: Object File Format". ModelNet40 needs deviations: the
//! keyword may be glued to the counts (`OFF490 518 0`, 2,862 of its 12,311 files). Comments, blank
//! lines and any of the three line ends may occur anywhere; the number of edges may be missing. The
//! rest of each line (colours, normals, texture coordinates) is ignored.

use formats::plausible::Warning;
use glam::DVec3;

use super::error::{Malformed, ParseError, excerpt};
use super::tokens::{Tokens, integer};
use super::triangle_mesh::Parsed;

pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, ParseError> {
    let mut tokens = Tokens::new(bytes);
    if !tokens.seek_data() {
        return Err(Malformed::Empty.into());
    }
    read(&mut tokens).map_err(|cause| cause.at(tokens.line))
}

/// Reads the file from its keyword on. An error is in the current line of `tokens`.
fn read(tokens: &mut Tokens<'_>) -> Result<Parsed, Malformed> {
    let [n_vertices, n_faces] = header(tokens)?;
    Malformed::check_vertex_count(n_vertices)?;
    let mut parsed = Parsed::default();
    for held in 0..n_vertices {
        if !tokens.next_data_line() {
            return Err(Malformed::Truncated { part: "vertices", held, promised: n_vertices });
        }
        let mut position = DVec3::ZERO;
        for axis in 0..3 {
            position[axis] = tokens.next_coordinate(axis as u64)?;
        }
        parsed.mesh.vertices.push(position);
    }
    let mut corners = Vec::new();
    for held in 0..n_faces {
        if !tokens.next_data_line() {
            return Err(Malformed::Truncated { part: "faces", held, promised: n_faces });
        }
        read_corners(tokens, n_vertices, &mut corners)?;
        parsed.add_face(&corners);
    }
    if tokens.next_data_line() {
        parsed.warnings.push(Warning::MoreLines(n_faces));
    }
    Ok(parsed)
}

/// Reads the corners of a face, unless it has fewer than three.
fn read_corners(
    tokens: &mut Tokens<'_>,
    n_vertices: u64,
    corners: &mut Vec<u32>,
) -> Result<(), Malformed> {
    corners.clear();
    let n_corners = integer(tokens.next().unwrap_or_default(), "a number of corners")?;
    for nth in (0..n_corners).filter(|_| n_corners >= 3) {
        let token = tokens.next_of("corners of a face", nth as u64, n_corners as u64)?;
        let index = integer(token, "a vertex index")?;
        let corner = u32::try_from(index).ok().filter(|&corner| u64::from(corner) < n_vertices);
        let outside = || Malformed::IndexOutOfRange { found: excerpt(token), n_vertices };
        corners.push(corner.ok_or_else(outside)?);
    }
    Ok(())
}

/// Reads the keyword, and returns the counts of vertices and faces.
fn header(tokens: &mut Tokens<'_>) -> Result<[u64; 2], Malformed> {
    let keyword = tokens.next().unwrap_or_default();
    // The prefix has at most the letters of all variants together.
    let found = keyword.windows(3).position(|part| part == b"OFF" || part == b"off");
    let Some(at) = found.filter(|&at| at <= "STCN4n".len()) else {
        return Err(Malformed::expected("an OFF file", &keyword[..keyword.len().min(16)]));
    };
    check_kind(&keyword[..at])?;

    let glued = &keyword[at + 3..];
    let mut first = if glued.is_empty() { tokens.next() } else { Some(glued) };
    if first.is_some_and(|token| token.eq_ignore_ascii_case(b"BINARY")) {
        return Err(Malformed::Syntax("expected ASCII OFF, found binary OFF".into()));
    }
    if first.is_none() && tokens.next_data_line() {
        first = tokens.next();
    }
    let mut counts = [0; 2];
    for (nth, count) in (0..).zip(&mut counts) {
        let token = first.take().map_or_else(|| tokens.next_of("counts", nth, 2), Ok)?;
        let number = u64::try_from(integer(token, "a count")?);
        *count = number.map_err(|_| Malformed::expected("a count", token))?;
    }
    Ok(counts)
}

/// Accepts the prefixes of `OFF` with which x, y, z remain the first three numbers.
fn check_kind(kind: &[u8]) -> Result<(), Malformed> {
    let rest = kind.strip_prefix(b"ST").unwrap_or(kind);
    let rest = rest.strip_prefix(b"C").unwrap_or(rest);
    let is_read = rest.strip_prefix(b"N").unwrap_or(rest).is_empty();
    let expected = "an OFF file of three dimensions";
    if is_read { Ok(()) } else { Err(Malformed::expected(expected, &[kind, b"OFF"].concat())) }
}

#[cfg(test)]
mod tests {
    use test_support::said::faults;

    use super::super::testing::{fails, is_the_triangle};
    use super::*;

    const TRIANGLE: &str = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

    #[test]
    fn the_header_may_be_glued_split_or_lack_the_edges() {
        for header in
            ["OFF\n3 1 0\n", "OFF3 1 0\n", "OFF 3 1 0\n", "OFF\n3 1\n", "OFF3 1\n", "off\n3 1 3\n"]
        {
            is_the_triangle(parse, format!("{header}{TRIANGLE}"));
        }
        is_the_triangle(
            parse,
            format!("\n # made by hand\n\nOFF # keyword\n\n# counts\n3 1 0\n{TRIANGLE}"),
        );
    }

    #[test]
    fn line_ends_comments_and_blank_lines_do_not_matter() {
        let text = format!("OFF\n3 1 0\n{TRIANGLE}");
        is_the_triangle(parse, text.replace('\n', "\r\n"));
        is_the_triangle(parse, text.replace('\n', "\r"));
        is_the_triangle(parse, text.replace('\n', " \t\n"));
        is_the_triangle(parse, text.replace('\n', "\n\n  \n"));
        is_the_triangle(parse, text.replace('\n', " # 4 5 6\n# 7\n"));
        is_the_triangle(parse, text.trim_end());
        is_the_triangle(parse, format!("{text}\n# the end\n\n  \n"));
    }

    #[test]
    fn more_lines_than_the_header_promises_are_a_warning() {
        let text = format!("OFF\n3 1 0\n{TRIANGLE}# another\n3 2 1 0\n");
        let parsed = parse(text.as_bytes()).unwrap();
        assert_eq!(
            (parsed.mesh.triangles.len(), &parsed.warnings[..]),
            (1, &[Warning::MoreLines(1)][..])
        );
    }

    #[test]
    fn columns_after_what_is_needed_are_ignored() {
        is_the_triangle(parse, "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 255 0 0\n");
        is_the_triangle(parse, "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 0.5 0.5 0.5 1\n");
        is_the_triangle(
            parse,
            "COFF\n3 1 0\n0 0 0 255 0 0 255\n1 0 0 1 2 3 4\n0 1 0 5 6 7 8\n3 0 1 2\n",
        );
        is_the_triangle(parse, "NOFF\n3 1 0\n0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1\n3 0 1 2\n");
        is_the_triangle(parse, "CNOFF 3 1 0\n0 0 0 0 0 1 9 9 9 9\n1 0 0\n0 1 0\n3 0 1 2\n");
        is_the_triangle(parse, "STOFF 3 1 0\n0 0 0 .5 .5\n1 0 0 1 1\n0 1 0 0 0\n3 0 1 2\n");
    }

    #[test]
    fn numbers_come_in_every_spelling() {
        is_the_triangle(parse, "OFF\n3 1 0\n-0 .0 0.\n+1 0e5 0\n0 10E-1 0\n3 00 01 +2\n");
    }

    #[test]
    fn polygons_become_fans_and_smaller_faces_are_counted() {
        let text = "OFF\n5 4 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n\
                    5 0 1 2 3 4\n1 0\n2 0 1\n4 4 3 2 1 0.1 0.2 0.3\n";
        let parsed = parse(text.as_bytes()).unwrap();
        let fans = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [4, 3, 2], [4, 2, 1]];
        assert_eq!(parsed.mesh.triangles, fans);
        assert_eq!(parsed.dropped_faces, 2);
    }

    #[test]
    fn faults_are_named_with_their_lines() {
        fails(parse, faults(include_str!("off_faults.txt")));
    }
}
