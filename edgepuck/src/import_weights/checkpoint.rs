//! Reads a model from a PyTorch checkpoint.
//!
//! The `pytorch-reader` crate reads the file. It executes no code, and reads all containers that
//! versions of `torch.save` write.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use formats::weights::{Tensor, tensor_part};
use half::{bf16, f16};
use pytorch_reader::{DType, PickleValue, PytorchReader};

/// The prefixes of the model's tensors in checkpoints that also hold the optimiser's state.
const STATES: [&str; 2] = ["model_state_dict.", "state_dict."];

/// The prefix that `torch.nn.DataParallel` adds to all names.
const PARALLEL: &str = "module.";

/// Largest number of elements of a model, far above that of any PointNet. Without this limit, a
/// small file could fill the memory by a view that repeats one element.
const MOST_ELEMENTS: usize = 1 << 27;

/// A checkpoint whose tensors are read on demand.
pub struct Checkpoint {
    path: PathBuf,
    tensors: BTreeMap<String, pytorch_reader::Tensor>,
    /// The accuracy of the model, if the checkpoint states it; the error is the Python type of an
    /// object that is not read.
    pub accuracy: Result<Option<String>, String>,
}

impl Checkpoint {
    pub fn open(path: &Path) -> anyhow::Result<Self> {
        let here = || format!("{}", path.display());
        let file = PytorchReader::new(path).with_context(here)?;
        let tensors = model_tensors(file.into_tensors().into_iter().collect());
        if tensors.is_empty() {
            bail!("{}: no tensor in it", path.display());
        }
        let accuracy = accuracy(&PytorchReader::read_pickle_data(path, None).with_context(here)?);
        Ok(Self { path: path.to_owned(), tensors, accuracy })
    }

    /// The names of the model's tensors, sorted.
    pub fn names(&self) -> impl Iterator<Item = &str> + Clone {
        self.tensors.keys().map(String::as_str)
    }

    /// Whether all tensors of the model are in f16.
    pub fn is_half(&self) -> bool {
        self.tensors.values().all(|tensor| matches!(tensor.dtype(), DType::F16))
    }

    /// Reads the tensors in `names`, which maps new names to names in the checkpoint.
    pub fn read(
        &self,
        names: &BTreeMap<String, String>,
    ) -> anyhow::Result<BTreeMap<String, Tensor>> {
        let mut elements_left = MOST_ELEMENTS;
        let mut tensors = BTreeMap::new();
        for (ours, theirs) in names {
            let here = || format!("{}: {}", self.path.display(), tensor_part(theirs));
            let source = self.tensors.get(theirs).context("missing").with_context(here)?;
            elements_left = elements_left
                .checked_sub(source.num_elements())
                .with_context(|| format!("the model has more than {MOST_ELEMENTS} elements"))
                .with_context(here)?;
            let values = read_values(source).with_context(here)?;
            tensors.insert(ours.clone(), Tensor { shape: source.shape().to_vec(), values });
        }
        Ok(tensors)
    }
}

/// The tensors of the model among `all` tensors of a file, without the prefixes of their names.
fn model_tensors<T>(all: BTreeMap<String, T>) -> BTreeMap<String, T> {
    let state = STATES.into_iter().find(|state| all.keys().any(|name| name.starts_with(state)));
    let model = within(all, state.unwrap_or_default());
    let is_parallel = model.keys().all(|name| name.starts_with(PARALLEL));
    within(model, if is_parallel { PARALLEL } else { "" })
}

/// The tensors whose names begin with `prefix`, under their names without the prefix.
fn within<T>(tensors: BTreeMap<String, T>, prefix: &str) -> BTreeMap<String, T> {
    let stripped = |name: String| name.strip_prefix(prefix).map(str::to_owned);
    tensors.into_iter().filter_map(|(name, tensor)| Some((stripped(name)?, tensor))).collect()
}

fn read_values(tensor: &pytorch_reader::Tensor) -> anyhow::Result<Vec<f32>> {
    let bytes = tensor.read()?;
    let values: Vec<f32> = match tensor.dtype() {
        DType::F32 => elements(&bytes, f32::from_ne_bytes),
        DType::F64 => elements(&bytes, |bytes| f64::from_ne_bytes(bytes) as f32),
        DType::F16 => elements(&bytes, |bytes| f16::from_ne_bytes(bytes).to_f32()),
        DType::BF16 => elements(&bytes, |bytes| bf16::from_ne_bytes(bytes).to_f32()),
        other => bail!("its elements are {other:?}, expected floating-point numbers"),
    };
    match values.iter().position(|value| !value.is_finite()) {
        Some(at) => bail!("element {at} is {} as f32", values[at]),
        None => Ok(values),
    }
}

fn elements<const N: usize>(bytes: &[u8], decode: impl Fn([u8; N]) -> f32) -> Vec<f32> {
    bytes.as_chunks::<N>().0.iter().map(|element| decode(*element)).collect()
}

/// The accuracy that yanx27's training script stores with the weights.
fn accuracy(root: &PickleValue) -> Result<Option<String>, String> {
    let PickleValue::Dict(entries) = root else { return Ok(None) };
    let mut stated = Vec::new();
    for (key, word) in [("instance_acc", "instance"), ("class_acc", "class")] {
        match entries.get(key) {
            Some(PickleValue::Float(share)) => {
                stated.push(format!("{word} {:.2} %", 100.0 * share))
            }
            Some(PickleValue::Unsupported(kind)) => return Err(kind.clone()),
            _ => {}
        }
    }
    Ok((!stated.is_empty()).then(|| format!("{}, as its checkpoint says", stated.join(", "))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::fs;

    fn golden(name: &str) -> Vec<u8> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/golden/checkpoints");
        fs::read(folder.join(name)).unwrap()
    }

    /// Reads everything; a read that fails is an error like any other.
    fn read_all(bytes: &[u8]) -> anyhow::Result<BTreeMap<String, Tensor>> {
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(file.path(), bytes).unwrap();
        let checkpoint = Checkpoint::open(file.path())?;
        checkpoint.read(&checkpoint.names().map(|name| (name.into(), name.into())).collect())
    }

    #[test]
    fn the_model_is_found_beside_the_optimiser_and_below_data_parallel() {
        let names = |all: &[&str]| {
            let all = all.iter().map(|name| ((*name).to_owned(), ())).collect();
            model_tensors(all).into_keys().collect::<Vec<_>>()
        };
        assert_eq!(names(&["fc1.bias", "fc2.bias"]), ["fc1.bias", "fc2.bias"]);
        assert_eq!(names(&["module.a", "module.b"]), ["a", "b"]);
        assert_eq!(names(&["module.a", "b"]), ["b", "module.a"]);
        let beside = ["model_state_dict.module.a", "optimizer_state_dict.state.0.exp_avg"];
        assert_eq!(names(&beside), ["a"]);
        assert_eq!(names(&["optimizer.x", "state_dict.a"]), ["a"]);
    }

    #[test]
    fn a_number_that_is_no_weight_is_refused() {
        let bytes = golden("3dcertify_legacy.pth");
        let error = format!("{:#}", read_all(&bytes).unwrap_err());
        let cause = "tensor `mlp1.1.num_batches_tracked`: its elements are I64, expected";
        assert!(error.contains(cause), "{error}");
    }

    #[test]
    fn a_view_that_repeats_one_element_without_end_is_refused() {
        let pickle = b"\x80\x02}X\x01\x00\x00\x00actorch._utils\n_rebuild_tensor_v2\n\
            ((X\x07\x00\x00\x00storagectorch\nFloatStorage\nX\x01\x00\x00\x000X\x03\x00\x00\x00cpuK\x01tQ\
            K\x00J\x00\x00\x00\x10\x85K\x00\x85\x89}tRs.";
        let header = b"\x80\x02\x8a\nl\xfc\x9cF\xf9 j\xa8P\x19.\x80\x02M\xe9\x03.\
            \x80\x02}X\x0d\x00\x00\x00little_endian\x88s.";
        let storage =
            b"\x80\x02]X\x01\x00\x00\x000a.\x01\x00\x00\x00\x00\x00\x00\x00\x00\x00\x80\x3f";
        let error = read_all(&[&header[..], pickle, storage].concat()).unwrap_err();
        assert!(
            format!("{error:#}")
                .ends_with("tensor `a`: the model has more than 134217728 elements")
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(512))]

        /// No change to a checkpoint makes its reader panic or fill the memory.
        #[test]
        fn a_damaged_checkpoint_is_an_error_or_a_checkpoint(
            is_zip: bool,
            changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..8),
            length in prop::option::of(any::<prop::sample::Index>()),
        ) {
            let mut bytes = golden(if is_zip { "yanx27.pth" } else { "3dcertify_legacy.pth" });
            for (at, byte) in changes {
                let at = at.index(bytes.len());
                bytes[at] = byte;
            }
            let length = length.map_or(bytes.len(), |length| length.index(bytes.len()));
            let _ = read_all(&bytes[..length]);
        }
    }
}
