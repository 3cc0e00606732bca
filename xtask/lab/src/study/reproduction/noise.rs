//! Errors by class, scans of few points, and noise in training and in tests.

use anyhow::Context;
use formats::split::Split;
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
    Ok(Section {
        title: "Confusion, few points, noise".to_owned(),
        about: vec![
            format!("Data: {}, scans of a VLP-32C from four sides.", context.meshes_are),
            "The matrix: a row a true class, a column an answer; darker for more, red for wrong. \
             The threshold filter: scans of fewer points are left out of the test."
                .to_owned(),
        ],
        tables: vec![
            confusion(&found.confusion, &held.classes),
            thresholds(context, &model)?,
            sweep(context)?,
        ],
        drawings: vec![accuracy_report::drawing(&found, &held.classes).to_string()],
        ..Section::default()
    })
}

fn confusion(matrix: &[Vec<usize>], classes: &[String]) -> Table {
    let row = |(class, answers): (&String, &Vec<usize>)| {
        (class.clone(), answers.iter().map(|&n| Cell::Number(n as f64, 0)).collect())
    };
    Table {
        id: "6 confusion".to_owned(),
        caption: "Confusion on rotational noisy scans".to_owned(),
        rows_are: "class".to_owned(),
        columns: classes.to_vec(),
        rows: classes.iter().zip(matrix).map(row).collect(),
    }
}

fn thresholds(context: &ExperimentContext, model: &std::path::Path) -> anyhow::Result<Table> {
    let noisy = SIGMAS[1].1;
    let held = context.scans(noisy, Split::Test)?;
    let n_raw = held.set.n_raw.as_ref();
    let n_raw = n_raw.with_context(|| format!("{noisy}-test.npz does not list n_raw"))?;
    let mut rows = Vec::new();
    for least in THRESHOLDS {
        let kept: Vec<usize> = (0..held.len()).filter(|&i| n_raw[i] >= least).collect();
        let some: Clouds = held.select(&kept);
        let accuracy = match some.is_empty() {
            true => Cell::None,
            false => Cell::instance(&test(model, &some, None)?),
        };
        rows.push((least.to_string(), vec![Cell::Share(kept.len(), held.len()), accuracy]));
    }
    Ok(Table {
        id: "6 threshold".to_owned(),
        caption: "Rotational noisy scans of at least so many points".to_owned(),
        rows_are: "points".to_owned(),
        columns: vec!["scans kept".to_owned(), "instance accuracy".to_owned()],
        rows,
    })
}

fn sweep(context: &ExperimentContext) -> anyhow::Result<Table> {
    let mut rows = Vec::new();
    for (sigma, place) in SIGMAS {
        let model = matrix::network(context, place)?;
        let cells = SIGMAS.map(|(_, place)| {
            Ok(Cell::instance(&test(&model, &*context.scans(place, Split::Test)?, None)?))
        });
        rows.push((sigma.to_owned(), cells.into_iter().collect::<anyhow::Result<_>>()?));
    }
    Ok(Table {
        id: "6 noise".to_owned(),
        caption: "Instance accuracy by noise along the ray".to_owned(),
        rows_are: "trained with".to_owned(),
        columns: SIGMAS.map(|(sigma, _)| format!("tested with {sigma}")).into(),
        rows,
    })
}
