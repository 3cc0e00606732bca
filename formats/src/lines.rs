//! Lines of text, with their numbers.

use std::borrow::Cow;
use std::io::{BufRead, Read};
use std::path::Path;

use crate::decoding::excerpt;
use crate::error::FormatError;

/// The longest line that is read, so that a file without line ends does not fill the memory. The
/// line of a point takes some hundred bytes.
const LONGEST_LINE: u64 = 1 << 20;

/// What some editors and programs write before UTF-8.
pub(crate) const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();

/// The lines of a text, without the byte order mark that it may begin with.
pub(crate) struct Lines<'a, R> {
    /// The rest of the file after the last line that was read.
    pub reader: &'a mut R,
    name: &'a Path,
    number: u64,
    bytes: Vec<u8>,
}

/// One line, without blanks at its ends.
pub(crate) struct Line<'a> {
    /// The text of the line; bytes that are not UTF-8 are replaced.
    pub text: Cow<'a, str>,
    name: &'a Path,
    number: u64,
}

impl<'a, R: BufRead> Lines<'a, R> {
    pub fn new(reader: &'a mut R, name: &'a Path) -> Self {
        Self { reader, name, number: 0, bytes: Vec::new() }
    }

    pub fn next(&mut self) -> Result<Option<Line<'_>>, FormatError> {
        Ok(if self.advance()? { Some(self.line()) } else { None })
    }

    /// The next line that is not blank. Errors say that `found` of `n` lines were found.
    pub fn next_of(&mut self, found: u64, n: u64) -> Result<Line<'_>, FormatError> {
        match self.advance_over_blanks()? {
            true => Ok(self.line()),
            false => Err(self.line().error(format!("the file ends after {found} of {n}"))),
        }
    }

    /// Checks that only blank lines are left after the `n` that a header states.
    pub fn check_end(&mut self, n: u64) -> Result<(), FormatError> {
        match self.advance_over_blanks()? {
            true => Err(self.line().error(format!("expected {n} lines by the header, found more"))),
            false => Ok(()),
        }
    }

    fn advance_over_blanks(&mut self) -> Result<bool, FormatError> {
        while self.advance()? {
            if !self.bytes.trim_ascii().is_empty() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn advance(&mut self) -> Result<bool, FormatError> {
        self.bytes.clear();
        self.number += 1;
        let mut limited = self.reader.by_ref().take(LONGEST_LINE);
        let read = limited.read_until(b'\n', &mut self.bytes);
        let n = read.map_err(|source| FormatError::io(self.name, source))? as u64;
        if self.number == 1 && self.bytes.starts_with(BYTE_ORDER_MARK) {
            self.bytes.drain(..BYTE_ORDER_MARK.len());
        }
        if n == LONGEST_LINE && !self.bytes.ends_with(b"\n") {
            return Err(self.line().error(format!("longer than {LONGEST_LINE} bytes")));
        }
        Ok(n > 0)
    }

    fn line(&self) -> Line<'_> {
        let text = String::from_utf8_lossy(self.bytes.trim_ascii());
        Line { text, name: self.name, number: self.number }
    }
}

impl Line<'_> {
    pub fn error(&self, cause: impl ToString) -> FormatError {
        FormatError::malformed(self.name, format!("line {}", self.number), cause)
    }

    /// The number `word`, which may be NaN or infinite.
    pub fn number(&self, word: &str) -> Result<f64, FormatError> {
        word.parse()
            .map_err(|_| self.error(format!("expected a number, found `{}`", excerpt(word))))
    }

    pub fn count(&self, word: &str) -> Result<u64, FormatError> {
        word.parse().map_err(|_| self.error(format!("expected a count, found `{}`", excerpt(word))))
    }
}
