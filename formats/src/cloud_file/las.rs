//! LAS, the ASPRS's format of airborne scans.
//!
//! The crate `las` reads the header and knows the point formats. Its reader of
//! points is not used: it allocates memory by the stated sizes of records after the
//! points, so that a file of a hundred bytes can exhaust the memory.

use std::io::{self, BufRead, Read};
use std::path::Path;

use las::Transform;
use las::point::Format;
use las::raw::Header;

use super::Cloud;
use super::columns::{Extra, Rows, Unit};
use super::format::COMPRESSED_LAS;
use crate::decoding::{error_in, invalid};
use crate::error::FormatError;
use crate::number::{ByteOrder, NumberType};
use crate::records;

/// Reads every point, with the header's scale and offset applied.
pub(super) fn read(reader: &mut impl BufRead, name: &Path) -> Result<Cloud, FormatError> {
    let (header, n_bytes) = read_header(reader).map_err(|error| error_in(name, "header", error))?;
    let gap = u64::from(header.offset_to_point_data).checked_sub(n_bytes);
    let gap = gap.ok_or_else(|| {
        FormatError::malformed(name, "header", "the points begin before the header ends")
    })?;
    records::skip(reader, gap).map_err(|error| error_in(name, "header", error))?;
    let transforms = transforms(&header).map_err(|error| error_in(name, "header", error))?;
    let mut rows = Rows::new([Extra::Intensity(Unit::Las)]);
    let size = usize::from(header.point_data_record_length);
    records::read(reader, size, n_points(&header), |record| {
        let [x, y, z] = [0, 1, 2].map(|axis| coordinate(transforms[axis], &record[4 * axis..]));
        rows.push(&[x, y, z, NumberType::U16.decode(&record[12..], ByteOrder::Little)]);
    })
    .and_then(|()| match has_more(&header) {
        true => Ok(()),
        false => records::check_end(reader, size, n_points(&header)),
    })
    .map_err(|error| error_in(name, "points", error))?;
    Ok(rows.cloud())
}

/// The header and its size, bytes.
fn read_header(reader: &mut impl Read) -> io::Result<(Header, u64)> {
    let wrong = |error| match error {
        las::Error::Io(error) => error,
        other => invalid(other),
    };
    let start = start(reader)?;
    let header = Header::read_from((&*start).chain(&mut *reader)).map_err(wrong)?;
    let format = Format::new(header.point_data_record_format).map_err(wrong)?;
    if format.is_compressed {
        return Err(invalid(COMPRESSED_LAS));
    }
    let (found, least) = (header.point_data_record_length, format.len());
    if found < least {
        let format = header.point_data_record_format;
        return Err(invalid(format!(
            "expected points of {least} bytes in format {format}, found {found}"
        )));
    }
    let n_bytes = header.header_size.max(header.version.header_size());
    Ok((header, n_bytes.into()))
}

/// The bytes up to the end of the header, whose size they state (LAS 1.4 R15, table 3).
fn start(reader: &mut impl Read) -> io::Result<Vec<u8>> {
    // The header of LAS 1.2 and before.
    const LEAST: usize = 227;
    let mut start = Vec::new();
    reader.take(LEAST as u64).read_to_end(&mut start)?;
    let stated = start.get(94..96).map_or(0.0, |it| NumberType::U16.decode(it, ByteOrder::Little));
    let size = LEAST.max(stated as usize);
    if start.len() == LEAST {
        reader.take((size - LEAST) as u64).read_to_end(&mut start)?;
    }
    if start.starts_with(b"LASF") && start.len() < size {
        let cause = format!("the file ends after {} of {size} bytes", start.len());
        return Err(io::Error::new(io::ErrorKind::UnexpectedEof, cause));
    }
    Ok(start)
}

/// Whether something may follow the points: waveforms or extended records (LAS 1.3, 1.4).
fn has_more(header: &Header) -> bool {
    header.evlr.is_some_and(|evlr| evlr.number_of_evlrs > 0)
        || header.start_of_waveform_data_packet_record.is_some_and(|start| start > 0)
}

/// The number of points. The field of LAS 1.3 and before takes precedence unless it is 0 (LAS 1.4
/// R15, 2.4).
fn n_points(header: &Header) -> u64 {
    match (header.number_of_point_records, header.large_file) {
        (0, Some(large)) => large.number_of_point_records,
        (n, _) => n.into(),
    }
}

fn transforms(header: &Header) -> io::Result<[Transform; 3]> {
    let transforms = [
        Transform { scale: header.x_scale_factor, offset: header.x_offset },
        Transform { scale: header.y_scale_factor, offset: header.y_offset },
        Transform { scale: header.z_scale_factor, offset: header.z_offset },
    ];
    for (axis, Transform { scale, offset }) in ["x", "y", "z"].into_iter().zip(transforms) {
        if scale == 0.0 || !scale.is_finite() {
            let expected = "expected a finite number other than 0";
            return Err(invalid(format!("scale of {axis}: {expected}, found {scale}")));
        }
        if !offset.is_finite() {
            let expected = "expected a finite number";
            return Err(invalid(format!("offset of {axis}: {expected}, found {offset}")));
        }
    }
    Ok(transforms)
}

/// Every point format begins with x, y and z as i32, and the intensity as u16.
fn coordinate(transform: Transform, bytes: &[u8]) -> f64 {
    transform.scale * NumberType::I32.decode(bytes, ByteOrder::Little) + transform.offset
}
