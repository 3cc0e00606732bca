//! The tokens of a text file of numbers, with their lines.

use super::error::Malformed;

/// A text without its byte order mark, if it has one.
pub(super) fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes)
}

/// The lines of a text, with their numbers from 1. A line ends with `\n`, `\r\n` or `\r`.
pub(super) fn lines(mut rest: &[u8]) -> impl Iterator<Item = (usize, &[u8])> {
    let next = move || {
        let end = memchr::memchr2(b'\n', b'\r', rest).unwrap_or(rest.len());
        let (line, end) = rest.split_at_checked(end).filter(|_| !rest.is_empty())?;
        rest = end.strip_prefix(b"\r\n").or_else(|| end.get(1..)).unwrap_or_default();
        Some(line)
    };
    (1..).zip(std::iter::from_fn(next))
}

/// The tokens of a text, line by line, without its comments (from `#` on).
pub(super) struct Tokens<'a> {
    bytes: &'a [u8],
    at: usize,
    /// The current line, counted from 1.
    pub line: usize,
}

impl<'a> Tokens<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, line: 1 }
    }

    /// The next token on this line.
    pub fn next(&mut self) -> Option<&'a [u8]> {
        self.skip_blanks();
        let rest = &self.bytes[self.at..];
        let length = rest.iter().take_while(|byte| is_word(**byte)).count();
        self.at += length;
        (length > 0).then(|| &rest[..length])
    }

    /// The next token on this line, which is the `nth` of the `expected` tokens of kind `what`.
    pub fn next_of(&mut self, what: &str, nth: u64, expected: u64) -> Result<&'a [u8], Malformed> {
        let short = || format!("expected {expected} {what} on the line, found {nth}");
        self.next().ok_or_else(|| Malformed::Syntax(short()))
    }

    /// The next token on this line as a coordinate, the `nth` of three.
    pub fn next_coordinate(&mut self, nth: u64) -> Result<f64, Malformed> {
        self.skip_blanks();
        let rest = &self.bytes[self.at..];
        // Parsing finds the end of the token too; `coordinate` decides about unusual tokens.
        if let Ok((number, length)) = fast_float2::parse_partial::<f64, _>(rest)
            && number.is_finite()
            && rest.get(length).is_none_or(|&byte| !is_word(byte))
        {
            self.at += length;
            return Ok(number);
        }
        coordinate(self.next_of("coordinates of a vertex", nth, 3)?)
    }

    fn skip_blanks(&mut self) {
        let rest = &self.bytes[self.at..];
        self.at += rest.iter().take_while(|byte| is_blank(**byte)).count();
    }

    /// Moves to the next line with a token; false at the end.
    pub fn next_data_line(&mut self) -> bool {
        self.skip_line();
        self.seek_data()
    }

    /// Moves to the next token, which may be here; false at the end.
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
        let Some(end) = memchr::memchr2(b'\n', b'\r', rest) else {
            self.at = self.bytes.len();
            return;
        };
        self.at += end + 1 + usize::from(rest[end..].starts_with(b"\r\n"));
        self.line += 1;
    }
}

pub(super) fn integer(token: &[u8], expected: &str) -> Result<i64, Malformed> {
    let number = match token {
        // Nearly every token of a face is short, and nine digits cannot overflow.
        [b'0'..=b'9', ..] if token.len() <= 9 => token.iter().try_fold(0, |sum, byte| {
            byte.is_ascii_digit().then(|| sum * 10 + i64::from(byte - b'0'))
        }),
        _ => std::str::from_utf8(token).ok().and_then(|text| text.parse().ok()),
    };
    number.ok_or_else(|| Malformed::expected(expected, token))
}

pub(super) fn coordinate(token: &[u8]) -> Result<f64, Malformed> {
    let finite = fast_float2::parse(token).ok().filter(|number: &f64| number.is_finite());
    finite.ok_or_else(|| Malformed::expected("a finite coordinate", token))
}

/// Whether a byte is a blank within a line; form feeds and vertical tabs occur in exports.
fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | 0x0B | 0x0C)
}

fn is_word(byte: u8) -> bool {
    !is_blank(byte) && !matches!(byte, b'\n' | b'\r' | b'#')
}
