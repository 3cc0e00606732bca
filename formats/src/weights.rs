//! Weights on disk: safetensors, read tensor by tensor, so that a model is not in memory twice.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Cursor, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use half::f16;
use safetensors::tensor::{Dtype, Metadata, TensorInfo};

use crate::atomic;
use crate::error::FormatError;
use crate::plausible::or_foreign;

/// The header's length comes first, as u64.
const LENGTH_SIZE: u64 = 8;
/// The longest header that the crate `safetensors` accepts.
const LONGEST_HEADER: u64 = 100_000_000;

/// Bytes that tell other kinds of files: the name of a zip archive's first entry is among them.
const EXAMINED: u64 = 256;
const CHECKPOINT: &str =
    "a PyTorch checkpoint: import its weights with edgepuck.torch.import_weights in Python";

/// A tensor of f32 and its shape.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor {
    /// The size along each axis.
    pub shape: Vec<usize>,
    /// The elements in C order; all are finite when read by [`WeightsFile`].
    pub values: Vec<f32>,
}

/// A safetensors file that is being read.
pub struct WeightsFile {
    path: PathBuf,
    file: Box<dyn Source>,
    data_offset: u64,
    header: Metadata,
}

/// What a file is that begins with `start`, if it is of a kind that is taken for a model.
fn of_another_kind(start: &[u8]) -> Option<&'static str> {
    const KINDS: [(&[u8], &str); 5] = [
        // A pickle of protocol 2, from before PyTorch 1.6.
        (b"\x80\x02", CHECKPOINT),
        (b"\x93NUMPY", "an array of NumPy, such as a cloud: name a model"),
        (b"ply", "a cloud or a mesh: name a model"),
        (b"# .PCD", "a cloud: name a model"),
        (b"{", "JSON: name a model"),
    ];
    let Some(entry) = start.strip_prefix(b"PK\x03\x04") else {
        let known = KINDS.iter().find(|(sign, _)| start.trim_ascii_start().starts_with(sign));
        // UTF-8 has no byte above.
        let is_text = |byte: &u8| (b' '..0xf5).contains(byte) || byte.is_ascii_whitespace();
        let text = start.iter().all(is_text).then_some("text: name a model");
        return known.map(|(_, what)| *what).or(text);
    };
    // The name of the first entry: 26 bytes into a zip archive is its length (APPNOTE.TXT, 4.3.7).
    let length = entry.get(22..24).map_or(0, |size| u16::from_le_bytes([size[0], size[1]]));
    let name = entry.get(26..).unwrap_or_default();
    let name = name.get(..length.into()).unwrap_or(name);
    Some(match name {
        name if name.ends_with(b".npy") => "an NPZ file, such as a scan or a cloud: name a model",
        name if name.contains(&b'/') => CHECKPOINT,
        _ => "a zip archive",
    })
}

/// A file, or its bytes in memory.
trait Source: Read + Seek + Send {}

impl<T: Read + Seek + Send> Source for T {}

impl WeightsFile {
    /// Opens the file at `path` and checks its header against its size.
    ///
    /// # Errors
    /// A file that cannot be read, is not safetensors, or is cut short.
    pub fn open(path: &Path) -> Result<Self, FormatError> {
        let here = |source| FormatError::io(path, source);
        if path.is_dir() {
            let cause = "expected safetensors, found a folder";
            return Err(FormatError::malformed(path, "file", cause));
        }
        let file = File::open(path).map_err(here)?;
        let file_size = file.metadata().map_err(here)?.len();
        Self::new(path, Box::new(file), file_size)
    }

    /// Takes the `bytes` of a file from memory and checks its header against their number. Errors
    /// call the file `name`.
    ///
    /// # Errors
    /// Bytes that are not safetensors, or cut short.
    pub fn from_bytes(name: &Path, bytes: Arc<[u8]>) -> Result<Self, FormatError> {
        let size = bytes.len() as u64;
        Self::new(name, Box::new(Cursor::new(bytes)), size)
    }

    fn new(path: &Path, mut file: Box<dyn Source>, file_size: u64) -> Result<Self, FormatError> {
        let (data_offset, header) =
            Self::read_header(path, &mut file, file_size).map_err(|error| {
                // A file that cannot be read again keeps its error.
                let _ = file.rewind();
                or_foreign(path, &mut file, "safetensors", error)
            })?;
        Ok(Self { path: path.to_path_buf(), file, data_offset, header })
    }

    /// Where the data begin, and the header.
    fn read_header(
        path: &Path,
        mut file: &mut dyn Source,
        file_size: u64,
    ) -> Result<(u64, Metadata), FormatError> {
        let here = |source| FormatError::io(path, source);
        let bad = |cause: String| FormatError::malformed(path, "header", cause);
        let mut length = [0; LENGTH_SIZE as usize];
        file.read_exact(&mut length).map_err(|_| bad("too short for safetensors".to_owned()))?;
        let mut start = length.to_vec();
        let length = u64::from_le_bytes(length);
        if length > LONGEST_HEADER || length > file_size - LENGTH_SIZE {
            // A valid length is tested first, since a header of 640 bytes begins as pickles do.
            (&mut file).take(EXAMINED).read_to_end(&mut start).map_err(here)?;
            let found = of_another_kind(&start).map_or_else(
                || format!("a header of {length} bytes in a file of {file_size}"),
                str::to_owned,
            );
            return Err(bad(format!("expected safetensors, found {found}")));
        }
        let mut json = Vec::new();
        (&mut file).take(length).read_to_end(&mut json).map_err(here)?;
        let header: Metadata = serde_json::from_slice(&json)
            .map_err(|cause| bad(format!("expected safetensors: {cause}")))?;
        let data_offset = LENGTH_SIZE + length;
        let promised = data_offset + header.data_len() as u64;
        if promised != file_size {
            return Err(bad(format!("expected {promised} bytes by the header, found {file_size}")));
        }
        Ok((data_offset, header))
    }

    /// The file's name.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The names and shapes of all tensors, sorted by name.
    #[must_use]
    pub fn shapes(&self) -> BTreeMap<String, Vec<usize>> {
        let tensors = self.header.tensors().into_iter();
        tensors.map(|(name, info)| (name, info.shape.clone())).collect()
    }

    /// The metadata of the file, sorted by key.
    #[must_use]
    pub fn metadata(&self) -> BTreeMap<String, String> {
        let metadata = self.header.metadata().iter().flatten();
        metadata.map(|(key, value)| (key.clone(), value.clone())).collect()
    }

    /// The shape of tensor `name`, if there is one.
    #[must_use]
    pub fn shape(&self, name: &str) -> Option<&[usize]> {
        self.header.info(name).map(|info| &info.shape[..])
    }

    /// Reads tensor `name`.
    ///
    /// # Errors
    /// A tensor that is missing, is neither f32 nor f16, or has a value that is not finite.
    pub fn read(&mut self, name: &str) -> Result<Tensor, FormatError> {
        let bad = |cause: String| FormatError::malformed(&self.path, tensor_part(name), cause);
        let info: &TensorInfo = self.header.info(name).ok_or_else(|| bad("missing".to_owned()))?;
        if ![Dtype::F32, Dtype::F16].contains(&info.dtype) {
            return Err(bad(format!("expected f32 or f16, found {:?}", info.dtype)));
        }
        let (begin, end) = info.data_offsets;
        let mut bytes = vec![0; end - begin];
        let start = SeekFrom::Start(self.data_offset + begin as u64);
        let read = self.file.seek(start).and_then(|_| self.file.read_exact(&mut bytes));
        read.map_err(|source| FormatError::io(&self.path, source))?;
        let values: Vec<f32> = if info.dtype == Dtype::F16 {
            let (halves, _) = bytes.as_chunks::<2>();
            halves.iter().map(|bytes| f16::from_le_bytes(*bytes).to_f32()).collect()
        } else {
            bytes.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect()
        };
        if let Some(at) = values.iter().position(|value| !value.is_finite()) {
            return Err(bad(format!("element {at} is {}", values[at])));
        }
        Ok(Tensor { shape: info.shape.clone(), values })
    }
}

/// The name of tensor `name` in errors.
#[must_use]
pub fn tensor_part(name: &str) -> String {
    format!("tensor `{name}`")
}

/// Writes `tensors` and `metadata` to `path` in f32, atomically; the same
/// content gives the same bytes.
///
/// # Errors
/// A tensor whose shape does not fit its values; errors of the system.
pub fn write_weights(
    path: &Path,
    tensors: &BTreeMap<String, Tensor>,
    metadata: &BTreeMap<String, String>,
) -> Result<(), FormatError> {
    write(path, tensors, metadata, Dtype::F32)
}

/// As [`write_weights`], rounded to f16.
///
/// # Errors
/// As [`write_weights`]; a value that f16 cannot hold.
pub fn write_half_weights(
    path: &Path,
    tensors: &BTreeMap<String, Tensor>,
    metadata: &BTreeMap<String, String>,
) -> Result<(), FormatError> {
    for (name, Tensor { values, .. }) in tensors {
        if let Some(at) = values.iter().position(|&x| !f16::from_f32(x).is_finite()) {
            let cause = format!("element {at}, {}, is too large for f16", values[at]);
            return Err(FormatError::malformed(path, tensor_part(name), cause));
        }
    }
    write(path, tensors, metadata, Dtype::F16)
}

fn write(
    path: &Path,
    tensors: &BTreeMap<String, Tensor>,
    metadata: &BTreeMap<String, String>,
    dtype: Dtype,
) -> Result<(), FormatError> {
    let size = if dtype == Dtype::F16 { size_of::<f16>() } else { size_of::<f32>() };
    let mut infos = Vec::with_capacity(tensors.len());
    let mut offset = 0;
    for (name, Tensor { shape, values }) in tensors {
        if shape.iter().product::<usize>() != values.len() {
            let cause = format!("shape {shape:?} for {} values", values.len());
            return Err(FormatError::malformed(path, tensor_part(name), cause));
        }
        let data_offsets = (offset, offset + size * values.len());
        offset = data_offsets.1;
        infos.push((name.clone(), TensorInfo { dtype, shape: shape.clone(), data_offsets }));
    }
    let json = header_json(infos, metadata)
        .map_err(|cause| FormatError::malformed(path, "header", cause))?;
    atomic::write(path, |writer| {
        writer.write_all(&(json.len() as u64).to_le_bytes())?;
        writer.write_all(json.as_bytes())?;
        for value in tensors.values().flat_map(|tensor| &tensor.values) {
            if dtype == Dtype::F16 {
                writer.write_all(&f16::from_f32(*value).to_le_bytes())?;
            } else {
                writer.write_all(&value.to_le_bytes())?;
            }
        }
        Ok(())
    })
}

/// The header with sorted keys: the crate `safetensors` keeps metadata in a hash map, whose
/// order changes from run to run. Blanks pad it, so that the tensors begin at a multiple of
/// eight bytes.
fn header_json(
    infos: Vec<(String, TensorInfo)>,
    metadata: &BTreeMap<String, String>,
) -> Result<String, Box<dyn std::error::Error>> {
    let mut header = serde_json::to_value(Metadata::new(None, infos)?)?;
    if !metadata.is_empty() {
        header["__metadata__"] = serde_json::to_value(metadata)?;
    }
    let mut json = header.to_string();
    json.extend(std::iter::repeat_n(' ', json.len().next_multiple_of(8) - json.len()));
    Ok(json)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> BTreeMap<String, Tensor> {
        BTreeMap::from([
            ("a".to_owned(), Tensor { shape: vec![2, 1], values: vec![1.5, -0.0] }),
            ("b".to_owned(), Tensor { shape: vec![0], values: vec![] }),
        ])
    }

    fn message(path: &Path, name: &str) -> String {
        let read = WeightsFile::open(path).and_then(|mut file| file.read(name));
        read.unwrap_err().to_string()
    }

    #[test]
    fn written_weights_come_back_and_safetensors_reads_them() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.safetensors");
        let metadata = BTreeMap::from([("z".into(), "1".into()), ("a".into(), "2".into())]);
        write_weights(&path, &example(), &metadata).unwrap();
        let mut file = WeightsFile::open(&path).unwrap();
        assert_eq!(file.metadata(), metadata);
        for (name, tensor) in example() {
            assert_eq!(file.read(&name).unwrap(), tensor);
        }
        let bytes = std::fs::read(&path).unwrap();
        let peer = safetensors::SafeTensors::deserialize(&bytes).unwrap();
        assert_eq!(peer.tensor("a").unwrap().shape(), [2, 1]);
    }

    #[test]
    fn half_weights_come_back_rounded() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("half.safetensors");
        let tensor = |values: Vec<f32>| Tensor { shape: vec![values.len()], values };
        let tensors = BTreeMap::from([("a".to_owned(), tensor(vec![0.1, -2.0, 65504.0, 1e-9]))]);
        write_half_weights(&path, &tensors, &BTreeMap::new()).unwrap();
        let read = WeightsFile::open(&path).unwrap().read("a").unwrap();
        // The nearest halves (IEEE 754 binary16).
        assert_eq!(read.values, [0.099_975_586, -2.0, 65504.0, 0.0]);
        let large = BTreeMap::from([("b".to_owned(), tensor(vec![1.0, 7e4]))]);
        let error = write_half_weights(&path, &large, &BTreeMap::new()).unwrap_err();
        assert!(error.to_string().contains("tensor `b`: element 1, 70000"), "{error}");
    }

    /// The length 640 is written 80 02 and zeros; 80 02 is also how old pickles begin.
    #[test]
    fn a_header_as_long_as_a_pickle_s_first_bytes_is_a_header() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.safetensors");
        let with_note = |n: usize| BTreeMap::from([("note".to_owned(), "x".repeat(n))]);
        write_weights(&path, &example(), &with_note(0)).unwrap();
        let length = |path: &Path| {
            let bytes = std::fs::read(path).unwrap();
            u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize
        };
        write_weights(&path, &example(), &with_note(640 - length(&path))).unwrap();
        assert_eq!(length(&path), 640);
        assert_eq!(WeightsFile::open(&path).unwrap().read("a").unwrap(), example()["a"]);
    }

    #[test]
    fn errors_name_the_tensor() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.safetensors");
        let mut tensors = example();
        tensors.insert("c".into(), Tensor { shape: vec![2], values: vec![0.0, f32::NAN] });
        write_weights(&path, &tensors, &BTreeMap::new()).unwrap();
        assert!(message(&path, "c").contains("tensor `c`: element 1 is NaN"));
        assert!(message(&path, "d").contains("tensor `d`: missing"));
        let view = safetensors::tensor::TensorView::new(Dtype::F64, vec![1], &[0; 8]).unwrap();
        std::fs::write(&path, safetensors::serialize([("e", view)], None).unwrap()).unwrap();
        assert!(message(&path, "e").contains("tensor `e`: expected f32 or f16, found F64"));
    }

    #[test]
    fn a_file_cut_short_or_of_another_kind_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.safetensors");
        write_weights(&path, &example(), &BTreeMap::new()).unwrap();
        let whole = std::fs::read(&path).unwrap();
        for length in 0..whole.len() {
            std::fs::write(&path, &whole[..length]).unwrap();
            assert!(WeightsFile::open(&path).is_err(), "{length}");
        }
        std::fs::write(&path, [b"PK\x03\x04", &[0xff; 60][..]].concat()).unwrap();
        assert!(message(&path, "a").contains("expected safetensors"));
    }
}
