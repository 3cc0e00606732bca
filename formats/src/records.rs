//! Reads records of equal size, as binary files hold points.

use std::io::{self, Read};

use crate::decoding::invalid;

const BLOCK_SIZE: usize = 1 << 16;
/// The largest record that is read. No sensor has points of this size.
const LARGEST_RECORD: usize = 1 << 24;

/// Passes `n` records of `size` bytes to `each`. Memory does not grow with `n`, which comes from a
/// header and may be wrong.
pub(crate) fn read(
    reader: &mut (impl Read + ?Sized),
    size: usize,
    n: u64,
    each: impl FnMut(&[u8]),
) -> io::Result<()> {
    let (found, _) = read_at_most(reader, size, n, each)?;
    if found < n { Err(truncated(found, n)) } else { Ok(()) }
}

/// Checks that less than a record of `size` bytes is left after the `n` that a header states.
pub(crate) fn check_end(reader: &mut (impl Read + ?Sized), size: usize, n: u64) -> io::Result<()> {
    match io::copy(reader, &mut io::sink())? / size as u64 {
        0 => Ok(()),
        more => Err(invalid(format!("expected {n} by the header, found {}", n + more))),
    }
}

/// Passes every record of `size` bytes up to the end of the file to `each`, and returns the
/// number of bytes that are left over.
pub(crate) fn read_to_end(
    reader: &mut (impl Read + ?Sized),
    size: usize,
    each: impl FnMut(&[u8]),
) -> io::Result<usize> {
    read_at_most(reader, size, u64::MAX, each).map(|(_, rest)| rest)
}

pub(crate) fn truncated(found: u64, n: u64) -> io::Error {
    io::Error::new(io::ErrorKind::UnexpectedEof, format!("the file ends after {found} of {n}"))
}

pub(crate) fn skip(reader: &mut (impl Read + ?Sized), n: u64) -> io::Result<()> {
    let skipped = io::copy(&mut reader.take(n), &mut io::sink())?;
    if skipped < n { Err(io::ErrorKind::UnexpectedEof.into()) } else { Ok(()) }
}

/// Fills `buffer` as far as the reader has bytes, and returns their number.
pub(crate) fn fill(reader: &mut (impl Read + ?Sized), buffer: &mut [u8]) -> io::Result<usize> {
    let mut filled = 0;
    while filled < buffer.len() {
        match reader.read(&mut buffer[filled..]) {
            Ok(0) => break,
            Ok(n) => filled += n,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(filled)
}

/// Reads up to `n` records; returns their number and the bytes of an incomplete one.
fn read_at_most(
    reader: &mut (impl Read + ?Sized),
    size: usize,
    n: u64,
    mut each: impl FnMut(&[u8]),
) -> io::Result<(u64, usize)> {
    if !(1..=LARGEST_RECORD).contains(&size) {
        return Err(invalid(format!(
            "expected points of 1 to {LARGEST_RECORD} bytes, found {size}"
        )));
    }
    let per_block = (BLOCK_SIZE / size).max(1) as u64;
    let mut block = vec![0; per_block.min(n) as usize * size];
    let mut n_read = 0;
    while n_read < n {
        let wanted = (n - n_read).min(per_block) as usize * size;
        let filled = fill(reader, &mut block[..wanted])?;
        block[..filled].chunks_exact(size).for_each(&mut each);
        n_read += (filled / size) as u64;
        if filled < wanted {
            return Ok((n_read, filled % size));
        }
    }
    Ok((n_read, 0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_of_any_size_are_whole() {
        let bytes: Vec<u8> = (0..200_003u32).map(|i| i as u8).collect();
        for size in [1, 3, 16, 1000, BLOCK_SIZE + 1] {
            let mut seen = Vec::new();
            let rest = read_to_end(&mut &bytes[..], size, |record| {
                assert_eq!(record.len(), size);
                seen.extend_from_slice(record);
            });
            assert_eq!(rest.unwrap(), bytes.len() % size);
            assert_eq!(seen, bytes[..bytes.len() / size * size]);
        }
    }

    #[test]
    fn fewer_records_than_stated_are_an_error() {
        let mut n = 0;
        let error = read(&mut &[0; 10][..], 4, u64::MAX, |_| n += 1).unwrap_err();
        assert_eq!(error.to_string(), format!("the file ends after 2 of {}", u64::MAX));
        assert_eq!(n, 2);
        assert!(read(&mut &[0; 10][..], 0, 1, |_| ()).is_err());
        assert!(read(&mut &[0; 10][..], usize::MAX, 1, |_| ()).is_err());
        assert!(skip(&mut &[0; 10][..], u64::MAX).is_err());
    }
}
