//! The results of an evaluation as a line of text, as CSV and as a drawing.

use std::path::Path;

use formats::interval::wilson;
use infer_cpu::Evaluation;

use crate::svg::{self, text};

/// The accuracies and their intervals in one line, for data with `n_classes` classes.
#[must_use]
pub fn summary(found: &Evaluation, n_classes: usize, data: &Path) -> String {
    let (n, correct) = (found.total(), found.correct());
    let (low, high) = wilson(correct, n);
    let name = data.file_name().unwrap_or(data.as_os_str()).to_string_lossy();
    let (class_mean, half_width) = found.class_accuracy();
    let n_found = found.confusion.iter().filter(|answers| answers.iter().any(|n| *n > 0)).count();
    let classes = match n_found < n_classes {
        true => format!("{n_found} of {n_classes} classes"),
        false => "classes".to_owned(),
    };
    format!(
        "{correct} of {n} ({:.2} %, 95 % interval {:.2} to {:.2} %), mean over {classes} {:.2} % \
         (± {:.2}), on {name}",
        100.0 * found.instance_accuracy(),
        100.0 * low,
        100.0 * high,
        100.0 * class_mean,
        100.0 * half_width,
    )
}

/// The confusion matrix as CSV, with a row for each true class and a column for each answer.
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

/// Draws the confusion matrix as SVG. A darker cell is a larger share of a true class's clouds.
#[must_use]
pub fn drawing(found: &Evaluation, classes: &[String]) -> String {
    const CELL: f64 = 16.0;
    const MARGIN: f64 = 110.0;
    let side = MARGIN + classes.len() as f64 * CELL + 10.0;
    let mut parts = String::new();
    for (row, (class, answers)) in classes.iter().zip(&found.confusion).enumerate() {
        let y = MARGIN + row as f64 * CELL;
        let [line, edge] = [y + 12.0, MARGIN - 6.0];
        parts += &text(class, edge, line, 10, "text-anchor='end'");
        let turned = format!("transform='translate({line} {edge}) rotate(-60)'");
        parts += &text(class, 0.0, 0.0, 10, &turned);
        let total: usize = answers.iter().sum();
        for (column, &count) in answers.iter().enumerate().filter(|(_, count)| **count > 0) {
            let x = MARGIN + column as f64 * CELL;
            let colour = if row == column { "#06c" } else { "#c30" };
            // The root makes rare confusions visible.
            let opacity = (count as f64 / total as f64).sqrt();
            parts += &format!(
                "<rect x='{x}' y='{y}' width='{CELL}' height='{CELL}' fill='{colour}' \
                 fill-opacity='{opacity:.3}'/>\n"
            );
        }
    }
    svg::drawing(side, side, &parts)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_over_some_of_the_classes_says_so() {
        let found = Evaluation { confusion: vec![vec![3, 1], vec![0, 0]] };
        for (n_classes, expected) in
            [(2, "mean over 1 of 2 classes 75.00 %"), (1, "mean over classes 75.00 %")]
        {
            let line = summary(&found, n_classes, Path::new("d/test.npz"));
            assert!(line.contains(expected) && line.ends_with("on test.npz"), "{line}");
        }
    }

    #[test]
    fn a_matrix_has_a_row_for_each_true_class() {
        let found = Evaluation { confusion: vec![vec![3, 1], vec![0, 2]] };
        let classes = ["cup".to_owned(), "vase".to_owned()];
        assert_eq!(to_csv(&found, &classes), b"class,cup,vase\ncup,3,1\nvase,0,2\n");
        assert_eq!(drawing(&found, &classes).matches("<rect").count(), 4);
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
