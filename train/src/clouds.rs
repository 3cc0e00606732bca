//! Labelled clouds: reading, checking, normalising and splitting them.

mod yanx27;

use std::path::{Path, PathBuf};

use formats::labelled::{LabelledSet, read_labelled};
use formats::model_card::Normalization;
use formats::modelnet_h5_list;
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

#[cfg(feature = "hdf5")]
fn read_hdf5(path: &Path, split: Split) -> Result<LabelledSet, Error> {
    Ok(formats::modelnet_h5::read(path, split)?)
}

#[cfg(not(feature = "hdf5"))]
fn read_hdf5(path: &Path, _: Split) -> Result<LabelledSet, Error> {
    let cause = "expected a build with --features hdf5, found a program without HDF5";
    Err(Error::Data { path: path.to_path_buf(), cause: cause.to_owned() })
}

/// Whether the farthest point is 1 from the origin.
fn is_in_unit_sphere(cloud: &[[f32; 3]]) -> bool {
    let radius = |point: &[f32; 3]| point.iter().map(|x| x * x).sum::<f32>().sqrt();
    (cloud.iter().map(radius).fold(0.0, f32::max) - 1.0).abs() < 1e-3
}

impl Clouds {
    /// The digest of all points, labels and classes.
    #[must_use]
    pub fn digest(&self) -> String {
        let LabelledSet { points, labels, offsets, .. } = &self.set;
        let coordinates = |points: &[f32]| points.iter().flat_map(|x| x.to_le_bytes()).collect();
        let numbers = labels.iter().chain(offsets).flat_map(|&n| (n as u64).to_le_bytes());
        let others = [numbers.collect(), self.classes.join("\n").into_bytes()];
        let parts = points.chunks(1 << 16).map(coordinates).chain(others);
        formats::hash::of_parts::<Vec<u8>>(parts)
    }

    /// Reads the `split` of the data at `path` and normalises its clouds to the unit sphere. `path`
    /// is one of:
    ///
    /// - a packed NPZ file;
    /// - the common prefix of two packed files, `PREFIX-train.npz` and `PREFIX-test.npz`;
    /// - a folder with `train.npz` and `test.npz`;
    /// - a folder of ModelNet40's HDF5 files (`modelnet40_ply_hdf5_2048`), with feature `hdf5`;
    /// - a folder of text files as in yanx27/Pointnet_Pointnet2_pytorch. The first `most_points`
    ///   points of each file are read.
    pub fn read(path: &Path, split: Split, most_points: usize) -> Result<Self, Error> {
        Self::read_for(Normalization::UnitSphere, path, split, most_points)
    }

    /// Reads as [`Clouds::read`] does, for a network of this `normalization`. Clouds for a network
    /// that takes metres stay unchanged, because training and infer-cpu move each of them, and are
    /// refused if all are in the unit sphere.
    pub fn read_for(
        normalization: Normalization,
        path: &Path,
        split: Split,
        most_points: usize,
    ) -> Result<Self, Error> {
        let set = if let Some(packed) = packed(path, split) {
            read_labelled(&packed)?
        } else if modelnet_h5_list::list(path, split).is_file() {
            read_hdf5(path, split)?
        } else if yanx27::is_layout_of(path) {
            yanx27::read(path, split, most_points)?
        } else {
            let names = prefixes(path, split).join(", ");
            let found = if names.is_empty() { names } else { format!("; found {names}: name one") };
            let cause = format!(
                "expected a packed NPZ file, a folder or a start of a name with {split}.npz, or a \
                 folder with {split}_files.txt or modelnet40_shape_names.txt{found}"
            );
            return Err(Error::Data { path: path.to_path_buf(), cause });
        };
        if set.is_empty() {
            let cause = format!(
                "expected clouds, found none: its {split} part is empty; more meshes or sweeps, or \
                 a smaller --min-points, fill it"
            );
            return Err(Error::Data { path: path.to_path_buf(), cause });
        }
        let mut clouds = Self::checked(normalization, set, path)?;
        if !normalization.is_metric() {
            clouds.normalize();
        } else if (0..clouds.len()).all(|i| is_in_unit_sphere(clouds.set.cloud(i))) {
            let cause = format!(
                "expected clouds in metres, as a network with normalization = \"{normalization}\" \
                 takes them, found clouds in the unit sphere, as gen-dataset packs them: choose a \
                 recipe or a model with normalization = \"unit-sphere\", or give clusters of gen-scenes"
            );
            return Err(Error::Data { path: path.to_path_buf(), cause });
        }
        Ok(clouds)
    }

    /// Moves every cloud's mean to 0 and scales its largest radius to 1.
    pub fn normalize(&mut self) {
        for cloud in 0..self.len() {
            formats::cloud::normalize_unit_sphere(self.set.cloud_mut(cloud));
        }
    }

    fn checked(
        normalization: Normalization,
        mut set: LabelledSet,
        path: &Path,
    ) -> Result<Self, Error> {
        let refuse = |cause: String| Err(Error::Data { path: path.to_path_buf(), cause });
        if set.is_empty() {
            return refuse("expected clouds, found none".to_owned());
        }
        let name = |cloud: usize| {
            let name = set.names.as_ref().map(|names| format!(" ({})", names[cloud]));
            format!("cloud {cloud}{}", name.unwrap_or_default())
        };
        for cloud in 0..set.len() {
            let points = set.cloud(cloud);
            if points.is_empty() {
                return refuse(format!("{}: expected points, found none", name(cloud)));
            }
            if let Some(point) = points.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
                return refuse(format!("point {point} of {} is not finite", name(cloud)));
            }
            // A far object may have a single point in a sweep.
            let least = if normalization.is_metric() { 2 } else { 1 };
            if points.len() >= least && points.iter().all(|point| *point == points[0]) {
                let cause = "expected points of an object, found all in one place";
                return refuse(format!("{}: {cause}, {:?}", name(cloud), points[0]));
            }
        }
        let most = set.labels.iter().max().map_or(0, |label| label + 1);
        let classes = match set.classes.take() {
            Some(classes) => classes,
            None => (0..most).map(unnamed).collect(),
        };
        let is_again = |&i: &usize| classes[..i].contains(&classes[i]);
        if let Some(i) = (0..classes.len()).find(is_again) {
            let name = &classes[i];
            return refuse(format!("expected a name for each class, found two classes `{name}`"));
        }
        Ok(Self { set, classes })
    }

    /// The number of clouds.
    #[must_use]
    pub fn len(&self) -> usize {
        self.set.len()
    }

    /// Whether the set has no cloud.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.set.is_empty()
    }

    /// The clouds at `indices`.
    #[must_use]
    pub fn select(&self, indices: &[usize]) -> Self {
        Self { set: self.set.select(indices), classes: self.classes.clone() }
    }

    /// These clouds followed by `others`. Of the remarks, only the names are kept.
    pub fn concat(&self, others: &Self) -> Result<Self, String> {
        if self.classes != others.classes {
            return Err(format!(
                "expected the classes {:?}, found {:?}",
                self.classes, others.classes
            ));
        }
        let names = self.set.names.as_ref().zip(others.set.names.as_ref());
        let names = names.map(|(a, b)| [&a[..], &b[..]].concat());
        let mut set = LabelledSet { names, ..LabelledSet::default() };
        for part in [&self.set, &others.set] {
            (0..part.len()).for_each(|i| set.push(part.cloud(i), part.labels[i]));
        }
        Ok(Self { set, classes: self.classes.clone() })
    }

    /// The first `most` clouds of every class.
    #[must_use]
    pub fn of_each_class(&self, most: usize) -> Self {
        let mut seen = vec![0; self.classes.len()];
        let is_wanted = |i: &usize| {
            seen[self.set.labels[*i]] += 1;
            seen[self.set.labels[*i]] <= most
        };
        self.select(&(0..self.len()).filter(is_wanted).collect::<Vec<_>>())
    }

    /// Whether the data have no names of classes.
    #[must_use]
    pub fn is_unnamed(&self) -> bool {
        self.classes.iter().enumerate().all(|(label, name)| *name == unnamed(label))
    }

    /// Splits the set into training clouds and a `share` of validation clouds, and returns the
    /// indices of both. All views of a mesh are on the same side, and each class gives the share.
    #[must_use]
    pub fn split_validation(&self, share: f64, seed: u64) -> (Vec<usize>, Vec<usize>) {
        let stream = Stream::Validation {}.key(seed);
        let mut instances: Vec<(usize, String, Vec<usize>)> = Vec::new();
        let mut places = std::collections::BTreeMap::new();
        for i in 0..self.len() {
            let key = (self.set.labels[i], self.instance(i));
            let place = *places.entry(key.clone()).or_insert_with(|| {
                instances.push((key.0, key.1, Vec::new()));
                instances.len() - 1
            });
            instances[place].2.push(i);
        }
        let (mut learnt, mut held) = (Vec::new(), Vec::new());
        for class in 0..self.classes.len() {
            let mut of_class: Vec<_> =
                (0..instances.len()).filter(|&i| instances[i].0 == class).collect();
            of_class.sort_by(|&a, &b| {
                stream.unit(a as u64).total_cmp(&stream.unit(b as u64)).then(a.cmp(&b))
            });
            let n_held = (of_class.len() as f64 * share).round() as usize;
            for (rank, instance) in of_class.into_iter().enumerate() {
                let part = if rank < n_held { &mut held } else { &mut learnt };
                part.extend(&instances[instance].2);
            }
        }
        learnt.sort_unstable();
        held.sort_unstable();
        (learnt, held)
    }

    /// The name of cloud `i` without the number of the view, which gen-dataset appends after `_v`.
    fn instance(&self, i: usize) -> String {
        let Some(names) = &self.set.names else { return i.to_string() };
        match names[i].rsplit_once("_v") {
            Some((mesh, view)) if view.bytes().all(|b| b.is_ascii_digit()) => mesh.to_owned(),
            _ => names[i].clone(),
        }
    }
}
