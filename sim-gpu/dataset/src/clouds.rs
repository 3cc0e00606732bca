//! Draws clouds of one size and one scale, as networks take them, from scans.
//!
//! A cloud is drawn when its scan is written, and waits in memory until it is packed. Clouds of an
//! earlier run, of shards, or beyond the limit of memory are drawn from the files of their scans.

use crate::config::{DatasetConfig, Layout, SetConfig, Variant};
use crate::error::DatasetError;
use crate::layout;
use crate::manifest::LeftOut;
use crate::record::{Cloud, Entry, MeshRecord, VariantRecord};
use formats::cloud::{normalize_unit_sphere, resample};
use formats::rng::StreamKey;
use formats::scan::{Attribute, Column};
use formats::scan_file::{ScanFormat, read_scan};
use formats::streams::Stream;
use formats::{Scan, Split};
use rayon::prelude::*;
use std::borrow::Cow;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// Bytes of the clouds that wait in memory until they are packed: 1 GiB, some 89,000 clouds of
/// 1024 points.
const KEPT_BYTES: usize = 1 << 30;

/// Points of the clouds that are read together, for each part: 12 MiB.
const POINTS_AT_ONCE: u32 = 1 << 20;

/// The scan of a cloud.
#[derive(Clone, Copy)]
pub(crate) struct Source<'a> {
    pub set: &'a SetConfig,
    pub variant: Variant,
    pub entry: &'a Entry,
    pub view: u32,
}

impl Cloud {
    /// The cloud of `scan`, or `None` if the scan has no points or fewer than
    /// [`DatasetConfig::min_points`].
    pub(crate) fn draw(config: &DatasetConfig, source: Source, scan: &Scan) -> Option<Self> {
        if (scan.len() as u64) < u64::from(config.min_points) {
            return None;
        }
        let key = Self::key(config, source);
        let n = config.packed_points as usize;
        let mut points = resample(&scan.positions, n, key)?;
        normalize_unit_sphere(&mut points);
        // One key draws the same indices from lists of equal length.
        let normals = scan.normal.as_ref().filter(|_| config.layouts.contains(&Layout::Yanx27));
        let normals = normals.and_then(|normals| resample(normals, n, key));
        Some(Self { points, normals })
    }

    fn key(config: &DatasetConfig, source: Source) -> StreamKey {
        let Source { set, variant, entry, view } = source;
        let (set, variant, mesh) = (&*set.name, variant.name(), &entry.id());
        Stream::Pack { set, variant, mesh, view }.key(config.seed)
    }

    /// The points of [`Cloud::draw`], each followed by its `attributes`.
    pub(crate) fn rows(
        config: &DatasetConfig,
        source: Source,
        scan: &Scan,
        attributes: &[Attribute],
    ) -> Option<Vec<f32>> {
        let points = Self::draw(config, source, scan)?.points;
        if attributes.is_empty() {
            return Some(points.into_flattened());
        }
        let columns = attributes.iter().map(|&attribute| scan.column(attribute));
        let columns: Vec<Column> = columns.collect::<Option<_>>()?;
        let all: Vec<u32> = (0..scan.len() as u32).collect();
        let drawn = resample(&all, points.len(), Self::key(config, source))?;
        let mut rows = Vec::with_capacity(points.len() * (3 + columns.len()));
        for (point, i) in points.into_iter().zip(drawn.into_iter().map(|i| i as usize)) {
            rows.extend(point);
            for column in &columns {
                match column {
                    Column::F32(of) => rows.push(of[i]),
                    Column::U8(of) => rows.push(of[i].into()),
                    Column::U16(of) => rows.push(of[i].into()),
                    Column::U32(of) => rows.push(of[i] as f32),
                    Column::Vector(of) => rows.extend(of[i]),
                }
            }
        }
        Some(rows)
    }

    /// The cloud of a scan that was just written, unless the clouds in memory, whose bytes `kept`
    /// counts, leave no room for it.
    pub(crate) fn keep(
        kept: &AtomicUsize,
        config: &DatasetConfig,
        source: Source,
        scan: &Scan,
    ) -> Option<Self> {
        if kept.load(Relaxed) >= KEPT_BYTES {
            return None;
        }
        let cloud = Self::draw(config, source, scan)?;
        let numbers = cloud.points.len() + cloud.normals.as_ref().map_or(0, Vec::len);
        kept.fetch_add(numbers * size_of::<[f32; 3]>(), Relaxed);
        Some(cloud)
    }
}

#[derive(Clone, Copy)]
pub(crate) struct Scans<'a> {
    pub out: &'a Path,
    pub config: &'a DatasetConfig,
    /// The meshes, sorted by entry.
    pub records: &'a [MeshRecord],
    /// All classes of the dataset, sorted.
    pub classes: &'a [String],
}

/// The scans of one set, variant and split.
#[derive(Clone, Copy)]
pub(crate) struct Part<'a> {
    pub set: &'a SetConfig,
    pub variant: Variant,
    pub split: Split,
}

/// A cloud, its name and its label.
pub(crate) struct Packed<'a> {
    pub entry: &'a Entry,
    pub view: u32,
    /// `CLASS/NAME_vK`, unique in its part.
    pub name: String,
    pub label: usize,
    /// Points of the scan.
    pub n_raw: u32,
    pub cloud: Cow<'a, Cloud>,
}

impl<'a> Scans<'a> {
    /// Passes the clouds of `part` to `take`: by mesh, then by view. Clouds that are not in memory
    /// are read on all cores, some at a time. Returns the scans that have too few points.
    pub fn for_each_cloud(
        &self,
        part: &Part<'a>,
        mut take: impl FnMut(Packed<'a>) -> Result<(), DatasetError>,
    ) -> Result<Vec<LeftOut>, DatasetError> {
        let scans: Vec<_> = self.scans_of(*part).collect();
        let at_once = POINTS_AT_ONCE / self.config.packed_points.max(1);
        let mut left_out = Vec::new();
        for some in scans.chunks(at_once.clamp(1, 256) as usize) {
            let clouds = some.par_iter().map(|(source, written)| self.cloud(*source, written));
            let clouds: Vec<Option<Cow<Cloud>>> = clouds.collect::<Result<_, DatasetError>>()?;
            for (&(Source { entry, view, .. }, written), cloud) in some.iter().zip(clouds) {
                let (name, points) = (format!("{}_v{view}", entry.id()), written.tally.points);
                let Some(cloud) = cloud else {
                    left_out.push(LeftOut { name, points });
                    continue;
                };
                let label = self.classes.partition_point(|class| *class < entry.class);
                take(Packed { entry, view, name, label, n_raw: points as u32, cloud })?;
            }
        }
        Ok(left_out)
    }

    fn scans_of(&self, part: Part<'a>) -> impl Iterator<Item = (Source<'a>, &'a VariantRecord)> {
        let Part { set, variant, split } = part;
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
    ) -> Result<Option<Cow<'a, Cloud>>, DatasetError> {
        let points = written.tally.points;
        if let Some(cloud) = &written.cloud {
            return Ok(Some(Cow::Borrowed(cloud)));
        }
        if points < u64::from(self.config.min_points) {
            return Ok(None);
        }
        let Source { set, variant, entry, view } = source;
        let path = layout::scan(self.out, &set.name, variant, entry, view, ScanFormat::Npz);
        let scan = read_scan(&path)?;
        if scan.len() as u64 != points {
            let cause = format!("expected {points} points as recorded, found {}", scan.len());
            return Err(DatasetError::malformed(&path, cause));
        }
        Ok(Cloud::draw(self.config, source, &scan).map(Cow::Owned))
    }
}
