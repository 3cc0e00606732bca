//! Tables for people.

pub use edgepuck_program::significant_digits::digits;
use std::fmt;

/// Rows of words under a heading. The first column is flush left, the others
/// flush right.
pub struct Table {
    title: String,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// A table without rows.
    pub fn new(title: impl Into<String>, heading: &[&str]) -> Self {
        Self { title: title.into(), rows: vec![heading.iter().map(|&h| h.to_owned()).collect()] }
    }

    /// Adds a row, as long as the heading.
    pub fn push(&mut self, row: Vec<String>) {
        debug_assert_eq!(row.len(), self.rows[0].len());
        self.rows.push(row);
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = |column: usize| {
            self.rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..self.rows[0].len()).map(width).collect();
        writeln!(f, "\n{}", self.title)?;
        for row in &self.rows {
            for (column, (word, &width)) in row.iter().zip(&widths).enumerate() {
                if column == 0 {
                    write!(f, "  {word:width$}")?;
                } else {
                    write!(f, "  {word:>width$}")?;
                }
            }
            writeln!(f)?;
        }
        Ok(())
    }
}

/// `count` per `seconds`, in millions with three digits.
pub fn millions_per_s(count: usize, seconds: f64) -> String {
    if seconds > 0.0 { digits(count as f64 / seconds / 1e6) } else { "-".to_owned() }
}

/// `x` seconds in milliseconds.
pub fn milliseconds(x: f64) -> String {
    digits(x * 1e3)
}
