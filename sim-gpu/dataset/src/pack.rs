//! Packs the clouds of scans: one file for each set, variant and split.
//!
//! A cloud is drawn when its scan is written, and waits in memory until it is packed. Clouds of an
//! earlier run, of shards, or beyond the limit of memory are drawn from the files of their scans.

use crate::clouds::{Points, Source, draw};
use crate::config::{DatasetConfig, SetConfig, Variant};
use crate::error::DatasetError;
use crate::folder::DatasetFolder;
use crate::manifest::{LeftOut, PackedRecord};
use crate::record::{MeshRecord, VariantRecord};
use formats::packed::PackedWriter;
use formats::scan_file::{ScanFormat, read_scan};
use formats::{Scan, Split};
use rayon::prelude::*;
use std::borrow::Cow;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// Bytes of the clouds that wait in memory until they are packed: 1 GiB, some 89,000 clouds of
/// 1024 points.
const KEPT_BYTES: usize = 1 << 30;

/// Points of the clouds that are read together, for each file: 12 MiB.
const POINTS_AT_ONCE: u32 = 1 << 20;

/// The cloud of a scan that was just written, unless the clouds in memory, whose bytes `kept`
/// counts, leave no room for it.
pub(crate) fn keep(
    kept: &AtomicUsize,
    config: &DatasetConfig,
    source: Source,
    scan: &Scan,
) -> Option<Points> {
    if kept.load(Relaxed) >= KEPT_BYTES {
        return None;
    }
    let points = draw(config, source, scan)?;
    kept.fetch_add(points.len() * size_of::<[f32; 3]>(), Relaxed);
    Some(points)
}

/// The scans of a dataset.
pub(crate) struct Scans<'a> {
    pub folder: DatasetFolder<'a>,
    pub config: &'a DatasetConfig,
    /// The meshes, sorted by entry.
    pub records: &'a [MeshRecord],
    /// All classes of the dataset, sorted; labels are indices into them.
    pub classes: &'a [String],
}

impl<'a> Scans<'a> {
    /// Writes the packed files, even those that hold no cloud.
    pub fn pack(&self) -> Result<Vec<PackedRecord>, DatasetError> {
        let mut files = Vec::new();
        for set in &self.config.sets {
            for &variant in &self.config.variants {
                files.extend(Split::ALL.map(|split| (set, variant, split)));
            }
        }
        files.into_par_iter().map(|(set, variant, split)| self.write(set, variant, split)).collect()
    }

    /// Writes one packed file: by mesh, then by view. Clouds that are not in memory are read on all cores,
    /// some at a time.
    fn write(
        &self,
        set: &'a SetConfig,
        variant: Variant,
        split: Split,
    ) -> Result<PackedRecord, DatasetError> {
        let file = format!("packed/{}-{variant}-{split}.npz", set.name);
        let (place, n_points) = (self.folder.0.join(&file), self.config.packed_points);
        let mut writer = PackedWriter::create(&place, n_points as usize, self.classes.to_vec())?;
        let scans: Vec<_> = self.scans_of(set, variant, split).collect();
        let at_once = POINTS_AT_ONCE / n_points.max(1);
        let mut left_out = Vec::new();
        for some in scans.chunks(at_once.clamp(1, 256) as usize) {
            let clouds = some.par_iter().map(|(source, written)| self.cloud(*source, written));
            let clouds: Vec<_> = clouds.collect::<Result<_, DatasetError>>()?;
            for (&(Source { entry, view, .. }, written), cloud) in some.iter().zip(clouds) {
                let (name, points) = (format!("{}_v{view}", entry.id()), written.tally.points);
                let Some(cloud) = cloud else {
                    left_out.push(LeftOut { name, points });
                    continue;
                };
                let label = self.classes.partition_point(|class| *class < entry.class);
                writer.push(&cloud, label, &name, points as u32)?;
            }
        }
        let clouds = writer.n_clouds() as u64;
        let hash = writer.finish(self.config.hash)?;
        Ok(PackedRecord { file, hash, clouds, left_out })
    }

    fn scans_of(
        &self,
        set: &'a SetConfig,
        variant: Variant,
        split: Split,
    ) -> impl Iterator<Item = (Source<'a>, &'a VariantRecord)> {
        let records = self.records.iter().filter(move |record| record.entry.split == split);
        records.flat_map(move |MeshRecord { entry, scans, .. }| {
            let scans = scans.iter().filter(move |scan| scan.set == set.name);
            scans.filter_map(move |scan| {
                let written = scan.variants.iter().find(|written| written.variant == variant)?;
                Some((Source { set, variant, entry, view: scan.view }, written))
            })
        })
    }

    /// The cloud of one scan, or `None` if the scan has too few points.
    fn cloud(
        &self,
        source: Source,
        written: &'a VariantRecord,
    ) -> Result<Option<Cow<'a, [[f32; 3]]>>, DatasetError> {
        let points = written.tally.points;
        if let Some(cloud) = &written.cloud {
            return Ok(Some(Cow::Borrowed(cloud)));
        }
        if points < u64::from(self.config.min_points) {
            return Ok(None);
        }
        let Source { set, variant, entry, view } = source;
        let file = entry.scan_file(&set.name, variant, view, ScanFormat::Npz);
        let path = self.folder.0.join(file);
        let scan = read_scan(&path)?;
        if scan.len() as u64 != points {
            let cause = format!("expected {points} points as recorded, found {}", scan.len());
            return Err(DatasetError::malformed(&path, cause));
        }
        Ok(draw(self.config, source, &scan).map(Cow::Owned))
    }
}
