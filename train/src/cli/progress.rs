//! The progress of a training on standard error: a bar for the current epoch, and a line for each
//! finished one.

use crate::run::Progress;
use indicatif::{ProgressBar, ProgressStyle};

const TEMPLATE: &str = "epoch {prefix} {bar:30} {pos}/{len} {msg} {eta} left";

pub fn shown() -> impl FnMut(Progress<'_>) {
    let style = ProgressStyle::with_template(TEMPLATE).expect("invariant: a valid template");
    let mut bar = ProgressBar::hidden();
    move |progress| match progress {
        Progress::Resumed { epoch, epochs } => {
            formats::say!("resuming after epoch {epoch} of {epochs}");
        }
        Progress::Step { epoch, epochs, step, steps, summary } => {
            if step == 1 {
                bar = ProgressBar::new(steps as u64).with_style(style.clone());
                bar.set_prefix(format!("{epoch}/{epochs}"));
            }
            bar.set_position(step as u64);
            let accuracy = 100.0 * summary.accuracy;
            bar.set_message(format!("loss {:.3}, {accuracy:.1} %", summary.loss));
            if step == steps {
                bar.finish_and_clear();
            }
        }
        Progress::Epoch(row) => formats::say!("{row}"),
    }
}
