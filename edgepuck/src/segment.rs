//! `edgepuck detect --segment-only`: the ground and the clusters of a sweep.

use crate::colours::{self, Rgb};
use crate::points::SweepArgs;
use crate::view::preview;
use crate::{Outcome, Usage};
use edgepuck_segment::{Label, Segmentation, Segmenter, Settings, Sweep};
use formats::atomic::UnfinishedFolder;
use formats::cloud_file::write_cloud;
use formats::hash::Hashing;
use formats::scan::Column;
use formats::{FormatError, Scan, counted, rows};
use program::outputs::Overwrite;
use std::path::Path;
use std::time::Instant;

/// Cuts the sweep `input` into clusters, of connected points within `radius` metres if there is one,
/// and writes them into the folder `out`.
pub fn run(
    input: &SweepArgs,
    out: &Path,
    overwrite: &Overwrite,
    radius: Option<f32>,
) -> anyhow::Result<Outcome> {
    overwrite.check_folder(out)?;
    let (scan, settings) = match radius {
        Some(radius_m) => (input.read()?, Settings::of_components(radius_m)),
        None => (input.read_upright()?, Settings::default()),
    };
    let mut segmenter = Segmenter::new(settings).map_err(|error| Usage(error.to_string()))?;
    let sweep = Sweep { points: &scan.positions, rings: scan.ring.as_deref() };
    // The first sweep allocates memory; the time of a later one is typical.
    segmenter.segment(&sweep)?;
    let start = Instant::now();
    let segmentation = segmenter.segment(&sweep)?;
    let elapsed_ms = 1e3 * start.elapsed().as_secs_f64();

    let begun = UnfinishedFolder::begin_new(out);
    write_clusters(out, &scan, segmentation)?;
    let tints: Vec<_> = segmentation.labels().iter().map(|label| tint(*label)).collect();
    write_ply(&out.join("sweep.ply"), &scan.positions, &tints)?;
    preview::picture(&scan, &tints, &[], &[], &out.join("preview.png"))?;
    begun.into_iter().for_each(UnfinishedFolder::finish);
    let ground = segmentation.labels().iter().filter(|label| **label == Label::Ground).count();
    program::say!(
        "{} in {elapsed_ms:.1} ms: {}, {:.0} % ground: {}",
        counted(scan.len(), "point"),
        counted(segmentation.clusters().len(), "cluster"),
        100.0 * ground as f64 / scan.len().max(1) as f64,
        out.display()
    );
    Ok(Outcome::Success)
}

/// The colour of a label: grey for the ground, light grey for points in no cluster, and that of its
/// number for a cluster.
fn tint(label: Label) -> Rgb {
    match label {
        Label::Ground => colours::of_class("ground"),
        Label::Small | Label::Invalid => colours::of_class("small"),
        Label::Cluster(number) => colours::of_number(number),
    }
}

/// Writes each cluster, and removes files of further clusters from an earlier run.
fn write_clusters(folder: &Path, scan: &Scan, found: &Segmentation) -> Result<(), FormatError> {
    let file = |number: usize| folder.join(format!("cluster-{number:04}.npy"));
    for (number, cluster) in found.clusters().enumerate() {
        let position = |&point: &u32| scan.positions[point as usize].map(f64::from);
        let points: Vec<_> = cluster.points.iter().map(position).collect();
        write_cloud(&file(number), &points)?;
    }
    let left = (found.clusters().len()..).map(file).take_while(|file| file.exists());
    for file in left {
        std::fs::remove_file(&file).map_err(|source| FormatError::io(&file, source))?;
    }
    Ok(())
}

fn write_ply(file: &Path, points: &[[f32; 3]], tints: &[Rgb]) -> Result<(), FormatError> {
    let [red, green, blue] =
        [0, 1, 2].map(|of| tints.iter().map(|tint| tint[of]).collect::<Vec<_>>());
    let columns = [
        (rows::AXES.to_vec(), Column::Vector(points)),
        (vec!["red"], Column::U8(&red)),
        (vec!["green"], Column::U8(&green)),
        (vec!["blue"], Column::U8(&blue)),
    ];
    let header = rows::ply_header([0.0; 3], None, &Default::default(), &columns);
    rows::write(file, Hashing::None, &header, &columns).map(|_| ())
}
