//! The results of an evaluation as a line of text and as CSV.

use std::path::Path;

use formats::interval::wilson_of;
use infer_cpu::Evaluation;

/// The accuracies and their intervals in one line, for data with `n_classes` classes.
pub fn summary(found: &Evaluation, n_classes: usize, data: &Path) -> String {
    let (n, correct) = (found.total(), found.correct());
    let n_instances: usize = found.instances.iter().sum();
    let (low, high) = match n {
        0 => (0.0, 1.0),
        _ => wilson_of(found.instance_accuracy(), n_instances),
    };
    // Views of one mesh are often right or wrong together.
    let of = match n_instances < n {
        true => format!(" of {}", formats::counted(n_instances, "mesh")),
        false => String::new(),
    };
    let name = data.file_name().unwrap_or(data.as_os_str()).to_string_lossy();
    let (class_mean, half_width) = found.class_accuracy();
    let n_found = found.confusion.iter().filter(|answers| answers.iter().any(|n| *n > 0)).count();
    let classes = match n_found < n_classes {
        true => format!("{n_found} of {n_classes} classes"),
        false => "classes".to_owned(),
    };
    format!(
        "{correct} of {n} ({:.2} %, 95 % interval{of} {:.2} to {:.2} %), mean over {classes} {:.2} % \
         (± {:.2}), on {name}",
        100.0 * found.instance_accuracy(),
        100.0 * low,
        100.0 * high,
        100.0 * class_mean,
        100.0 * half_width,
    )
}

/// The confusion matrix as CSV, with a row for each true class and a column for each answer.
pub fn to_csv(found: &Evaluation, classes: &[String]) -> Vec<u8> {
    let header = std::iter::once("class".to_owned()).chain(classes.iter().cloned()).collect();
    let row = |(class, answers): (&String, &Vec<usize>)| -> Vec<String> {
        std::iter::once(class.clone()).chain(answers.iter().map(ToString::to_string)).collect()
    };
    csv_of(std::iter::once(header).chain(classes.iter().zip(&found.confusion).map(row)))
}

/// Records of equal length as CSV.
pub fn csv_of(records: impl Iterator<Item = impl IntoIterator<Item = String>>) -> Vec<u8> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    for record in records {
        csv.write_record(record).expect("invariant: memory takes all, rows are equally long");
    }
    csv.into_inner().expect("invariant: memory takes all")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_over_some_of_the_classes_says_so() {
        let (confusion, instances) = (vec![vec![3, 1], vec![0, 0]], vec![1, 0]);
        let found = Evaluation { confusion, instances };
        for (n_classes, expected) in
            [(2, "mean over 1 of 2 classes 75.00 %"), (1, "mean over classes 75.00 %")]
        {
            let line = summary(&found, n_classes, Path::new("d/test.npz"));
            // Of one trial, an interval of Wilson is wide.
            assert!(line.contains("interval of 1 mesh 11.79 to 98.54 %)"), "{line}");
            assert!(line.contains(expected) && line.ends_with("on test.npz"), "{line}");
        }
    }

    #[test]
    fn a_matrix_has_a_row_for_each_true_class() {
        let found = Evaluation { confusion: vec![vec![3, 1], vec![0, 2]], instances: vec![4, 2] };
        let classes = ["cup, small", "a \"vase\""].map(str::to_owned);
        let expected =
            "class,\"cup, small\",\"a \"\"vase\"\"\"\n\"cup, small\",3,1\n\"a \"\"vase\"\"\",0,2\n";
        assert_eq!(to_csv(&found, &classes), expected.as_bytes());
    }
}
