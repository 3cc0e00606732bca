//! The tokens of a text file of numbers, with their lines.

use super::error::{Malformed, ParseError, Part, excerpt};

/// The tokens of a text, line by line, without its comments (from `#` on).
pub(super) struct Tokens<'a> {
    bytes: &'a [u8],
    at: usize,
    line: usize,
}

impl<'a> Tokens<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, line: 1 }
    }

    /// The next token on this line.
    pub fn next(&mut self) -> Option<&'a [u8]> {
        let rest = &self.bytes[self.at..];
        let blank = rest.iter().take_while(|byte| is_blank(**byte)).count();
        let length = rest[blank..].iter().take_while(|byte| is_word(**byte)).count();
        self.at += blank + length;
        (length > 0).then(|| &rest[blank..blank + length])
    }

    /// Leaves this line for the next one that holds a token; false at the end.
    pub fn next_data_line(&mut self) -> bool {
        self.skip_line();
        self.seek_data()
    }

    /// Moves to the first token at or after here; false at the end.
    pub fn seek_data(&mut self) -> bool {
        while let Some(&byte) = self.bytes.get(self.at) {
            match byte {
                b'\n' | b'\r' | b'#' => self.skip_line(),
                _ if is_blank(byte) => self.at += 1,
                _ => return true,
            }
        }
        false
    }

    /// Moves past the next line end: `\n`, `\r\n` or `\r`.
    fn skip_line(&mut self) {
        let rest = &self.bytes[self.at..];
        let Some(end) = rest.iter().position(|byte| matches!(byte, b'\n' | b'\r')) else {
            self.at = self.bytes.len();
            return;
        };
        self.at += end + 1 + usize::from(rest[end..].starts_with(b"\r\n"));
        self.line += 1;
    }

    /// `promised` items, or as many of `shortest` bytes as can still come.
    pub fn room(&self, promised: u64, shortest: usize) -> usize {
        let fit = (self.bytes.len() - self.at) / shortest + 1;
        usize::try_from(promised).map_or(fit, |promised| promised.min(fit))
    }

    /// The number of vertices or faces that `token` spells.
    pub fn count(&self, token: &[u8], part: Part) -> Result<u64, ParseError> {
        let number = self.integer(token, "a count")?;
        u64::try_from(number)
            .map_err(|_| self.fault(Malformed::NegativeCount { part, found: excerpt(token) }))
    }

    /// The whole number that `token` spells.
    pub fn integer(&self, token: &[u8], expected: &'static str) -> Result<i64, ParseError> {
        let number = match token {
            // Nearly every token of a face: a few digits cannot overflow.
            [b'0'..=b'9', ..] if token.len() <= 9 => token.iter().try_fold(0, |sum, byte| {
                byte.is_ascii_digit().then(|| sum * 10 + i64::from(byte - b'0'))
            }),
            _ => std::str::from_utf8(token).ok().and_then(|text| text.parse().ok()),
        };
        number.ok_or_else(|| self.fault(Malformed::NotANumber { found: excerpt(token), expected }))
    }

    /// The next corner of a face, its `nth` of `n_corners`.
    pub fn corner(&mut self, nth: i64, n_corners: i64, n_vertices: u64) -> Result<u32, ParseError> {
        let token = self
            .next()
            .ok_or_else(|| self.fault(short("corners of a face", nth as u64, n_corners as u64)))?;
        let index = self.integer(token, "a vertex index")?;
        u32::try_from(index).ok().filter(|&index| u64::from(index) < n_vertices).ok_or_else(|| {
            self.fault(Malformed::IndexOutOfRange { found: excerpt(token), n_vertices })
        })
    }

    /// The next token as a coordinate, its vertex's `axis` of three.
    pub fn coordinate(&mut self, axis: usize) -> Result<f64, ParseError> {
        let token = self
            .next()
            .ok_or_else(|| self.fault(short("coordinates of a vertex", axis as u64, 3)))?;
        finite(token).map_err(|cause| self.fault(cause))
    }

    /// `cause`, found on this line.
    pub fn fault(&self, cause: Malformed) -> ParseError {
        cause.at(self.line)
    }
}

/// A blank within a line; form feed and vertical tab occur in exports.
fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | 0x0B | 0x0C)
}

fn is_word(byte: u8) -> bool {
    !is_blank(byte) && !matches!(byte, b'\n' | b'\r' | b'#')
}

pub(super) fn short(what: &'static str, held: u64, expected: u64) -> Malformed {
    Malformed::ShortLine { what, held, expected }
}

/// The number that `token` spells, if it is finite.
fn finite(token: &[u8]) -> Result<f64, Malformed> {
    let number = std::str::from_utf8(token).ok().and_then(|text| text.parse::<f64>().ok());
    match number {
        Some(number) if number.is_finite() => Ok(number),
        Some(_) => Err(Malformed::NotFinite { found: excerpt(token) }),
        None => Err(Malformed::NotANumber { found: excerpt(token), expected: "a coordinate" }),
    }
}
