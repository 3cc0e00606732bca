//! Wavefront OBJ: positions and faces, through the crate tobj.
//!
//! Groups, materials, normals and texture coordinates do not matter to a beam: faults in them are
//! no faults of the mesh. tobj would split the mesh by them, or fail, so that it is given positions
//! and faces only. These are checked before, because its errors name no line.

use glam::DVec3;
use tobj::{LoadError, LoadOptions};

use super::error::{Malformed, ParseError, excerpt};
use super::tokens::{coordinate, integer, lines};
use super::triangle_mesh::Parsed;

/// All objects become one mesh. It has the vertices that faces refer to, in the order of their
/// first use.
pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, ParseError> {
    let mut geometry = Vec::with_capacity(bytes.len());
    let mut instead = std::collections::BTreeSet::new();
    let checked = read(bytes, |key, rest| {
        append_geometry(&mut geometry, key, rest);
        instead.extend(match key {
            b"l" => Some("lines"),
            b"p" => Some("points"),
            b"curv" | b"curv2" | b"surf" => Some("free-form curves and surfaces: export triangles"),
            b"fo" => Some("faces by `fo`, which is obsolete: write `f`"),
            _ => None,
        });
    })?;
    let options = LoadOptions { ignore_points: true, ignore_lines: true, ..LoadOptions::default() };
    let no_materials = |_: &std::path::Path| Err(LoadError::OpenFileFailed);
    let (models, _) = tobj::load_obj_buf(&mut &geometry[..], &options, no_materials)
        .map_err(|error| Malformed::Syntax(error.to_string()))?;
    let mut parsed = Parsed::default();
    for tobj::Model { mesh, .. } in models {
        let base = parsed.mesh.vertices.len() as u32;
        let positions = mesh.positions.as_chunks().0.iter().copied().map(DVec3::from_array);
        parsed.mesh.vertices.extend(positions);
        let mut corners = mesh.indices.iter().map(|index| base + index);
        // tobj lists the numbers of corners unless all faces are triangles.
        let triangles = std::iter::repeat_n(3, mesh.indices.len() / 3);
        let arities: Vec<u32> = match mesh.face_arities.is_empty() {
            true => triangles.collect(),
            false => mesh.face_arities,
        };
        for arity in arities {
            parsed.add_face(&corners.by_ref().take(arity as usize).collect::<Vec<_>>());
        }
    }
    parsed.dropped_faces = checked.dropped_faces;
    if parsed.mesh.triangles.is_empty() && !instead.is_empty() {
        let found = Vec::from_iter(instead).join(", ");
        let cause = format!("expected at least one triangle, found only {found}");
        return Err(Malformed::Syntax(cause).into());
    }
    Ok(parsed)
}

/// Appends a line of positions or of the positions of a face, as tobj reads them.
fn append_geometry(text: &mut Vec<u8>, key: &[u8], rest: &[u8]) {
    let kept: Vec<&[u8]> = match key {
        // A fourth number alone is a weight; more are a colour.
        b"v" if words(rest).count() == 4 => words(rest).collect(),
        b"v" => words(rest).take(3).collect(),
        b"f" => words(rest).filter_map(|word| word.split(|&byte| byte == b'/').next()).collect(),
        _ => return,
    };
    text.extend_from_slice(key);
    for word in kept {
        text.push(b' ');
        text.extend_from_slice(word);
    }
    text.push(b'\n');
}

/// Reads the mesh with all vertices of the file. `also` gets the first word and the rest of each
/// line, without a comment.
pub(super) fn read(bytes: &[u8], mut also: impl FnMut(&[u8], &[u8])) -> Result<Parsed, ParseError> {
    // Faces may refer to later vertices.
    let mut n_vertices = 0;
    for_each_line(bytes, |key, _| {
        n_vertices += usize::from(key == b"v");
        Ok(())
    })?;
    Malformed::check_vertex_count(n_vertices as u64)?;
    let (mut parsed, mut corners) = (Parsed::default(), Vec::new());
    for_each_line(bytes, |key, rest| {
        match key {
            b"v" => parsed.mesh.vertices.push(position(rest)?),
            b"f" => {
                corners.clear();
                for word in words(rest) {
                    let corner = word.split(|&byte| byte == b'/').next().unwrap_or_default();
                    let index = index(corner, parsed.mesh.vertices.len(), n_vertices)?;
                    let outside = || Malformed::IndexOutOfRange {
                        found: excerpt(corner),
                        n_vertices: n_vertices as u64,
                    };
                    corners.push(index.ok_or_else(outside)?);
                }
                parsed.add_face(&corners);
            }
            _ => {}
        }
        also(key, rest);
        Ok(())
    })?;
    Ok(parsed)
}

/// Reads x, y, z and, if nothing else follows, the weight; not colours.
fn position(rest: &[u8]) -> Result<DVec3, Malformed> {
    let mut words = words(rest);
    let mut next = |n| {
        let short = || Malformed::Syntax(format!("expected 3 coordinates of a vertex, found {n}"));
        coordinate(words.next().ok_or_else(short)?)
    };
    let position = DVec3::new(next(0)?, next(1)?, next(2)?);
    let (Some(word), None) = (words.next(), words.next()) else { return Ok(position) };
    let weight = coordinate(word).ok().filter(|weight| *weight != 0.0);
    let wrong = || Malformed::expected("a weight other than 0", word);
    Ok(position / weight.ok_or_else(wrong)?)
}

/// Converts an index, from 1 or, if negative, from the end of the `n_before` items so far, to one
/// from 0, if there are more than it of `n` items.
pub(super) fn index(word: &[u8], n_before: usize, n: usize) -> Result<Option<u32>, Malformed> {
    let number = integer(word, "an index")?;
    let from_0 = if number < 0 { number + n_before as i64 } else { number - 1 };
    Ok(u32::try_from(from_0).ok().filter(|index| (*index as usize) < n))
}

/// Calls a function for each line, with its first word and the rest without a comment. A backslash
/// at the end of a line continues it on the next one.
pub(super) fn for_each_line(
    bytes: &[u8],
    mut take: impl FnMut(&[u8], &[u8]) -> Result<(), Malformed>,
) -> Result<(), ParseError> {
    let mut lines = lines(bytes);
    while let Some((number, line)) = lines.next() {
        let mut line = line.trim_ascii();
        let mut joined = Vec::new();
        while let Some(head) = line.strip_suffix(b"\\").filter(|_| !line.starts_with(b"#")) {
            joined.extend_from_slice(head);
            joined.push(b' ');
            line = lines.next().map_or(b"", |(_, line)| line.trim_ascii_end());
        }
        if !joined.is_empty() {
            joined.extend_from_slice(line);
            line = &joined;
        }
        let data = line.split(|&byte| byte == b'#').next().unwrap_or_default();
        let end = data.iter().position(u8::is_ascii_whitespace).unwrap_or(data.len());
        take(&data[..end], data[end..].trim_ascii()).map_err(|cause| cause.at(number))?;
    }
    Ok(())
}

pub(super) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

#[cfg(test)]
mod tests {
    use test_support::said::faults;

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
        is_the_triangle(parse, format!("{CORNERS}f 1 2 3\n").replace('\n', "\r"));
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
    fn elements_in_place_of_triangles_are_named() {
        for (lines, found) in [
            ("p 1\nl 1 2\nl 2 3\n", "lines, points"),
            ("fo 1 2 3\n", "faces by `fo`, which is obsolete: write `f`"),
            ("surf 0 1 0 1 1 2 3 3\n", "free-form curves and surfaces: export triangles"),
        ] {
            let error = parse(format!("{CORNERS}{lines}").as_bytes()).unwrap_err().to_string();
            assert_eq!(error, format!("expected at least one triangle, found only {found}"));
            is_the_triangle(parse, format!("{CORNERS}{lines}f 1 2 3\n"));
        }
    }

    #[test]
    fn faults_are_named_with_their_lines() {
        fails(parse, faults(include_str!("obj_faults.txt")));
    }
}
