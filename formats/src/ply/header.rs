//! The header of PLY files.

use std::io::BufRead;
use std::path::Path;

use crate::decoding::excerpt;
use crate::error::FormatError;
use crate::lines::{Line, Lines};
use crate::number::{ByteOrder, NumberType};
use crate::scan::{OBJECT_TEXTS, pose_of};

pub(super) struct Header {
    pub encoding: Encoding,
    pub frame: Frame,
    /// The kinds of elements, in the order of the file.
    pub elements: Vec<Element>,
}

/// What comments of scans say of the positions.
#[derive(Clone, Default)]
pub struct Frame {
    /// An offset to add to every position: `origin X Y Z`.
    pub origin: Option<[f64; 3]>,
    /// From the sensor's frame to the world's: `pose`, and 16 numbers row by row.
    pub pose: Option<[f64; 16]>,
    /// The objects' names and labels: their key, the index and the text.
    pub object_texts: [Vec<String>; 2],
}

#[derive(Clone, Copy)]
pub(super) enum Encoding {
    /// A line for each element.
    Ascii,
    Binary(ByteOrder),
}

/// A kind of element; the file has `n` of it.
pub struct Element {
    pub(super) name: String,
    pub(super) n: u64,
    pub(super) properties: Vec<Property>,
}

pub(super) struct Property {
    pub name: String,
    /// The type of its number, or of its list's numbers.
    pub number: NumberType,
    /// The type of the length, if it is a list.
    pub length: Option<NumberType>,
}

impl Element {
    /// Whether it has a property of this name, in upper or lower case.
    #[must_use]
    pub fn has(&self, name: &str) -> bool {
        self.place(name).is_some()
    }

    /// Whether the file has none of it.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.n == 0
    }

    fn place(&self, name: &str) -> Option<usize> {
        self.properties.iter().position(|property| property.name.eq_ignore_ascii_case(name))
    }

    /// The index of the property `name`, in upper or lower case, which must be a number.
    pub fn scalar(&self, name: &str) -> Result<usize, String> {
        match self.place(name) {
            None => Err(format!("property {name} is missing")),
            Some(at) if self.properties[at].length.is_some() => {
                Err(format!("expected a number as property {name}, found a list"))
            }
            Some(at) => Ok(at),
        }
    }

    /// The index of the first list with one of these names.
    pub fn list(&self, names: &[&str]) -> Result<usize, String> {
        let is_wanted = |p: &Property| p.length.is_some() && names.contains(&p.name.as_str());
        let at = self.properties.iter().position(is_wanted);
        at.ok_or_else(|| format!("expected a list called {}", names.join(" or ")))
    }

    /// Whether the property at this index is of type `float`.
    #[must_use]
    pub fn is_single(&self, at: usize) -> bool {
        self.properties[at].number == NumberType::F32
    }

    /// Bytes of a binary element, or `None` if it has a list.
    pub(super) fn size(&self) -> Option<usize> {
        let size = |property: &Property| match property.length {
            Some(_) => None,
            None => Some(property.number.size()),
        };
        self.properties.iter().try_fold(0, |sum: usize, property| Some(sum + size(property)?))
    }
}

/// Reads a header up to its last line, `end_header`.
pub(super) fn read_header<R: BufRead>(
    lines: &mut Lines<'_, R>,
    name: &Path,
) -> Result<Header, FormatError> {
    let wrong = |cause: &str| FormatError::malformed(name, "header", cause);
    match lines.next()? {
        Some(line) if line.text == "ply" => {}
        _ => return Err(wrong("expected `ply` as the first line")),
    }
    let (mut encoding, mut frame, mut elements) = (None, Frame::default(), Vec::new());
    while let Some(line) = lines.next()? {
        let mut words = line.text.split_ascii_whitespace();
        let keyword = words.next().unwrap_or_default();
        let words: Vec<_> = words.collect();
        match (keyword, &words[..]) {
            ("" | "obj_info", _) => {}
            ("comment", ["origin", words @ ..]) => {
                let origin = numbers(words).and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
                if origin.is_some_and(|origin| !origin.iter().all(|x| x.is_finite())) {
                    return Err(line.error("expected an origin of three finite numbers"));
                }
                frame.origin = frame.origin.or(origin);
            }
            ("comment", ["pose", words @ ..]) => {
                let pose = numbers(words).and_then(|numbers| pose_of(&numbers));
                frame.pose = frame.pose.or(pose);
            }
            ("comment", [key, number, text @ ..]) if OBJECT_TEXTS.contains(key) => {
                let texts = &mut frame.object_texts[usize::from(*key == OBJECT_TEXTS[1])];
                if number.parse() == Ok(texts.len()) {
                    texts.push(text.join(" "));
                }
            }
            ("comment", _) => {}
            ("format", [word, ..]) => encoding = Some(encoding_named(&line, word)?),
            ("element", [name, n]) => elements.push(Element {
                name: (*name).to_owned(),
                n: line.count(n)?,
                properties: Vec::new(),
            }),
            ("property", words) => {
                let element = elements.last_mut();
                let element = element
                    .ok_or_else(|| line.error("expected an element before its properties"))?;
                element.properties.push(property(&line, words)?);
            }
            ("end_header", []) => {
                let encoding = encoding.ok_or_else(|| wrong("the line `format` is missing"))?;
                return Ok(Header { encoding, frame, elements });
            }
            _ => {
                return Err(line
                    .error(format!("expected a keyword of PLY, found `{}`", excerpt(&line.text))));
            }
        }
    }
    Err(wrong("the file ends before `end_header`"))
}

fn numbers(words: &[&str]) -> Option<Vec<f64>> {
    words.iter().map(|word| word.parse().ok()).collect()
}

fn encoding_named(line: &Line<'_>, word: &str) -> Result<Encoding, FormatError> {
    match word {
        "ascii" => Ok(Encoding::Ascii),
        "binary_little_endian" => Ok(Encoding::Binary(ByteOrder::Little)),
        "binary_big_endian" => Ok(Encoding::Binary(ByteOrder::Big)),
        other => Err(line.error(format!(
            "expected ascii, binary_little_endian or binary_big_endian, found `{}`",
            excerpt(other)
        ))),
    }
}

fn property(line: &Line<'_>, words: &[&str]) -> Result<Property, FormatError> {
    let (length, number, name) = match words {
        ["list", length, number, name] => (Some(number_named(line, length)?), number, name),
        [number, name] => (None, number, name),
        _ => return Err(line.error("expected `property TYPE NAME`")),
    };
    if let Some(NumberType::F32 | NumberType::F64) = length {
        return Err(line.error("expected a whole number as the type of a list's length"));
    }
    Ok(Property { name: (*name).to_owned(), number: number_named(line, number)?, length })
}

fn number_named(line: &Line<'_>, word: &str) -> Result<NumberType, FormatError> {
    Ok(match word {
        "char" | "int8" => NumberType::I8,
        "uchar" | "uint8" => NumberType::U8,
        "short" | "int16" => NumberType::I16,
        "ushort" | "uint16" => NumberType::U16,
        "int" | "int32" => NumberType::I32,
        "uint" | "uint32" => NumberType::U32,
        "float" | "float32" => NumberType::F32,
        "double" | "float64" => NumberType::F64,
        other => {
            return Err(line.error(format!("expected a type of PLY, found `{}`", excerpt(other))));
        }
    })
}
