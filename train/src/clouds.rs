//! Labelled clouds: reading, checking, normalising and splitting them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use formats::labelled::{LabelledSet, read_labelled};
use formats::model_card::Normalization;
use formats::plausible::coarse_object;
use formats::split::Split;
use formats::streams::Stream;

use crate::error::Error;

/// Clouds with their classes.
#[derive(Clone, Debug, PartialEq)]
pub struct Clouds {
    /// The clouds: in the unit sphere, or in metres from the sensor for networks that take metres.
    pub set: LabelledSet,
    /// Class names in the order of the labels.
    pub classes: Vec<String>,
}

/// The name of a class of data without names.
fn unnamed(label: usize) -> String {
    format!("class {label}")
}

/// The packed NPZ file of `split` at `path`, if there is one.
fn packed(path: &Path, split: Split) -> Option<PathBuf> {
    let mut beginning = path.as_os_str().to_owned();
    beginning.push(format!("-{split}.npz"));
    let candidates = [path.to_path_buf(), path.join(format!("{split}.npz")), beginning.into()];
    candidates.into_iter().find(|path| path.is_file())
}

/// The beginnings of the names of packed files of `split` in the folder `path`, or in that of a
/// dataset's packed files; where there is no such folder, in the one above.
fn prefixes(path: &Path, split: Split) -> Vec<String> {
    let ending = format!("-{split}.npz");
    let above = path.parent().unwrap_or(path);
    let folder = if path.is_dir() { path } else { above };
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let folders = [folder.to_path_buf(), folder.join("packed")];
    let files = folders.iter().filter_map(|folder| folder.read_dir().ok()).flatten().flatten();
    let files = files.map(|file| file.path().to_string_lossy().into_owned());
    let mut names: Vec<String> =
        files.filter_map(|file| file.strip_suffix(&ending).map(str::to_owned)).collect();
    names.sort();
    names
}

/// Whether the farthest point is 1 from the origin.
fn is_in_unit_sphere(cloud: &[[f32; 3]]) -> bool {
    let radius = |point: &[f32; 3]| point.iter().map(|x| x * x).sum::<f32>().sqrt();
    (cloud.iter().map(radius).fold(0.0, f32::max) - 1.0).abs() < 1e-3
}

impl Clouds {
    /// The digest of all points, labels and classes.
    pub(crate) fn digest(&self) -> String {
        let LabelledSet { points, labels, offsets, .. } = &self.set;
        let coordinates = |points: &[f32]| points.iter().flat_map(|x| x.to_le_bytes()).collect();
        let numbers = labels.iter().chain(offsets).flat_map(|&n| (n as u64).to_le_bytes());
        let others = [numbers.collect(), self.classes.join("\n").into_bytes()];
        let parts = points.chunks(1 << 16).map(coordinates).chain(others);
        formats::hash::of_parts::<Vec<u8>>(parts)
    }

    /// Reads the `split` of the data at `path` for a network of this `normalization`. `path` is one
    /// of:
    ///
    /// - a packed NPZ file;
    /// - the common prefix of two packed files, `PREFIX-train.npz` and `PREFIX-test.npz`;
    /// - a folder with `train.npz` and `test.npz`.
    ///
    /// Clouds for a network that takes metres stay unchanged, because training and infer-cpu move
    /// each of them, and are refused if all are in the unit sphere. Others are normalised to it.
    pub fn read(normalization: Normalization, path: &Path, split: Split) -> Result<Self, Error> {
        let refuse = |cause: String| Err(Error::data(path, cause));
        let Some(packed) = packed(path, split) else {
            let names = prefixes(path, split).join(", ");
            let found = if names.is_empty() { names } else { format!("; found {names}: name one") };
            return refuse(format!(
                "expected a packed NPZ file, or a folder or a start of a name with {split}.npz{found}"
            ));
        };
        let set = read_labelled(&packed)?;
        if set.is_empty() {
            return refuse(format!(
                "expected clouds, found none: its {split} part is empty; more meshes or sweeps, or \
                 a smaller --min-points, fill it"
            ));
        }
        let mut clouds = Self::checked(normalization, set).or_else(refuse)?;
        if !normalization.is_metric() {
            for cloud in 0..clouds.len() {
                formats::cloud::normalize_unit_sphere(clouds.set.cloud_mut(cloud));
            }
        } else if (0..clouds.len()).all(|i| is_in_unit_sphere(clouds.set.cloud(i))) {
            return refuse(format!(
                "expected clouds in metres, as a network with normalization = \"{normalization}\" \
                 takes them, found clouds in the unit sphere, as gen-dataset packs them: choose a \
                 recipe or a model with normalization = \"unit-sphere\", or give clusters of gen-scenes"
            ));
        }
        Ok(clouds)
    }

    /// The clouds of `set`, or the cause why they cannot be used.
    fn checked(normalization: Normalization, mut set: LabelledSet) -> Result<Self, String> {
        let name = |cloud: usize| {
            let name = set.names.as_ref().map(|names| format!(" ({})", names[cloud]));
            format!("cloud {cloud}{}", name.unwrap_or_default())
        };
        for cloud in 0..set.len() {
            let points = set.cloud(cloud);
            if points.is_empty() {
                return Err(format!("{}: expected points, found none", name(cloud)));
            }
            if let Some(point) = points.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
                return Err(format!("point {point} of {} is not finite", name(cloud)));
            }
            // A far object may have a single point in a sweep.
            let least = if normalization.is_metric() { 2 } else { 1 };
            if points.len() >= least && points.iter().all(|point| *point == points[0]) {
                let cause = "expected points of an object, found all in one place";
                return Err(format!("{}: {cause}, {:?}", name(cloud), points[0]));
            }
            if let Some(cause) = coarse_object(points) {
                return Err(format!("{}: {cause}", name(cloud)));
            }
        }
        let most = set.labels.iter().max().map_or(0, |label| label + 1);
        let classes = set.classes.take().unwrap_or_else(|| (0..most).map(unnamed).collect());
        let is_again = |&i: &usize| classes[..i].contains(&classes[i]);
        if let Some(i) = (0..classes.len()).find(is_again) {
            let name = &classes[i];
            return Err(format!("expected a name for each class, found two classes `{name}`"));
        }
        Ok(Self { set, classes })
    }

    /// The number of clouds.
    pub(crate) fn len(&self) -> usize {
        self.set.len()
    }

    /// The clouds at `indices`.
    pub(crate) fn select(&self, indices: &[usize]) -> Self {
        Self { set: self.set.select(indices), classes: self.classes.clone() }
    }

    /// Whether these classes are those of data without names of classes.
    pub(crate) fn are_unnamed(classes: &[String]) -> bool {
        classes.iter().enumerate().all(|(label, name)| *name == unnamed(label))
    }

    /// The training clouds and a `share` of validation clouds. Views of a mesh stay together; the
    /// split is stratified by class.
    pub(crate) fn split_validation(&self, share: f64, seed: u64) -> (Self, Self) {
        let stream = Stream::Validation {}.key(seed);
        // The views of each mesh, numbered in the order of their first clouds.
        let mut meshes: Vec<(usize, Vec<usize>)> = Vec::new();
        let mut numbers = BTreeMap::new();
        for (i, &label) in self.set.labels.iter().enumerate() {
            let number = *numbers.entry((label, self.set.instance(i))).or_insert(meshes.len());
            meshes.resize_with(meshes.len().max(number + 1), || (label, Vec::new()));
            meshes[number].1.push(i);
        }
        let (mut learnt, mut held) = (Vec::new(), Vec::new());
        for class in 0..self.classes.len() {
            let mut own: Vec<_> = (0..meshes.len()).filter(|&i| meshes[i].0 == class).collect();
            let draw = |i: usize| stream.unit(i as u64);
            own.sort_by(|&a, &b| draw(a).total_cmp(&draw(b)).then(a.cmp(&b)));
            let n_held = (own.len() as f64 * share).round() as usize;
            for (rank, mesh) in own.into_iter().enumerate() {
                let part = if rank < n_held { &mut held } else { &mut learnt };
                part.extend(&meshes[mesh].1);
            }
        }
        learnt.sort_unstable();
        held.sort_unstable();
        (self.select(&learnt), self.select(&held))
    }
}
