//! Draws clouds of one size and one scale, as networks take them, from scans.

use crate::config::{DatasetConfig, SetConfig, Variant};
use crate::record::Entry;
use formats::Scan;
use formats::cloud::{normalize_unit_sphere, resample};
use formats::rng::StreamKey;
use formats::scan::{Attribute, Column};
use formats::streams::Stream;

/// The scan of a cloud.
#[derive(Clone, Copy)]
pub(crate) struct Source<'a> {
    pub set: &'a SetConfig,
    pub variant: Variant,
    pub entry: &'a Entry,
    pub view: u32,
}

/// The points of a cloud, at the size and scale of packed clouds.
pub(crate) type Points = Vec<[f32; 3]>;

/// The cloud of `scan`, or `None` if the scan has no points or fewer than
/// [`DatasetConfig::min_points`].
pub(crate) fn draw(config: &DatasetConfig, source: Source, scan: &Scan) -> Option<Points> {
    if (scan.len() as u64) < u64::from(config.min_points) {
        return None;
    }
    let key = key(config, source);
    let mut points = resample(&scan.positions, config.packed_points as usize, key)?;
    normalize_unit_sphere(&mut points);
    Some(points)
}

/// The points of [`draw`], each followed by its `attributes`.
pub(crate) fn draw_rows(
    config: &DatasetConfig,
    source: Source,
    scan: &Scan,
    attributes: &[Attribute],
) -> Option<Vec<f32>> {
    let points = draw(config, source, scan)?;
    if attributes.is_empty() {
        return Some(points.into_flattened());
    }
    let columns = attributes.iter().map(|&attribute| scan.column(attribute));
    let columns: Vec<Column> = columns.collect::<Option<_>>()?;
    // One key draws the same indices from lists of equal length.
    let all: Vec<u32> = (0..scan.len() as u32).collect();
    let drawn = resample(&all, points.len(), key(config, source))?;
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

fn key(config: &DatasetConfig, Source { set, variant, entry, view }: Source) -> StreamKey {
    let (set, variant, mesh) = (&*set.name, variant.name(), &entry.id());
    Stream::Pack { set, variant, mesh, view }.key(config.seed)
}
