use std::ffi::{CString, c_char};
use std::path::Path;
use std::ptr::null;

use infer_cpu::{Classifier, Options, Precision};

use crate::failure::{Failure, guard, guard_status};
use crate::options::EdgepuckOptions;
use crate::pointers;
use crate::prediction::EdgepuckPrediction;
use crate::status::EdgepuckStatus;

/// A loaded network that classifies clouds. edgepuck_load creates it, and edgepuck_free frees it.
pub struct EdgepuckClassifier {
    classifier: Classifier,
    precision: Precision,
    class_names: Vec<CString>,
    /// The logits of the last cloud; empty if it could not be classified.
    logits: Vec<f32>,
}

impl EdgepuckClassifier {
    fn load(path: &Path, options: &Options) -> Result<Self, Failure> {
        let classifier = Classifier::load(path, options)?;
        let names = classifier.classes().iter().map(|name| {
            let message = || format!("expected class names without NUL, found {name:?}");
            CString::new(name.as_bytes())
                .map_err(|_| Failure::new(EdgepuckStatus::BadModel, message()))
        });
        let class_names: Vec<CString> = names.collect::<Result<_, _>>()?;
        let logits = Vec::with_capacity(class_names.len());
        Ok(Self { classifier, precision: options.precision, class_names, logits })
    }

    fn classify(&mut self, cloud: &[[f32; 3]]) -> Result<EdgepuckPrediction, Failure> {
        self.logits.clear();
        let found = self.classifier.classify(cloud)?;
        self.logits.extend_from_slice(&found.logits);
        Ok(EdgepuckPrediction::new(found, self.precision))
    }
}

/// C may move a classifier to another thread.
const _: () = {
    const fn is_send<T: Send>() {}
    is_send::<EdgepuckClassifier>();
};

/// The library's version, such as "0.1.0".
#[unsafe(no_mangle)]
pub extern "C" fn edgepuck_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}

/// Loads the model file at path (UTF-8 on Windows) with options; null stands for the defaults.
/// Writes the classifier to out, or null if it fails. Pass it to edgepuck_free in the end.
///
/// # Safety
///
/// path is null or a NUL-terminated string, as is every word of options; options is null or valid;
/// out is null or may be written to.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn edgepuck_load(
    path: *const c_char,
    options: *const EdgepuckOptions,
    out: *mut *mut EdgepuckClassifier,
) -> EdgepuckStatus {
    // SAFETY: the pointers are as the `# Safety` section above requires.
    unsafe {
        pointers::make(out, || {
            EdgepuckClassifier::load(&pointers::path(path)?, &pointers::options(options)?)
        })
    }
}

/// Classifies a cloud of n_points points, x y z after x y z, in metres; any unit will do for a
/// model that normalises clouds. Writes to out if it succeeds. Clouds of up to capacity points (see
/// EdgepuckOptions) cause no allocation.
///
/// # Safety
///
/// classifier is null or comes from edgepuck_load, is not freed, and no other thread uses it now;
/// xyz is null or 3 * n_points floats can be read there; out is null or may be written to.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn edgepuck_classify(
    classifier: *mut EdgepuckClassifier,
    xyz: *const f32,
    n_points: usize,
    out: *mut EdgepuckPrediction,
) -> EdgepuckStatus {
    guard_status(|| {
        // SAFETY: the pointers are as the `# Safety` section above requires.
        let (out, classifier, cloud) = unsafe {
            let out = pointers::out(out)?;
            (out, pointers::exclusive(classifier, "classifier")?, pointers::cloud(xyz, n_points)?)
        };
        out.write(classifier.classify(cloud)?);
        Ok(())
    })
}

/// Copies the logits of the last cloud, one per class, to a buffer of length floats. After votes
/// they are mean log-probabilities.
///
/// # Safety
///
/// classifier is null or comes from edgepuck_load, is not freed, and no other thread classifies
/// with it now; out is null or length floats may be written there.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn edgepuck_logits(
    classifier: *const EdgepuckClassifier,
    out: *mut f32,
    length: usize,
) -> EdgepuckStatus {
    guard_status(|| {
        pointers::check(out, "out")?;
        // SAFETY: null or from edgepuck_load, and not freed, as required above.
        let classifier = unsafe { pointers::shared(classifier, "classifier") }?;
        let (logits, n_classes) = (&classifier.logits, classifier.class_names.len());
        if logits.is_empty() {
            let message = "expected a classified cloud, but the last call classified none";
            return Err(Failure::new(EdgepuckStatus::NoPrediction, message));
        }
        if length < n_classes {
            let message =
                format!("expected a buffer for {n_classes} logits, found one of {length}");
            return Err(Failure::new(EdgepuckStatus::BufferTooSmall, message));
        }
        // SAFETY: not null, aligned, and long enough, as checked above; the buffer of C does not
        // overlap with the `Vec` of logits.
        unsafe { out.copy_from_nonoverlapping(logits.as_ptr(), logits.len()) };
        Ok(())
    })
}

/// The number of classes; 0 for a null classifier.
///
/// # Safety
///
/// classifier is null or comes from edgepuck_load and is not freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn edgepuck_n_classes(classifier: *const EdgepuckClassifier) -> usize {
    let n_classes = guard(|| {
        // SAFETY: null or from edgepuck_load, and not freed, as required above.
        let classifier = unsafe { pointers::shared(classifier, "classifier") }?;
        Ok(classifier.class_names.len())
    });
    n_classes.unwrap_or(0)
}

/// The name of class index, UTF-8, valid as long as the classifier; null for a null classifier or a
/// class that does not exist.
///
/// # Safety
///
/// classifier is null or comes from edgepuck_load and is not freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn edgepuck_class_name(
    classifier: *const EdgepuckClassifier,
    index: usize,
) -> *const c_char {
    let name = guard(|| {
        // SAFETY: null or from edgepuck_load, and not freed, as required above.
        let names = unsafe { &pointers::shared(classifier, "classifier")?.class_names };
        names.get(index).map(|name| name.as_ptr()).ok_or_else(|| {
            let message = format!("expected a class below {}, found {index}", names.len());
            Failure::new(EdgepuckStatus::BadOption, message)
        })
    });
    name.unwrap_or(null())
}

/// Frees a classifier; null has no effect.
///
/// # Safety
///
/// classifier is null or comes from edgepuck_load; no thread uses it or its class names now or
/// later.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn edgepuck_free(classifier: *mut EdgepuckClassifier) {
    // SAFETY: null or from edgepuck_load, which calls `make`, and not used later, as required
    // above.
    unsafe { pointers::free(classifier) }
}
