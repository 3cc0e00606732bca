//! NumPy's array files: the elements behind the header.

use std::io::{self, Read, Write};

use crate::decoding::invalid;
use crate::npy_header::{Header, header_ending_in};
use crate::number::{Number, NumberType};
use crate::records;

/// NumPy's name of the type that [`write_array`] writes.
fn descr(number: NumberType) -> &'static str {
    match number {
        NumberType::I8 => "|i1",
        NumberType::U8 => "|u1",
        NumberType::I16 => "<i2",
        NumberType::U16 => "<u2",
        NumberType::I32 => "<i4",
        NumberType::U32 => "<u4",
        NumberType::I64 => "<i8",
        NumberType::U64 => "<u8",
        NumberType::F16 => "<f2",
        NumberType::F32 => "<f4",
        NumberType::F64 => "<f8",
    }
}

/// Writes a whole array, of `elements` in C order.
pub(crate) fn write_array<A: Number>(
    writer: &mut impl Write,
    shape: &[usize],
    elements: impl IntoIterator<Item = A>,
) -> io::Result<()> {
    // Recorded hashes of datasets depend on this brace; NumPy itself writes a
    // comma before it.
    writer.write_all(&header_ending_in("}", descr(A::TYPE), shape))?;
    elements
        .into_iter()
        .try_for_each(|element| writer.write_all(element.to_little_endian().as_ref()))
}

/// Reads the elements of a whole array in C order, whichever order the file
/// has. They must be of the type `A`.
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

/// Reads the elements of a whole array in C order, numbers of any type, each
/// through `convert`.
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

    #[test]
    fn elements_come_in_c_order() {
        let header = |is_fortran_order, shape: &[usize]| Header {
            descr: "|u1".to_owned(),
            is_fortran_order,
            shape: shape.to_vec(),
            n_bytes: 0,
        };
        let read = |header| read_elements::<u8>(&mut &[0, 1, 2, 3, 4, 5][..], &header).unwrap();
        assert_eq!(read(header(false, &[2, 3])), [0, 1, 2, 3, 4, 5]);
        assert_eq!(read(header(true, &[2, 3])), [0, 2, 4, 1, 3, 5]);
        assert_eq!(read(header(true, &[3, 1, 2])), [0, 3, 1, 4, 2, 5]);
        assert!(read(header(true, &[0, usize::MAX, usize::MAX])).is_empty());
    }

    #[test]
    fn elements_that_cannot_be_counted_are_an_error() {
        let header = Header {
            descr: "<f4".to_owned(),
            is_fortran_order: false,
            shape: vec![usize::MAX, usize::MAX],
            n_bytes: 0,
        };
        let error = read_elements::<f32>(&mut io::empty(), &header).unwrap_err();
        assert_eq!(error.to_string(), "the shape has more elements than memory can hold");
        let error = read_elements::<f64>(&mut io::empty(), &header).unwrap_err();
        assert_eq!(error.to_string(), "expected elements of type <f8, found <f4");
    }
}
