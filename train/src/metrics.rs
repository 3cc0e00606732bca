//! Losses and accuracies of each epoch, written as CSV.

use std::fmt;

use serde::{Deserialize, Serialize};

/// The metrics of one epoch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
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

/// Whether `epoch` is better on the validation set than all `earlier` ones. Compares the share of
/// correct clouds or, if the recipe has a `balance`, its mean over classes.
pub fn is_best(epoch: &Epoch, earlier: &[Epoch], balance: f64) -> bool {
    let score = |row: &Epoch| {
        if balance > 0.0 { row.validation_class } else { row.validation_instance }.unwrap_or(0.0)
    };
    earlier.iter().all(|row| score(row) < score(epoch))
}

/// The epochs as CSV.
pub fn to_csv(epochs: &[Epoch]) -> String {
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
    epochs.iter().map(line).fold(HEADER.to_owned(), |csv, line| csv + &line)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_epoch_is_that_of_clouds_or_with_a_balance_that_of_classes() {
        let of = |instance, class| Epoch {
            validation_instance: Some(instance),
            validation_class: Some(class),
            ..Epoch::default()
        };
        let (clouds, classes) = (of(0.9, 0.4), of(0.8, 0.6));
        assert!(is_best(&clouds, &[classes], 0.0) && is_best(&classes, &[clouds], 0.5));
        assert!(!is_best(&classes, &[clouds], 0.0) && !is_best(&clouds, &[classes], 0.5));
    }
}
