//! The numbers that accessors name in the buffers of a glTF file.
//!
//! They are read here, because the crate's readers of accessors do not check their bounds.

use std::borrow::Cow;
use std::cell::Cell;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use gltf::accessor::{DataType, Dimensions};
use gltf::{Accessor, Gltf};

use crate::file::read;

/// More elements take more than 6 GB: a small file may name one accessor any number of times.
pub(super) const MOST_ELEMENTS: usize = 1 << 28;

pub(super) struct Buffers<'a> {
    content: Vec<Cow<'a, [u8]>>,
    /// How many more elements may be read.
    left: Cell<usize>,
}

impl<'a> Buffers<'a> {
    /// The buffers of `file`, of which others are in `folder`.
    pub fn of(file: &'a Gltf, folder: Option<&Path>) -> Result<Self, String> {
        let blob = file.blob.as_deref().unwrap_or_default();
        let content = file.buffers().map(|buffer| content(&buffer, blob, folder));
        Ok(Self { content: content.collect::<Result<_, _>>()?, left: Cell::new(MOST_ELEMENTS) })
    }

    /// Passes the numbers of each element of an accessor to `each`.
    pub fn each(
        &self,
        accessor: &Accessor<'_>,
        dimensions: Dimensions,
        mut each: impl FnMut(&[f64; 4]),
    ) -> Result<(), String> {
        let place = format!("accessors[{}]", accessor.index());
        if accessor.dimensions() != dimensions {
            return Err(format!(
                "{place}: expected {dimensions:?}, found {:?}",
                accessor.dimensions()
            ));
        }
        let (Some(view), None) = (accessor.view(), accessor.sparse()) else {
            return Err(format!(
                "{place}: expected a buffer view, found sparse or no numbers: export it without sparse accessors"
            ));
        };
        let kind = accessor.data_type();
        let (size, width) = (kind.size(), dimensions.multiplicity());
        let stride = view.stride().unwrap_or(size * width);
        if stride < size * width {
            let size = size * width;
            return Err(format!(
                "{place}: expected a stride of {size} bytes or more, found {stride}"
            ));
        }
        let bytes = &self.content[view.buffer().index()];
        let end = view.offset().checked_add(view.length());
        let bytes = end.and_then(|end| bytes.get(view.offset()..end));
        let bytes =
            bytes.ok_or_else(|| format!("{place}: its buffer view ends after the buffer"))?;
        let n = accessor.count();
        // The last element needs no whole stride.
        let last = n.saturating_sub(1).checked_mul(stride);
        let end = last
            .and_then(|last| last.checked_add(size * width))
            .and_then(|end| end.checked_add(accessor.offset()));
        if n > 0 && end.is_none_or(|end| end > bytes.len()) {
            return Err(format!(
                "{place}: expected {n} elements, found an end of the buffer view before"
            ));
        }
        let left = self.left.get().checked_sub(n);
        self.left.set(left.ok_or_else(|| {
            format!("{place}: expected {MOST_ELEMENTS} elements in all accessors, found more")
        })?);
        for i in 0..n {
            let element = &bytes[accessor.offset() + i * stride..];
            let mut numbers = [0.0; 4];
            for (at, number) in numbers[..width].iter_mut().enumerate() {
                *number = decode(kind, &element[at * size..], accessor.normalized());
            }
            each(&numbers);
        }
        Ok(())
    }
}

/// The bytes of a buffer: of the file itself, in base64, or of another file.
fn content<'a>(
    buffer: &gltf::Buffer<'_>,
    blob: &'a [u8],
    folder: Option<&Path>,
) -> Result<Cow<'a, [u8]>, String> {
    let place = format!("buffers[{}]", buffer.index());
    let found = match buffer.source() {
        gltf::buffer::Source::Bin => Cow::Borrowed(blob),
        gltf::buffer::Source::Uri(uri) => match (uri.strip_prefix("data:"), folder) {
            (Some(data), _) => {
                let text = data.split_once(";base64,").map(|(_, text)| text);
                let decoded = text.and_then(|text| STANDARD.decode(text).ok());
                let wrong = || format!("{place}: expected base64, found something else");
                Cow::Owned(decoded.ok_or_else(wrong)?)
            }
            (None, Some(folder)) => {
                let bytes = read(&folder.join(unescaped(uri)));
                Cow::Owned(bytes.map_err(|error| format!("{place}: {error}"))?)
            }
            (None, None) => {
                return Err(format!("{place}: expected its bytes, found the file {uri}"));
            }
        },
    };
    match found.len() < buffer.length() {
        true => Err(format!("{place}: expected {} bytes, found {}", buffer.length(), found.len())),
        false => Ok(found),
    }
}

/// `uri` with the bytes that `%XX` stands for (RFC 3986, 2.1).
fn unescaped(uri: &str) -> String {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let [first, others @ ..] = rest {
        let byte = (*first == b'%').then(|| others.get(..2)).flatten();
        let byte = byte.and_then(|hex| u8::from_str_radix(std::str::from_utf8(hex).ok()?, 16).ok());
        bytes.push(byte.unwrap_or(*first));
        rest = if byte.is_some() { &others[2..] } else { others };
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

pub(super) fn is_index(kind: DataType) -> bool {
    matches!(kind, DataType::U8 | DataType::U16 | DataType::U32)
}

/// A number, little-endian; a `normalized` one of whole numbers is a share of the largest
/// (glTF 2.0, 3.6.2.2).
fn decode(kind: DataType, bytes: &[u8], normalized: bool) -> f64 {
    let (number, most) = match kind {
        DataType::I8 => (f64::from(bytes[0] as i8), 127.0),
        DataType::U8 => (f64::from(bytes[0]), 255.0),
        DataType::I16 => (f64::from(i16::from_le_bytes([bytes[0], bytes[1]])), 32767.0),
        DataType::U16 => (f64::from(u16::from_le_bytes([bytes[0], bytes[1]])), 65535.0),
        DataType::U32 => {
            let [a, b, c, d, ..] = *bytes else { return 0.0 };
            (f64::from(u32::from_le_bytes([a, b, c, d])), f64::from(u32::MAX))
        }
        DataType::F32 => {
            let [a, b, c, d, ..] = *bytes else { return 0.0 };
            return f64::from(f32::from_le_bytes([a, b, c, d]));
        }
    };
    if normalized { (number / most).max(-1.0) } else { number }
}
