//! Five datasets, each learnt from and tested on.

use formats::split::Split;
use train::recipe::{Recipe, Sampling};

use super::context::{ExperimentContext, test};
use super::section::{Cell, Section, Table};

/// The datasets: a name, and where they lie.
pub const SETS: [(&str, &str); 5] = [
    ("uniform samples", "surfaces/surface"),
    ("static clean", "lidar/packed/static-clean"),
    ("static noisy", "lidar/packed/static-noisy"),
    ("rotational clean", "lidar/packed/rotational-clean"),
    ("rotational noisy", "lidar/packed/rotational-noisy"),
];

/// How networks are trained on `clouds` clouds of meshes.
pub fn recipe(context: &ExperimentContext, clouds: usize) -> Recipe {
    Recipe { sampling: Sampling::Random, ..context.plan.on_meshes(clouds) }
}

/// The network trained on the set at `place`.
pub fn network(context: &ExperimentContext, place: &str) -> anyhow::Result<std::path::PathBuf> {
    let clouds = context.scans(place, Split::Train)?;
    let name = format!("on-{}", place.replace('/', "-"));
    context.network(&name, recipe(context, clouds.len()), &clouds)
}

pub fn run(context: &ExperimentContext) -> anyhow::Result<Section> {
    let table = |id: &str, caption: &str| Table {
        id: id.to_owned(),
        caption: caption.to_owned(),
        rows_are: "trained on".to_owned(),
        columns: SETS.map(|(name, _)| format!("tested on {name}")).into(),
        rows: Vec::new(),
    };
    let mut instance = table("2 instance", "Instance accuracy");
    let mut class = table("2 class", "Class accuracy");
    for (name, place) in SETS {
        let model = network(context, place)?;
        let mut found = Vec::new();
        for (_, place) in SETS {
            found.push(test(&model, &*context.scans(place, Split::Test)?, None)?);
        }
        instance.rows.push((name.to_owned(), found.iter().map(Cell::instance).collect()));
        class.rows.push((name.to_owned(), found.iter().map(Cell::class).collect()));
    }
    let n_classes = context.scans(SETS[0].1, Split::Train)?.classes.len();
    Ok(Section {
        title: "Five datasets by five".to_owned(),
        about: vec![
            format!(
                "Data: {}, the same meshes and the same split in all five. {} points; as many \
                 epochs each as come nearest above {} steps. A guess is right in {:.1} %.",
                context.meshes_are,
                context.plan.mesh_points,
                context.plan.mesh_steps,
                100.0 / n_classes as f64
            ),
            "The paper's accuracy across datasets falls to 2 to 17 %. Its uniform samples are the \
             baseline's text files, in a frame of their own; here all five share one frame."
                .to_owned(),
        ],
        tables: vec![instance, class],
        ..Section::default()
    })
}
