//! What an experiment came to: tables, drawings, clouds.

use std::path::Path;

use formats::interval::wilson;
use infer_cpu::Evaluation;
use serde::{Deserialize, Serialize};

/// One experiment of the report.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Section {
    /// Its heading.
    pub title: String,
    /// On which data, and what is to be known.
    pub about: Vec<String>,
    /// Its numbers.
    pub tables: Vec<Table>,
    /// SVG.
    pub drawings: Vec<String>,
    /// Clouds to turn.
    pub clouds: Vec<Cloud>,
}

/// Rows of numbers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Table {
    /// Its name in the CSV file.
    pub id: String,
    /// What it shows.
    pub caption: String,
    /// What the rows are.
    pub rows_are: String,
    /// Headings of the columns.
    pub columns: Vec<String>,
    /// A heading and a cell for each column.
    pub rows: Vec<(String, Vec<Cell>)>,
}

impl Section {
    /// A section of `tables`, without drawings and clouds.
    pub fn new(title: &str, about: [String; 2], tables: Vec<Table>) -> Self {
        Self { title: title.to_owned(), about: about.into(), tables, ..Self::default() }
    }
}

impl Table {
    /// A table without rows.
    pub fn new(
        id: &str,
        caption: impl Into<String>,
        rows_are: &str,
        columns: impl IntoIterator<Item = impl Into<String>>,
    ) -> Self {
        Self {
            id: id.to_owned(),
            caption: caption.into(),
            rows_are: rows_are.to_owned(),
            columns: columns.into_iter().map(Into::into).collect(),
            rows: Vec::new(),
        }
    }

    /// Adds a row.
    pub fn push(&mut self, name: impl Into<String>, cells: impl IntoIterator<Item = Cell>) {
        self.rows.push((name.into(), cells.into_iter().collect()));
    }

    /// Adds a row of cells that are measured one after another.
    pub fn measure(
        &mut self,
        name: impl Into<String>,
        cells: impl IntoIterator<Item = anyhow::Result<Cell>>,
    ) -> anyhow::Result<()> {
        let cells = cells.into_iter().collect::<anyhow::Result<Vec<_>>>()?;
        self.push(name, cells);
        Ok(())
    }
}

/// A cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Cell {
    /// Nothing was measured.
    None,
    /// A figure of the paper, or a remark.
    Text(String),
    /// A number and its decimals.
    Number(f64, usize),
    /// So many of so many.
    Share(usize, usize),
    /// A mean of shares, and the half width of its 95 % interval.
    Mean(f64, f64),
}

/// A cloud whose points have colours.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cloud {
    /// What is to be seen.
    pub caption: String,
    /// Points, thousandths of the unit sphere's radius.
    pub points: Vec<[i16; 3]>,
    /// An index into [`COLOURS`] for each.
    pub colours: Vec<u8>,
}

/// Grey for a point, red for a critical one, blue for LIME's, violet for both.
pub const COLOURS: [&str; 4] = ["#a8a8a8", "#d33b12", "#1763c7", "#8a2fc0"];

impl Cell {
    /// A number, nothing where there is none.
    pub fn number(value: f64, digits: usize) -> Self {
        if value.is_finite() { Self::Number(value, digits) } else { Self::None }
    }

    /// Instance accuracy.
    pub fn instance(found: &Evaluation) -> Self {
        Self::Share(found.correct(), found.total())
    }

    /// Class accuracy.
    pub fn class(found: &Evaluation) -> Self {
        let (mean, half) = found.class_accuracy();
        Self::Mean(mean, half)
    }

    /// Value and interval, as CSV has them.
    pub fn numbers(&self) -> (Option<f64>, Option<[f64; 2]>) {
        match *self {
            Self::None | Self::Text(_) => (None, None),
            Self::Number(value, _) => (Some(value), None),
            Self::Share(correct, n) => {
                let (low, high) = wilson(correct, n);
                (Some(correct as f64 / n.max(1) as f64), Some([low, high]))
            }
            Self::Mean(mean, half) => (Some(mean), Some([mean - half, mean + half])),
        }
    }

    /// In words, and its interval.
    pub fn words(&self) -> (String, String) {
        let percent = |share: f64| format!("{:.1}", 100.0 * share);
        let interval = |[low, high]: [f64; 2]| format!("{} to {}", percent(low), percent(high));
        match self {
            Self::None => (String::new(), String::new()),
            Self::Text(text) => (text.clone(), String::new()),
            Self::Number(value, digits) => (format!("{value:.digits$}"), String::new()),
            Self::Share(..) | Self::Mean(..) => {
                let (value, range) = self.numbers();
                let value = value.map_or(String::new(), |value| format!("{} %", percent(value)));
                (value, range.map_or(String::new(), interval))
            }
        }
    }
}

/// Writes the numbers of all sections as CSV, a line a cell.
pub fn write_csv(sections: &[Section], path: &Path) -> anyhow::Result<()> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    csv.write_record(["table", "row", "column", "value", "low", "high", "text"])?;
    for table in sections.iter().flat_map(|section| &section.tables) {
        for (row, cells) in &table.rows {
            for (column, cell) in table.columns.iter().zip(cells) {
                let (value, range) = cell.numbers();
                let text = if let Cell::Text(text) = cell { text } else { "" };
                let number = |x: Option<f64>| x.map_or(String::new(), |x| format!("{x}"));
                let [low, high] = [0, 1].map(|i| number(range.map(|range| range[i])));
                csv.write_record([&table.id, row, column, &number(value), &low, &high, text])?;
            }
        }
    }
    let bytes = csv.into_inner()?;
    Ok(formats::atomic::write_bytes(path, &bytes)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_says_its_interval() {
        assert_eq!(Cell::Share(9, 10).words().0, "90.0 %");
        // Wilson 1927 for 9 of 10.
        assert_eq!(Cell::Share(9, 10).words().1, "59.6 to 98.2");
        assert_eq!(Cell::Number(1.234, 1).words(), ("1.2".to_owned(), String::new()));
        assert_eq!(Cell::None.words(), (String::new(), String::new()));
    }
}
