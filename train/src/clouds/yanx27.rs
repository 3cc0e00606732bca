//! `modelnet40_normal_resampled`: one text file for each cloud.

use std::fs;
use std::path::Path;

use formats::FormatError;
use formats::labelled::{LabelledSet, equal_offsets};
use formats::split::Split;
use rayon::prelude::*;

use crate::error::Error;

const NAMES: &str = "modelnet40_shape_names.txt";

/// Whether the folder at `path` has this layout.
pub fn is_layout_of(path: &Path) -> bool {
    path.join(NAMES).is_file()
}

/// Reads the first `n_points` points of every cloud of `split`, like the baseline's loader.
pub fn read(root: &Path, split: Split, n_points: usize) -> Result<LabelledSet, Error> {
    let lines = |name: &str| -> Result<Vec<String>, FormatError> {
        let path = root.join(name);
        let text = fs::read_to_string(&path).map_err(|source| FormatError::io(&path, source))?;
        let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
        Ok(lines.map(str::to_owned).collect())
    };
    let classes = lines(NAMES)?;
    let list = format!("modelnet40_{split}.txt");
    let ids = lines(&list)?;
    let labels = ids.iter().map(|id| {
        let class = id.rsplit_once('_').map_or("", |(class, _)| class);
        classes.iter().position(|name| name == class).ok_or_else(|| Error::Data {
            path: root.join(&list),
            cause: format!("expected a class of {NAMES} in the id `{id}`"),
        })
    });
    let labels: Vec<usize> = labels.collect::<Result<_, _>>()?;
    let clouds: Vec<Vec<f32>> = ids
        .par_iter()
        .zip(&labels)
        .map(|(id, &label)| cloud(&root.join(&classes[label]).join(format!("{id}.txt")), n_points))
        .collect::<Result<_, _>>()?;
    let points = clouds.concat();
    let offsets = equal_offsets(labels.len(), n_points);
    let (names, classes) = (Some(ids), Some(classes));
    Ok(LabelledSet { points, offsets, labels, names, classes, ..LabelledSet::default() })
}

fn cloud(path: &Path, n_points: usize) -> Result<Vec<f32>, FormatError> {
    let text = fs::read_to_string(path).map_err(|source| FormatError::io(path, source))?;
    let mut points = Vec::with_capacity(3 * n_points);
    for (line, number) in text.lines().take(n_points).zip(1..) {
        let bad = |cause: String| FormatError::malformed(path, format!("line {number}"), cause);
        let mut fields = line.split(',');
        for axis in ["x", "y", "z"] {
            let field = fields.next().ok_or_else(|| bad(format!("{axis} is missing")))?;
            let value: f32 = field
                .trim()
                .parse()
                .map_err(|_| bad(format!("expected a number as {axis}, found `{field}`")))?;
            points.push(value);
        }
    }
    if points.len() < 3 * n_points {
        let cause = format!("expected {n_points} points, found {}", points.len() / 3);
        return Err(FormatError::malformed(path, "file", cause));
    }
    Ok(points)
}
