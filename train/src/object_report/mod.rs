//! How a model answers to objects that were cut out of scans, some of which it is
//! meant to know and some not.
//!
//! Known objects are right if they are called by their class, and negatives, such as
//! trees and walls, if they are answered as `unknown`. A negative that is called
//! something known is a false alarm.

mod detection;
mod failures;
mod table;
mod truth;

pub use detection::{Detection, calibration_error, detection};
pub use failures::drawing;
pub use table::{Row, Table};
pub use truth::{Labels, Truth};

use std::path::Path;

use infer_cpu::{Options, Prediction};

use crate::clouds::Clouds;
use crate::error::Error;
use crate::evaluate::predictions;

/// A labelled object, and what a model says of it.
#[derive(Clone, Debug)]
pub struct Object {
    /// The file that it is from, without its extension.
    pub data: String,
    /// Its place in that file.
    pub index: usize,
    /// Its label in the file.
    pub label: String,
    /// What the answer should be.
    pub truth: Truth,
    /// Points of its cluster.
    pub n_points: usize,
    /// Distance from the sensor in metres, where the file lists it.
    pub range_m: Option<f32>,
    /// The sensor's name, where the file lists it.
    pub sensor: Option<String>,
    /// The track in its file: what follows the `#` of its id.
    pub track: Option<String>,
    /// The model's answer, with which of the classes count as known.
    pub answer: Answer,
}

/// A model's answer to an object.
#[derive(Clone, Debug)]
pub struct Answer {
    /// The class, an index into the model's; `None` for `unknown`.
    pub class: Option<usize>,
    /// Whether the fine class is right, and its confidence: of a known object.
    pub confidence: f64,
    /// The most probable of all classes.
    pub fine: usize,
    /// [`Prediction::energy`].
    pub energy: f64,
    /// The largest logit of the classes that are not known, less the largest of
    /// those that are; `None` if either has none.
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

/// Classifies `clouds`, which are of the file `data`, by the model at `path`: those
/// of `least` points or more whose label is not left out.
///
/// # Errors
/// A model or a cloud that infer-cpu refuses.
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
