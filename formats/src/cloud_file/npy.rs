//! NumPy's arrays as clouds: each row is a point, and the first three columns are x, y, z. Records
//! have fields of these names.

use std::io::{self, Read, Write};
use std::path::Path;

use super::Cloud;
use super::columns::{self, Extra, Rows};
use super::precision::Precision;
use crate::decoding::{error_in, excerpt, invalid};
use crate::error::FormatError;
use crate::npy::{self, Header, RecordField};
use crate::number::{ByteOrder, NumberType};
use crate::records;

pub(super) fn read(reader: &mut impl Read, name: &Path) -> Result<Cloud, FormatError> {
    let header = npy::read_header(reader).map_err(|error| error_in(name, "header", error))?;
    read_points(&header, reader).map_err(|error| error_in(name, "array", error))
}

pub(super) fn holds_points(header: &Header) -> bool {
    let is_table = matches!(header.shape[..], [_, columns] if columns >= 3);
    (is_table && header.number().is_some()) || columns(header).is_some()
}

/// The coordinates x, y and z of a record and what else there is of a point, and the size of a record,
/// bytes.
fn columns(header: &Header) -> Option<(Vec<RecordField<'_>>, Vec<Extra>, usize)> {
    let (mut fields, size) = header.record()?;
    let mut take = |name: &str| {
        let at = fields.iter().position(|field| field.name.eq_ignore_ascii_case(name))?;
        Some(fields.swap_remove(at))
    };
    let mut columns = vec![take("x")?, take("y")?, take("z")?];
    let (more, extras): (Vec<_>, _) = columns::find(take).into_iter().unzip();
    columns.extend(more);
    Some((columns, extras, size))
}

/// Most values of a point. A wider array of three rows is transposed.
const WIDEST_POINT: usize = 64;

/// Reads the points that follow `header`: numbers of any type.
pub(super) fn read_points(header: &Header, reader: &mut (impl Read + ?Sized)) -> io::Result<Cloud> {
    if let Some((columns, extras, size)) = columns(header) {
        let n = header.n_elements().unwrap_or(usize::MAX);
        let (mut rows, mut row) = (Rows::new(extras), vec![0.0; columns.len()]);
        records::read(reader, size, n as u64, |record| {
            for (value, column) in row.iter_mut().zip(&columns) {
                *value = column.number.decode(&record[column.offset..], column.order);
            }
            rows.push(&row);
        })?;
        return Ok(rows.cloud());
    }
    let mut points = Vec::new();
    if header.descr.starts_with('[') {
        let found = excerpt(&header.descr);
        return Err(invalid(format!("expected records with numbers x, y and z, found {found}")));
    }
    let (n, columns) = match header.shape[..] {
        [3, n] if n > WIDEST_POINT => {
            return Err(invalid(format!("expected shape [n, 3], found [3, {n}]: transpose it")));
        }
        [n, columns] if columns >= 3 => (n, columns),
        [m, n, 3] => {
            return Err(invalid(format!(
                "expected shape [n, 3], found {m} clouds of {n} points: `edgepuck eval` classifies \
                 packed sets"
            )));
        }
        _ => return Err(invalid(format!("expected shape [n, 3], found {:?}", header.shape))),
    };
    let (number, order) = header.number_or_error()?;
    if header.is_fortran_order {
        read_columns(reader, n as u64, number, order, &mut points)?;
        return Ok(Cloud { points, ..Cloud::default() });
    }
    let size = number.size();
    records::read(reader, columns.saturating_mul(size), n as u64, |row| {
        points.push([0, 1, 2].map(|axis| number.decode(&row[axis * size..], order)));
    })?;
    Ok(Cloud { points, ..Cloud::default() })
}

/// Reads all x, then all y, then all z.
fn read_columns(
    reader: &mut (impl Read + ?Sized),
    n: u64,
    number: NumberType,
    order: ByteOrder,
    points: &mut Vec<[f64; 3]>,
) -> io::Result<()> {
    records::read(reader, number.size(), n, |x| points.push([number.decode(x, order), 0.0, 0.0]))?;
    for axis in [1, 2] {
        let mut rest = points.iter_mut();
        records::read(reader, number.size(), n, |bytes| {
            if let Some(point) = rest.next() {
                point[axis] = number.decode(bytes, order);
            }
        })?;
    }
    Ok(())
}

/// Writes `points` as an array of shape `[n, 3]`.
pub(super) fn write(
    writer: &mut impl Write,
    points: &[[f64; 3]],
    precision: Precision,
) -> io::Result<()> {
    let shape = [points.len(), 3];
    let coordinates = points.as_flattened().iter();
    match precision {
        Precision::Single => npy::write_array(writer, &shape, coordinates.map(|&x| x as f32)),
        Precision::Double => npy::write_array(writer, &shape, coordinates.copied()),
    }
}
