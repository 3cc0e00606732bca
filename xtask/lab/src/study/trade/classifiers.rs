//! Models, samplers, points, precisions, T-Nets and threads on one test set.

use super::classes::{Answers, Classifying, TestSet};
use crate::measure::clock::Spread;
use crate::pi5::{Modelled, Sampler};
use anyhow::{Context, Result};
use edgepuck_program::sampler_config::SamplerConfig;
use edgepuck_program::trade_record::Measurement;
use infer_cpu::{Precision, Summary, TNets, inspect};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Threads whose times on a Raspberry Pi 5 are modelled: it has four cores.
const PI_THREADS: [usize; 3] = [1, 2, 4];

struct Sweep {
    points: Vec<usize>,
    samplers: Vec<SamplerConfig>,
    /// Precisions besides fp32.
    precisions: Vec<Precision>,
    /// Threads of the network as its card has it, besides one.
    threads: Vec<usize>,
}

impl Sweep {
    fn whole() -> Self {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        Self {
            points: vec![16, 64, 256, 1024],
            samplers: SamplerConfig::ALL.to_vec(),
            precisions: vec![Precision::F32Fc16, Precision::F16, Precision::I8],
            threads: (2..=threads.min(4)).collect(),
        }
    }

    fn quick() -> Self {
        Self {
            points: vec![16, 64],
            samplers: vec![SamplerConfig::RANDOM, SamplerConfig::FPS],
            precisions: vec![Precision::I8],
            threads: Vec::new(),
        }
    }
}

/// Rows of one parameter at a time, then of combinations of the promising ones, for
/// `model` on `set`, with modelled times of a Raspberry Pi 5 unless the run is `quick`;
/// what the model or the clouds do not allow is left out.
pub fn rows(model: &Path, set: &TestSet, quick: bool, rounds: usize) -> Result<Vec<Measurement>> {
    let sweep = if quick { Sweep::quick() } else { Sweep::whole() };
    let say = |error: &anyhow::Error| eprintln!("No modelled times of a Raspberry Pi: {error:#}");
    let pi = if quick { None } else { Modelled::open(model).inspect_err(say).ok() };
    let (trained, summary) = (Classifying::as_trained(model)?, inspect(model)?);
    let measured = |setting: Classifying, answers: Answers, reference: Option<&Answers>| {
        let mut row = setting.row(set, &summary, &answers, reference.unwrap_or(&answers));
        row.knob = varied(&setting, &trained);
        eprintln!("{row}: {:.1} %", 100.0 * row.accuracy);
        Measured { setting, answers, row }
    };
    let mut first: Vec<Measured> = Vec::new();
    for setting in sampled(&trained, set, &sweep) {
        let answers = setting.answers(&set.clouds)?;
        first.push(measured(setting, answers, None));
    }
    let more: Vec<Measured> = promising(&first, &trained)
        .flat_map(|sampled| with_precisions(&sampled.setting, &trained, &sweep, &summary))
        .map(|setting| {
            let reference = first.iter().find(|sampled| sampled.setting.chooses_as(&setting));
            let answers = setting.answers(&set.clouds)?;
            Ok(measured(setting, answers, reference.map(|reference| &reference.answers)))
        })
        .collect::<Result<_>>()?;
    let mut all: Vec<Measured> = first.into_iter().chain(more).collect();
    time(&mut all, set, rounds)?;
    let from = set.most_points();
    let with_pi =
        |Measured { setting, row, .. }: Measured| with_pi(row, &setting, from, pi.as_ref());
    let rows: Vec<Vec<Measurement>> = all.into_par_iter().map(with_pi).collect();
    Ok(rows.concat())
}

struct Measured {
    setting: Classifying,
    answers: Answers,
    row: Measurement,
}

/// Times all settings in turns, so that a slow minute affects them all.
fn time(all: &mut [Measured], set: &TestSet, rounds: usize) -> Result<()> {
    let mut times = vec![Vec::new(); all.len()];
    for _ in 0..rounds {
        for (measured, ms) in all.iter().zip(&mut times) {
            measured.setting.time(&set.clouds, ms)?;
        }
    }
    for (Measured { row, .. }, ms) in all.iter_mut().zip(times) {
        row.ms_here = (!ms.is_empty()).then(|| Spread::of(ms).median);
    }
    Ok(())
}

/// The samplings that are measured in every precision: those with the model's own
/// sampler or its number of points, and those that are more accurate than every other
/// with as few points.
fn promising<'a>(
    all: &'a [Measured],
    trained: &'a Classifying,
) -> impl Iterator<Item = &'a Measured> {
    all.iter().filter(move |sampled| {
        let beaten = |other: &Measured| {
            other.setting.points <= sampled.setting.points && other.row.right > sampled.row.right
        };
        sampled.setting.sampler == trained.sampler
            || sampled.setting.points == trained.points
            || !all.iter().any(beaten)
    })
}

/// The row with its modelled time on a Raspberry Pi 5, and rows for the board's
/// other numbers of threads: answers do not depend on them.
fn with_pi(
    row: Measurement,
    setting: &Classifying,
    from: usize,
    pi: Option<&Modelled>,
) -> Vec<Measurement> {
    let Some(ms) = pi_ms(setting, from, pi) else { return vec![row] };
    if setting.threads != 1 {
        return vec![row];
    }
    let on_board = |(&threads, ms): (&usize, f64)| {
        let here = threads == setting.threads;
        Measurement {
            threads: Some(threads),
            ms_here: row.ms_here.filter(|_| here),
            ms_pi5: Some(ms),
            ..row.clone()
        }
    };
    PI_THREADS.iter().zip(ms).map(on_board).collect()
}

/// Every sampler and number of points, in fp32 on one thread.
fn sampled(trained: &Classifying, set: &TestSet, sweep: &Sweep) -> Vec<Classifying> {
    let most = set.most_points();
    let mut all = Vec::new();
    for &sampler in &sweep.samplers {
        let points = sweep.points.iter().copied().filter(|&points| points <= most);
        all.extend(points.map(|points| Classifying { sampler, points, ..trained.clone() }));
    }
    // All samplers keep the same points if they keep all.
    all.retain(|setting| setting.points < most || setting.sampler == SamplerConfig::RANDOM);
    if trained.points < most && !all.iter().any(|setting| setting.chooses_as(trained)) {
        all.insert(0, trained.clone());
    }
    // The model may lack what a sampler needs.
    all.retain(|setting| {
        let (name, points) = (setting.sampler.name, setting.points);
        let say = |error: &anyhow::Error| eprintln!("left out: {name} {points}: {error:#}");
        setting.load(most).inspect_err(say).is_ok()
    });
    all
}

/// One way to choose points in every precision but fp32; as trained, also with
/// other threads and without T-Nets.
fn with_precisions(
    samples: &Classifying,
    trained: &Classifying,
    sweep: &Sweep,
    summary: &Summary,
) -> Vec<Classifying> {
    let precise = |&precision: &Precision| Classifying { precision, ..samples.clone() };
    let mut all: Vec<Classifying> = sweep.precisions.iter().map(precise).collect();
    if samples.chooses_as(trained) {
        let threads = sweep.threads.iter();
        all.extend(threads.map(|&threads| Classifying { threads, ..samples.clone() }));
        if summary.stn.is_some() || summary.fstn.is_some() {
            all.push(Classifying { t_nets: TNets::Neither, ..samples.clone() });
        }
    }
    all
}

/// The parameters in which `setting` differs from `trained`.
fn varied(setting: &Classifying, trained: &Classifying) -> String {
    let differ = [
        ("sampler", setting.sampler != trained.sampler),
        ("points", setting.points != trained.points),
        ("precision", setting.precision != trained.precision),
        ("T-Nets", setting.t_nets != trained.t_nets),
        ("threads", setting.threads != trained.threads),
    ];
    let names: Vec<&str> = differ.iter().filter(|(_, is)| *is).map(|(name, _)| *name).collect();
    if names.is_empty() { "reference".to_owned() } else { names.join(" and ") }
}

/// Modelled milliseconds for each of [`PI_THREADS`]; `None` for what is not
/// modelled: the number of points that voxels leave is not known beforehand.
fn pi_ms(setting: &Classifying, from: usize, pi: Option<&Modelled>) -> Option<Vec<f64>> {
    let (Some(pi), TNets::Both) = (pi, setting.t_nets) else { return None };
    // Tiles of the model are of eight rows.
    if !setting.points.is_multiple_of(8) || !from.is_multiple_of(8) {
        return None;
    }
    let sampler = match setting.sampler {
        _ if setting.points == from => Sampler::All,
        SamplerConfig::RANDOM => Sampler::Random,
        SamplerConfig::FPS => Sampler::Fps,
        SamplerConfig::CPL => Sampler::Cpl,
        SamplerConfig::CPL_STN => Sampler::CplStn,
        _ => return None,
    };
    let ms = pi.total_ms(sampler, (from, setting.points), setting.precision, &PI_THREADS);
    // A front end of few channels keeps fewer points than it is asked for.
    ms.inspect_err(|error| {
        let (name, points) = (setting.sampler.name, setting.points);
        eprintln!("not modelled: {name} {points} in {}: {error:#}", setting.precision);
    })
    .unwrap_or_default()
}

/// The bundled models with all classes of `set` and the fewest classes in all.
pub fn bundled(set: &TestSet) -> Result<Vec<PathBuf>> {
    let folder = xtask::workspace::root().join("assets/weights");
    let entries =
        std::fs::read_dir(&folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let files = entries.flatten().map(|entry| entry.path());
    let with_classes = |path: PathBuf| {
        let card = inspect(&path).ok()?.card;
        (card.trained && set.fits(&path).is_ok()).then_some((card.classes.len(), path))
    };
    let is_model = |path: &PathBuf| path.extension().is_some_and(|end| end == "safetensors");
    let mut models: Vec<(usize, PathBuf)> =
        files.filter(is_model).filter_map(with_classes).collect();
    models.sort();
    let fewest = models.first().map_or(0, |(classes, _)| *classes);
    Ok(models.into_iter().filter(|(n, _)| *n == fewest).map(|(_, path)| path).collect())
}
