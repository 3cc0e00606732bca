//! Tables: the same rows as text for a terminal and as HTML for a page.

pub use edgepuck_program::significant_digits::digits;
use maud::{Markup, html};
use std::fmt;

/// Rows of words under a heading.
pub struct Table {
    title: String,
    heading: Vec<String>,
    rows: Vec<Row>,
}

struct Row {
    is_marked: bool,
    cells: Vec<Cell>,
}

/// A cell of a table.
#[derive(Default)]
pub struct Cell {
    /// Its value.
    pub text: String,
    /// A remark, such as the value's interval; may be empty.
    pub note: String,
    /// A share that shades the cell on a page.
    pub share: Option<f64>,
}

/// A column of a table: its heading, and what it says of an item.
pub type Column<'a, T> = (&'a str, &'a dyn Fn(&T) -> String);

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self { text, ..Self::default() }
    }
}

impl Cell {
    fn html(&self) -> Markup {
        let opacity = self.share.map(|share| 0.45 * share);
        let shade = opacity.map(|opacity| format!("background:rgba(23,99,199,{opacity:.2})"));
        html! { td style=[shade] { (self.text) @if !self.note.is_empty() { small { (self.note) } } } }
    }
}

impl Table {
    /// A table without rows.
    pub fn new(title: impl Into<String>, heading: &[&str]) -> Self {
        let heading = heading.iter().map(|&word| word.to_owned()).collect();
        Self { title: title.into(), heading, rows: Vec::new() }
    }

    /// A table with a row for each of `items`.
    pub fn of<T>(title: impl Into<String>, items: &[T], columns: &[Column<'_, T>]) -> Self {
        let mut table =
            Self::new(title, &columns.iter().map(|column| column.0).collect::<Vec<_>>());
        for item in items {
            table.push(columns.iter().map(|(_, says)| says(item)).collect::<Vec<_>>());
        }
        table
    }

    /// The rows of a CSV file.
    pub fn from_csv(title: &str, bytes: &[u8]) -> anyhow::Result<Self> {
        let mut csv = csv::Reader::from_reader(bytes);
        let mut table = Self::new(title, &csv.headers()?.iter().collect::<Vec<_>>());
        for record in csv.records() {
            table.push::<String>(record?.iter().map(str::to_owned).collect());
        }
        Ok(table)
    }

    /// Adds a row, as long as the heading.
    pub fn push<C: Into<Cell>>(&mut self, cells: Vec<C>) {
        self.push_marked(false, cells);
    }

    /// Adds a row, which is set in bold on a page if it `is_marked`.
    pub fn push_marked<C: Into<Cell>>(&mut self, is_marked: bool, cells: Vec<C>) {
        let cells: Vec<Cell> = cells.into_iter().map(Into::into).collect();
        debug_assert_eq!(cells.len(), self.heading.len());
        self.rows.push(Row { is_marked, cells });
    }

    /// How many rows there are.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// The heading and the rows as a CSV file.
    pub fn to_csv(&self) -> anyhow::Result<Vec<u8>> {
        let mut csv = csv::Writer::from_writer(Vec::new());
        csv.write_record(&self.heading)?;
        for row in &self.rows {
            csv.write_record(row.cells.iter().map(|cell| &cell.text))?;
        }
        Ok(csv.into_inner()?)
    }

    /// The table as Markdown, under its title.
    pub fn markdown(&self) -> String {
        let line = |words: Vec<&str>| format!("| {} |\n", words.join(" | "));
        let heading = self.heading.iter().map(String::as_str).collect();
        let rows =
            self.rows.iter().map(|row| row.cells.iter().map(|cell| cell.text.as_str()).collect());
        let body: String = rows.map(line).collect();
        format!(
            "## {}\n\n{}{}{body}",
            self.title,
            line(heading),
            line(vec!["---"; self.heading.len()])
        )
    }

    /// The table as HTML.
    pub fn html(&self) -> Markup {
        html! {
            div class="scroll" {
                table {
                    @if !self.title.is_empty() { caption { (self.title) } }
                    thead { tr { @for word in &self.heading { th scope="col" { (word) } } } }
                    tbody { @for row in &self.rows {
                        tr class=[row.is_marked.then_some("marked")] {
                            @for (i, cell) in row.cells.iter().enumerate() {
                                @if i == 0 { th scope="row" { (cell.text) } } @else { (cell.html()) }
                            }
                        }
                    } }
                }
            }
        }
    }
}

/// As text: the first column is flush left, the others are flush right.
impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words = |row: &Row| row.cells.iter().map(|cell| cell.text.clone()).collect();
        let body = self.rows.iter().map(words);
        let rows: Vec<Vec<String>> = std::iter::once(self.heading.clone()).chain(body).collect();
        let width = |i: usize| rows.iter().map(|row| row[i].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..self.heading.len()).map(width).collect();
        writeln!(f, "\n{}", self.title)?;
        for row in &rows {
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

/// `seconds` in milliseconds.
pub fn milliseconds(seconds: f64) -> String {
    digits(seconds * 1e3)
}

/// A share in percent with one decimal.
pub fn percent(share: f64) -> String {
    format!("{:.1}", 100.0 * share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_rows_are_text_and_html() {
        let columns: [Column<'_, u8>; 2] =
            [("name", &|_| "a < b".to_owned()), ("ms", &|ms| ms.to_string())];
        let mut table = Table::of("title", &[1], &columns);
        table.push_marked(true, vec!["c".to_owned(), "10".to_owned()]);
        assert_eq!(table.to_string(), "\ntitle\n  name   ms\n  a < b   1\n  c      10\n");
        assert_eq!(
            table.markdown(),
            "## title\n\n| name | ms |\n| --- | --- |\n| a < b | 1 |\n| c | 10 |\n"
        );
        let html = table.html().into_string();
        assert!(html.contains("<th scope=\"row\">a &lt; b</th><td>1</td>"), "{html}");
        assert!(html.contains("<tr class=\"marked\">"), "{html}");
    }

    #[test]
    fn a_csv_file_becomes_rows() {
        let csv = b"a,b\n1,\"x, y\"\n";
        let table = Table::from_csv("caption", csv).unwrap();
        assert_eq!(table.to_csv().unwrap(), csv);
        let found = table.html().into_string();
        assert!(found.contains("<th scope=\"col\">a</th>"));
        assert!(found.contains("<th scope=\"row\">1</th>") && found.contains("<td>x, y</td>"));
        assert!(Table::from_csv("caption", b"a,b\n1\n").is_err());
    }
}
