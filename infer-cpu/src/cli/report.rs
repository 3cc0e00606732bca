//! The output of `classify`: one line per cloud, as text or JSON.

use std::io::{self, Write};
use std::path::Path;
use std::time::Duration;

use crate::{Precision, Prediction};
use program::outcome::say;
use serde::Serialize;

#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Style {
    /// Name, class and confidence, separated by tabs; warnings go to standard error.
    Text,
    /// One JSON object a line.
    Json,
}

#[derive(Serialize)]
struct Classified<'a> {
    file: &'a str,
    class: usize,
    label: &'a str,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    unknown: bool,
    confidence: f64,
    logits: &'a [f32],
    points: usize,
    used: usize,
    dropped: usize,
    clipped: u64,
    precision: &'a str,
    ms: f64,
}

#[derive(Serialize)]
struct Failed<'a> {
    file: &'a str,
    error: &'a str,
}

impl Style {
    /// Prints and flushes the prediction for the cloud `name`; `precision` is the requested one and
    /// `time` the duration.
    pub fn classified(
        self,
        name: &Path,
        prediction: &Prediction,
        precision: Precision,
        time: Duration,
    ) -> io::Result<()> {
        if self == Self::Text {
            warn(name, prediction, precision);
            let percent = 100.0 * prediction.confidence();
            let answer = prediction.answer();
            return line(&format!("{}\t{answer}\t{percent:.1} %", name.display()));
        }
        json_line(&Classified {
            file: &name.to_string_lossy(),
            class: prediction.class,
            label: &prediction.label,
            unknown: prediction.is_unknown,
            confidence: prediction.confidence(),
            logits: &prediction.logits,
            points: prediction.n_points,
            used: prediction.n_used,
            dropped: prediction.n_dropped,
            clipped: prediction.n_clipped,
            precision: prediction.precision.name(),
            ms: time.as_secs_f64() * 1e3,
        })
    }

    pub fn failed(self, name: &Path, error: &str) -> io::Result<()> {
        match self {
            Self::Json => json_line(&Failed { file: &name.to_string_lossy(), error }),
            Self::Text => {
                say(format!("error: {error}"));
                Ok(())
            }
        }
    }
}

/// Prints warnings, which a line of text does not include.
fn warn(name: &Path, prediction: &Prediction, precision: Precision) {
    let warn = |what: &str| say(format!("warning: {}: {what}", name.display()));
    match prediction.n_dropped {
        0 => {}
        n => warn(&format!("dropped {} at 0, 0, 0 or not finite", formats::counted(n, "point"))),
    }
    if prediction.n_clipped > 0 {
        let n = prediction.n_clipped;
        warn(&format!(
            "{n} activations were above the calibrated range of {precision} and were clipped to it"
        ));
    }
}

fn json_line(record: &impl Serialize) -> io::Result<()> {
    line(&serde_json::to_string(record)?)
}

fn line(text: &str) -> io::Result<()> {
    let mut out = io::stdout().lock();
    writeln!(out, "{text}")?;
    out.flush()
}
