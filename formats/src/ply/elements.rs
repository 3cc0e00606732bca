//! Reads the elements of PLY files as rows of numbers.

use std::io::{self, BufRead, Read};
use std::path::Path;

use super::header::{Element, Encoding, Frame, Property, read_header};
use crate::decoding::{error_in, invalid};
use crate::error::FormatError;
use crate::lines::Lines;
use crate::number::{ByteOrder, NumberType};
use crate::records;

/// Reads the elements `wanted` of the PLY file in `reader`, which errors call `name`.
///
/// A kind of element is its index in `wanted`; the file must have the first. For each kind,
/// `choose` returns the indices of properties. `each` gets the kind and a row for each element: the
/// numbers of the chosen properties, in the order of the choice. The last of them may be a list,
/// whose numbers end the row. Other properties and elements are skipped. Memory does not grow with
/// the counts of the header.
///
/// Returns what comments of the header say of the positions.
pub fn read_elements(
    reader: &mut impl BufRead,
    name: &Path,
    wanted: &[&str],
    mut choose: impl FnMut(usize, &Element) -> Result<Vec<usize>, String>,
    mut each: impl FnMut(usize, &[f64]),
) -> Result<Frame, FormatError> {
    let mut lines = Lines::new(reader, name);
    let header = read_header(&mut lines, name)?;
    let wrong = |kind: &str, cause| FormatError::malformed(name, format!("element {kind}"), cause);
    let mut choices = vec![None; header.elements.len()];
    for (kind, wanted) in wanted.iter().enumerate() {
        let at = header.elements.iter().position(|element| element.name == *wanted);
        let Some(at) = at else {
            if kind == 0 {
                return Err(wrong(wanted, "missing".to_owned()));
            }
            continue;
        };
        let chosen = choose(kind, &header.elements[at]).map_err(|cause| wrong(wanted, cause))?;
        choices[at] = Some((kind, chosen));
    }
    // The rest of the file after the last wanted element is ignored.
    let end = choices.iter().rposition(Option::is_some).map_or(0, |last| last + 1);
    let last = header.elements.iter().rposition(|element| element.n > 0);
    for (at, (element, choice)) in header.elements.iter().zip(choices).take(end).enumerate() {
        // Elements without properties take no line and no byte.
        if element.properties.is_empty() {
            continue;
        }
        let (kind, chosen) = choice.map_or((None, Vec::new()), |(kind, c)| (Some(kind), c));
        let each = |row: &[f64]| kind.into_iter().for_each(|kind| each(kind, row));
        match header.encoding {
            Encoding::Ascii => {
                read_ascii(&mut lines, element, &chosen, each)?;
                if last == Some(at) {
                    lines.check_end(element.n)?;
                }
            }
            Encoding::Binary(order) => read_binary(lines.reader, element, &chosen, order, each)
                .and_then(|()| match element.size().filter(|_| last == Some(at)) {
                    Some(size) => records::check_end(lines.reader, size, element.n),
                    None => Ok(()),
                })
                .map_err(|error| error_in(name, &format!("element {}", element.name), error))?,
        }
    }
    Ok(header.frame)
}

fn read_ascii<R: BufRead>(
    lines: &mut Lines<'_, R>,
    element: &Element,
    chosen: &[usize],
    mut each: impl FnMut(&[f64]),
) -> Result<(), FormatError> {
    let mut row = Vec::new();
    for i in 0..element.n {
        let line = lines.next_of(i, element.n)?;
        let mut words = line.text.split_ascii_whitespace();
        read_row(element, chosen, &mut row, |property, length| {
            let missing =
                || line.error(format!("the number for property {} is missing", property.name));
            let word = words.next().ok_or_else(missing)?;
            if length.is_some() { Ok(line.count(word)? as f64) } else { line.number(word) }
        })?;
        each(&row);
    }
    Ok(())
}

fn read_binary(
    reader: &mut impl Read,
    element: &Element,
    chosen: &[usize],
    order: ByteOrder,
    mut each: impl FnMut(&[f64]),
) -> io::Result<()> {
    let mut row = vec![0.0; chosen.len()];
    if let Some(size) = element.size() {
        let offset = |at: usize| element.properties[..at].iter().map(|p| p.number.size()).sum();
        let columns: Vec<(usize, NumberType)> =
            chosen.iter().map(|&at| (offset(at), element.properties[at].number)).collect();
        return records::read(reader, size, element.n, |bytes| {
            for (value, (offset, number)) in row.iter_mut().zip(&columns) {
                *value = number.decode(&bytes[*offset..], order);
            }
            each(&row);
        });
    }
    for i in 0..element.n {
        let read = read_row(element, chosen, &mut row, |property, length| {
            let number = length.unwrap_or(property.number);
            let mut bytes = [0; 8];
            reader.read_exact(&mut bytes[..number.size()])?;
            let value = number.decode(&bytes, order);
            if length.is_some() && value < 0.0 {
                return Err(invalid(format!("the list {} has length {value}", property.name)));
            }
            Ok(value)
        });
        read.map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => records::truncated(i, element.n),
            _ => error,
        })?;
        each(&row);
    }
    Ok(())
}

/// Reads one element and stores the chosen numbers in `row`. `next` reads a number of the given
/// type: that of a property, or the length of a list.
fn read_row<E>(
    element: &Element,
    chosen: &[usize],
    row: &mut Vec<f64>,
    mut next: impl FnMut(&Property, Option<NumberType>) -> Result<f64, E>,
) -> Result<(), E> {
    row.clear();
    row.resize(chosen.iter().filter(|&&at| element.properties[at].length.is_none()).count(), 0.0);
    for (at, property) in element.properties.iter().enumerate() {
        let column = chosen.iter().position(|&place| place == at);
        if property.length.is_some() {
            for _ in 0..next(property, property.length)? as u64 {
                let value = next(property, None)?;
                row.extend(column.map(|_| value));
            }
        } else {
            let value = next(property, None)?;
            if let Some(column) = column {
                row[column] = value;
            }
        }
    }
    Ok(())
}
