//! Points that wait for the array that they will be.

use std::io::{self, BufWriter, Seek, Write};
use std::path::Path;

use tempfile::SpooledTempFile;

use crate::archive::{NpzWriter, waiting_room};
use crate::atomic;
use crate::error::FormatError;
use crate::npy;

/// The key of the points in a set.
const KEY: &str = "points";

/// The points of a set that is being written. The first 32 MiB wait in memory;
/// more wait in a file without a name in the set's folder, which the system
/// removes however the process ends.
pub(crate) struct WaitingPoints(BufWriter<SpooledTempFile>);

impl WaitingPoints {
    /// None yet, for the set at `path`.
    pub fn new(path: &Path) -> Result<Self, FormatError> {
        Ok(Self(BufWriter::new(waiting_room(atomic::make_folder_of(path)?))))
    }

    /// Appends `points`.
    pub fn push(&mut self, points: &[[f32; 3]]) -> io::Result<()> {
        let mut coordinates = points.as_flattened().iter();
        coordinates.try_for_each(|coordinate| self.0.write_all(&coordinate.to_le_bytes()))
    }

    /// No more come. They can be read from their beginning; returns the number of
    /// their bytes, too.
    pub fn close(self) -> io::Result<(SpooledTempFile, u64)> {
        let mut file = self.0.into_inner().map_err(io::IntoInnerError::into_error)?;
        let size = file.stream_position()?;
        file.rewind()?;
        Ok((file, size))
    }
}

/// Writes points that are [closed](WaitingPoints::close) as an array of `shape`.
pub(crate) fn write_points<W: Write + Seek>(
    npz: &mut NpzWriter<W>,
    (mut points, size): (SpooledTempFile, u64),
    shape: &[usize],
) -> io::Result<()> {
    let header = npy::header_bytes("<f4", shape);
    let entry = npz.begin(KEY, header.len() as u64 + size)?;
    entry.write_all(&header)?;
    io::copy(&mut points, entry)?;
    Ok(())
}
