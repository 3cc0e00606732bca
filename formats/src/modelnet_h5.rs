//! ModelNet40's HDF5 layout (`modelnet40_ply_hdf5_2048`), as PointNet, DGCNN
//! and their successors read it.
//!
//! `ply_data_{split}{k}.h5` hold at most 2048 clouds each: `data` f32
//! `[m, n, 3]` and `label` u8 `[m, 1]`. `{split}_files.txt` lists them as the
//! original does, from the folder that holds `data/modelnet40_ply_hdf5_2048`;
//! `shape_names.txt` has the class names in the order of the labels.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use hdf5_pure::{File, FileBuilder};

use crate::atomic;
use crate::error::FormatError;
use crate::hash::{HashedFile, Hashing};
use crate::labelled::{LabelledSet, equal_offsets};
pub use crate::modelnet_h5_list::is_one;
use crate::modelnet_h5_list::list;
use crate::packed::{check_label, check_size};
use crate::split::Split;

/// Clouds in a file, as in the original.
pub const CLOUDS_PER_FILE: usize = 2048;
const LISTED_FOLDER: &str = "data/modelnet40_ply_hdf5_2048";

/// Writes one split of a dataset. It holds at most [`CLOUDS_PER_FILE`] clouds in memory.
pub struct ModelNetH5Writer {
    folder: PathBuf,
    split: Split,
    n_points: usize,
    classes: Vec<String>,
    n_files: usize,
    data: Vec<f32>,
    labels: Vec<u8>,
    hashing: Hashing,
    files: Vec<HashedFile>,
}

impl ModelNetH5Writer {
    /// Begins the `split` of a dataset in `folder`, of clouds of `n_points`
    /// points. A label is an index into `classes`; files are hashed as `hashing` says.
    #[must_use]
    pub fn create(
        folder: &Path,
        split: Split,
        n_points: usize,
        classes: Vec<String>,
        hashing: Hashing,
    ) -> Self {
        Self {
            folder: folder.to_path_buf(),
            split,
            n_points,
            classes,
            n_files: 0,
            data: Vec::new(),
            labels: Vec::new(),
            hashing,
            files: Vec::new(),
        }
    }

    /// Appends a cloud of class `label`, and writes a file when it is full.
    ///
    /// # Errors
    /// [`FormatError::Instance`] for a cloud of another size than the set's, a
    /// label without a class or above 255; errors of the system.
    pub fn push(
        &mut self,
        points: &[[f32; 3]],
        label: usize,
        name: &str,
    ) -> Result<(), FormatError> {
        // A label is one byte.
        let classes = self.classes.len().min(256);
        check_size(name, points.len(), self.n_points)?;
        check_label(name, label, classes)?;
        self.data.extend_from_slice(points.as_flattened());
        self.labels.push(label as u8);
        if self.labels.len() == CLOUDS_PER_FILE { self.write_file() } else { Ok(()) }
    }

    /// Writes the remaining clouds and the lists. A set without clouds has one empty file, since
    /// readers concatenate the listed files. Returns all files of the split.
    ///
    /// # Errors
    /// Errors of the system.
    pub fn finish(mut self) -> Result<Vec<HashedFile>, FormatError> {
        if !self.labels.is_empty() || self.n_files == 0 {
            self.write_file()?;
        }
        let names = self.folder.join("shape_names.txt");
        self.files.push(atomic::write_lines(names, self.hashing, &self.classes)?);
        let listed = |k| format!("{LISTED_FOLDER}/{}", file_name(self.split, k));
        let list = list(&self.folder, self.split);
        self.files.push(atomic::write_lines(list, self.hashing, (0..self.n_files).map(listed))?);
        Ok(self.files)
    }

    fn write_file(&mut self) -> Result<(), FormatError> {
        let m = self.labels.len() as u64;
        let mut file = FileBuilder::new();
        file.create_dataset("data").with_f32_data(&self.data).with_shape(&[
            m,
            self.n_points as u64,
            3,
        ]);
        file.create_dataset("label").with_u8_data(&self.labels).with_shape(&[m, 1]);
        let path = self.folder.join(file_name(self.split, self.n_files));
        let bytes =
            file.finish().map_err(|error| FormatError::io(&path, io::Error::other(error)))?;
        let hash = atomic::write_hashed(&path, self.hashing, |writer| writer.write_all(&bytes))?;
        self.files.push(HashedFile { path, hash });
        self.n_files += 1;
        self.data.clear();
        self.labels.clear();
        Ok(())
    }
}

fn file_name(split: Split, k: usize) -> String {
    format!("ply_data_{split}{k}.h5")
}

/// Reads one split of the dataset in `folder`. The files must be in that folder, whatever folder
/// the list names.
///
/// # Errors
/// A list, a file or a dataset that is missing or of another type or shape,
/// clouds of two sizes, a label without a class.
pub fn read(folder: &Path, split: Split) -> Result<LabelledSet, FormatError> {
    let list = list(folder, split);
    let names = fs::read_to_string(&list).map_err(|source| FormatError::io(&list, source))?;
    let mut set = LabelledSet { classes: class_names(folder)?, ..LabelledSet::default() };
    for line in names.lines().map(str::trim).filter(|line| !line.is_empty()) {
        let name = Path::new(line).file_name().unwrap_or(line.as_ref());
        read_file(&folder.join(name), &mut set)?;
    }
    Ok(set)
}

fn class_names(folder: &Path) -> Result<Option<Vec<String>>, FormatError> {
    let path = folder.join("shape_names.txt");
    match fs::read_to_string(&path) {
        Ok(text) => {
            let names = text.lines().map(str::trim).filter(|line| !line.is_empty());
            Ok(Some(names.map(str::to_owned).collect()))
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(source) => Err(FormatError::io(&path, source)),
    }
}

fn read_file(path: &Path, set: &mut LabelledSet) -> Result<(), FormatError> {
    let bad = |part: &str, cause: String| FormatError::malformed(path, part, cause);
    // The crate's own errors do not name the file.
    let bytes = fs::read(path).map_err(|source| FormatError::io(path, source))?;
    let file = File::from_bytes(bytes).map_err(|error| bad("HDF5", error.to_string()))?;
    let dataset = |name: &str| {
        let part = format!("dataset `{name}`");
        let dataset = file.dataset(name).map_err(|error| bad(&part, error.to_string()))?;
        let shape = dataset.shape().map_err(|error| bad(&part, error.to_string()))?;
        Ok((part, dataset, shape))
    };
    let (part, data, shape) = dataset("data")?;
    let [m, n_points, 3] = shape[..] else {
        return Err(bad(&part, format!("expected shape [m, n, 3], found {shape:?}")));
    };
    let points = data.read_f32().map_err(|error| bad(&part, error.to_string()))?;
    let (label_part, label, shape) = dataset("label")?;
    if shape.iter().product::<u64>() != m {
        return Err(bad(
            &label_part,
            format!("expected {m} labels, one for each cloud, found shape {shape:?}"),
        ));
    }
    let labels = label.read_u8().map_err(|error| bad(&label_part, error.to_string()))?;
    let expected = set.smallest_cloud();
    if !set.is_empty() && expected as u64 != n_points {
        return Err(bad(&part, format!("expected clouds of {expected} points, found {n_points}")));
    }
    let n_classes = set.classes.as_ref().map_or(usize::MAX, Vec::len);
    if let Some(cloud) = labels.iter().position(|&label| usize::from(label) >= n_classes) {
        let found = labels[cloud];
        let cause = format!("cloud {cloud}: expected a label below {n_classes}, found {found}");
        return Err(bad(&label_part, cause));
    }
    set.points.extend(points);
    set.labels.extend(labels.into_iter().map(usize::from));
    set.offsets = equal_offsets(set.len(), n_points as usize);
    Ok(())
}
