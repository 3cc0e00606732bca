//! Hands text to a reader line by line, to know how far it came.

use std::io::{self, Read, Seek, SeekFrom};

/// A reader that gives one line per `read`, so that, when a parser behind a
/// [`std::io::BufReader`] gives up, [`Self::line`] is the line it gave up on.
pub(super) struct LineFeeder<'a> {
    text: &'a [u8],
    at: usize,
    line: usize,
}

impl<'a> LineFeeder<'a> {
    pub fn new(text: &'a [u8]) -> Self {
        Self { text, at: 0, line: 0 }
    }

    /// The last line handed out, counted from 1.
    pub fn line(&self) -> usize {
        self.line.max(1)
    }
}

impl Read for LineFeeder<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let rest = &self.text[self.at..];
        let length = rest.iter().position(|&byte| byte == b'\n').map_or(rest.len(), |end| end + 1);
        let given = length.min(buffer.len());
        buffer[..given].copy_from_slice(&rest[..given]);
        let starts_a_line = self.at == 0 || self.text[self.at - 1] == b'\n';
        self.line += usize::from(given > 0 && starts_a_line);
        self.at += given;
        Ok(given)
    }
}

impl Seek for LineFeeder<'_> {
    /// Back to the start, whatever is asked for: parsers that probe for their
    /// format need no more.
    fn seek(&mut self, position: SeekFrom) -> io::Result<u64> {
        if position != SeekFrom::Start(0) {
            return Err(io::ErrorKind::Unsupported.into());
        }
        (self.at, self.line) = (0, 0);
        Ok(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{BufRead, BufReader};

    #[test]
    fn the_line_is_the_one_that_the_reader_holds() {
        let long = "x".repeat(20_000);
        let text = format!("a\n\n{long}\nd");
        let mut feeder = LineFeeder::new(text.as_bytes());
        let mut lengths = Vec::new();
        for wanted in 1..=4 {
            let mut line = String::new();
            BufReader::new(&mut feeder).read_line(&mut line).unwrap();
            assert_eq!(feeder.line(), wanted);
            lengths.push(line.trim_end().len());
        }
        assert_eq!(lengths, [1, 0, 20_000, 1]);
        feeder.seek(SeekFrom::Start(0)).unwrap();
        assert_eq!(feeder.line(), 1);
    }
}
