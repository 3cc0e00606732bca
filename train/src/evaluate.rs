//! Classification of clouds by a model file, with infer-cpu.

use std::path::Path;

use infer_cpu::{Classifier, Evaluation, Options, Prediction};
use rayon::prelude::*;

use crate::clouds::Clouds;
use crate::error::Error;

/// Number of clouds that one task classifies.
const CHUNK: usize = 128;

/// The answers of the model at `path` to `clouds`, whose classes must be the model's: how many clouds of
/// each true class it gives each class.
pub fn evaluate(path: &Path, clouds: &Clouds, options: &Options) -> Result<Evaluation, Error> {
    let n = clouds.classes.len();
    let mut confusion = vec![vec![0; n]; n];
    for (answer, &label) in predictions(path, clouds, options)?.iter().zip(&clouds.set.labels) {
        let found = answer.logits.len();
        if found != n {
            return Err(Error::data(
                path,
                format!("expected a model of {n} classes, found {found}"),
            ));
        }
        confusion[label][answer.class] += 1;
    }
    Ok(Evaluation { confusion, instances: clouds.set.n_instances(n) })
}

/// The predictions of the model at `path` for `clouds`, whose classes may differ from the model's.
pub fn predictions(
    path: &Path,
    clouds: &Clouds,
    options: &Options,
) -> Result<Vec<Prediction>, Error> {
    let chunk = |chunk| -> Result<Vec<Prediction>, Error> {
        let mut classifier = Classifier::load(path, options)?;
        let some = chunk * CHUNK..clouds.len().min((chunk + 1) * CHUNK);
        let classify = |i| {
            let (cloud, ground_z) = (clouds.set.cloud(i), clouds.set.ground_z(i));
            Ok(classifier.classify_on_ground(cloud, ground_z)?.clone())
        };
        some.map(classify).collect()
    };
    let parts = (0..clouds.len().div_ceil(CHUNK)).into_par_iter().map(chunk);
    Ok(parts.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect())
}
