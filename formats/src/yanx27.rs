//! The text layout that yanx27/Pointnet_Pointnet2_pytorch trains on, known as
//! `modelnet40_normal_resampled`.
//!
//! Its `ModelNetDataLoader` reads `modelnet40_shape_names.txt` (class names in
//! the order of the labels), `modelnet40_{train,test}.txt` (an id a line) and
//! `CLASS/ID.txt` (lines `x,y,z,nx,ny,nz`). The class is what remains of an id
//! when the part after the last `_` is cut off. With `--num_category 10` it
//! looks for `modelnet10_*` instead; a set of ten classes gets both.
//!
//! It takes the first `--num_point` lines of a file and stacks them, so that
//! every cloud needs at least as many points as the user will ask for.

use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};

use crate::atomic;
use crate::error::FormatError;
use crate::hash::{HashedFile, Hashing};
use crate::split::Split;

/// Writes a dataset in yanx27's layout.
pub struct Yanx27Writer {
    root: PathBuf,
    classes: Vec<String>,
    /// Sorted, so that the lists do not depend on the order of pushing.
    ids: [BTreeSet<String>; Split::ALL.len()],
    hashing: Hashing,
    files: Vec<HashedFile>,
}

impl Yanx27Writer {
    /// Begins a dataset in the folder `root`. Labels follow the order of
    /// `classes`; files are hashed as `hashing` says.
    pub fn create(
        root: &Path,
        classes: Vec<String>,
        hashing: Hashing,
    ) -> Result<Self, FormatError> {
        if let Some(class) = classes.iter().find(|class| !is_folder_name(class)) {
            return Err(FormatError::instance(
                class,
                "expected a class name that can be a folder's",
            ));
        }
        let root = root.to_path_buf();
        Ok(Self { root, classes, ids: Default::default(), hashing, files: Vec::new() })
    }

    /// Writes the cloud of view `view` of the mesh `name` of `class`. Unknown normals are 0.
    pub fn push(
        &mut self,
        class: &str,
        split: Split,
        name: &str,
        view: u32,
        points: &[[f32; 3]],
        normals: Option<&[[f32; 3]]>,
    ) -> Result<(), FormatError> {
        let refuse = |cause: String| Err(FormatError::instance(name, cause));
        // NumPy reads a single line as a vector, on which the loader fails.
        if points.len() < 2 {
            return refuse(format!("expected two points or more, found {}", points.len()));
        }
        if let Some(normals) = normals
            && normals.len() != points.len()
        {
            return refuse(format!(
                "expected {} normals, one for each point, found {}",
                points.len(),
                normals.len()
            ));
        }
        if !self.classes.iter().any(|known| known == class) {
            return refuse(format!("expected a class of the set, found `{class}`"));
        }
        let id = instance_id(class, name, view);
        if !is_folder_name(&id) {
            return refuse("expected a name that can be a file's".to_owned());
        }
        if self.ids.iter().any(|ids| ids.contains(&id)) {
            return refuse(format!("another instance is called {id} already"));
        }
        self.ids[split as usize].insert(id.clone());
        let normals = normals.map_or([].iter(), <[_]>::iter).chain(std::iter::repeat(&[0.0; 3]));
        let path = self.root.join(class).join(format!("{id}.txt"));
        let hash = atomic::write_hashed(&path, self.hashing, |writer| {
            for ([x, y, z], [nx, ny, nz]) in points.iter().zip(normals) {
                writeln!(writer, "{x},{y},{z},{nx},{ny},{nz}")?;
            }
            Ok(())
        })?;
        self.files.push(HashedFile { path, hash });
        Ok(())
    }

    /// Writes the lists atomically, in the order of the labels and ids. Returns all files.
    pub fn finish(mut self) -> Result<Vec<HashedFile>, FormatError> {
        self.write_lists("modelnet40")?;
        if self.classes.len() == 10 {
            self.write_lists("modelnet10")?;
        }
        Ok(self.files)
    }

    fn write_lists(&mut self, stem: &str) -> Result<(), FormatError> {
        let path = self.root.join(format!("{stem}_shape_names.txt"));
        self.files.push(atomic::write_lines(path, self.hashing, &self.classes)?);
        for split in Split::ALL {
            let path = self.root.join(format!("{stem}_{split}.txt"));
            self.files.push(atomic::write_lines(path, self.hashing, &self.ids[split as usize])?);
        }
        Ok(())
    }
}

/// The id of one view: the class, `_`, and the rest without any `_`, as in
/// `night_stand_0007v2` for view 2 of `night_stand_0007`.
///
/// `_` becomes `-` and `-` becomes `~-`, so that different names of a class have different ids,
/// except that a name that begins with its class has the same id as the name without it.
fn instance_id(class: &str, name: &str, view: u32) -> String {
    let prefix = format!("{class}_");
    let number = name.strip_prefix(&prefix).unwrap_or(name);
    let number = number.replace('~', "~~").replace('-', "~-").replace('_', "-");
    format!("{prefix}{number}v{view}")
}

/// Whether `name` can be a line of a list, which the loader strips, and the name of a folder.
fn is_folder_name(name: &str) -> bool {
    let bad = |letter: char| letter.is_control() || matches!(letter, '/' | '\\' | ':');
    !name.is_empty() && name.trim() == name && !name.starts_with('.') && !name.contains(bad)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// The loader's rule: `'_'.join(id.split('_')[0:-1])`.
    fn class_of(id: &str) -> &str {
        id.rsplit_once('_').unwrap().0
    }

    #[test]
    fn the_loader_finds_the_class_in_an_id() {
        assert_eq!(instance_id("airplane", "airplane_0001", 0), "airplane_0001v0");
        for (class, name) in [("night_stand", "night_stand_7"), ("cup", "my_cup-3"), ("a_b", "c_")]
        {
            assert_eq!(class_of(&instance_id(class, name, 3)), class);
        }
        let ids: BTreeSet<_> =
            ["a_b", "a-b", "a~b", "a~-b", "a_-b"].map(|name| instance_id("cup", name, 0)).into();
        assert_eq!(ids.len(), 5, "{ids:?}");
    }

    #[test]
    fn the_lists_name_every_file() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        let classes = vec!["night_stand".to_owned(), "cup".to_owned()];
        let mut writer = Yanx27Writer::create(root, classes, Hashing::None).unwrap();
        let points = [[0.5, -1.0, 1e-7], [0.0, 0.25, 3.0]];
        writer.push("cup", Split::Test, "cup_0002", 1, &points, None).unwrap();
        let normals = Some(&points[..]);
        writer.push("night_stand", Split::Train, "x_1", 0, &points, normals).unwrap();
        let twice = writer.push("cup", Split::Train, "0002", 1, &points, None);
        assert!(twice.unwrap_err().to_string().contains("cup_0002v1 already"));
        assert!(writer.push("cup", Split::Train, "a/b", 0, &points, None).is_err());
        assert!(writer.push("cup", Split::Train, "b", 0, &points[..1], None).is_err());
        assert!(writer.push("mug", Split::Train, "b", 0, &points, None).is_err());
        writer.finish().unwrap();

        let read = |name: &str| fs::read_to_string(root.join(name)).unwrap();
        assert_eq!(read("modelnet40_shape_names.txt"), "night_stand\ncup\n");
        assert_eq!(read("modelnet40_train.txt"), "night_stand_x-1v0\n");
        assert_eq!(read("modelnet40_test.txt"), "cup_0002v1\n");
        assert_eq!(read("cup/cup_0002v1.txt"), "0.5,-1,0.0000001,0,0,0\n0,0.25,3,0,0,0\n");
        assert!(read("night_stand/night_stand_x-1v0.txt").contains("0,0.25,3,0,0.25,3\n"));
        assert!(!root.join("modelnet10_train.txt").exists());
    }
}
