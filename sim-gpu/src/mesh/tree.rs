//! The meshes of a dataset, with their classes and splits.

use std::collections::HashMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use formats::Split;
use formats::rng::StreamKey;
use sha2::{Digest, Sha256};
use walkdir::WalkDir;

use super::format::{MeshFormat, mesh_extensions};

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
    /// The path of a mesh is not Unicode, and so cannot be stored in a manifest.
    #[error("{}: the path is not Unicode; rename it", .0.display())]
    NotUnicode(PathBuf),
    /// The folder has no mesh.
    #[error("{}: no mesh found; looked for {}", .0.display(), mesh_extensions().map(|e| format!("*.{e}")).join(", "))]
    NoMesh(PathBuf),
    /// Two meshes have equal names even with a hash of their paths.
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
/// A mesh `CLASS/{train,test}/NAME.ext` keeps its split. The class of any other mesh is its folder,
/// and 4 of 5 are in the training set. The split is a function of `seed`, class and name alone, so
/// that a new mesh does not move others. Folders above `root` count too: `root` may itself be a
/// class, or a split of one.
///
/// Characters that some platform forbids in file names become `_`. If several meshes have the same
/// class, split and name (`a.obj` beside `a.off`, or in folders at different depths), `_` and a
/// hash of the relative path is appended to each of their names.
///
/// Links are followed, except to a folder that contains them. Files with other extensions, files
/// and folders whose name begins with a dot, and `__MACOSX` are ignored.
pub fn discover(root: &Path, seed: u64) -> Result<Vec<MeshEntry>, TreeError> {
    let absolute =
        root.canonicalize().map_err(|source| TreeError::Read { path: root.into(), source })?;
    let mut entries = Vec::new();
    for path in mesh_files(root)? {
        entries.push(entry(root, &absolute, path, seed)?);
    }
    if entries.is_empty() {
        return Err(TreeError::NoMesh(root.into()));
    }
    make_unique(&mut entries)?;
    entries.sort_by(|a, b| (&a.class, a.split, &a.name).cmp(&(&b.class, b.split, &b.name)));
    Ok(entries)
}

/// The mesh files at and below `root`, in order of their paths.
fn mesh_files(root: &Path) -> Result<Vec<PathBuf>, TreeError> {
    let walk = WalkDir::new(root).follow_links(true).sort_by_file_name();
    let is_wanted = |name: &OsStr| !name.as_encoded_bytes().starts_with(b".") && name != "__MACOSX";
    let mut files = Vec::new();
    for item in
        walk.into_iter().filter_entry(|item| item.depth() == 0 || is_wanted(item.file_name()))
    {
        match item {
            Ok(item) if item.file_type().is_dir() => {}
            Ok(item) if MeshFormat::from_path(item.path()).is_some() => {
                files.push(item.into_path())
            }
            Ok(_) => {}
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
    Ok(files)
}

fn entry(root: &Path, absolute: &Path, path: PathBuf, seed: u64) -> Result<MeshEntry, TreeError> {
    let below = path.strip_prefix(root).unwrap_or(&path);
    let whole = absolute.join(below);
    let whole = if below.as_os_str().is_empty() { absolute } else { &whole };
    let unicode = |text: &OsStr| text.to_str().map(str::to_owned);
    let not_unicode = || TreeError::NotUnicode(path.clone());

    let relative = if below.as_os_str().is_empty() {
        path.file_name().and_then(unicode).ok_or_else(not_unicode)?
    } else {
        let parts: Option<Vec<_>> = below.iter().map(unicode).collect();
        parts.ok_or_else(not_unicode)?.join("/")
    };
    let stem = path.file_stem().and_then(unicode).ok_or_else(not_unicode)?;
    let name = safe_name(&stem);

    let mut folders = whole.ancestors().skip(1).map(Path::file_name);
    let parent = folders.next().flatten().unwrap_or(OsStr::new("mesh"));
    let given = match parent.to_str() {
        Some("train") => Some(Split::Train),
        Some("test") => Some(Split::Test),
        _ => None,
    };
    let above = folders.next().flatten().filter(|_| given.is_some());
    let class = safe_name(&unicode(above.unwrap_or(parent)).ok_or_else(not_unicode)?);
    let split = match above.and(given) {
        Some(split) => split,
        None => {
            let unit = StreamKey::new(seed, &format!("{class}/{name}"), 0).unit(0);
            if unit < TRAIN_SHARE { Split::Train } else { Split::Test }
        }
    };
    Ok(MeshEntry { path, relative, class, split, name })
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
    fn equal_names_are_told_apart_by_their_paths() {
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
        let expected = "data: no mesh found; looked for *.off, *.obj, *.ply, *.stl";
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
    fn a_name_that_is_not_unicode_is_an_error() {
        use std::os::unix::ffi::OsStrExt;
        let (_folder, root) = tree(&["cup/a.off"]);
        fs::write(root.join("cup").join(OsStr::from_bytes(b"caf\xE9.txt")), "").unwrap();
        assert_eq!(discover(&root, 1).unwrap().len(), 1);
        fs::write(root.join("cup").join(OsStr::from_bytes(b"caf\xE9.off")), "").unwrap();
        assert!(matches!(discover(&root, 1), Err(TreeError::NotUnicode(_))));
    }
}
