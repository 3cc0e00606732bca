//! What an evaluation found, as a line of text, as CSV and as a drawing.

use std::path::Path;

use formats::interval::wilson;
use infer_cpu::Evaluation;
use svg::Document;
use svg::node::element::Rectangle;

use crate::svg_text::text;

/// The accuracies with their intervals, in one line.
#[must_use]
pub fn summary(found: &Evaluation, data: &Path) -> String {
    let (n, correct) = (found.total(), found.correct());
    let (low, high) = wilson(correct, n);
    let name = data.file_name().unwrap_or(data.as_os_str()).to_string_lossy();
    let (class, half) = found.class_accuracy();
    format!(
        "{correct} of {n} ({:.2} %, 95 % interval {:.2} to {:.2} %), mean over classes {:.2} % \
         (± {:.2}), on {name}",
        100.0 * found.instance_accuracy(),
        100.0 * low,
        100.0 * high,
        100.0 * class,
        100.0 * half,
    )
}

/// The matrix as CSV: one row for each true class, one column for each answer.
#[must_use]
pub fn to_csv(found: &Evaluation, classes: &[String]) -> Vec<u8> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    let header = std::iter::once("class").chain(classes.iter().map(String::as_str));
    let mut write = |record: &mut dyn Iterator<Item = String>| {
        csv.write_record(record).expect("invariant: memory takes all, rows are equally long");
    };
    write(&mut header.map(str::to_owned));
    for (class, answers) in classes.iter().zip(&found.confusion) {
        let answers = answers.iter().map(ToString::to_string);
        write(&mut std::iter::once(class.clone()).chain(answers));
    }
    csv.into_inner().expect("invariant: memory takes all")
}

/// The matrix as a drawing: the share of each true class's clouds that got each
/// answer, darker for more.
#[must_use]
pub fn drawing(found: &Evaluation, classes: &[String]) -> Document {
    const CELL: f64 = 16.0;
    const MARGIN: f64 = 110.0;
    let n = classes.len() as f64;
    let side = MARGIN + n * CELL + 10.0;
    let text = |words: &str, x: f64, y: f64| text(words, x, y, 10);
    let background = Rectangle::new().set("width", side).set("height", side).set("fill", "white");
    let mut document = Document::new().set("viewBox", (0, 0, side, side)).add(background);
    for (row, (class, answers)) in classes.iter().zip(&found.confusion).enumerate() {
        let y = MARGIN + row as f64 * CELL;
        document = document.add(text(class, MARGIN - 6.0, y + 12.0).set("text-anchor", "end")).add(
            text(class, 0.0, 0.0)
                .set("transform", format!("translate({} {}) rotate(-60)", y + 12.0, MARGIN - 6.0)),
        );
        let total: usize = answers.iter().sum();
        for (column, &count) in answers.iter().enumerate().filter(|(_, count)| **count > 0) {
            let share = count as f64 / total as f64;
            let colour = if row == column { "#06c" } else { "#c30" };
            let cell = Rectangle::new()
                .set("x", MARGIN + column as f64 * CELL)
                .set("y", y)
                .set("width", CELL)
                .set("height", CELL)
                .set("fill", colour)
                // The root makes rare confusions visible.
                .set("fill-opacity", format!("{:.3}", share.sqrt()));
            document = document.add(cell);
        }
    }
    document
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_has_a_row_for_each_true_class() {
        let found = Evaluation { confusion: vec![vec![3, 1], vec![0, 2]] };
        let classes = ["cup".to_owned(), "vase".to_owned()];
        assert_eq!(to_csv(&found, &classes), b"class,cup,vase\ncup,3,1\nvase,0,2\n");
        assert_eq!(drawing(&found, &classes).to_string().matches("<rect").count(), 4);
    }

    #[test]
    fn a_class_with_a_comma_or_a_quote_is_one_field() {
        let found = Evaluation { confusion: vec![vec![3, 1], vec![0, 2]] };
        let classes = ["cup, small".to_owned(), "a \"vase\"".to_owned()];
        let csv = to_csv(&found, &classes);
        let mut reader = csv::Reader::from_reader(&csv[..]);
        assert_eq!(reader.headers().unwrap(), vec!["class", "cup, small", "a \"vase\""]);
        let names = reader.records().map(|row| row.unwrap()[0].to_owned());
        assert_eq!(names.collect::<Vec<_>>(), classes);
    }
}
