//! Scores the answers of a model to objects that were cut out of scans.
//!
//! An answer to a known object is right if it is the object's class. An answer to a negative, such
//! as a tree or a wall, is right if it is `unknown`; any other answer is a false alarm.

mod labels;
mod table;

pub use labels::Labels;
pub use table::Table;

use std::path::Path;

use infer_cpu::{Options, Prediction};

use crate::clouds::Clouds;
use crate::error::Error;
use crate::evaluate::predictions;

/// A labelled object with a model's answer. Classes are indices into the model's.
#[derive(Clone, Debug, Default)]
pub struct Object {
    /// The name of the file, without its extension.
    pub data: String,
    /// The label in the file.
    pub label: String,
    /// The right answer: a class, or `None` for `unknown`.
    pub truth: Option<usize>,
    /// The number of points.
    pub n_points: usize,
    /// The distance from the sensor in metres, if the file states it.
    pub range_m: Option<f32>,
    /// The name of the sensor, if the file states it.
    pub sensor: Option<String>,
    /// The track in the file: the part of the object's id after `#`.
    pub track: Option<String>,
    /// The model's answer: a class, or `None` for `unknown`.
    pub answer: Option<usize>,
}

/// Classifies the `clouds` of `least` points or more, read from the file `data`, with the model at
/// `path`.
pub fn classified(
    path: &Path,
    data: &str,
    clouds: &Clouds,
    (labels, least): (&Labels, usize),
    options: &Options,
) -> Result<Vec<Object>, Error> {
    let is_wanted = |&i: &usize| clouds.set.cloud(i).len() >= least;
    let clouds = clouds.select(&(0..clouds.len()).filter(is_wanted).collect::<Vec<_>>());
    let found = predictions(path, &clouds, options)?;
    let object = |(i, found): (usize, &Prediction)| {
        let (set, label) = (&clouds.set, &clouds.classes[clouds.set.labels[i]]);
        let track = set.ids.as_ref().and_then(|ids| ids[i].split_once('#'));
        let is_known = !found.is_unknown && labels.is_known[found.class];
        Object {
            data: data.to_owned(),
            label: label.clone(),
            truth: labels.truth(label),
            n_points: set.cloud(i).len(),
            range_m: set.range_m.as_ref().map(|range| range[i]),
            sensor: set.sensor.as_ref().map(|sensor| sensor[i].clone()),
            track: track.map(|(_, track)| track.to_owned()),
            answer: is_known.then_some(found.class),
        }
    };
    Ok(found.iter().enumerate().map(object).collect())
}
