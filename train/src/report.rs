//! What a test came to, in words and as a drawing.

use std::fmt::Write as _;
use std::path::Path;

use svg::Document;
use svg::node::element::{Rectangle, Text};
use train::evaluate::{Confusion, Z};

/// Accuracies with their intervals, in one line.
pub fn line(found: &Confusion, data: &Path) -> String {
    let (n, correct) = (found.total(), found.correct());
    let (low, high) = wilson_interval(correct, n);
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
pub fn csv(found: &Confusion, classes: &[String]) -> String {
    let mut csv = format!("class,{}\n", classes.join(","));
    for (class, answers) in classes.iter().zip(&found.0) {
        let answers: Vec<String> = answers.iter().map(ToString::to_string).collect();
        // Writing to a string cannot fail.
        let _ = writeln!(csv, "{class},{}", answers.join(","));
    }
    csv
}

/// The matrix as a drawing: shares of each true class, darker for more.
pub fn drawing(found: &Confusion, classes: &[String]) -> Document {
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
    for (row, (class, answers)) in classes.iter().zip(&found.0).enumerate() {
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

/// The 95 % interval of a share of `hits` in `n` trials (Wilson 1927).
pub fn wilson_interval(hits: usize, n: usize) -> (f64, f64) {
    if n == 0 {
        return (0.0, 1.0);
    }
    let (n, share) = (n as f64, hits as f64 / n as f64);
    let centre = share + Z * Z / (2.0 * n);
    let half = Z * (share * (1.0 - share) / n + Z * Z / (4.0 * n * n)).sqrt();
    let scale = 1.0 + Z * Z / n;
    ((centre - half) / scale, (centre + half) / scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Brown, Cai and DasGupta 2001, table of Wilson intervals.
    #[test]
    fn intervals_are_wilson_s() {
        let near = |(low, high): (f64, f64), expected: (f64, f64)| {
            (low - expected.0).abs() < 5e-5 && (high - expected.1).abs() < 5e-5
        };
        assert!(near(wilson_interval(0, 10), (0.0, 0.2775)));
        assert!(near(wilson_interval(5, 10), (0.2366, 0.7634)));
    }

    #[test]
    fn a_matrix_has_a_row_for_each_true_class() {
        let found = Confusion(vec![vec![3, 1], vec![0, 2]]);
        let classes = ["cup".to_owned(), "vase".to_owned()];
        assert_eq!(csv(&found, &classes), "class,cup,vase\ncup,3,1\nvase,0,2\n");
        assert_eq!(drawing(&found, &classes).to_string().matches("<rect").count(), 4);
    }
}
