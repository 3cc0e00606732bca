//! Losses and accuracies of each epoch, written as CSV and as a curve.

use std::fmt;
use std::path::Path;

use formats::{FormatError, atomic};
use serde::{Deserialize, Serialize};

use crate::svg::{drawing, text};

/// The metrics of one epoch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Epoch {
    /// The epoch, counted from 1.
    pub epoch: u32,
    /// The learning rate at the start of the epoch.
    pub rate: f64,
    /// The mean loss.
    pub loss: f64,
    /// The share of augmented training clouds that were classified correctly.
    pub accuracy: f64,
    /// The share of validation clouds that were classified correctly.
    pub validation_instance: Option<f64>,
    /// The mean of that share over classes.
    pub validation_class: Option<f64>,
    /// The wall-clock time of the training steps, seconds.
    pub seconds: f64,
    /// The number of training clouds per second.
    pub clouds_per_second: f64,
}

impl fmt::Display for Epoch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "epoch {}: loss {:.4}, {:.2} %", self.epoch, self.loss, 100.0 * self.accuracy)?;
        if let (Some(instance), Some(class)) = (self.validation_instance, self.validation_class) {
            write!(f, "; validation {:.2} %, class {:.2} %", 100.0 * instance, 100.0 * class)?;
        }
        write!(f, "; {:.0} s, {:.0} clouds/s", self.seconds, self.clouds_per_second)
    }
}

/// The metrics of all finished epochs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Metrics {
    /// The epochs in order.
    #[serde(rename = "rows")]
    pub epochs: Vec<Epoch>,
}

impl Metrics {
    /// The text for a checkpoint.
    #[must_use]
    pub fn to_notes(&self) -> String {
        serde_json::to_string(self).expect("invariant: numbers are JSON")
    }

    /// Reads the text of a checkpoint.
    pub fn from_notes(notes: &str) -> Result<Self, serde_json::Error> {
        serde_json::from_str(notes)
    }

    /// Whether this epoch is better on the validation set than all earlier epochs. Compares the
    /// share of correct clouds or, if `by_class`, its mean over classes.
    #[must_use]
    pub fn is_best(&self, epoch: u32, by_class: bool) -> bool {
        let share =
            |row: &Epoch| if by_class { row.validation_class } else { row.validation_instance };
        let score = |row: &Epoch| share(row).unwrap_or(0.0);
        let this = self.epochs.iter().find(|row| row.epoch == epoch).map_or(0.0, score);
        self.epochs.iter().filter(|row| row.epoch < epoch).all(|row| score(row) < this)
    }

    /// Writes `metrics.csv` and `curve.svg` to `folder`.
    pub fn write(&self, folder: &Path) -> Result<(), FormatError> {
        atomic::write_bytes(&folder.join("metrics.csv"), self.to_csv())?;
        atomic::write_bytes(&folder.join("curve.svg"), self.curve())
    }

    fn to_csv(&self) -> String {
        const HEADER: &str = "epoch,rate,loss,accuracy,validation_instance,validation_class,\
                              seconds,clouds_per_second\n";
        let line = |row: &Epoch| {
            let Epoch { epoch, rate, loss, accuracy, seconds, clouds_per_second, .. } = row;
            let [instance, class] = [row.validation_instance, row.validation_class]
                .map(|share| share.map_or(String::new(), |share| share.to_string()));
            format!(
                "{epoch},{rate},{loss},{accuracy},{instance},{class},{seconds:.3},\
                 {clouds_per_second:.1}\n"
            )
        };
        self.epochs.iter().map(line).fold(HEADER.to_owned(), |csv, line| csv + &line)
    }

    /// The accuracy by epoch on training and on validation clouds, as SVG.
    fn curve(&self) -> String {
        let (width, height) = (640.0, 360.0);
        let last = self.epochs.last().map_or(1, |row| row.epoch).max(2);
        let x = |epoch: u32| 50.0 + (width - 70.0) * f64::from(epoch - 1) / f64::from(last - 1);
        let y = |share: f64| height - 40.0 - (height - 60.0) * share;
        let line = |share: &dyn Fn(&Epoch) -> Option<f64>, colour: &str| {
            let points = self.epochs.iter().filter_map(|row| Some((x(row.epoch), y(share(row)?))));
            let points: Vec<String> = points.map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
            let points = points.join(" ");
            format!(
                "<polyline points='{points}' fill='none' stroke='{colour}' stroke-width='1.5'/>\n"
            )
        };
        let mut parts = String::new();
        for percent in [0, 25, 50, 75, 100] {
            let (at, right) = (y(f64::from(percent) / 100.0), width - 20.0);
            parts += &format!("<polyline points='50,{at} {right},{at}' stroke='#ddd'/>\n");
            parts += &text(&format!("{percent} %"), 8.0, at + 4.0, 12, "fill='#444'");
        }
        parts += &line(&|row| Some(row.accuracy), "#888");
        parts += &line(&|row| row.validation_instance, "#06c");
        parts += &text("training, augmented", 60.0, 16.0, 12, "fill='#888'");
        parts += &text("validation", 200.0, 16.0, 12, "fill='#06c'");
        let last_epoch = format!("epoch {last}");
        parts += &text(&last_epoch, width - 80.0, height - 20.0, 12, "fill='#444'");
        drawing(width, height, &parts)
    }
}
