//! NumPy's archives as clouds.

use std::io::{self, Read, Seek, Write};
use std::path::Path;

use super::columns::{self, Extra};
use super::precision::Precision;
use super::{Cloud, npy};
use crate::archive::{NpzReader, NpzWriter};
use crate::decoding::invalid;
use crate::error::FormatError;
use crate::scan::{POSE, pose_of};

/// The key of the points of scans, to which `origin` is added, and of written clouds.
const POSITIONS: &str = "positions";
const ORIGIN: &str = "origin";
const POSE_KEY: &str = "pose";
/// The key of the points in most other archives.
const POINTS: &str = "points";

/// The key that makes an archive a set of clouds.
const OFFSETS: &str = "offsets";

pub(super) fn read(reader: impl Read + Seek, name: &Path) -> Result<Cloud, FormatError> {
    let mut npz = NpzReader::new(reader, name)?;
    let (mut cloud, [x, y, z]) = read_points(&mut npz)?;
    if [x, y, z] != [0.0; 3] {
        cloud.points.iter_mut().for_each(|p| *p = [p[0] + x, p[1] + y, p[2] + z]);
    }
    cloud.pose = read_pose(&mut npz)?;
    let keys = npz.keys();
    let key = |name: &str| keys.iter().find(|key| key.eq_ignore_ascii_case(name));
    // Records have their own.
    let is_record = cloud.intensities.is_some() || cloud.rings.is_some();
    for (key, extra) in columns::find(key).into_iter().filter(|_| !is_record) {
        let n = cloud.points.len();
        // Anything may be called `i`, or hold rings of something else.
        let is_short = key.len() == 1 || matches!(extra, Extra::Ring);
        let values = npz.entry(key, |header, _, elements| {
            match crate::npy::check_columns(&header, 1, n) {
                Err(_) if is_short => return Ok(None),
                found => found?,
            }
            crate::npy::read_numbers(elements, &header, |x| x as f32).map(Some)
        })?;
        values.into_iter().for_each(|values| cloud.set(extra, values));
    }
    Ok(cloud)
}

/// The points, and the origin to add to each.
pub(crate) fn read_points<R: Read + Seek>(
    npz: &mut NpzReader<R>,
) -> Result<(Cloud, [f64; 3]), FormatError> {
    if npz.has(OFFSETS) && !npz.has(POSITIONS) {
        return npz.entry(OFFSETS, |header, _, _| {
            let n = header.n_elements().unwrap_or_default().saturating_sub(1);
            Err(invalid(format!(
                "expected one cloud, found a packed set of {n} clouds: `edgepuck eval --data` \
                 classifies them, and in NumPy the first is points[offsets[0]:offsets[1]]"
            )))
        });
    }
    let key = match [POSITIONS, POINTS].into_iter().find(|key| npz.has(key)) {
        Some(key) => key.to_owned(),
        None => only_array_of_points(npz)?,
    };
    let cloud = npz.entry(&key, |header, _, elements| {
        let cloud = npy::read_points(&header, elements)?;
        // An array in Fortran order may have further columns after z.
        io::copy(elements, &mut io::sink())?;
        Ok(cloud)
    })?;
    if key != POSITIONS || !npz.has(ORIGIN) {
        return Ok((cloud, [0.0; 3]));
    }
    let origin: Option<[f64; 3]> = npz.array::<f64>(ORIGIN)?.elements.try_into().ok();
    let origin = origin.filter(|origin| origin.iter().all(|x| x.is_finite()));
    let origin = origin.ok_or_else(|| npz.error(ORIGIN, "expected three finite numbers"))?;
    Ok((cloud, origin))
}

/// The pose of a scan's sensor, row by row.
pub(crate) fn read_pose<R: Read + Seek>(
    npz: &mut NpzReader<R>,
) -> Result<Option<[f64; 16]>, FormatError> {
    // In other archives, `pose` may be anything.
    if !npz.has(POSE_KEY) || !npz.has(POSITIONS) {
        return Ok(None);
    }
    let pose = npz.array::<f64>(POSE_KEY)?;
    let found = pose_of(&pose.elements).filter(|_| pose.shape == [4, 4]);
    found.map(Some).ok_or_else(|| npz.error(POSE_KEY, POSE))
}

fn only_array_of_points<R: Read + Seek>(npz: &mut NpzReader<R>) -> Result<String, FormatError> {
    let mut found = Vec::new();
    let keys = npz.keys();
    if let Some(key) = keys.iter().find(|key| key.ends_with(".weight")) {
        return Err(npz.error(key, "expected points, found the weights of a network"));
    }
    for key in &keys {
        let holds_points = npz.entry(key, |header, _, elements| {
            io::copy(elements, &mut io::sink())?;
            Ok(npy::holds_points(&header))
        })?;
        if holds_points {
            found.push(key.clone());
        }
    }
    match &found[..] {
        [key] => Ok(key.clone()),
        [] => Err(npz.error(
            "archive",
            format!("expected an array of shape [n, 3], found the keys [{}]", keys.join(", ")),
        )),
        several => Err(npz.error(
            "archive",
            format!(
                "expected one array of points, found {}: name one `{POINTS}`",
                several.join(", ")
            ),
        )),
    }
}

pub(super) fn write(
    writer: impl Write + Seek,
    points: &[[f64; 3]],
    precision: Precision,
) -> io::Result<()> {
    let shape = [points.len(), 3];
    let coordinates = points.as_flattened().iter();
    NpzWriter::write(writer, |npz| match precision {
        Precision::Single => npz.array(POSITIONS, &shape, coordinates.map(|&x| x as f32)),
        Precision::Double => npz.array(POSITIONS, &shape, coordinates.copied()),
    })
}
