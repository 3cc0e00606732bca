//! Classification of clouds by a model file, with infer-cpu.

use std::ops::Range;
use std::path::Path;

use infer_cpu::{Classifier, Evaluation, Options, Prediction, evaluate_some};
use rayon::prelude::*;

use crate::clouds::Clouds;
use crate::error::Error;

/// Number of clouds that one task classifies.
const CHUNK: usize = 128;

/// The confusion matrix of the model at `path` on `clouds`.
pub fn confusion(path: &Path, clouds: &Clouds, options: &Options) -> Result<Evaluation, Error> {
    let n = clouds.classes.len();
    let parts = in_chunks(path, clouds, options, |classifier, some| {
        let found = classifier.classes().len();
        if found != n {
            let cause = format!("expected a model of {n} classes, found {found}");
            return Err(Error::Data { path: path.to_path_buf(), cause });
        }
        Ok(evaluate_some(classifier, &clouds.set, some)?)
    })?;
    let mut whole = Evaluation { confusion: vec![vec![0; n]; n] };
    parts.iter().for_each(|part| whole.merge(part));
    Ok(whole)
}

/// The predictions of the model at `path` for `clouds`, whose classes may differ from the model's.
pub fn predictions(
    path: &Path,
    clouds: &Clouds,
    options: &Options,
) -> Result<Vec<Prediction>, Error> {
    let parts = in_chunks(path, clouds, options, |classifier, some| {
        let classify = |i| -> Result<Prediction, Error> {
            Ok(classifier.classify_on_ground(clouds.set.cloud(i), clouds.set.ground_z(i))?.clone())
        };
        some.map(classify).collect::<Result<Vec<_>, _>>()
    })?;
    Ok(parts.into_iter().flatten().collect())
}

/// The results of `take` for each chunk of the clouds, in order. The chunks run in parallel.
fn in_chunks<T: Send>(
    path: &Path,
    clouds: &Clouds,
    options: &Options,
    take: impl Fn(&mut Classifier, Range<usize>) -> Result<T, Error> + Sync,
) -> Result<Vec<T>, Error> {
    let chunk = |chunk| {
        let first = chunk * CHUNK;
        let some = first..clouds.len().min(first + CHUNK);
        take(&mut Classifier::load(path, options)?, some)
    };
    (0..clouds.len().div_ceil(CHUNK)).into_par_iter().map(chunk).collect()
}
