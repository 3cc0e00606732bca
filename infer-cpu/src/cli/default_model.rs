//! Chooses among the bundled models where a user named none: by what a cloud is.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf, absolute};

use formats::FormatError;
use formats::cloud_file::is_scan;
use formats::plausible::Unlike;
use serde::Deserialize;

use crate::ModelCard;
use crate::model::network::open;

/// The bundled model of scans, which show an object from one side.
pub const SCANS: &str = "shapes-rotational-64";

/// The folders above a scan in a data set: split, class, variant, set and the data set itself.
const DEEPEST: usize = 5;

#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A scan whose data set has only classes that [`SCANS`] knows.
    KnownScan,
    /// What the default model has not learnt.
    Unlike(Unlike),
    Other,
}

const OTHER_SCAN: Kind = Kind::Unlike(Unlike::OneSide);

/// What `manifest.json` of a data set says.
#[derive(Deserialize)]
struct Manifest {
    tool: String,
    meshes: Vec<Mesh>,
}

#[derive(Deserialize)]
struct Mesh {
    class: String,
}

pub struct Kinds {
    card: ModelCard,
    /// The last data set.
    set: Option<(PathBuf, Kind)>,
}

impl Kinds {
    pub fn new() -> Result<Self, FormatError> {
        Ok(Self { card: open(Path::new(SCANS))?.1, set: None })
    }

    /// The kind of the cloud in `file`, by its data set or its columns.
    pub fn of(&mut self, file: &Path) -> Kind {
        let place = absolute(file).unwrap_or_default();
        let folders = place.ancestors().skip(1).take(DEEPEST);
        let manifest = folders.map(|folder| folder.join("manifest.json")).find(|at| at.is_file());
        let Some(manifest) = manifest else {
            return if is_scan(file) { OTHER_SCAN } else { Kind::Other };
        };
        match &self.set {
            Some((known, kind)) if *known == manifest => *kind,
            _ => {
                let kind = self.of_set(&manifest).unwrap_or(Kind::Other);
                self.set = Some((manifest, kind));
                kind
            }
        }
    }

    fn of_set(&self, manifest: &Path) -> Option<Kind> {
        let file = BufReader::new(File::open(manifest).ok()?);
        let Manifest { tool, meshes } = serde_json::from_reader(file).ok()?;
        let knows = |mesh: &Mesh| self.card.classes.contains(&mesh.class);
        let kind = if meshes.iter().all(knows) { Kind::KnownScan } else { OTHER_SCAN };
        (tool == "edgepuck").then_some(kind)
    }
}
