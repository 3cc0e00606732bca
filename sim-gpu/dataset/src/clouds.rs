//! From scans on disk to clouds as networks take them: one size, one scale.

use super::config::{DatasetConfig, SetConfig, Variant};
use super::error::DatasetError;
use super::layout;
use super::manifest::LeftOut;
use super::record::{Entry, MeshRecord};
use formats::Split;
use formats::cloud::{normalize_unit_sphere, resample};
use formats::npz;
use formats::rng::StreamKey;
use formats::scan_file::ScanFormat;
use rayon::prelude::*;
use std::path::Path;

/// Points of all clouds that wait to be taken, in one part: 12 MiB.
const POINTS_AT_ONCE: u32 = 1 << 20;

/// The scans that clouds are drawn from.
#[derive(Clone, Copy)]
pub(super) struct Scans<'a> {
    /// The dataset's folder.
    pub out: &'a Path,
    /// What it is to hold.
    pub config: &'a DatasetConfig,
    /// The meshes, sorted by entry.
    pub records: &'a [MeshRecord],
    /// All classes of the dataset, sorted.
    pub classes: &'a [String],
}

/// Which of the scans.
#[derive(Clone, Copy)]
pub(super) struct Part<'a> {
    pub set: &'a SetConfig,
    pub variant: Variant,
    pub split: Split,
}

/// One cloud.
pub(super) struct Cloud<'a> {
    /// The mesh.
    pub entry: &'a Entry,
    /// The view's number.
    pub view: u32,
    /// `CLASS/NAME_vK`, unique in its part.
    pub name: String,
    /// The class's index.
    pub label: usize,
    /// [`DatasetConfig::packed_points`] points, mean 0 and largest radius 1.
    pub points: Vec<[f32; 3]>,
    /// The surface's normal at each point, if the scan has them.
    pub normals: Option<Vec<[f32; 3]>>,
    /// Points of the scan.
    pub n_raw: u32,
}

/// A scan as its record has it.
struct Recorded<'a> {
    entry: &'a Entry,
    view: u32,
    points: u64,
}

enum Drawn<'a> {
    Cloud(Cloud<'a>),
    TooFew(LeftOut),
}

impl<'a> Scans<'a> {
    /// Hands the clouds of `part` to `take`: by mesh, then by view. They are
    /// read on all cores, some at a time. Returns the scans that have too few
    /// points.
    ///
    /// # Errors
    /// A scan that cannot be read or is not as recorded; what `take` returns.
    pub fn for_each_cloud(
        &self,
        part: &Part,
        mut take: impl FnMut(Cloud<'a>) -> Result<(), DatasetError>,
    ) -> Result<Vec<LeftOut>, DatasetError> {
        let recorded: Vec<Recorded> = self.recorded(*part).collect();
        let at_once = POINTS_AT_ONCE / self.config.packed_points.max(1);
        let mut left_out = Vec::new();
        for some in recorded.chunks(at_once.clamp(1, 256) as usize) {
            let drawn: Result<Vec<Drawn>, DatasetError> =
                some.par_iter().map(|recorded| self.draw(part, recorded)).collect();
            for drawn in drawn? {
                match drawn {
                    Drawn::Cloud(cloud) => take(cloud)?,
                    Drawn::TooFew(scan) => left_out.push(scan),
                }
            }
        }
        Ok(left_out)
    }

    fn recorded(&self, part: Part<'_>) -> impl Iterator<Item = Recorded<'a>> {
        let records = self.records.iter().filter(move |record| record.entry.split == part.split);
        records.flat_map(move |record| {
            let scans = record.scans.iter().filter(move |scan| scan.set == part.set.name);
            scans.filter_map(move |scan| {
                let written =
                    scan.variants.iter().find(|written| written.variant == part.variant)?;
                let points = written.tally.points;
                Some(Recorded { entry: &record.entry, view: scan.view, points })
            })
        })
    }

    fn draw(&self, part: &Part, recorded: &Recorded<'a>) -> Result<Drawn<'a>, DatasetError> {
        let &Recorded { entry, view, points: n_raw } = recorded;
        let name = format!("{}_v{view}", entry.id());
        if n_raw < u64::from(self.config.min_points) {
            return Ok(Drawn::TooFew(LeftOut { name, points: n_raw }));
        }
        let set = &part.set.name;
        let path = layout::scan(self.out, set, part.variant, entry, view, ScanFormat::Npz);
        let scan = npz::read_scan(&path)?;
        if scan.len() as u64 != n_raw {
            let cause = format!("holds {} points, its record says {n_raw}", scan.len());
            return Err(DatasetError::Malformed { path, cause });
        }
        let stream = format!("pack/{set}/{}/{}", part.variant.name(), entry.id());
        let key = StreamKey::new(self.config.seed, &stream, view);
        let n = self.config.packed_points as usize;
        let Some(mut points) = resample(&scan.positions, n, key) else {
            return Ok(Drawn::TooFew(LeftOut { name, points: n_raw }));
        };
        normalize_unit_sphere(&mut points);
        // One key draws the same places from lists of one length.
        let normals = scan.normal.and_then(|normals| resample(&normals, n, key));
        let label = self.classes.partition_point(|class| *class < entry.class);
        Ok(Drawn::Cloud(Cloud { entry, view, name, label, points, normals, n_raw: n_raw as u32 }))
    }
}
