//! Losses and accuracies by epoch, as CSV and as a curve.

use std::fmt;
use std::path::Path;

use formats::{FormatError, atomic};
use serde::{Deserialize, Serialize};
use svg::Document;
use svg::node::element::Polyline;

use crate::svg_text::text;

/// One epoch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Counted from 1.
    pub epoch: u32,
    /// Learning rate at its beginning.
    pub rate: f64,
    /// Mean loss.
    pub loss: f64,
    /// Share of augmented training clouds classified correctly.
    pub accuracy: f64,
    /// Share of validation clouds classified correctly.
    pub validation_instance: Option<f64>,
    /// The mean of that share over classes.
    pub validation_class: Option<f64>,
    /// Wall-clock time of learning, seconds.
    pub seconds: f64,
    /// Clouds learnt from per second.
    pub clouds_per_second: f64,
}

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "epoch {}: loss {:.4}, {:.2} %", self.epoch, self.loss, 100.0 * self.accuracy)?;
        if let (Some(instance), Some(class)) = (self.validation_instance, self.validation_class) {
            write!(f, "; validation {:.2} %, class {:.2} %", 100.0 * instance, 100.0 * class)?;
        }
        write!(f, "; {:.0} s, {:.0} clouds/s", self.seconds, self.clouds_per_second)
    }
}

/// All epochs so far.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Metrics {
    /// In order.
    pub rows: Vec<Row>,
}

impl Metrics {
    /// As a checkpoint keeps them.
    #[must_use]
    pub fn to_notes(&self) -> String {
        serde_json::to_string(self).expect("invariant: numbers are JSON")
    }

    /// From a checkpoint.
    ///
    /// # Errors
    /// Notes that [`Metrics::to_notes`] did not write.
    pub fn from_notes(notes: &str) -> Result<Self, serde_json::Error> {
        serde_json::from_str(notes)
    }

    /// Whether this epoch is better on the validation set than all before it: by the
    /// share of clouds, or `by_class` by the mean of that share over classes.
    #[must_use]
    pub fn is_best(&self, epoch: u32, by_class: bool) -> bool {
        let share =
            |row: &Row| if by_class { row.validation_class } else { row.validation_instance };
        let of = |row: &Row| share(row).unwrap_or(0.0);
        let this = self.rows.iter().find(|row| row.epoch == epoch).map_or(0.0, of);
        self.rows.iter().filter(|row| row.epoch < epoch).all(|row| of(row) < this)
    }

    /// Writes `metrics.csv` and `curve.svg` to `folder`.
    ///
    /// # Errors
    /// What the system reports.
    pub fn write(&self, folder: &Path) -> Result<(), FormatError> {
        atomic::write_bytes(&folder.join("metrics.csv"), self.to_csv())?;
        atomic::write_bytes(&folder.join("curve.svg"), self.curve().to_string())
    }

    /// A header and one line for each epoch. Numbers need no quotes.
    fn to_csv(&self) -> String {
        const HEADER: &str = "epoch,rate,loss,accuracy,validation_instance,validation_class,\
                              seconds,clouds_per_second\n";
        let line = |row: &Row| {
            let Row { epoch, rate, loss, accuracy, seconds, clouds_per_second, .. } = row;
            let [instance, class] = [row.validation_instance, row.validation_class]
                .map(|share| share.map_or(String::new(), |share| share.to_string()));
            format!(
                "{epoch},{rate},{loss},{accuracy},{instance},{class},{seconds:.3},\
                 {clouds_per_second:.1}\n"
            )
        };
        self.rows.iter().map(line).fold(HEADER.to_owned(), |csv, line| csv + &line)
    }

    /// Accuracy by epoch: of training and of validation.
    fn curve(&self) -> Document {
        let (width, height) = (640.0, 360.0);
        let last = self.rows.last().map_or(1, |row| row.epoch).max(2);
        let x = |epoch: u32| 50.0 + (width - 70.0) * f64::from(epoch - 1) / f64::from(last - 1);
        let y = |share: f64| height - 40.0 - (height - 60.0) * share;
        let line = |of: &dyn Fn(&Row) -> Option<f64>, colour: &str| {
            let points = self.rows.iter().filter_map(|row| Some((x(row.epoch), y(of(row)?))));
            let points: Vec<String> = points.map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
            Polyline::new()
                .set("points", points.join(" "))
                .set("fill", "none")
                .set("stroke", colour.to_owned())
                .set("stroke-width", 1.5)
        };
        let text = |words: String, x: f64, y: f64, colour: &str| {
            text(&words, x, y, 12).set("fill", colour.to_owned())
        };
        let mut document = Document::new().set("viewBox", (0, 0, width, height)).add(
            svg::node::element::Rectangle::new()
                .set("width", "100%")
                .set("height", "100%")
                .set("fill", "white"),
        );
        for percent in [0, 25, 50, 75, 100] {
            let at = y(f64::from(percent) / 100.0);
            let grid = Polyline::new()
                .set("points", format!("50,{at} {},{at}", width - 20.0))
                .set("stroke", "#ddd");
            document = document.add(grid).add(text(format!("{percent} %"), 8.0, at + 4.0, "#444"));
        }
        document
            .add(line(&|row| Some(row.accuracy), "#888"))
            .add(line(&|row| row.validation_instance, "#06c"))
            .add(text("training, augmented".to_owned(), 60.0, 16.0, "#888"))
            .add(text("validation".to_owned(), 200.0, 16.0, "#06c"))
            .add(text(format!("epoch {last}"), width - 80.0, height - 20.0, "#444"))
    }
}
