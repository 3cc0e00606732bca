//! The header of PCD files: lines that begin with keywords.

use std::io::BufRead;
use std::path::Path;

use super::columns::{self, Extra};
use crate::decoding::excerpt;
use crate::error::FormatError;
use crate::lines::{Line, Lines};
use crate::number::{ByteOrder, NumberType};

pub(super) struct Header {
    pub n: u64,
    pub encoding: Encoding,
    fields: Vec<Field>,
    /// Where the points were seen from: a translation and a quaternion w, x, y, z.
    pub viewpoint: Option<[f64; 7]>,
}

/// One field: `count` numbers of `size` bytes.
struct Field {
    name: String,
    size: u64,
    kind: char,
    count: u64,
}

#[derive(Clone, Copy)]
pub(super) enum Encoding {
    /// A line for each point.
    Ascii,
    /// Binary, point by point.
    Binary,
    /// LZF-compressed, field by field.
    Compressed,
}

/// One number of every point.
#[derive(Clone, Copy)]
pub(super) struct Coordinate {
    pub number: NumberType,
    /// Its offset in a point, bytes.
    pub offset: u64,
    /// Its index among the numbers of a point.
    pub column: u64,
}

/// Reads a header up to its last line, `DATA`.
pub(super) fn read_header<R: BufRead>(
    lines: &mut Lines<'_, R>,
    name: &Path,
) -> Result<Header, FormatError> {
    let missing =
        |key: &str| FormatError::malformed(name, "header", format!("the line {key} is missing"));
    let mut fields: Vec<Field> = Vec::new();
    let (mut points, mut width, mut height, mut viewpoint) = (None, None, None, None);
    while let Some(line) = lines.next()? {
        let content = line.text.split('#').next().unwrap_or_default();
        let mut words = content.split_ascii_whitespace();
        let Some(key) = words.next() else { continue };
        match key.to_ascii_uppercase().as_str() {
            // Files before version 0.7 call them columns.
            "FIELDS" | "COLUMNS" => fields = words.map(Field::named).collect(),
            what @ ("SIZE" | "COUNT" | "TYPE") => {
                let words: Vec<_> = words.collect();
                if words.len() != fields.len() {
                    return Err(line.error(format!(
                        "expected {} words, one for each of FIELDS, found {}",
                        fields.len(),
                        words.len()
                    )));
                }
                for (field, word) in fields.iter_mut().zip(words) {
                    match what {
                        "SIZE" => field.size = line.count(word)?,
                        // Some writers pad with fields of count 0, which take no bytes.
                        "COUNT" => field.count = line.count(word)?,
                        _ => field.kind = word.chars().next().unwrap_or_default(),
                    }
                }
            }
            "POINTS" => points = Some(line.count(words.next().unwrap_or_default())?),
            "WIDTH" => width = Some(line.count(words.next().unwrap_or_default())?),
            "HEIGHT" => height = Some(line.count(words.next().unwrap_or_default())?),
            "VIEWPOINT" => {
                let numbers: Vec<f64> = words.map_while(|word| word.parse().ok()).collect();
                if numbers.iter().any(|x| !x.is_finite()) {
                    return Err(line.error("expected finite numbers, or no line VIEWPOINT"));
                }
                viewpoint = numbers.try_into().ok();
            }
            "DATA" => {
                let encoding = Encoding::named(&line, words.next().unwrap_or_default())?;
                let by_sides = width.zip(height).and_then(|(w, h): (u64, u64)| w.checked_mul(h));
                if let Some((n, by_sides)) = points.zip(by_sides).filter(|(n, sides)| n != sides) {
                    let cause = format!(
                        "expected as many POINTS as WIDTH times HEIGHT, {by_sides}, found {n}"
                    );
                    return Err(FormatError::malformed(name, "header", cause));
                }
                let n = points.or(by_sides).ok_or_else(|| missing("POINTS"))?;
                return Ok(Header { n, fields, encoding, viewpoint });
            }
            _ => {}
        }
    }
    Err(missing("DATA"))
}

impl Header {
    /// Bytes of a binary point; `u64::MAX` if the sum overflows.
    pub fn point_size(&self) -> u64 {
        self.fields.iter().fold(0, |sum: u64, field| sum.saturating_add(field.n_bytes()))
    }

    /// Drops the fields of padding, `_`.
    pub fn drop_padding(&mut self) {
        self.fields.retain(|field| field.name != "_");
    }

    /// The coordinates x, y and z, and what else there is of each point.
    pub fn columns(&self) -> Result<(Vec<Coordinate>, Vec<Extra>), String> {
        let (columns, extras): (Vec<_>, _) =
            columns::find(|name| self.coordinate(name).ok()).into_iter().unzip();
        let axes = ["x", "y", "z"].map(|axis| self.coordinate(axis)).into_iter();
        Ok((axes.chain(columns.into_iter().map(Ok)).collect::<Result<_, _>>()?, extras))
    }

    fn coordinate(&self, axis: &str) -> Result<Coordinate, String> {
        let at = self.fields.iter().position(|field| field.name.eq_ignore_ascii_case(axis));
        let at = at.ok_or_else(|| {
            let names: Vec<_> = self.fields.iter().map(|field| field.name.as_str()).collect();
            format!("expected a field {axis}, found `{}`", excerpt(&names.join(" ")))
        })?;
        let field = &self.fields[at];
        let before = &self.fields[..at];
        let number = field.number().filter(|_| field.count == 1).ok_or_else(|| {
            format!(
                "expected one number as {axis}, found {} of type {}{}",
                field.count, field.kind, field.size
            )
        })?;
        let offset = before.iter().fold(0, |sum: u64, field| sum.saturating_add(field.n_bytes()));
        let column = before.iter().fold(0, |sum: u64, field| sum.saturating_add(field.count));
        Ok(Coordinate { number, offset, column })
    }
}

impl Field {
    fn named(name: &str) -> Self {
        // The defaults of files before version 0.7.
        Self { name: name.to_owned(), size: 4, kind: 'F', count: 1 }
    }

    fn n_bytes(&self) -> u64 {
        self.size.saturating_mul(self.count)
    }

    fn number(&self) -> Option<NumberType> {
        Some(match (self.kind.to_ascii_uppercase(), self.size) {
            ('F', 4) => NumberType::F32,
            ('F', 8) => NumberType::F64,
            ('I', 1) => NumberType::I8,
            ('I', 2) => NumberType::I16,
            ('I', 4) => NumberType::I32,
            ('I', 8) => NumberType::I64,
            ('U', 1) => NumberType::U8,
            ('U', 2) => NumberType::U16,
            ('U', 4) => NumberType::U32,
            ('U', 8) => NumberType::U64,
            _ => return None,
        })
    }
}

impl Encoding {
    fn named(line: &Line<'_>, word: &str) -> Result<Self, FormatError> {
        match word.to_ascii_lowercase().as_str() {
            "ascii" => Ok(Self::Ascii),
            "binary" => Ok(Self::Binary),
            "binary_compressed" => Ok(Self::Compressed),
            other => Err(line.error(format!(
                "expected ascii, binary or binary_compressed, found `{}`",
                excerpt(other)
            ))),
        }
    }
}

impl Coordinate {
    pub fn decode(self, bytes: &[u8]) -> f64 {
        self.number.decode(bytes, ByteOrder::Little)
    }
}
