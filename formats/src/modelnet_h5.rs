//! ModelNet40's HDF5 layout (`modelnet40_ply_hdf5_2048`), as PointNet, DGCNN
//! and their successors read it.
//!
//! `ply_data_{split}{k}.h5` hold at most 2048 clouds each: `data` f32
//! `[m, n, 3]` and `label` u8 `[m, 1]`. `{split}_files.txt` lists them as the
//! original does, from the folder that holds `data/modelnet40_ply_hdf5_2048`;
//! `shape_names.txt` has the class names in the order of the labels.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use hdf5_pure::FileBuilder;

use crate::atomic;
use crate::error::FormatError;
use crate::split::Split;

/// Clouds in a file, as in the original.
pub const CLOUDS_PER_FILE: usize = 2048;
const LISTED_FOLDER: &str = "data/modelnet40_ply_hdf5_2048";

/// One half of a dataset that is being written. It holds at most
/// [`CLOUDS_PER_FILE`] clouds in memory.
pub struct ModelNetH5Writer {
    folder: PathBuf,
    split: Split,
    n_points: usize,
    classes: Vec<String>,
    n_files: usize,
    data: Vec<f32>,
    labels: Vec<u8>,
}

impl ModelNetH5Writer {
    /// Begins the `split` of a dataset in `folder`, of clouds of `n_points`
    /// points. A label is an index into `classes`.
    #[must_use]
    pub fn create(folder: &Path, split: Split, n_points: usize, classes: Vec<String>) -> Self {
        Self {
            folder: folder.to_path_buf(),
            split,
            n_points,
            classes,
            n_files: 0,
            data: Vec::new(),
            labels: Vec::new(),
        }
    }

    /// Appends a cloud of class `label`, and writes a file when it is full.
    ///
    /// # Errors
    /// [`FormatError::Instance`] for a cloud of another size than the set's, a
    /// label without a class or above 255; what the system reports.
    pub fn push(
        &mut self,
        points: &[[f32; 3]],
        label: usize,
        name: &str,
    ) -> Result<(), FormatError> {
        if points.len() != self.n_points {
            let cause = format!("{} points in a set of {}", points.len(), self.n_points);
            return Err(FormatError::instance(name, cause));
        }
        let label = u8::try_from(label)
            .ok()
            .filter(|&label| usize::from(label) < self.classes.len())
            .ok_or_else(|| {
                let cause = format!("label {label} of {} classes", self.classes.len());
                FormatError::instance(name, format!("{cause}; the layout has room for 256"))
            })?;
        self.data.extend_from_slice(points.as_flattened());
        self.labels.push(label);
        if self.labels.len() == CLOUDS_PER_FILE { self.write_file() } else { Ok(()) }
    }

    /// Writes what is left and the lists. A set without clouds has one file
    /// that is empty, since readers join what they find.
    ///
    /// # Errors
    /// What the system reports.
    pub fn finish(mut self) -> Result<(), FormatError> {
        if !self.labels.is_empty() || self.n_files == 0 {
            self.write_file()?;
        }
        atomic::write(&self.folder.join("shape_names.txt"), |writer| {
            self.classes.iter().try_for_each(|class| writeln!(writer, "{class}"))
        })?;
        atomic::write(&self.folder.join(format!("{}_files.txt", self.split)), |writer| {
            (0..self.n_files)
                .try_for_each(|k| writeln!(writer, "{LISTED_FOLDER}/{}", file_name(self.split, k)))
        })
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
        atomic::write(&path, |writer| writer.write_all(&bytes))?;
        self.n_files += 1;
        self.data.clear();
        self.labels.clear();
        Ok(())
    }
}

fn file_name(split: Split, k: usize) -> String {
    format!("ply_data_{split}{k}.h5")
}
