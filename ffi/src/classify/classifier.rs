use std::ffi::{CString, c_char};
use std::mem::MaybeUninit;
use std::path::Path;
use std::ptr::null;

use infer_cpu::{Classifier, Options};

use super::options::EdgepuckOptions;
use super::prediction::EdgepuckPrediction;
use crate::pointers;
use crate::status::{EdgepuckStatus, Failure, guard, guard_status};

/// A loaded network that classifies clouds. edgepuck_load creates it, and edgepuck_free frees it.
pub struct EdgepuckClassifier {
    classifier: Classifier,
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
        Ok(Self { classifier, class_names, logits })
    }

    fn classify(&mut self, cloud: &[[f32; 3]]) -> Result<EdgepuckPrediction, Failure> {
        self.logits.clear();
        let found = self.classifier.classify(cloud)?;
        self.logits.extend_from_slice(&found.logits);
        Ok(EdgepuckPrediction::new(found))
    }
}

/// C may move a classifier to another thread.
const _: () = {
    const fn is_send<T: Send>() {}
    is_send::<EdgepuckClassifier>();
};

/// Loads the model file at path (UTF-8 on Windows) with options; null stands for the defaults.
/// Writes the classifier to out, or null if it fails. Pass it to edgepuck_free in the end.
///
/// # Safety
///
/// path is null or a NUL-terminated string, as is every word of options.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn edgepuck_load(
    path: *const c_char,
    options: Option<&EdgepuckOptions>,
    out: Option<&mut MaybeUninit<Option<Box<EdgepuckClassifier>>>>,
) -> EdgepuckStatus {
    pointers::make(out, || {
        // SAFETY: the strings are as the `# Safety` section above requires.
        let (path, options) =
            unsafe { (pointers::path(path, "path")?, EdgepuckOptions::or_default(options)?) };
        EdgepuckClassifier::load(&path, &options)
    })
}

/// Classifies a cloud of n_points points, x y z after x y z, in metres; any unit will do for a
/// model that normalises clouds. Writes to out if it succeeds. Clouds of up to capacity points (see
/// EdgepuckOptions) cause no allocation.
///
/// # Safety
///
/// xyz is null or 3 * n_points floats can be read there.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn edgepuck_classify(
    classifier: Option<&mut EdgepuckClassifier>,
    xyz: *const f32,
    n_points: usize,
    out: Option<&mut MaybeUninit<EdgepuckPrediction>>,
) -> EdgepuckStatus {
    guard_status(|| {
        let (out, classifier) =
            (pointers::need(out, "out")?, pointers::need(classifier, "classifier")?);
        // SAFETY: null or long enough, as required above.
        let cloud = unsafe { pointers::slice(xyz.cast(), n_points, "xyz") }?;
        out.write(classifier.classify(cloud)?);
        Ok(())
    })
}

/// Copies the logits of the last cloud, one per class, to a buffer of length floats.
///
/// # Safety
///
/// out is null or length floats may be written there.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn edgepuck_logits(
    classifier: Option<&EdgepuckClassifier>,
    out: *mut f32,
    length: usize,
) -> EdgepuckStatus {
    guard_status(|| {
        pointers::check(out, "out")?;
        let classifier = pointers::need(classifier, "classifier")?;
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
        // SAFETY: long enough, as checked above.
        unsafe { pointers::write(logits, out, "out") }
    })
}

/// The number of classes; 0 for a null classifier.
#[unsafe(no_mangle)]
pub extern "C" fn edgepuck_n_classes(classifier: Option<&EdgepuckClassifier>) -> usize {
    classifier.map_or(0, |classifier| classifier.class_names.len())
}

/// The name of class index, UTF-8, valid as long as the classifier; null for a null classifier or a
/// class that does not exist.
#[unsafe(no_mangle)]
pub extern "C" fn edgepuck_class_name(
    classifier: Option<&EdgepuckClassifier>,
    index: usize,
) -> *const c_char {
    let name = guard(|| {
        let names = &pointers::need(classifier, "classifier")?.class_names;
        names.get(index).map(|name| name.as_ptr()).ok_or_else(|| {
            let message = format!("expected a class below {}, found {index}", names.len());
            Failure::new(EdgepuckStatus::BadValue, message)
        })
    });
    name.unwrap_or(null())
}

/// Frees a classifier; null has no effect.
#[unsafe(no_mangle)]
pub extern "C" fn edgepuck_free(classifier: Option<Box<EdgepuckClassifier>>) {
    pointers::free(classifier);
}
