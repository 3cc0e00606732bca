//! NumPy's array files: a header, followed by the elements.
//!
//! Format: NumPy enhancement proposal 1, `numpy.lib.format`. The crate
//! `ndarray-npy` is not used: its parser of Python literals (`py_literal`, over
//! `pest` and `psm`) needs a C compiler for the target, which a cross build for
//! the Raspberry Pi should not need; and it reads neither text nor streams.

use std::io::{self, Read, Write};

use crate::decoding::{excerpt, invalid};
use crate::number::{ByteOrder, Number, NumberType};
use crate::python_literal::{dictionary, record, string, tuple};
use crate::records;

pub(crate) const MAGIC: &[u8] = b"\x93NUMPY";
/// The data begin at a multiple of this.
const ALIGNMENT: usize = 64;
/// The longest header that is read. NumPy itself refuses to parse more than
/// 10,000 bytes.
const LONGEST_HEADER: u64 = 1 << 20;

#[derive(Debug, PartialEq)]
pub(crate) struct Header {
    /// The type of an element, as in `<f4`, or the list of a record's fields.
    pub descr: String,
    /// Whether the first index, not the last, runs fastest.
    pub is_fortran_order: bool,
    pub shape: Vec<usize>,
    /// Bytes of the header itself, from the magic string to the data.
    pub n_bytes: usize,
}

impl Header {
    /// The number of elements by the header, unless it overflows.
    pub fn n_elements(&self) -> Option<usize> {
        // With a zero the product is 0, even if the other sizes overflow.
        if self.shape.contains(&0) {
            return Some(0);
        }
        self.shape.iter().try_fold(1usize, |product, &size| product.checked_mul(size))
    }

    /// The type of an element, if it is a number.
    pub fn number(&self) -> Option<(NumberType, ByteOrder)> {
        number(&self.descr)
    }

    /// The fields of a record that are single numbers, with their names, types and offsets, and the
    /// size of the record, bytes.
    pub fn record(&self) -> Option<(Vec<RecordField<'_>>, usize)> {
        let (mut numbers, mut end) = (Vec::new(), 0usize);
        for (name, kind, count) in record(&self.descr)? {
            if let Some((number, order)) = number(kind).filter(|_| count == 1) {
                numbers.push(RecordField { name, number, order, offset: end });
            }
            end = end.checked_add(size_of_element(kind)?.checked_mul(count)?)?;
        }
        Some((numbers, end))
    }

    /// As [`Header::number`], with an error for other types.
    pub fn number_or_error(&self) -> io::Result<(NumberType, ByteOrder)> {
        let not_numbers = || match self.descr.as_str() {
            "|O" => invalid("expected numbers, found pickled Python objects"),
            descr => {
                invalid(format!("expected numbers, found elements of type `{}`", excerpt(descr)))
            }
        };
        self.number().ok_or_else(not_numbers)
    }
}

/// A number in a record.
pub(crate) struct RecordField<'a> {
    pub name: &'a str,
    pub number: NumberType,
    pub order: ByteOrder,
    pub offset: usize,
}

fn number(descr: &str) -> Option<(NumberType, ByteOrder)> {
    let order = match descr.get(..1)? {
        ">" => ByteOrder::Big,
        "<" | "|" => ByteOrder::Little,
        _ => return None,
    };
    Some((NumberType::of_numpy(&descr[1..])?, order))
}

/// Bytes of an element of any type but Python's objects.
fn size_of_element(descr: &str) -> Option<usize> {
    let kind = descr.trim_start_matches(['<', '>', '|']);
    // A unit may follow: `M8[ns]`.
    let size: usize = kind.get(1..)?.split('[').next()?.parse().ok()?;
    if kind.starts_with('U') { size.checked_mul(4) } else { Some(size) }
}

/// The header of an array in C order, as NumPy writes it.
pub(crate) fn header_bytes(descr: &str, shape: &[usize]) -> Vec<u8> {
    header_ending_in(", }", descr, shape)
}

/// A header whose Python dictionary closes with `ending`.
pub(crate) fn header_ending_in(ending: &str, descr: &str, shape: &[usize]) -> Vec<u8> {
    let sizes: Vec<_> = shape.iter().map(usize::to_string).collect();
    // Python's tuple of one ends in a comma.
    let comma = if shape.len() == 1 { "," } else { "" };
    let sizes = sizes.join(", ");
    let dictionary =
        format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({sizes}{comma}){ending}");
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
pub(crate) fn read_header(reader: &mut (impl Read + ?Sized)) -> io::Result<Header> {
    let mut start = [0; MAGIC.len() + 2];
    reader.read_exact(&mut start)?;
    if !start.starts_with(MAGIC) {
        return Err(invalid("expected a NumPy array"));
    }
    let length_size = match start[MAGIC.len()] {
        1 => 2,
        2 | 3 => 4,
        version => return Err(invalid(format!("expected NPY version 1, 2 or 3, found {version}"))),
    };
    let mut length = [0; 4];
    reader.read_exact(&mut length[..length_size])?;
    let length = u64::from(u32::from_le_bytes(length));
    if length > LONGEST_HEADER {
        return Err(invalid(format!(
            "expected a header of at most {LONGEST_HEADER} bytes, found {length}"
        )));
    }
    let mut text = Vec::new();
    if reader.take(length).read_to_end(&mut text)? as u64 != length {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    let n_bytes = start.len() + length_size + text.len();
    let text = std::str::from_utf8(&text).map_err(invalid)?;
    interpret(text, n_bytes).ok_or_else(|| {
        invalid(format!(
            "expected a dictionary with descr, fortran_order and shape, found {}",
            excerpt(text)
        ))
    })
}

fn interpret(text: &str, n_bytes: usize) -> Option<Header> {
    let entries = dictionary(text)?;
    let entry = |name: &str| entries.iter().find(|(key, _)| *key == name).map(|(_, value)| *value);
    let descr = entry("descr")?;
    let is_fortran_order = match entry("fortran_order")? {
        "True" => true,
        "False" => false,
        _ => return None,
    };
    let shape = tuple(entry("shape")?)?;
    let descr = string(descr).map_or(descr, |(descr, _)| descr).to_owned();
    Some(Header { descr, is_fortran_order, shape, n_bytes })
}

/// NumPy's name of the type that [`write_array`] writes.
fn descr(number: NumberType) -> String {
    let order = if number.size() == 1 { '|' } else { '<' };
    format!("{order}{}", number.numpy())
}

/// Writes a whole array, of `elements` in C order.
pub(crate) fn write_array<A: Number>(
    writer: &mut impl Write,
    shape: &[usize],
    elements: impl IntoIterator<Item = A>,
) -> io::Result<()> {
    // Recorded hashes of datasets depend on this brace; NumPy itself writes a
    // comma before it.
    writer.write_all(&header_ending_in("}", &descr(A::TYPE), shape))?;
    elements
        .into_iter()
        .try_for_each(|element| writer.write_all(element.to_little_endian().as_ref()))
}

/// Reads a whole array, whose elements must be of the type `A`, and returns them in C order.
pub(crate) fn read_elements<A: Number>(
    reader: &mut (impl Read + ?Sized),
    header: &Header,
) -> io::Result<Vec<A>> {
    let order = match header.number() {
        Some((number, order)) if number == A::TYPE => order,
        _ => {
            let expected = descr(A::TYPE);
            return Err(invalid(format!(
                "expected elements of type {expected}, found {}",
                header.descr
            )));
        }
    };
    read_in_c_order(reader, header, size_of::<A>(), |bytes| A::from_bytes(bytes, order))
}

/// Checks that an array has the shape `[n, width]`, or `[n]` if `width` is 1.
pub(crate) fn check_columns(header: &Header, width: usize, n: usize) -> io::Result<()> {
    match header.shape[..] {
        [found] if width == 1 && found == n => Ok(()),
        [found, columns] if columns == width && found == n => Ok(()),
        [found] if width == 1 => Err(other_length(n, found)),
        [found, columns] if columns == width => Err(other_length(n, found)),
        _ => Err(invalid(format!("expected shape [{n}, {width}], found {:?}", header.shape))),
    }
}

fn other_length(expected: usize, found: usize) -> io::Error {
    invalid(format!("expected {expected} values, one for each point, found {found}"))
}

/// Reads a whole array of numbers and returns them in C order, each converted by `convert`.
pub(crate) fn read_numbers<T: Copy>(
    reader: &mut (impl Read + ?Sized),
    header: &Header,
    convert: impl Fn(f64) -> T,
) -> io::Result<Vec<T>> {
    let (number, order) = header.number_or_error()?;
    read_in_c_order(reader, header, number.size(), |bytes| convert(number.decode(bytes, order)))
}

fn read_in_c_order<T: Copy>(
    reader: &mut (impl Read + ?Sized),
    header: &Header,
    size: usize,
    decode: impl Fn(&[u8]) -> T,
) -> io::Result<Vec<T>> {
    let n = header
        .n_elements()
        .ok_or_else(|| invalid("the shape has more elements than memory can hold"))?;
    let mut elements = Vec::new();
    records::read(reader, size, n as u64, |bytes| elements.push(decode(bytes)))?;
    if header.is_fortran_order { Ok(to_c_order(&elements, &header.shape)) } else { Ok(elements) }
}

fn to_c_order<A: Copy>(elements: &[A], shape: &[usize]) -> Vec<A> {
    let place = |index: usize| {
        let mut rest = index;
        let mut strides_left = elements.len();
        let mut place = 0;
        for &size in shape.iter().rev() {
            strides_left /= size;
            place += rest % size * strides_left;
            rest /= size;
        }
        elements[place]
    };
    (0..elements.len()).map(place).collect()
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
    fn arrays_have_the_bytes_of_numpy() {
        let bytes = header_bytes("<f4", &[5, 3]);
        assert_eq!(bytes.len(), 128);
        let text = "{'descr': '<f4', 'fortran_order': False, 'shape': (5, 3), }";
        assert_eq!(&bytes[..10], b"\x93NUMPY\x01\0\x76\0");
        assert!(bytes[10..].starts_with(text.as_bytes()));
        assert!(bytes.ends_with(b" \n"));
    }

    #[test]
    fn a_header_may_be_written_in_any_way_of_pythons() {
        for (dictionary, descr, is_fortran_order, shape) in [
            ("{'shape':(),'fortran_order':True,'descr':'|u1'}", "|u1", true, &[][..]),
            ("{\"descr\": \"<f8\", 'fortran_order': False, 'shape': (7,)}  \n", "<f8", false, &[7]),
            (
                "{ 'descr' : '<f4', 'fortran_order': False, 'shape': (3L, 4L) }",
                "<f4",
                false,
                &[3, 4],
            ),
            (
                "{'descr': [('x', '<f4'), ('y,}', '<f4')], 'fortran_order': False, 'shape': (2,), }",
                "[('x', '<f4'), ('y,}', '<f4')]",
                false,
                &[2],
            ),
        ] {
            let header = read_header(&mut &with_dictionary(dictionary)[..]).unwrap();
            let expected = Header {
                descr: descr.to_owned(),
                is_fortran_order,
                shape: shape.to_vec(),
                n_bytes: 10 + dictionary.len(),
            };
            assert_eq!(header, expected);
        }
    }

    #[test]
    fn a_header_that_lies_is_an_error() {
        for dictionary in [
            "{",
            "[]",
            "{'descr': '<f4'}",
            "{'descr': '<f4', 'shape': (1,)}",
            "{'descr': '<f4', 'fortran_order': 0, 'shape': (1,)}",
            "{'descr': '<f4', 'fortran_order': False, 'shape': (-1,)}",
            "{'descr': '<f4', 'fortran_order': False, 'shape': (,)}",
            "{'descr': '<f4', 'fortran_order': False, 'shape': (1,) 'x': 2}",
            "{'descr': '<f4', 'fortran_order': False, 'shape': (99999999999999999999,)}",
            &"(".repeat(60_000),
        ] {
            assert!(read_header(&mut &with_dictionary(dictionary)[..]).is_err(), "{dictionary}");
        }
        let many = "{'descr': '<f4', 'fortran_order': False, 'shape': (4294967296, 4294967296)}";
        let header = read_header(&mut &with_dictionary(many)[..]).unwrap();
        assert_eq!(header.n_elements(), None);
    }

    #[test]
    fn elements_come_in_c_order_or_are_an_error() {
        let header = |descr: &str, is_fortran_order, shape: &[usize]| Header {
            descr: descr.to_owned(),
            is_fortran_order,
            shape: shape.to_vec(),
            n_bytes: 0,
        };
        let read = |is_fortran_order, shape: &[usize]| {
            let header = header("|u1", is_fortran_order, shape);
            read_elements::<u8>(&mut &[0, 1, 2, 3, 4, 5][..], &header).unwrap()
        };
        assert_eq!(read(false, &[2, 3]), [0, 1, 2, 3, 4, 5]);
        assert_eq!(read(true, &[2, 3]), [0, 2, 4, 1, 3, 5]);
        assert_eq!(read(true, &[3, 1, 2]), [0, 3, 1, 4, 2, 5]);
        assert!(read(true, &[0, usize::MAX, usize::MAX]).is_empty());

        let endless = header("<f4", false, &[usize::MAX, usize::MAX]);
        let error = read_elements::<f32>(&mut io::empty(), &endless).unwrap_err();
        assert_eq!(error.to_string(), "the shape has more elements than memory can hold");
        let error = read_elements::<f64>(&mut io::empty(), &endless).unwrap_err();
        assert_eq!(error.to_string(), "expected elements of type <f8, found <f4");
    }

    proptest! {
        #[test]
        fn a_header_comes_back(shape in prop::collection::vec(any::<usize>(), 0..5)) {
            let bytes = header_bytes("<U12", &shape);
            prop_assert_eq!(bytes.len() % ALIGNMENT, 0);
            let header = read_header(&mut &bytes[..]).unwrap();
            prop_assert_eq!(header.descr, "<U12");
            prop_assert_eq!(header.shape, shape);
            prop_assert_eq!(header.n_bytes, bytes.len());
        }

        #[test]
        fn no_bytes_make_the_reader_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let _ = read_header(&mut &[MAGIC, &[1, 0], &bytes].concat()[..]);
        }
    }
}
