//! Accuracy, measured with infer-cpu, which runs the models that are written.

use std::path::Path;

use infer_cpu::{Classifier, Evaluation, Options, evaluate_some};
use rayon::prelude::*;

use crate::clouds::Clouds;
use crate::error::Error;

/// Clouds that one classifier takes at a time.
const CHUNK: usize = 128;

/// Classifies all of `clouds` with the model at `path`.
///
/// # Errors
/// A model that infer-cpu refuses, or that has other classes than the clouds.
pub fn confusion(path: &Path, clouds: &Clouds, options: &Options) -> Result<Evaluation, Error> {
    let n = clouds.classes.len();
    let parts: Vec<Evaluation> = (0..clouds.len().div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| {
            let mut classifier = Classifier::load(path, options)?;
            let found = classifier.classes().len();
            if found != n {
                let cause = format!("expected a model of {n} classes, found {found}");
                return Err(Error::Data { path: path.to_path_buf(), cause });
            }
            let first = chunk * CHUNK;
            let some = first..clouds.len().min(first + CHUNK);
            Ok(evaluate_some(&mut classifier, &clouds.set, some)?)
        })
        .collect::<Result<_, Error>>()?;
    let mut whole = Evaluation { confusion: vec![vec![0; n]; n] };
    parts.iter().for_each(|part| whole.merge(part));
    Ok(whole)
}
