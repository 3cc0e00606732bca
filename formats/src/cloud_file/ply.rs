//! PLY files as clouds: the x, y and z of the element `vertex`.
//!
//! Scans, with all their attributes, go through `formats::ply` and the crate
//! `ply-rs-bw`. That crate takes neither `nan` nor `.5` for a number, reads
//! text as f32 and matches names for every number; so clouds are read here.

use std::io::{self, BufRead, Read, Write};
use std::path::Path;

use super::lines::Lines;
use super::ply_header::{Element, Encoding, read_header};
use super::precision::Precision;
use crate::decoding::{error_in, invalid};
use crate::error::FormatError;
use crate::number::{ByteOrder, NumberType};
use crate::records;

const AXES: [&str; 3] = ["x", "y", "z"];
const VERTEX: &str = "vertex";

/// Reads every vertex; other properties and elements are passed over.
pub(super) fn read(reader: &mut impl BufRead, name: &Path) -> Result<Vec<[f64; 3]>, FormatError> {
    let mut lines = Lines::new(reader, name);
    let header = read_header(&mut lines, name)?;
    let wrong = |cause: String| FormatError::malformed(name, "element vertex", cause);
    let at = header.elements.iter().position(|element| element.name == VERTEX);
    let at = at.ok_or_else(|| wrong("missing".to_owned()))?;
    let (before, vertex) = (&header.elements[..at], &header.elements[at]);
    let axes = axes(vertex).map_err(wrong)?;
    let mut points = match header.encoding {
        Encoding::Ascii => {
            before.iter().try_for_each(|element| skip_lines(&mut lines, element))?;
            read_ascii(&mut lines, vertex, axes)?
        }
        Encoding::Binary(order) => {
            for element in before {
                let part = format!("element {}", element.name);
                skip_binary(lines.reader, element, order)
                    .map_err(|error| error_in(name, &part, error))?;
            }
            read_binary(lines.reader, vertex, axes, order)
                .map_err(|error| error_in(name, "element vertex", error))?
        }
    };
    if let Some([x, y, z]) = header.origin {
        points.iter_mut().for_each(|p| *p = [p[0] + x, p[1] + y, p[2] + z]);
    }
    Ok(points)
}

/// Which properties x, y and z are.
fn axes(vertex: &Element) -> Result<[usize; 3], String> {
    let place = |axis: &str| {
        let found = |name: &str| vertex.properties.iter().position(|p| p.name == name);
        let at = found(axis).ok_or_else(|| format!("no property {axis}"))?;
        match vertex.properties[at].length {
            Some(_) => Err(format!("property {axis} is a list")),
            None => Ok(at),
        }
    };
    let [x, y, z] = AXES.map(place);
    Ok([x?, y?, z?])
}

/// Passes over elements of text; one without properties has no line.
fn skip_lines<R: BufRead>(lines: &mut Lines<'_, R>, element: &Element) -> Result<(), FormatError> {
    if element.properties.is_empty() {
        return Ok(());
    }
    (0..element.n).try_for_each(|i| lines.next_of(i, element.n).map(|_| ()))
}

fn read_ascii<R: BufRead>(
    lines: &mut Lines<'_, R>,
    vertex: &Element,
    axes: [usize; 3],
) -> Result<Vec<[f64; 3]>, FormatError> {
    let mut points = Vec::new();
    for i in 0..vertex.n {
        let line = lines.next_of(i, vertex.n)?;
        let mut words = line.text.split_ascii_whitespace();
        let mut point = [0.0; 3];
        for (at, property) in vertex.properties.iter().enumerate() {
            let mut next = || {
                let missing = || line.error(format!("no number for property {}", property.name));
                words.next().ok_or_else(missing)
            };
            let word = next()?;
            if property.length.is_some() {
                for _ in 0..line.count(word)? {
                    next()?;
                }
            } else if let Some(axis) = axes.iter().position(|&axis| axis == at) {
                point[axis] = line.number(word)?;
            }
        }
        points.push(point);
    }
    Ok(points)
}

fn read_binary(
    reader: &mut impl Read,
    vertex: &Element,
    axes: [usize; 3],
    order: ByteOrder,
) -> io::Result<Vec<[f64; 3]>> {
    let mut points = Vec::new();
    let numbers = axes.map(|at| vertex.properties[at].number);
    if let Some(size) = vertex.size() {
        let offset = |at: usize| vertex.properties[..at].iter().map(|p| p.number.size()).sum();
        let offsets: [usize; 3] = axes.map(offset);
        records::read(reader, size, vertex.n, |bytes| {
            points.push([0, 1, 2].map(|axis| numbers[axis].decode(&bytes[offsets[axis]..], order)));
        })?;
        return Ok(points);
    }
    for i in 0..vertex.n {
        let mut point = [0.0; 3];
        let read = for_each_number(reader, vertex, order, |at, number| {
            if let Some(axis) = axes.iter().position(|&axis| axis == at) {
                point[axis] = number;
            }
        });
        read.map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => records::truncated(i, vertex.n),
            _ => error,
        })?;
        points.push(point);
    }
    Ok(points)
}

/// Passes over binary elements.
fn skip_binary(reader: &mut impl Read, element: &Element, order: ByteOrder) -> io::Result<()> {
    if let Some(size) = element.size() {
        return records::skip(reader, element.n.saturating_mul(size as u64));
    }
    (0..element.n).try_for_each(|_| for_each_number(reader, element, order, |_, _| ()))
}

/// Reads one binary element, passes over its lists and hands each number, with
/// its property's place, to `take`.
fn for_each_number(
    reader: &mut impl Read,
    element: &Element,
    order: ByteOrder,
    mut take: impl FnMut(usize, f64),
) -> io::Result<()> {
    for (at, property) in element.properties.iter().enumerate() {
        match property.length {
            None => take(at, read_number(reader, property.number, order)?),
            Some(length) => {
                let n = read_number(reader, length, order)?;
                if n < 0.0 {
                    return Err(invalid(format!("a list {} of {n} numbers", property.name)));
                }
                records::skip(reader, n as u64 * property.number.size() as u64)?;
            }
        }
    }
    Ok(())
}

fn read_number(reader: &mut impl Read, number: NumberType, order: ByteOrder) -> io::Result<f64> {
    let mut bytes = [0; 8];
    reader.read_exact(&mut bytes[..number.size()])?;
    Ok(number.decode(&bytes, order))
}

/// Writes `points` as binary PLY, little-endian.
pub(super) fn write(
    writer: &mut impl Write,
    points: &[[f64; 3]],
    precision: Precision,
) -> io::Result<()> {
    let number = match precision {
        Precision::Single => "float",
        Precision::Double => "double",
    };
    write!(writer, "ply\nformat binary_little_endian 1.0\nelement vertex {}\n", points.len())?;
    AXES.iter().try_for_each(|axis| writeln!(writer, "property {number} {axis}"))?;
    writeln!(writer, "end_header")?;
    precision.write(writer, points)
}
