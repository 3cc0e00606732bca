//! Scores the answers of a model to objects that were cut out of scans.
//!
//! An answer to a known object is right if it is the object's class. An answer to a negative, such
//! as a tree or a wall, is right if it is `unknown`; any other answer is a false alarm.

mod detection;
mod failures;
mod share;
mod table;
mod truth;

pub use detection::{Detection, calibration_error, detection};
pub use failures::drawing;
pub use share::{Grouping, Share, bin, shares};
pub use table::Table;
pub use truth::{Labels, Truth};

use std::path::Path;

use infer_cpu::{Options, Prediction};

use crate::clouds::Clouds;
use crate::error::Error;
use crate::evaluate::predictions;

/// A labelled object with a model's answer.
#[derive(Clone, Debug)]
pub struct Object {
    /// The name of the file, without its extension.
    pub data: String,
    /// The index of the object in the file.
    pub index: usize,
    /// The label in the file.
    pub label: String,
    /// The right answer.
    pub truth: Truth,
    /// The number of points.
    pub n_points: usize,
    /// The distance from the sensor in metres, if the file states it.
    pub range_m: Option<f32>,
    /// The name of the sensor, if the file states it.
    pub sensor: Option<String>,
    /// The track in the file: the part of the object's id after `#`.
    pub track: Option<String>,
    /// The model's answer.
    pub answer: Answer,
}

/// A model's answer to an object.
#[derive(Clone, Debug)]
pub struct Answer {
    /// The class, an index into the model's; `None` for `unknown`.
    pub class: Option<usize>,
    /// The probability of the most probable class.
    pub confidence: f64,
    /// The most probable class, known or not.
    pub fine: usize,
    /// [`Prediction::energy`].
    pub energy: f64,
    /// The largest logit of the classes that are not known minus the largest logit of the known
    /// classes. `None` if there are no classes of either kind.
    pub margin: Option<f64>,
}

impl Object {
    /// Whether the answer is right.
    #[must_use]
    pub fn is_right(&self) -> bool {
        match self.truth {
            Truth::Known(class) => self.answer.class == Some(class),
            Truth::Negative => self.answer.class.is_none(),
        }
    }
}

/// Classifies `clouds`, read from the file `data`, with the model at `path`. Leaves out clouds of
/// fewer than `least` points, and those whose labels `labels` leaves out.
pub fn classified(
    path: &Path,
    data: &str,
    clouds: &Clouds,
    (labels, least): (&Labels, usize),
    options: &Options,
) -> Result<Vec<Object>, Error> {
    let is_wanted = |&i: &usize| {
        let label = &clouds.classes[clouds.set.labels[i]];
        clouds.set.cloud(i).len() >= least && labels.truth(label).is_some()
    };
    let wanted: Vec<_> = (0..clouds.len()).filter(is_wanted).collect();
    let clouds = clouds.select(&wanted);
    let found = predictions(path, &clouds, options)?;
    let object = |(i, found): (usize, &Prediction)| {
        let (set, label) = (&clouds.set, clouds.classes[clouds.set.labels[i]].clone());
        let track = set.ids.as_ref().and_then(|ids| ids[i].split_once('#'));
        Some(Object {
            data: data.to_owned(),
            index: wanted[i],
            truth: labels.truth(&label)?,
            label,
            n_points: set.cloud(i).len(),
            range_m: set.range_m.as_ref().map(|range| range[i]),
            sensor: set.sensor.as_ref().map(|sensor| sensor[i].clone()),
            track: track.map(|(_, track)| track.to_owned()),
            answer: answer(found, labels),
        })
    };
    Ok(found.iter().enumerate().filter_map(object).collect())
}

fn answer(found: &Prediction, labels: &Labels) -> Answer {
    let largest = |is_known: bool| {
        let some = (0..found.logits.len()).filter(|&class| labels.is_known(class) == is_known);
        some.map(|class| f64::from(found.logits[class])).reduce(f64::max)
    };
    let is_unknown = found.is_unknown || !labels.is_known(found.class);
    Answer {
        class: (!is_unknown).then_some(found.class),
        confidence: found.confidence(),
        fine: found.class,
        energy: found.energy,
        margin: largest(false).zip(largest(true)).map(|(unknown, known)| unknown - known),
    }
}
