//! The element `vertex` of PLY files, as rows of numbers.

use std::io::{self, BufRead, Read};
use std::path::Path;

use super::header::{Element, Encoding, read_header};
use crate::decoding::{error_in, invalid};
use crate::error::FormatError;
use crate::lines::Lines;
use crate::number::{ByteOrder, NumberType};
use crate::records;

const VERTEX: &str = "vertex";
/// What errors call that element.
const PART: &str = "element vertex";

/// Reads the vertices of the PLY file in `reader`, which errors call `name`.
///
/// `choose` picks properties by their places, of numbers and not of lists; `each`
/// is given one vertex's numbers at a time, in the order of the choice. Other
/// properties and elements are skipped. Returns the `origin` that the header
/// states: what to add to every position.
pub(crate) fn read_vertices(
    reader: &mut impl BufRead,
    name: &Path,
    choose: impl FnOnce(&Element) -> Result<Vec<usize>, String>,
    mut each: impl FnMut(&[f64]),
) -> Result<Option<[f64; 3]>, FormatError> {
    let mut lines = Lines::new(reader, name);
    let header = read_header(&mut lines, name)?;
    let wrong = |cause: String| FormatError::malformed(name, PART, cause);
    let at = header.elements.iter().position(|element| element.name == VERTEX);
    let at = at.ok_or_else(|| wrong("missing".to_owned()))?;
    let (before, vertex) = (&header.elements[..at], &header.elements[at]);
    let chosen = choose(vertex).map_err(wrong)?;
    match header.encoding {
        Encoding::Ascii => {
            before.iter().try_for_each(|element| skip_lines(&mut lines, element))?;
            read_ascii(&mut lines, vertex, &chosen, each)?;
        }
        Encoding::Binary(order) => {
            for element in before {
                let part = format!("element {}", element.name);
                skip_binary(lines.reader, element, order)
                    .map_err(|error| error_in(name, &part, error))?;
            }
            read_binary(lines.reader, vertex, &chosen, order, &mut each)
                .map_err(|error| error_in(name, PART, error))?;
        }
    }
    Ok(header.origin)
}

/// Skips elements of text. An element without properties takes no line.
fn skip_lines<R: BufRead>(lines: &mut Lines<'_, R>, element: &Element) -> Result<(), FormatError> {
    if element.properties.is_empty() {
        return Ok(());
    }
    (0..element.n).try_for_each(|i| lines.next_of(i, element.n).map(|_| ()))
}

fn read_ascii<R: BufRead>(
    lines: &mut Lines<'_, R>,
    vertex: &Element,
    chosen: &[usize],
    mut each: impl FnMut(&[f64]),
) -> Result<(), FormatError> {
    let mut row = vec![0.0; chosen.len()];
    for i in 0..vertex.n {
        let line = lines.next_of(i, vertex.n)?;
        let mut words = line.text.split_ascii_whitespace();
        for (at, property) in vertex.properties.iter().enumerate() {
            let mut next = || {
                let missing =
                    || line.error(format!("the number for property {} is missing", property.name));
                words.next().ok_or_else(missing)
            };
            let word = next()?;
            if property.length.is_some() {
                for _ in 0..line.count(word)? {
                    next()?;
                }
            } else if let Some(column) = chosen.iter().position(|&place| place == at) {
                row[column] = line.number(word)?;
            }
        }
        each(&row);
    }
    Ok(())
}

fn read_binary(
    reader: &mut impl Read,
    vertex: &Element,
    chosen: &[usize],
    order: ByteOrder,
    each: &mut impl FnMut(&[f64]),
) -> io::Result<()> {
    let mut row = vec![0.0; chosen.len()];
    if let Some(size) = vertex.size() {
        let offset = |at: usize| vertex.properties[..at].iter().map(|p| p.number.size()).sum();
        let columns: Vec<(usize, NumberType)> =
            chosen.iter().map(|&at| (offset(at), vertex.properties[at].number)).collect();
        return records::read(reader, size, vertex.n, |bytes| {
            for (value, (offset, number)) in row.iter_mut().zip(&columns) {
                *value = number.decode(&bytes[*offset..], order);
            }
            each(&row);
        });
    }
    for i in 0..vertex.n {
        let read = for_each_number(reader, vertex, order, |at, number| {
            if let Some(column) = chosen.iter().position(|&place| place == at) {
                row[column] = number;
            }
        });
        read.map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => records::truncated(i, vertex.n),
            _ => error,
        })?;
        each(&row);
    }
    Ok(())
}

/// Skips binary elements.
fn skip_binary(reader: &mut impl Read, element: &Element, order: ByteOrder) -> io::Result<()> {
    if let Some(size) = element.size() {
        return records::skip(reader, element.n.saturating_mul(size as u64));
    }
    (0..element.n).try_for_each(|_| for_each_number(reader, element, order, |_, _| ()))
}

/// Reads one binary element, skips its lists and hands each number, with its
/// property's place, to `take`.
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
                    return Err(invalid(format!("the list {} has length {n}", property.name)));
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
