//! `cargo xtask trade`: sweeps every parameter from mesh to class and records time and
//! accuracy.
//!
//! Objects are scanned with the settings of [`sensors`] ([`scans`]) and by all [`casters`];
//! [`classifiers`] sweep models, samplers, points and precisions. Each setting becomes a
//! [`Measurement`], a row of one CSV file, in which [`pareto`] marks the Pareto-optimal rows.
//! [`page`] shows the rows on a page, and `cargo xtask advise` reads them.

mod casters;
mod classes;
mod classifiers;
pub mod page;
mod pareto;
mod scans;
mod sensors;

use super::datasets;
use crate::measure::backends;
use crate::measure::machine::Machine;
use anyhow::{Context, Result, ensure};
use classes::{Classifying, TestSet, agreement};
use classifiers::bundled;
use edgepuck_program::flags::need_folder_of_meshes;
use edgepuck_program::trade_record::{self, Measurement, Part};
use edgepuck_program::{Outcome, gen_shapes};
use formats::cloud::resample;
use formats::rng::StreamKey;
use infer_cpu::inspect;
use scans::{Cloud, Object, Scanned};
use std::path::{Path, PathBuf};
use xtask::workspace::file_name;

#[derive(clap::Args)]
pub struct TradeArgs {
    /// Folder of meshes, as for gen-dataset; only the test meshes are scanned [default: built-in
    /// procedural shapes]
    #[arg(long, value_name = "DIR")]
    meshes: Option<PathBuf>,

    /// Name of the meshes in the record [default: the folder's name]
    #[arg(long, value_name = "TEXT", requires = "meshes")]
    meshes_name: Option<String>,

    /// Model that classifies the scans; it must know the meshes' classes [default: the bundled
    /// models that do]
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,

    /// Packed NPZ file of labelled clouds, on which models, samplers, numbers of points and
    /// precisions are compared [default: the scans themselves]
    #[arg(long, value_name = "NPZ")]
    clouds: Option<PathBuf>,

    /// Name of the clouds in the record [default: the file's name]
    #[arg(long, value_name = "TEXT", requires = "clouds")]
    clouds_name: Option<String>,

    /// Measure few meshes and few settings, and do not model a Raspberry Pi; this takes two minutes
    #[arg(long)]
    quick: bool,

    /// Number of times that all scans and classifications are measured; the medians are recorded
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u16).range(1..))]
    rounds: u16,

    /// Folder for trade.csv, trade.html and the charts
    #[arg(long, value_name = "DIR", default_value = "data/trade")]
    out: PathBuf,
}

/// Meshes of a class that a whole run scans at most.
const MOST_PER_CLASS: u32 = 5;

const FEW_PER_CLASS: u32 = 2;

const FEW_CLOUDS: usize = 100;

pub fn run(args: &TradeArgs) -> Result<Outcome> {
    need_folder_of_meshes(args.meshes.as_deref())?;
    let clouds = clouds(args)?;
    let of_clouds = clouds.as_ref().map(|set| models_for(args, set)).transpose()?;
    let per_class = if args.quick { FEW_PER_CLASS } else { MOST_PER_CLASS };
    let shapes = [gen_shapes::TRAIN_PER_CLASS, gen_shapes::TEST_PER_CLASS];
    let meshes = datasets::meshes(args.meshes.as_deref(), &args.out.join("shapes"), shapes)?;
    let objects = scans::read(&meshes, per_class)?;
    let unseen = vec![Cloud::new(); objects.len()];
    let of_scans = models_for(args, &scan_set(&objects, &name_of_meshes(args), &unseen))?;
    std::fs::create_dir_all(&args.out)
        .with_context(|| format!("cannot make {}", args.out.display()))?;
    let (mut rows, reference) = scan_rows(args, &objects, &of_scans[0])?;
    let models = of_clouds.unwrap_or(of_scans);
    rows.extend(classifier_rows(args, &models, clouds, reference)?);
    let Machine { cpu, threads, system, .. } = Machine::here();
    let cpu = cpu.as_deref().unwrap_or("unknown processor");
    let machine = format!("{cpu}, {threads} threads, {system}");
    rows.iter_mut().for_each(|row| row.machine.clone_from(&machine));
    pareto::mark(&mut rows);
    trade_record::write(&rows, &args.out.join("trade.csv"))?;
    page::write(&rows, &args.out)?;
    for part in [Part::Classifier, Part::Scan, Part::Caster] {
        print!("{}", page::pareto_table(&rows, part));
    }
    print!("{}", page::dominated_table(&rows));
    eprintln!("A page to look at: {}", args.out.join("trade.html").display());
    Ok(Outcome::Success)
}

fn name_of_meshes(args: &TradeArgs) -> String {
    let of_folder = || args.meshes.as_deref().map(file_name);
    let named = args.meshes_name.clone().or_else(of_folder);
    format!("scans of {}", named.as_deref().unwrap_or("shapes of our own"))
}

/// The models with the classes of `set`: that of `--model`, or bundled ones.
fn models_for(args: &TradeArgs, set: &TestSet) -> Result<Vec<PathBuf>> {
    if let Some(model) = &args.model {
        set.fits(model)?;
        return Ok(vec![model.clone()]);
    }
    let known = bundled(set)?;
    ensure!(
        !known.is_empty(),
        "no bundled model knows the classes of {}; name a model with --model",
        set.name
    );
    Ok(known)
}

fn clouds(args: &TradeArgs) -> Result<Option<TestSet>> {
    let Some(path) = &args.clouds else { return Ok(None) };
    let mut set = TestSet::read(path, if args.quick { FEW_CLOUDS } else { usize::MAX })?;
    set.name = args.clouds_name.clone().unwrap_or(set.name);
    Ok(Some(set))
}

fn scan_rows(
    args: &TradeArgs,
    objects: &[Object],
    model: &Path,
) -> Result<(Vec<Measurement>, TestSet)> {
    let (name, rounds) = (name_of_meshes(args), usize::from(args.rounds));
    let mut settings = sensors::one_at_a_time();
    if !args.quick {
        settings.extend(sensors::combinations());
    }
    let scanned = scans::scan_all(objects, &settings, rounds, &name)?;
    let cast = casters::cast_all(objects, &backends::open(None)?, rounds, &name)?;
    let reference = scan_set(objects, &name, &scanned[0].clouds);
    let (classifying, summary) = (Classifying::as_trained(model)?, inspect(model)?);
    // Scans are compared with the reference, casters with the first: f64.
    let noisy = classifying.answers(&reference.clouds)?;
    let exact = classifying.answers(&cast[0].clouds)?;
    let all = scanned.into_iter().chain(cast);
    let rows: Result<Vec<Measurement>> = all
        .map(|Scanned { row, clouds }| {
            let found = classifying.answers(&clouds)?;
            let answers = if row.part == Part::Caster { &exact } else { &noisy };
            let row = Measurement { agreement: Some(agreement(&found, answers)), ..row };
            let row = classifying.named_in(row, &summary);
            Ok(row.with_accuracy(reference.right(&found), clouds.len()))
        })
        .collect();
    Ok((rows?, reference))
}

fn scan_set(objects: &[Object], name: &str, clouds: &[Cloud]) -> TestSet {
    let views = clouds.len() / objects.len().max(1);
    let label = |object: &Object| vec![object.class.clone(); views];
    let labels = objects.iter().flat_map(label).collect();
    TestSet { name: name.to_owned(), clouds: clouds.to_vec(), labels }
}

fn classifier_rows(
    args: &TradeArgs,
    models: &[PathBuf],
    clouds: Option<TestSet>,
    reference: TestSet,
) -> Result<Vec<Measurement>> {
    let set = clouds.unwrap_or_else(|| {
        let clouds = reference.clouds.iter().map(|cloud| packed(cloud)).collect();
        TestSet { clouds, ..reference }
    });
    let rounds = usize::from(args.rounds);
    let rows = models.iter().map(|model| classifiers::rows(model, &set, args.quick, rounds));
    Ok(rows.collect::<Result<Vec<_>>>()?.concat())
}

/// As many points as gen-dataset packs, because the Raspberry Pi's model needs one size.
fn packed(cloud: &[[f32; 3]]) -> Cloud {
    const POINTS: usize = 1024;
    resample(cloud, POINTS, StreamKey::new(scans::SEED, "trade", 0)).unwrap_or_default()
}
