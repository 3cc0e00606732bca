//! What a test came to, in words and as a drawing.

use std::fmt::Write as _;
use std::path::Path;

use formats::interval::wilson;
use infer_cpu::Evaluation;
use svg::Document;
use svg::node::element::{Rectangle, Text};

/// Accuracies with their intervals, in one line.
pub fn line(found: &Evaluation, data: &Path) -> String {
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

/// The matrix as CSV: a row a true class, a column an answer.
pub fn csv(found: &Evaluation, classes: &[String]) -> String {
    let mut csv = format!("class,{}\n", classes.join(","));
    for (class, answers) in classes.iter().zip(&found.confusion) {
        let answers: Vec<String> = answers.iter().map(ToString::to_string).collect();
        // Writing to a string cannot fail.
        let _ = writeln!(csv, "{class},{}", answers.join(","));
    }
    csv
}

/// The matrix as a drawing: shares of each true class, darker for more.
pub fn drawing(found: &Evaluation, classes: &[String]) -> Document {
    const CELL: f64 = 16.0;
    const MARGIN: f64 = 110.0;
    let n = classes.len() as f64;
    let side = MARGIN + n * CELL + 10.0;
    let text = |words: &str, x: f64, y: f64| {
        Text::new(words)
            .set("x", x)
            .set("y", y)
            .set("font-family", "sans-serif")
            .set("font-size", 10)
    };
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
                // Rare confusions are to be seen, too.
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
        assert_eq!(csv(&found, &classes), "class,cup,vase\ncup,3,1\nvase,0,2\n");
        assert_eq!(drawing(&found, &classes).to_string().matches("<rect").count(), 4);
    }
}
