//! Tables for a terminal.

use formats::atomic;
pub use program::significant_digits::digits;
use serde::Serialize;
use std::fmt;
use std::path::Path;

#[derive(Default)]
pub struct Table {
    pub title: String,
    pub heading: Vec<String>,
    pub rows: Vec<Vec<String>>,
}

/// A column of a table: its heading, and its words for an item.
pub type Column<'a, T> = (&'a str, &'a dyn Fn(&T) -> String);

impl Table {
    pub fn new(title: impl Into<String>, heading: &[&str]) -> Self {
        let heading = heading.iter().map(|&word| word.to_owned()).collect();
        Self { title: title.into(), heading, rows: Vec::new() }
    }

    pub fn of<T>(title: impl Into<String>, items: &[T], columns: &[Column<'_, T>]) -> Self {
        let mut table =
            Self::new(title, &columns.iter().map(|column| column.0).collect::<Vec<_>>());
        for item in items {
            table.push(columns.iter().map(|(_, says)| says(item)).collect());
        }
        table
    }

    /// Adds a row, as long as the heading.
    pub fn push(&mut self, cells: Vec<String>) {
        debug_assert_eq!(cells.len(), self.heading.len());
        self.rows.push(cells);
    }

    /// The heading and the rows.
    fn lines(&self) -> impl Iterator<Item = &Vec<String>> {
        std::iter::once(&self.heading).chain(&self.rows)
    }
}

/// Writes `record` to the JSON file `file`, if one is asked for.
pub fn write_json(record: &impl Serialize, file: Option<&Path>) -> anyhow::Result<()> {
    if let Some(file) = file {
        atomic::write_bytes(file, serde_json::to_string_pretty(record)? + "\n")?;
    }
    Ok(())
}

/// As text: the first column is flush left, the others are flush right.
impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = |i: usize| self.lines().map(|row| row[i].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..self.heading.len()).map(width).collect();
        writeln!(f, "\n{}", self.title)?;
        for row in self.lines() {
            for (i, (word, &width)) in row.iter().zip(&widths).enumerate() {
                if i == 0 {
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

pub fn milliseconds(seconds: f64) -> String {
    digits(seconds * 1e3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_lines_of_text() {
        let columns: [Column<'_, u8>; 2] =
            [("name", &|_| "a < b".to_owned()), ("ms", &|ms| ms.to_string())];
        let mut table = Table::of("title", &[1], &columns);
        table.push(vec!["c".to_owned(), "10".to_owned()]);
        assert_eq!(table.to_string(), "\ntitle\n  name   ms\n  a < b   1\n  c      10\n");
    }
}
