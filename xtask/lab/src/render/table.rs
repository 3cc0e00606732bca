//! Tables: the same rows as text for a terminal, as Markdown, CSV and HTML.

pub use edgepuck_program::significant_digits::digits;
use formats::atomic;
use formats::interval::wilson;
use infer_cpu::Evaluation;
use maud::{Markup, html};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::Path;

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Table {
    pub title: String,
    pub heading: Vec<String>,
    pub rows: Vec<Vec<Cell>>,
    /// Numbers of the rows that a page sets in bold.
    marked: Vec<usize>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Cell {
    Text(String),
    Number(f64, usize),
    Share(usize, usize),
    /// A mean of shares, and half the width of its 95 % interval.
    Mean(f64, f64),
}

/// A column of a table: its heading, and its words for an item.
pub type Column<'a, T> = (&'a str, &'a dyn Fn(&T) -> String);

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl Cell {
    pub const EMPTY: Self = Self::Text(String::new());

    /// A number; empty if it is not finite.
    pub fn number(value: f64, digits: usize) -> Self {
        if value.is_finite() { Self::Number(value, digits) } else { Self::EMPTY }
    }

    pub fn instance(found: &Evaluation) -> Self {
        Self::Share(found.correct(), found.total())
    }

    pub fn class(found: &Evaluation) -> Self {
        let (mean, half) = found.class_accuracy();
        Self::Mean(mean, half)
    }

    /// Value and 95 % interval.
    pub fn numbers(&self) -> (Option<f64>, Option<[f64; 2]>) {
        match *self {
            Self::Text(_) => (None, None),
            Self::Number(value, _) => (Some(value), None),
            Self::Share(correct, n) => {
                let (low, high) = wilson(correct, n);
                (Some(correct as f64 / n.max(1) as f64), Some([low, high]))
            }
            Self::Mean(mean, half) => (Some(mean), Some([mean - half, mean + half])),
        }
    }

    pub fn text(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Number(value, digits) => format!("{value:.digits$}"),
            Self::Share(..) | Self::Mean(..) => {
                self.numbers().0.map_or(String::new(), |share| format!("{} %", percent(share)))
            }
        }
    }

    /// The interval in words; may be empty.
    fn interval(&self) -> String {
        let words = |[low, high]: [f64; 2]| format!("{} to {}", percent(low), percent(high));
        self.numbers().1.map_or(String::new(), words)
    }

    fn html(&self) -> Markup {
        let share = self.numbers().0.filter(|_| !matches!(self, Self::Number(..)));
        let opacity = share.map(|share| 0.45 * share);
        let shade = opacity.map(|opacity| format!("background:rgba(23,99,199,{opacity:.2})"));
        let interval = self.interval();
        html! { td style=[shade] { (self.text()) @if !interval.is_empty() { small { (interval) } } } }
    }
}

impl Table {
    pub fn new(title: impl Into<String>, heading: &[&str]) -> Self {
        let heading = heading.iter().map(|&word| word.to_owned()).collect();
        Self { title: title.into(), heading, ..Self::default() }
    }

    pub fn of<T>(title: impl Into<String>, items: &[T], columns: &[Column<'_, T>]) -> Self {
        let mut table =
            Self::new(title, &columns.iter().map(|column| column.0).collect::<Vec<_>>());
        for item in items {
            table.push(columns.iter().map(|(_, says)| says(item)).collect::<Vec<_>>());
        }
        table
    }

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
        debug_assert_eq!(cells.len(), self.heading.len());
        self.rows.push(cells.into_iter().map(Into::into).collect());
    }

    /// Adds a row of cells that are measured one after another, behind its name.
    pub fn measure(
        &mut self,
        name: impl Into<String>,
        cells: impl IntoIterator<Item = anyhow::Result<Cell>>,
    ) -> anyhow::Result<()> {
        let name = std::iter::once(Ok(Cell::Text(name.into())));
        let cells = name.chain(cells).collect::<anyhow::Result<Vec<Cell>>>()?;
        self.push(cells);
        Ok(())
    }

    pub fn mark(&mut self) {
        self.marked.push(self.rows.len() - 1);
    }

    /// The heading and the rows as a CSV file.
    pub fn to_csv(&self) -> anyhow::Result<Vec<u8>> {
        let mut csv = csv::Writer::from_writer(Vec::new());
        csv.write_record(&self.heading)?;
        for row in &self.rows {
            csv.write_record(row.iter().map(Cell::text))?;
        }
        Ok(csv.into_inner()?)
    }

    /// The table as Markdown, under its title.
    pub fn markdown(&self) -> String {
        let line = |words: Vec<String>| format!("| {} |\n", words.join(" | "));
        let rows = self.rows.iter().map(|row| row.iter().map(Cell::text).collect());
        let body: String = rows.map(line).collect();
        let rule = vec!["---".to_owned(); self.heading.len()];
        format!("## {}\n\n{}{}{body}", self.title, line(self.heading.clone()), line(rule))
    }

    pub fn html(&self) -> Markup {
        html! {
            div class="scroll" {
                table {
                    @if !self.title.is_empty() { caption { (self.title) } }
                    thead { tr { @for word in &self.heading { th scope="col" { (word) } } } }
                    tbody { @for (number, row) in self.rows.iter().enumerate() {
                        tr class=[self.marked.contains(&number).then_some("marked")] {
                            @for (i, cell) in row.iter().enumerate() {
                                @if i == 0 { th scope="row" { (cell.text()) } } @else { (cell.html()) }
                            }
                        }
                    } }
                }
            }
        }
    }
}

/// Prints `tables`, and writes them to the Markdown file `report`, if one is asked for.
pub fn publish(tables: &[Table], report: Option<&Path>) -> anyhow::Result<()> {
    tables.iter().for_each(|table| print!("{table}"));
    if let Some(file) = report {
        let text: Vec<String> = tables.iter().map(|table| table.markdown() + "\n").collect();
        atomic::write_bytes(file, text.concat())?;
    }
    Ok(())
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
        let body = self.rows.iter().map(|row| row.iter().map(Cell::text).collect());
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

pub fn milliseconds(seconds: f64) -> String {
    digits(seconds * 1e3)
}

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
        table.push(vec!["c".to_owned(), "10".to_owned()]);
        table.mark();
        assert_eq!(table.to_string(), "\ntitle\n  name   ms\n  a < b   1\n  c      10\n");
        assert_eq!(
            table.markdown(),
            "## title\n\n| name | ms |\n| --- | --- |\n| a < b | 1 |\n| c | 10 |\n"
        );
        let html = table.html().into_string();
        assert!(html.contains("<th scope=\"row\">a &lt; b</th><td>1</td>"), "{html}");
        assert!(html.contains("<tr class=\"marked\">"), "{html}");
        let csv = table.to_csv().unwrap();
        assert_eq!(Table::from_csv("", &csv).unwrap().to_csv().unwrap(), csv);
        assert!(Table::from_csv("caption", b"a,b\n1\n").is_err());
    }

    #[test]
    fn a_share_has_its_interval() {
        assert_eq!(Cell::Share(9, 10).text(), "90.0 %");
        // Wilson 1927 for 9 of 10.
        assert_eq!(Cell::Share(9, 10).interval(), "59.6 to 98.2");
        assert_eq!(Cell::Number(1.234, 1).text(), "1.2");
        assert_eq!(Cell::number(f64::NAN, 1), Cell::EMPTY);
    }
}
