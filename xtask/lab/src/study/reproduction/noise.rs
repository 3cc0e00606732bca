//! Errors by class, scans of few points, and noise in training and in tests.

use anyhow::Context;
use formats::split::Split;
use std::path::Path;
use train::accuracy_report;
use train::clouds::Clouds;

use super::context::{ExperimentContext, test};
use super::matrix;
use super::section::{Cell, Section, Table};

/// Standard deviations of the noise along the ray, metres, and the sets that
/// have it.
const SIGMAS: [(&str, &str); 5] = [
    ("0 m", "lidar/packed/rotational-clean"),
    ("0.01 m", "lidar/packed/rotational-noisy"),
    ("0.02 m", "noise-0.02/packed/rotational-noisy"),
    ("0.05 m", "noise-0.05/packed/rotational-noisy"),
    ("0.1 m", "noise-0.1/packed/rotational-noisy"),
];

/// Fewest points of a scan.
const THRESHOLDS: [u32; 6] = [16, 64, 128, 256, 512, 1024];

pub fn run(context: &ExperimentContext) -> anyhow::Result<Section> {
    let noisy = SIGMAS[1].1;
    let model = matrix::network(context, noisy)?;
    let held = context.scans(noisy, Split::Test)?;
    let found = test(&model, &held, None)?;
    let about = [
        format!("Data: {}, scans of a VLP-32C from four sides.", context.meshes_are),
        "The matrix: a row a true class, a column an answer; darker for more, red for wrong. \
         The threshold filter: scans of fewer points are left out of the test."
            .to_owned(),
    ];
    let caption = "Confusion on rotational noisy scans";
    let mut confusion = Table::new("6 confusion", caption, "class", &held.classes);
    for (class, answers) in held.classes.iter().zip(&found.confusion) {
        confusion.push(class, answers.iter().map(|&n| Cell::Number(n as f64, 0)));
    }
    let tables = vec![confusion, thresholds(&held, &model)?, sweep(context)?];
    Ok(Section {
        drawings: vec![accuracy_report::drawing(&found, &held.classes).to_string()],
        ..Section::new("Confusion, few points, noise", about, tables)
    })
}

fn thresholds(held: &Clouds, model: &Path) -> anyhow::Result<Table> {
    let n_raw = held.set.n_raw.as_ref();
    let n_raw = n_raw.with_context(|| format!("{}-test.npz does not list n_raw", SIGMAS[1].1))?;
    let caption = "Rotational noisy scans of at least so many points";
    let columns = ["scans kept", "instance accuracy"];
    let mut table = Table::new("6 threshold", caption, "points", columns);
    for least in THRESHOLDS {
        let kept: Vec<usize> = (0..held.len()).filter(|&i| n_raw[i] >= least).collect();
        let accuracy = match kept.is_empty() {
            true => Cell::None,
            false => Cell::instance(&test(model, &held.select(&kept), None)?),
        };
        table.push(least.to_string(), [Cell::Share(kept.len(), held.len()), accuracy]);
    }
    Ok(table)
}

fn sweep(context: &ExperimentContext) -> anyhow::Result<Table> {
    let caption = "Instance accuracy by noise along the ray";
    let columns = SIGMAS.map(|(sigma, _)| format!("tested with {sigma}"));
    let mut table = Table::new("6 noise", caption, "trained with", columns);
    for (sigma, place) in SIGMAS {
        let model = matrix::network(context, place)?;
        let tested = |(_, place)| Ok(Cell::instance(&context.test_on(place, &model)?));
        table.measure(sigma, SIGMAS.map(tested))?;
    }
    Ok(table)
}
