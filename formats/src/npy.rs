//! NumPy's array header, for what `ndarray-npy` leaves open: arrays of text,
//! arrays that are streamed, and headers that promise more than the file holds.
//!
//! Format: NumPy enhancement proposal 1, `numpy.lib.format`.

use std::io::{self, Read};

use py_literal::Value;

const MAGIC: &[u8] = b"\x93NUMPY";
/// Data begins at a multiple of this.
const ALIGNMENT: usize = 64;
/// No header of an array of ours comes near it; NumPy itself refuses to parse
/// more than 10,000 bytes.
const LONGEST_HEADER: u64 = 1 << 20;

/// What an array's header says.
pub(crate) struct Header {
    /// The type of an element, as in `<f4`; empty for a record.
    pub descr: String,
    /// The size along each axis.
    pub shape: Vec<usize>,
    /// The header itself, from the magic string to the data.
    pub bytes: Vec<u8>,
}

impl Header {
    /// How many elements the header promises, if that many can be counted.
    pub fn n_elements(&self) -> Option<usize> {
        // A zero makes the product 0 whatever the others are.
        if self.shape.contains(&0) {
            return Some(0);
        }
        self.shape.iter().try_fold(1usize, |product, &size| product.checked_mul(size))
    }
}

/// The header of an array in C order.
pub(crate) fn header_bytes(descr: &str, shape: &[usize]) -> Vec<u8> {
    let sizes: Vec<_> = shape.iter().map(usize::to_string).collect();
    // Python's tuple of one ends in a comma.
    let comma = if shape.len() == 1 { "," } else { "" };
    let sizes = sizes.join(", ");
    let dictionary =
        format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({sizes}{comma}), }}");
    // Magic, version, length of two bytes; the newline ends the padding.
    let unpadded = MAGIC.len() + 2 + 2 + dictionary.len() + 1;
    let length = dictionary.len() + 1 + unpadded.next_multiple_of(ALIGNMENT) - unpadded;
    let mut bytes = [MAGIC, &[1, 0], &(length as u16).to_le_bytes()].concat();
    bytes.extend_from_slice(dictionary.as_bytes());
    bytes.resize(unpadded.next_multiple_of(ALIGNMENT) - 1, b' ');
    bytes.push(b'\n');
    bytes
}

/// Reads a header and nothing after it.
pub(crate) fn read_header(reader: &mut impl Read) -> io::Result<Header> {
    let mut bytes = vec![0; MAGIC.len() + 2];
    reader.read_exact(&mut bytes)?;
    if !bytes.starts_with(MAGIC) {
        return Err(invalid("not a NumPy array"));
    }
    let length_size = match bytes[MAGIC.len()] {
        1 => 2,
        2 | 3 => 4,
        version => return Err(invalid(format!("unknown NPY version {version}"))),
    };
    let mut length = [0; 4];
    reader.read_exact(&mut length[..length_size])?;
    bytes.extend_from_slice(&length[..length_size]);
    let length = u64::from(u32::from_le_bytes(length));
    if length > LONGEST_HEADER {
        return Err(invalid(format!("a header of {length} bytes")));
    }
    let start = bytes.len();
    if reader.take(length).read_to_end(&mut bytes)? as u64 != length {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    let text = std::str::from_utf8(&bytes[start..]).map_err(invalid)?;
    let dictionary: Value = text.trim_end().parse().map_err(invalid)?;
    let (descr, shape) = interpret(&dictionary)
        .ok_or_else(|| invalid(format!("a header that makes no sense: {dictionary}")))?;
    Ok(Header { descr, shape, bytes })
}

fn interpret(dictionary: &Value) -> Option<(String, Vec<usize>)> {
    let entries = dictionary.as_dict()?;
    let entry = |name: &str| {
        let found = entries.iter().find(|(key, _)| key.as_string().is_some_and(|key| key == name));
        found.map(|(_, value)| value)
    };
    let descr = entry("descr")?.as_string().cloned().unwrap_or_default();
    let shape = entry("shape")?.as_tuple()?;
    let sizes = shape.iter().map(|size| usize::try_from(size.as_integer()?).ok());
    Some((descr, sizes.collect::<Option<_>>()?))
}

pub(crate) fn invalid(cause: impl ToString) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, cause.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn with_dictionary(dictionary: &str) -> Vec<u8> {
        let length = (dictionary.len() as u16).to_le_bytes();
        [MAGIC, &[1, 0], &length, dictionary.as_bytes()].concat()
    }

    #[test]
    fn what_is_written_is_what_numpy_writes() {
        let bytes = header_bytes("<f4", &[5, 3]);
        assert_eq!(bytes.len(), 128);
        let text = "{'descr': '<f4', 'fortran_order': False, 'shape': (5, 3), }";
        assert_eq!(&bytes[..10], b"\x93NUMPY\x01\0\x76\0");
        assert!(bytes[10..].starts_with(text.as_bytes()));
        assert!(bytes.ends_with(b" \n"));
    }

    #[test]
    fn a_header_that_lies_is_an_error() {
        for dictionary in [
            "{",
            "[]",
            "{'descr': '<f4'}",
            "{'descr': '<f4', 'shape': (-1,)}",
            "{'descr': '<f4', 'shape': (99999999999999999999,)}",
            &"(".repeat(60_000),
        ] {
            assert!(read_header(&mut &with_dictionary(dictionary)[..]).is_err(), "{dictionary}");
        }
        let many = with_dictionary("{'descr': '<f4', 'shape': (4294967296, 4294967296)}");
        assert_eq!(read_header(&mut &many[..]).unwrap().n_elements(), None);
    }

    proptest! {
        #[test]
        fn a_header_comes_back(shape in prop::collection::vec(any::<usize>(), 0..5)) {
            let bytes = header_bytes("<U12", &shape);
            prop_assert_eq!(bytes.len() % ALIGNMENT, 0);
            let header = read_header(&mut &bytes[..]).unwrap();
            prop_assert_eq!(header.descr, "<U12");
            prop_assert_eq!(header.shape, shape);
            prop_assert_eq!(header.bytes, bytes);
        }

        #[test]
        fn no_bytes_make_the_reader_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let _ = read_header(&mut &[MAGIC, &[1, 0], &bytes].concat()[..]);
        }
    }
}
