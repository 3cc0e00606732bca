//! Sweeps of real sensors with labelled boxes, read from an NPZ archive:
//!
//! | key | type | shape | what |
//! | --- | --- | --- | --- |
//! | `xyz_mm` | whole numbers | `[n, 3]` | points, millimetres, z up |
//! | `laser`, may be absent | whole numbers | `[n]` | the laser of each point |
//! | `boxes` | floating | `[b, 7]` | centre, length, width, height (metres), yaw (radians) |
//! | `classes` | text | `[b]` | the class of each box |
//!
//! Other keys are ignored.

use std::path::Path;

use crate::archive::NpzReader;
use crate::decoding::invalid;
use crate::error::FormatError;
use crate::geometry::OrientedBox;
use crate::npy;

/// A sweep with labelled boxes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LabelledSweep {
    /// The points, metres.
    pub points: Vec<[f64; 3]>,
    /// The laser of each point, if the file has them.
    pub lasers: Option<Vec<u16>>,
    /// The labelled objects.
    pub boxes: Vec<LabelledBox>,
}

/// A labelled object in an upright box.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelledBox {
    /// Its class.
    pub class: String,
    /// Where it is.
    pub place: OrientedBox,
}

/// Reads the labelled sweep at `path`.
pub fn read_labelled_sweep(path: &Path) -> Result<LabelledSweep, FormatError> {
    let mut npz = NpzReader::open(path)?;
    let millimetres = rows(&mut npz, "xyz_mm", 3)?;
    let points: Vec<_> =
        millimetres.chunks_exact(3).map(|row| [row[0], row[1], row[2]].map(|x| x * 1e-3)).collect();
    let mut lasers: Option<Vec<u16>> = None;
    if npz.has("laser") {
        let numbers = rows(&mut npz, "laser", 1)?;
        if numbers.len() != points.len() {
            let (expected, found) = (points.len(), numbers.len());
            let cause = format!("expected {expected} values, one for each point, found {found}");
            return Err(npz.error("laser", cause));
        }
        lasers = Some(numbers.iter().map(|&laser| laser as u16).collect());
    }
    let numbers = rows(&mut npz, "boxes", 7)?;
    let classes = npz.text("classes")?;
    if classes.len() * 7 != numbers.len() {
        let (expected, found) = (numbers.len() / 7, classes.len());
        let cause = format!("expected {expected} names, one for each box, found {found}");
        return Err(npz.error("classes", cause));
    }
    let boxes = numbers.chunks_exact(7).zip(classes).map(|(row, class)| {
        let [centre_m, size_m] = [[row[0], row[1], row[2]], [row[3], row[4], row[5]]];
        LabelledBox { class, place: OrientedBox { centre_m, size_m, yaw_rad: row[6] } }
    });
    Ok(LabelledSweep { boxes: boxes.collect(), points, lasers })
}

/// The numbers of the array `key`, of shape `[n, width]`, or `[n]` for a width of 1.
fn rows(npz: &mut NpzReader, key: &str, width: usize) -> Result<Vec<f64>, FormatError> {
    npz.entry(key, |header, _, elements| {
        let is_expected = match header.shape[..] {
            [_] => width == 1,
            [_, found] => found == width,
            _ => false,
        };
        if !is_expected {
            let expected = if width == 1 { "[n]".to_owned() } else { format!("[n, {width}]") };
            return Err(invalid(format!("expected shape {expected}, found {:?}", header.shape)));
        }
        npy::read_numbers(elements, &header, |x| x)
    })
}

#[cfg(test)]
#[cfg(feature = "dataset")]
mod tests {
    use super::*;
    use crate::archive::write_archive;
    use crate::hash::Hashing;

    fn written(boxes: &[usize], classes: &[&str]) -> (tempfile::TempDir, std::path::PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frame.npz");
        write_archive(&path, Hashing::None, |npz| {
            npz.array("xyz_mm", &[2, 3], [1000i32, -2000, 500, 0, 0, 0].into_iter())?;
            npz.array("laser", &[2], [31u32, 7].into_iter())?;
            let row = [1.0f32, -2.0, 0.5, 4.0, 2.0, 1.5, std::f32::consts::FRAC_PI_2];
            npz.array("boxes", boxes, row.into_iter())?;
            npz.text("classes", &classes.iter().map(|&class| class.into()).collect::<Vec<_>>())
        })
        .unwrap();
        (folder, path)
    }

    #[test]
    fn a_labelled_sweep_is_in_metres() {
        let (_folder, path) = written(&[1, 7], &["Car"]);
        let sweep = read_labelled_sweep(&path).unwrap();
        assert_eq!(sweep.points, [[1.0, -2.0, 0.5], [0.0, 0.0, 0.0]]);
        assert_eq!(sweep.lasers, Some(vec![31, 7]));
        assert_eq!(sweep.boxes[0].class, "Car");
        // The length of 4 m lies along y.
        assert!(sweep.boxes[0].place.contains([1.0, -0.1, 0.5], 0.0));
        assert!(!sweep.boxes[0].place.contains([2.1, -2.0, 0.5], 0.0));
        assert!(sweep.boxes[0].place.contains([2.1, -2.0, 0.5], 0.2));
    }

    #[test]
    fn wrong_shapes_and_missing_names_are_refused() {
        let (_folder, path) = written(&[7], &["Car"]);
        let error = read_labelled_sweep(&path).unwrap_err().to_string();
        assert!(error.ends_with("boxes: expected shape [n, 7], found [7]"), "{error}");
        let (_folder, path) = written(&[1, 7], &["Car", "Van"]);
        let error = read_labelled_sweep(&path).unwrap_err().to_string();
        assert!(error.ends_with("expected 1 names, one for each box, found 2"), "{error}");
    }
}
