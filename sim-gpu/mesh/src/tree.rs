//! The meshes of a dataset, with their classes and splits.

mod warnings;

use std::collections::{HashMap, HashSet};
use std::ffi::OsStr;
use std::fs::File;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

use formats::Split;
use formats::hash::{FileHash, Hashing};
use formats::streams::Stream;
use sha2::{Digest, Sha256};
use walkdir::{DirEntry, WalkDir};

use super::error::MeshError;
use super::format::{MeshFormat, mesh_extensions};
use super::load::{LoadedMesh, load_hashed};
pub use warnings::warnings;

/// The share of meshes in the training set of a seeded split.
const TRAIN_SHARE: f64 = 0.8;

/// The longest name. File systems allow 255 bytes, and file names append to it.
const LONGEST_NAME: usize = 180;

/// The hexadecimal digits of the hash that distinguishes equal names.
const HASH_DIGITS: usize = 12;

/// A mesh file of a dataset.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshEntry {
    /// The path of the file.
    pub path: PathBuf,
    /// Its path from the dataset's folder, with forward slashes.
    pub relative: String,
    /// Its class, which is a valid folder name on every platform.
    pub class: String,
    /// Its split.
    pub split: Split,
    /// Its name, which is valid in file names on every platform, and unique within its class and
    /// split, ignoring case.
    pub name: String,
}

/// A dataset could not be listed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TreeError {
    /// A folder cannot be read.
    #[error("{}: cannot be read: {source}", path.display())]
    Read {
        /// The folder.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The folder has no mesh.
    #[error("{}: no mesh found; looked for {}", .0.display(), mesh_extensions().map(|e| format!("*.{e}")).join(", "))]
    NoMesh(PathBuf),
    /// Two meshes have equal names even with a hash of their paths, or two folders of classes once all
    /// systems can have them.
    #[error("{first} and {second}: both would be called {name}; rename one")]
    SameName {
        /// The path of the first mesh from the dataset's folder.
        first: String,
        /// The second.
        second: String,
        /// The name.
        name: String,
    },
}

/// Lists the meshes in the folder `root`, or the single file `root`, sorted by class, split and
/// name.
///
/// A mesh `CLASS/{train,test}/NAME.ext` keeps its split, and so does any mesh with such a folder
/// between `root` and its class or its own folder. Where folders of splits stand alone beside each
/// other, the names may be in any case or `training` and `testing`, and `dev`, `val`, `valid` and
/// `validation` are of the training set. The class of a mesh is its folder. But if
/// folders deeper than those below `root` have one mesh each, as `CLASS/ID/models/model.obj`, then
/// the class is the folder below `root` (CLASS), and the name that of the next folder (ID).
///
/// Of the meshes without a split, 4 of 5 are in the training set. The split is a function of
/// `seed`, class and name alone, so that a new mesh does not move others; but a class of two or more
/// has one in each split, where a new mesh may move another. Folders above `root` count too: `root` may
/// itself be a class, or a split of one.
///
/// Characters that some platform forbids in file names become `_`. If several meshes have the same
/// class, split and name (`a.obj` beside `a.off`, or in folders at different depths), `_` and a
/// hash of the relative path is appended to each of their names. A path that is not Unicode cannot
/// be stored in a manifest: [`MeshEntry::load`] fails.
///
/// Links are followed, except to a folder that contains them. Files with other extensions, files
/// and folders whose name begins with a dot, `__MACOSX` and datasets of scans are ignored.
pub fn discover(root: &Path, seed: u64) -> Result<Vec<MeshEntry>, TreeError> {
    let absolute =
        root.canonicalize().map_err(|source| TreeError::Read { path: root.into(), source })?;
    let (files, _) = files(root)?;
    if files.is_empty() {
        return Err(TreeError::NoMesh(root.into()));
    }
    let mut places: Vec<Place> =
        files.into_iter().map(|path| Place::of(root, &absolute, path)).collect();
    let words = Words::of(&places);
    places.iter_mut().for_each(|place| place.take_split(words));

    let mut n_in_folder = HashMap::new();
    for place in &places {
        *n_in_folder.entry(place.path.parent()).or_insert(0) += 1;
    }
    let deep = || places.iter().filter(|place| place.may_have_own_folder());
    let alone = deep().filter(|place| n_in_folder[&place.path.parent()] == 1).count();
    // A few folders with a second mesh do not change the meaning of the others.
    let has_own_folder = 10 * alone >= 9 * deep().count();

    let mut entries: Vec<MeshEntry> =
        places.iter().map(|place| place.entry(has_own_folder, seed)).collect();
    check_classes(&places, &entries, has_own_folder)?;
    stratify(&places, &mut entries, seed);
    make_unique(&mut entries)?;
    entries.sort_by(|a, b| (&a.class, a.split, &a.name).cmp(&(&b.class, b.split, &b.name)));
    Ok(entries)
}

impl MeshEntry {
    /// Reads its file, with the hash of the bytes that `hashing` asks for.
    pub fn load(&self, hashing: Hashing) -> Result<(LoadedMesh, Option<FileHash>), MeshError> {
        if !self.path.ends_with(&self.relative) {
            return Err(MeshError::NotUnicode { path: self.path.clone() });
        }
        load_hashed(&self.path, hashing)
    }
}

/// The mesh files at and below `root`, and the others, in order of their paths.
fn files(root: &Path) -> Result<(Vec<PathBuf>, Vec<PathBuf>), TreeError> {
    let walk = WalkDir::new(root).follow_links(true).sort_by_file_name();
    let root_is_dataset = is_dataset(root);
    let is_wanted = |item: &DirEntry| {
        let is_set = || ["clean", "noisy"].iter().any(|part| item.path().join(part).is_dir());
        item.depth() == 0
            || !item.file_name().as_encoded_bytes().starts_with(b".")
                && item.file_name() != "__MACOSX"
                && !(item.file_type().is_dir() && is_dataset(item.path()))
                && !(root_is_dataset && item.depth() == 1 && is_set())
    };
    let (mut files, mut others) = (Vec::new(), Vec::new());
    for item in walk.into_iter().filter_entry(is_wanted) {
        match item {
            Ok(item) if item.file_type().is_dir() => {}
            Ok(item) if MeshFormat::from_path(item.path()).is_some() => {
                files.push(item.into_path())
            }
            Ok(item) => others.push(item.into_path()),
            Err(error) if error.loop_ancestor().is_some() => {}
            Err(error) => {
                let path = error.path().unwrap_or(root).to_path_buf();
                // A broken link to a mesh is listed, so that loading reports it.
                if path.is_symlink() && path != root {
                    files.extend(MeshFormat::from_path(&path).is_some().then_some(path));
                } else {
                    return Err(TreeError::Read { path, source: error.into() });
                }
            }
        }
    }
    Ok((files, others))
}

/// Whether a folder holds a dataset of scans, finished or not.
fn is_dataset(folder: &Path) -> bool {
    let mut head = Vec::new();
    let manifest = File::open(folder.join("manifest.json"));
    let read = manifest.and_then(|file| file.take(64).read_to_end(&mut head));
    let is_manifest =
        read.is_ok() && memchr::memmem::find(&head, br#""tool": "edgepuck""#).is_some();
    is_manifest || folder.join("journal/terms.json").exists()
}

/// The split of a folder of this name, in any case. A validation set is for training.
fn split_called(name: &str) -> Option<Split> {
    match name.to_lowercase().as_str() {
        "training" => Some(Split::Train),
        "testing" => Some(Split::Test),
        _ if is_validation(name) => Some(Split::Train),
        name => name.parse().ok(),
    }
}

fn is_validation(name: &str) -> bool {
    ["dev", "val", "valid", "validation"].iter().any(|word| name.eq_ignore_ascii_case(word))
}

/// Where folders with names of splits, in any case and with those of validation, are splits: where
/// at least two of them, and no other folders, stand beside each other.
#[derive(Clone, Copy)]
struct Words {
    /// Directly below the root.
    are_first: bool,
    /// In the folders of classes.
    are_deep: bool,
}

impl Words {
    fn of(places: &[Place]) -> Self {
        let is_split = |name: &String| split_called(name).is_some();
        let is_first = |place: &Place| place.below().first().is_some_and(is_split);
        let firsts: HashSet<&String> =
            places.iter().filter_map(|place| place.below().first()).collect();
        let (mut parents, mut words) = (HashSet::new(), HashSet::new());
        for below in places.iter().map(Place::below) {
            for at in (1..below.len()).filter(|&at| is_split(&below[at])) {
                parents.insert(&below[..at]);
                words.insert(&below[at]);
            }
        }
        let are_splits = |place: &Place| {
            let below = place.below();
            (1..below.len()).all(|at| !parents.contains(&below[..at]) || is_split(&below[at]))
        };
        Self {
            are_first: firsts.len() > 1 && places.iter().all(is_first),
            are_deep: words.len() > 1 && places.iter().all(are_splits),
        }
    }
}

/// Where a mesh is.
struct Place {
    path: PathBuf,
    relative: String,
    /// Its folders from that of the file system on, without that of its split.
    folders: Vec<String>,
    /// The number of folders at and above the root.
    n_above: usize,
    /// Its split, if a folder says so, and whether that folder is its own.
    split: Option<(Split, bool)>,
}

impl Place {
    fn of(root: &Path, absolute: &Path, path: PathBuf) -> Self {
        let below = path.strip_prefix(root).unwrap_or(&path);
        let (above, below) = match (below.parent(), path.file_name()) {
            (Some(_), _) | (_, None) => (absolute, below),
            // The root is the file.
            (None, Some(name)) => (absolute.parent().unwrap_or(absolute), Path::new(name)),
        };
        let names = |path: &Path| -> Vec<String> {
            let normal =
                |part| if let Component::Normal(name) = part { Some(text(name)) } else { None };
            path.components().filter_map(normal).collect()
        };
        let (mut folders, below) = (names(above), names(below));
        let (relative, n_above) = (below.join("/"), folders.len());
        folders.extend_from_slice(&below[..below.len().saturating_sub(1)]);
        Self { path, relative, folders, n_above, split: None }
    }

    /// Its folders below the root.
    fn below(&self) -> &[String] {
        self.folders.get(self.n_above..).unwrap_or_default()
    }

    /// Removes the last folder that is called as a split from its folders. Directly below the root
    /// it may as well be a class, unless all are splits or it is the folder of the mesh.
    fn take_split(&mut self, words: Words) {
        let n = self.folders.len();
        let split = |at: usize| {
            let is_own = at + 1 == n && n > 1;
            let [is_below, is_first] = [at > self.n_above, at == self.n_above && words.are_first];
            let name = &self.folders[at];
            let exact = name.parse().ok().filter(|_| is_own || is_below || is_first);
            let other = || split_called(name).filter(|_| is_below && words.are_deep || is_first);
            exact.or_else(other)
        };
        let last = (0..n).rev().find_map(|at| Some((split(at)?, at)));
        self.split = last.map(|(split, at)| {
            self.folders.remove(at);
            (split, at + 1 == n)
        });
    }

    /// Whether the mesh could be the one of its folder, and a folder above that its class.
    fn may_have_own_folder(&self) -> bool {
        self.below().len() > 1 && self.split.is_none_or(|(_, is_own)| !is_own)
    }

    /// The folder that is its class.
    fn class(&self, has_own_folder: bool) -> &str {
        match (self.below(), self.folders.last()) {
            ([class, ..], _) if self.may_have_own_folder() && has_own_folder => class,
            (_, class) => class.map_or("mesh", |class| class),
        }
    }

    fn entry(&self, has_own_folder: bool, seed: u64) -> MeshEntry {
        let own = self.may_have_own_folder() && has_own_folder;
        let name = match self.below() {
            [_, name, ..] if own => name.clone(),
            _ => self.path.file_stem().map(text).unwrap_or_default(),
        };
        let (class, name) = (safe_name(self.class(has_own_folder)), safe_name(&name));
        let drawn =
            || if unit(&class, &name, seed) < TRAIN_SHARE { Split::Train } else { Split::Test };
        let split = self.split.map_or_else(drawn, |(split, _)| split);
        let (path, relative) = (self.path.clone(), self.relative.clone());
        MeshEntry { path, relative, class, split, name }
    }
}

/// A part of a path, with each byte that is not Unicode as `\xE9`.
fn text(part: &OsStr) -> String {
    let mut text = String::new();
    for chunk in part.as_encoded_bytes().utf8_chunks() {
        text += chunk.valid();
        chunk.invalid().iter().for_each(|byte| text += &format!("\\x{byte:02X}"));
    }
    text
}

/// What decides the split of a mesh, 0 to 1.
fn unit(class: &str, name: &str, seed: u64) -> f64 {
    Stream::Split { class, name }.key(seed).unit(0)
}

/// That no two folders become one class.
fn check_classes(places: &[Place], entries: &[MeshEntry], own: bool) -> Result<(), TreeError> {
    let mut folders = HashMap::new();
    for (place, entry) in places.iter().zip(entries) {
        let first = *folders.entry(&entry.class).or_insert(place.class(own));
        if first != place.class(own) {
            let [first, second] = [first, place.class(own)].map(str::to_owned);
            return Err(TreeError::SameName { first, second, name: entry.class.clone() });
        }
    }
    Ok(())
}

/// Lets each class of two meshes or more, whose splits no folder says, have one in each split: the one
/// that was nearest to it.
fn stratify(places: &[Place], entries: &mut [MeshEntry], seed: u64) {
    let mut classes: HashMap<String, Vec<usize>> = HashMap::new();
    for (i, entry) in entries.iter().enumerate() {
        classes.entry(entry.class.clone()).or_default().push(i);
    }
    for mut of_class in classes.into_values().filter(|of_class| of_class.len() > 1) {
        let split = entries[of_class[0]].split;
        of_class.sort_by(|a, b| {
            let [a, b] = [a, b].map(|i| &entries[*i]);
            let of = |it: &MeshEntry| unit(&it.class, &it.name, seed);
            of(a).total_cmp(&of(b)).then_with(|| a.relative.cmp(&b.relative))
        });
        if of_class.iter().all(|&i| entries[i].split == split && places[i].split.is_none()) {
            let (nearest, other) = match split {
                Split::Train => (of_class.len() - 1, Split::Test),
                Split::Test => (0, Split::Train),
            };
            // Files of one name are of one object.
            let name = entries[of_class[nearest]].name.to_lowercase();
            let is_same = |&i: &usize| entries[i].name.to_lowercase() == name;
            let same: Vec<usize> = of_class.iter().copied().filter(is_same).collect();
            if same.len() < of_class.len() {
                same.into_iter().for_each(|i| entries[i].split = other);
            }
        }
    }
}

fn make_unique(entries: &mut [MeshEntry]) -> Result<(), TreeError> {
    let place =
        |entry: &MeshEntry| (entry.class.to_lowercase(), entry.split, entry.name.to_lowercase());
    let mut count = HashMap::new();
    for entry in entries.iter() {
        *count.entry(place(entry)).or_insert(0) += 1;
    }
    for entry in entries.iter_mut().filter(|entry| count[&place(entry)] > 1) {
        let digest = Sha256::digest(entry.relative.as_bytes());
        let digits: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
        entry.name = format!("{}_{}", entry.name, &digits[..HASH_DIGITS]);
    }
    let mut taken = HashMap::new();
    for entry in entries.iter() {
        if let Some(first) = taken.insert(place(entry), &entry.relative) {
            return Err(TreeError::SameName {
                first: first.clone(),
                second: entry.relative.clone(),
                name: entry.name.clone(),
            });
        }
    }
    Ok(())
}

/// Replaces characters that Windows, macOS or Linux forbid in file names with `_`.
/// Source: "Naming Files, Paths, and Namespaces", Microsoft.
fn safe_name(text: &str) -> String {
    let safe = |c: char| if c.is_control() || r#"<>:"/\|?*"#.contains(c) { '_' } else { c };
    let safe: String = text.chars().map(safe).collect();
    let fits = |(at, c): &(usize, char)| at + c.len_utf8() <= LONGEST_NAME;
    let mut name: String = safe.char_indices().take_while(fits).map(|(_, c)| c).collect();
    let kept = name.trim_end_matches(['.', ' ']).len();
    name.replace_range(kept.., &"_".repeat(name.len() - kept));
    if name.is_empty() || name.starts_with('.') || is_device(&name) {
        name.insert(0, '_');
    }
    name
}

/// Whether Windows reserves the part of `name` before its first dot for a device.
fn is_device(name: &str) -> bool {
    let stem = name.split('.').next().unwrap_or_default().trim_end().to_ascii_uppercase();
    let port = stem.strip_prefix("COM").or_else(|| stem.strip_prefix("LPT"));
    matches!(stem.as_str(), "CON" | "PRN" | "AUX" | "NUL")
        || port.is_some_and(|n| n.len() == 1 && n.bytes().all(|n| n.is_ascii_digit() && n != b'0'))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// A folder called `data` with empty files at the given paths.
    fn tree(paths: &[&str]) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().join("data");
        fs::create_dir(&root).unwrap();
        for path in paths {
            let path = root.join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, "").unwrap();
        }
        (folder, root)
    }

    fn listed(root: &Path) -> Vec<(String, Split, String)> {
        let entries = discover(root, 1).unwrap();
        entries.into_iter().map(|entry| (entry.class, entry.split, entry.name)).collect()
    }

    fn item(class: &str, split: Split, name: &str) -> (String, Split, String) {
        (class.into(), split, name.into())
    }

    #[test]
    fn modelnets_layout_keeps_its_splits_and_is_sorted() {
        let (_folder, root) = tree(&[
            "cup/test/cup_2.off",
            "cup/train/cup_1.OFF",
            "chair/train/chair_1.off",
            "chair/train/notes.txt",
            "chair/train/._chair_1.off",
            "__MACOSX/chair/train/chair_1.off",
        ]);
        let expected = [
            item("chair", Split::Train, "chair_1"),
            item("cup", Split::Train, "cup_1"),
            item("cup", Split::Test, "cup_2"),
        ];
        assert_eq!(listed(&root), expected);
        let entries = discover(&root, 2).unwrap();
        assert_eq!(entries[0].relative, "chair/train/chair_1.off");
        assert!(entries[0].path.is_file());
        assert_eq!(listed(&root.join("cup"))[..], expected[1..]);
        assert_eq!(listed(&root.join("cup/train")), expected[1..2]);
        assert_eq!(listed(&root.join("cup/test/cup_2.off")), expected[2..]);
    }

    #[test]
    fn another_tree_takes_the_parent_as_class_and_splits_4_to_1() {
        let names: Vec<_> = (0..1000).map(|n| format!("deep/cups/cup_{n}.ply")).collect();
        let mut paths: Vec<_> = names.iter().map(String::as_str).collect();
        paths.push("loose.stl");
        let (_folder, root) = tree(&paths);
        let entries = discover(&root, 1).unwrap();
        let (loose, cups): (Vec<_>, Vec<_>) = entries.iter().partition(|e| e.class == "data");
        assert_eq!((loose.len(), cups.len()), (1, 1000));
        assert!(cups.iter().all(|entry| entry.class == "cups"));
        let n_train = cups.iter().filter(|entry| entry.split == Split::Train).count();
        // Binomial: 800 with a standard deviation of 12.6; four of them.
        assert!(n_train.abs_diff(800) < 51, "{n_train}");
        let other = discover(&root, 2).unwrap();
        let split = |entries: &[MeshEntry]| {
            let mut list: Vec<_> = entries.iter().map(|e| (e.name.clone(), e.split)).collect();
            list.sort();
            list
        };
        assert_ne!(split(&entries), split(&other), "the seed has a say");
    }

    #[test]
    fn to_add_a_mesh_moves_no_other() {
        let (_folder, root) = tree(&["a/1.off", "a/2.off", "a/3.obj", "b/1.off"]);
        let before = listed(&root);
        fs::write(root.join("a/4.off"), "").unwrap();
        let after = listed(&root);
        assert!(before.iter().all(|entry| after.contains(entry)));
    }

    #[test]
    fn equal_names_differ_by_a_hash_of_their_paths() {
        let (_folder, root) = tree(&["x/a/m.off", "x/a/m.obj", "y/a/M.off", "y/a/n.off"]);
        let entries = discover(&root, 1).unwrap();
        let split_of = |relative: &str| {
            entries.iter().find(|entry| entry.relative == relative).map(|entry| entry.split)
        };
        assert_eq!(split_of("x/a/m.off"), split_of("x/a/m.obj"), "one split for one name");
        let mut names: Vec<_> = entries.iter().map(|entry| entry.name.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), 4);
        assert!(names.contains(&"n"), "a name of its own stays: {names:?}");
        let again = discover(&root, 1).unwrap();
        assert_eq!(again, entries);
    }

    #[test]
    fn small_classes_have_a_mesh_in_each_split_and_no_other_class_s() {
        let paths: Vec<_> = (0..9).map(|n| format!("{}/{n}.off", ["a", "b", "c"][n % 3])).collect();
        let (_folder, root) = tree(&paths.iter().map(String::as_str).collect::<Vec<_>>());
        for seed in 0..40 {
            let entries = discover(&root, seed).unwrap();
            let found: HashSet<_> = entries.iter().map(|it| (&it.class, it.split)).collect();
            assert_eq!(found.len(), 6, "{seed}");
        }
        // Files of one name are of one object, and in one split.
        let (_folder, root) = tree(&["cup/1.off", "cup/1.obj", "cup/2.off"]);
        for seed in 0..40 {
            let entries = discover(&root, seed).unwrap();
            let is_of_1 = |it: &&MeshEntry| it.relative.starts_with("cup/1");
            let splits: HashSet<_> = entries.iter().filter(is_of_1).map(|it| it.split).collect();
            assert_eq!(splits.len(), 1, "{seed}");
        }
        for [first, second] in [["CON", "_CON"], ["a b ", "a b_"], ["x?", "x:"]] {
            let (_folder, root) = tree(&[&format!("{first}/1.off"), &format!("{second}/2.off")]);
            let message = discover(&root, 1).unwrap_err().to_string();
            assert!(message.contains("both would be called"), "{message}");
        }
    }

    #[test]
    fn names_are_safe_on_every_platform() {
        for (text, safe) in [
            ("chair_0001", "chair_0001"),
            ("stuhl größe 2", "stuhl größe 2"),
            ("a:b*c?", "a_b_c_"),
            ("tab\tand\nline", "tab_and_line"),
            ("dots. .", "dots___"),
            ("", "_"),
            ("..", "__"),
            (".hidden", "_.hidden"),
            ("con", "_con"),
            ("Lpt1.old", "_Lpt1.old"),
            ("com10", "com10"),
        ] {
            assert_eq!(safe_name(text), safe, "{text:?}");
        }
        let long = safe_name(&"ä".repeat(300));
        assert_eq!(long, "ä".repeat(LONGEST_NAME / 2));
    }

    #[test]
    fn an_empty_or_missing_tree_is_named() {
        let (_folder, root) = tree(&["a/readme.txt"]);
        let message = discover(&root, 1).unwrap_err().to_string();
        let expected = "data: no mesh found; looked for *.off, *.obj, *.ply, *.stl, *.glb, *.gltf";
        assert!(message.ends_with(expected), "{message}");
        let message = discover(&root.join("nowhere"), 1).unwrap_err().to_string();
        assert!(message.contains("nowhere: cannot be read: "), "{message}");
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_but_not_in_circles() {
        use std::os::unix::fs::symlink;
        let (_folder, root) = tree(&["cup/train/a.off"]);
        symlink(&root, root.join("cup/train/circle")).unwrap();
        symlink(root.join("cup/train/a.off"), root.join("cup/train/b.off")).unwrap();
        symlink(root.join("gone.off"), root.join("cup/train/c.off")).unwrap();
        symlink(root.join("gone"), root.join("cup/train/gone")).unwrap();
        let names: Vec<_> = listed(&root).into_iter().map(|(_, _, name)| name).collect();
        assert_eq!(names, ["a", "b", "c"], "a link to no file fails when it is loaded");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_name_that_is_not_unicode_fails_when_it_is_loaded() {
        use std::os::unix::ffi::OsStrExt;
        let (_folder, root) = tree(&["cup/a.off"]);
        for name in [&b"caf\xE9.txt"[..], b"caf\xE9.off", b"caf\xEA.off"] {
            fs::write(root.join("cup").join(OsStr::from_bytes(name)), "").unwrap();
        }
        let entries = discover(&root, 1).unwrap();
        let message = |entry: &MeshEntry| {
            let error = entry.load(Hashing::None).unwrap_err().to_string();
            let path = format!("{}/", root.display());
            format!("{}: {}", entry.relative, error.strip_prefix(&path).unwrap())
        };
        let mut found: Vec<_> = entries.iter().map(message).collect();
        found.sort();
        let expected = [
            "cup/a.off: cup/a.off: the file is empty",
            "cup/caf\\xE9.off: cup/caf\u{FFFD}.off: the path is not Unicode; rename it",
            "cup/caf\\xEA.off: cup/caf\u{FFFD}.off: the path is not Unicode; rename it",
        ];
        assert_eq!(found, expected);
    }

    /// The class, the split if a folder gives it, and the name of each of these files.
    fn layout(paths: &[&str]) -> Vec<String> {
        let (_folder, root) = tree(paths);
        let entry =
            |entry: &MeshEntry| format!("{} {} {}", entry.relative, entry.class, entry.name);
        discover(&root, 1).unwrap().iter().map(entry).collect()
    }

    #[test]
    fn meshes_in_folders_of_their_own_have_the_class_of_the_folder_below_the_root() {
        let shapenet = [
            "02691156/10a/models/model.obj",
            "02691156/10b/models/model.obj",
            "03001627/20a/models/model.obj",
        ];
        let of_ids = ["bed/1/mesh.obj", "bed/2/mesh.obj", "car/1/mesh.obj"];
        let nested =
            ["in/bed/1.obj", "in/bed/2.obj", "in/car/1.obj", "out/car/2.obj", "out/car/3.obj"];
        let given = ["in/bed/train/1.obj", "in/bed/test/2.obj", "in/car/test/3.obj"];
        let cases: [(&[&str], &[&str]); 4] = [
            (&shapenet, &["02691156 10a", "02691156 10b", "03001627 20a"]),
            (&of_ids, &["bed 1", "bed 2", "car 1"]),
            (&nested, &["bed 1", "bed 2", "car 1", "car 2", "car 3"]),
            (&given, &["bed 1", "bed 2", "car 3"]),
        ];
        for (paths, expected) in cases {
            let mut found = layout(paths);
            found.sort();
            let mut expected: Vec<_> =
                paths.iter().zip(expected).map(|(path, entry)| format!("{path} {entry}")).collect();
            expected.sort();
            assert_eq!(found, expected);
        }
        // One folder of 20 has a second mesh.
        let many: Vec<_> = (0..20).map(|id| format!("bed/{id}/mesh.obj")).collect();
        let paths = many.iter().map(String::as_str).chain(["bed/7/part.obj"]);
        let found = layout(&paths.collect::<Vec<_>>());
        assert!(found.iter().all(|entry| entry.contains(" bed ")), "{found:?}");
    }

    #[test]
    fn folders_called_as_splits_are_splits_wherever_they_are() {
        let split = |path: &str, others: &[&str]| {
            let (_folder, root) = tree(&[others, &[path]].concat());
            let entries = discover(&root, 1).unwrap();
            let entry = entries.iter().find(|entry| entry.relative == path).unwrap();
            format!("{} {} {}", entry.class, entry.split, entry.name)
        };
        let train = ["train/bed/1.off", "train/car/1.off"];
        assert_eq!(split("test/car/2.off", &train), "car test 2");
        assert_eq!(split("test/car/2/mesh.off", &["train/car/1/mesh.off"]), "car test 2");
        assert_eq!(split("car/test/2/mesh.off", &["car/train/1/mesh.off"]), "car test 2");
        // Other names of splits, where only splits stand beside each other.
        let others = ["Train/car/1.off", "VAL/car/3.off", "validation/car/4.off"];
        assert_eq!(split("test/car/2.off", &others), "car test 2");
        assert_eq!(split("VAL/car/3.off", &["train/car/1.off"]), "car train 3");
        assert_eq!(split("car/Test/2.off", &["car/valid/1.off", "bus/Train/1.off"]), "car test 2");
        assert_eq!(split("car/testing/2.off", &["car/Training/1.off"]), "car test 2");
        assert!(
            split("toys/Train/2.off", &["toys/Train/1.off", "toys/Bus/1.off"])
                .starts_with("Train ")
        );
        assert_eq!(split("Test/2.off", &["Train/1.off"]), "data test 2");
        // A railway, beside other classes.
        assert!(split("train/ice/1.off", &["car/bus/1.off"]).starts_with("train "));
    }

    #[test]
    fn scans_of_datasets_are_not_meshes() {
        let manifest = "{\n  \"tool\": \"edgepuck\",\n  \"version\": \"0.1.0\"\n}\n";
        let (_folder, root) = tree(&["cup/a.off", "out/rotational/clean/cup/train/a_v0.ply"]);
        let n = |root: &Path| discover(root, 1).unwrap().len();
        assert_eq!(n(&root), 2, "not a dataset");
        fs::write(root.join("out/manifest.json"), "{\"meshes\": []}").unwrap();
        assert_eq!(n(&root), 2, "another program's manifest");
        fs::write(root.join("out/manifest.json"), manifest).unwrap();
        assert_eq!(n(&root), 1);
        fs::remove_file(root.join("out/manifest.json")).unwrap();
        fs::create_dir(root.join("out/journal")).unwrap();
        fs::write(root.join("out/journal/terms.json"), "{}").unwrap();
        assert_eq!(n(&root), 1, "an unfinished dataset");
        // The folder of the meshes is the dataset's too.
        fs::create_dir(root.join("out/cup")).unwrap();
        fs::write(root.join("out/cup/b.off"), "").unwrap();
        assert_eq!(n(&root.join("out")), 1);
    }

    #[test]
    fn odd_layouts_are_warnings() {
        let found = |paths: &[&str]| {
            let (_folder, root) = tree(paths);
            let all = warnings(&root, &discover(&root, 1).unwrap());
            all.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
        };
        let sound = ["a/train/1.off", "a/test/2.off", "b/train/1.off", "b/test/2.obj"];
        let lack = "split the meshes otherwise";
        let held = "the train split has 2 meshes of folders for validation: training holds out its \
                    own clouds for validation";
        let cases: [(&[&str], &[&str]); 7] = [
            (&sound, &[]),
            (&sound[..1], &["no mesh is in the test split", lack]),
            (&sound[1..3], &["each of the 2 classes has one mesh"]),
            (&sound[..3], &["no test mesh of b", lack]),
            (&["a/train/1.off", "a/val/2.off", "a/valid/3.off", "a/test/1.off"], &[held]),
            (
                &[&sound[..], &["a/train/1.binvox", "b/3.fbx", "c/train/a.STEP", "c/b.obj.gz"]]
                    .concat(),
                &["3 files are ignored (.fbx, .gz, .step); the class c has no mesh; expected .off"],
            ),
            (&["train/a/1.off", "train/b/2.off", "test/a/3.off", "test/b/4.off"], &[]),
        ];
        for (paths, expected) in cases {
            let found = found(paths);
            assert_eq!(found.is_empty(), expected.is_empty(), "{paths:?}: {found}");
            for part in expected {
                assert!(found.contains(part), "{paths:?}: {found}");
            }
        }
        assert!(
            !found(&sound[..1]).contains("one mesh"),
            "one class is no data set of single meshes"
        );
    }
}
