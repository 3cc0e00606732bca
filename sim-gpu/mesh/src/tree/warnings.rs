//! What is odd about the folders of a dataset's meshes.

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::path::Path;

use formats::Split;
use formats::plausible::Warning;

use super::{MeshEntry, files, is_validation, split_called, text};
use crate::format::mesh_extensions;

/// The extensions of files that probably hold meshes, too: of other formats, and compressed.
const OTHER_FORMATS: [&str; 22] = [
    "3ds", "3mf", "7z", "blend", "brep", "bz2", "dae", "dxf", "fbx", "gz", "iges", "igs", "step",
    "stp", "tar", "usd", "usdz", "vtk", "wrl", "x3d", "xz", "zip",
];

/// Why the folders of `root`, with the meshes `entries`, probably mean something else, and what of them is
/// left out.
#[must_use]
pub fn warnings(root: &Path, entries: &[MeshEntry]) -> Vec<Warning> {
    let mut splits: BTreeMap<&str, BTreeSet<Split>> = BTreeMap::new();
    for entry in entries {
        splits.entry(&entry.class).or_default().insert(entry.split);
    }
    let n_classes = splits.len();
    let is_alone = n_classes > 1 && n_classes == entries.len();
    let mut found = Vec::new();
    for split in Split::ALL {
        let lack = splits.iter().filter(|(_, splits)| !splits.contains(&split));
        let classes: Vec<String> = lack.map(|(class, _)| (*class).to_owned()).collect();
        let split = split.name();
        if classes.len() == n_classes {
            found.push(Warning::EmptySplit(split));
        } else if !classes.is_empty() && !is_alone {
            found.push(Warning::ClassesWithoutSplit(split, classes));
        }
    }
    found.extend(is_alone.then_some(Warning::OneMeshAClass(n_classes)));
    let is_held = |entry: &&MeshEntry| {
        let is_held =
            |name: &str| is_validation(name) && ![&*entry.class, &*entry.name].contains(&name);
        entry.split == Split::Train && folders(entry).any(is_held)
    };
    let n = entries.iter().filter(is_held).count();
    found.extend((n > 0).then_some(Warning::Validation(n)));
    found.extend(left_out(root, entries));
    found
}

/// The names of the folders of a mesh below the root, the outermost first.
fn folders(entry: &MeshEntry) -> impl Iterator<Item = &str> {
    let folder = entry.relative.rsplit_once('/').map(|(folder, _)| folder.split('/'));
    folder.into_iter().flatten()
}

/// The files below `root` that no mesh needs and that are not read, and the classes that lack a
/// mesh for it.
fn left_out(root: &Path, entries: &[MeshEntry]) -> Option<Warning> {
    let (_, others) = files(root).ok()?;
    let with_meshes: HashSet<&str> =
        entries.iter().flat_map(|entry| entry.relative.split('/')).collect();
    let mut extensions = BTreeSet::new();
    let mut lack = BTreeSet::new();
    let mut n = 0;
    for file in &others {
        let Some(extension) = file.extension().map(|e| text(e).to_lowercase()) else { continue };
        if !OTHER_FORMATS.contains(&&*extension) {
            continue;
        }
        n += 1;
        extensions.insert(format!(".{extension}"));
        let folders = file.strip_prefix(root).ok().and_then(Path::parent).into_iter();
        let mut folders = folders.flat_map(Path::components).map(|part| text(part.as_os_str()));
        let class = folders.find(|name| split_called(name).is_none());
        lack.extend(class.filter(|class| !with_meshes.contains(&**class)));
    }
    let (extensions, classes) = (Vec::from_iter(extensions), Vec::from_iter(lack));
    let read = mesh_extensions().map(|extension| format!(".{extension}")).join(", ");
    (n > 0).then_some(Warning::UnreadFormats { n, extensions, classes, read })
}
