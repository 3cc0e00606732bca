//! A run from recipe to model, in a folder that it can be resumed from.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use formats::atomic;
use formats::model_card::ModelCard;
use formats::split::Split;
use indicatif::{ProgressBar, ProgressStyle};
use infer_cpu::Evaluation;
use infer_cpu::Options;
use train::checkpoint;
use train::clouds::Clouds;
use train::evaluate::confusion;
use train::recipe::{Recipe, Sampling};
use train::trainer::{Learnt, Trainer};
use train::{batches, model};

mod metrics;

use metrics::{Metrics, Row};

use crate::eval::MOST_POINTS;
use crate::report;

/// Flags of `train`.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// What to learn from: a packed NPZ; the beginning of the names of two, as
    /// `rotational-noisy` of rotational-noisy-train.npz and -test.npz; a folder
    /// with train.npz and test.npz, one of ModelNet40's HDF5 files, or one of
    /// text files as
    /// yanx27/Pointnet_Pointnet2_pytorch has them
    #[arg(long, value_name = "PATH")]
    data: PathBuf,
    /// What to report accuracy on, once, at the end [default: the test half of
    /// --data, where it has two]
    #[arg(long, value_name = "PATH")]
    test: Option<PathBuf>,
    /// The run as TOML; flags below go before it [default: the baseline's]
    #[arg(long, value_name = "TOML")]
    recipe: Option<PathBuf>,
    /// pointnet, or cpl: behind a Critical Points Layer [default: the recipe's]
    #[arg(long, value_name = "NAME", value_parser = ["pointnet", "cpl"])]
    arch: Option<String>,
    /// Points that the network sees, or its Critical Points Layer
    #[arg(long, value_name = "N")]
    points: Option<usize>,
    /// Widths of the Critical Points Layer's own front end, coordinates first
    #[arg(long, value_name = "3-W-W", value_parser = front_of)]
    front: Option<Front>,
    /// Points that it keeps
    #[arg(long, value_name = "M")]
    keep: Option<usize>,
    /// Passes over the training set
    #[arg(long, value_name = "N")]
    epochs: Option<u32>,
    /// What all random draws depend on
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// What the model's card calls the training set [default: the path]
    #[arg(long, value_name = "TEXT")]
    data_name: Option<String>,
    /// Where the model goes; the run's folder is beside it, with `.run` for an
    /// ending
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// Widths of a front end, without the coordinates'.
#[derive(Clone, Debug)]
struct Front(Vec<usize>);

fn front_of(word: &str) -> Result<Front, String> {
    let widths: Vec<usize> =
        word.split('-').map(str::parse).collect::<Result<_, _>>().map_err(|_| "no widths")?;
    match widths.split_first() {
        Some((3, widths)) if widths.len() >= 2 => Ok(Front(widths.to_vec())),
        _ => Err("widths like 3-64-128-1024 are meant, with 3 coordinates first".to_owned()),
    }
}

/// Does what `args` ask for, from wherever an earlier run was interrupted.
///
/// # Errors
/// Data, recipe or checkpoint that cannot be used, a loss that is not finite,
/// what the system reports.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let recipe = recipe(args)?;
    let clouds = Clouds::read(&args.data, Split::Train, points_to_read(&recipe))?;
    // One file is no two halves.
    let halves = (!args.data.is_file()).then(|| args.data.clone());
    let name = args.data.display().to_string();
    let data_name = args.data_name.as_ref().unwrap_or(&name);
    let test = args.test.clone().or(halves);
    let job = Job { recipe, clouds: &clouds, data: &name, data_name, out: &args.out };
    job.run(test.as_deref())?;
    println!("{}", args.out.display());
    Ok(())
}

/// What is to be learnt from what.
pub struct Job<'a> {
    /// How.
    pub recipe: Recipe,
    /// From what.
    pub clouds: &'a Clouds,
    /// Where that comes from, for errors.
    pub data: &'a str,
    /// What the model's card calls it.
    pub data_name: &'a str,
    /// Where the model goes; the run's folder is beside it.
    pub out: &'a Path,
}

impl Job<'_> {
    /// Learns, from wherever an earlier run was interrupted, and writes the
    /// model; `test` is read once, at the end.
    ///
    /// # Errors
    /// As [`run`].
    pub fn run(self, test: Option<&Path>) -> anyhow::Result<()> {
        let Job { recipe, clouds: all, data, out, .. } = &self;
        recipe.check()?;
        check(all, recipe, data)?;
        let (learnt, held) = all.split_validation(recipe.validation, recipe.seed);
        let (clouds, held) = (all.some(&learnt), all.some(&held));
        ensure!(
            batches::count(clouds.len(), recipe) > 0,
            "{data}: {} clouds to learn from, fewer than a batch of {}",
            clouds.len(),
            recipe.batch
        );
        let folder = out.with_extension("run");
        fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
        atomic::sweep_leftovers(&folder)?;
        let mut run = Run::open(folder, &self)?;
        while run.trainer.epoch < run.trainer.recipe.epochs {
            run.epoch(&clouds, &held)?;
        }
        run.finish(&self, test, &clouds)
    }
}

fn recipe(args: &Args) -> anyhow::Result<Recipe> {
    let mut recipe = match &args.recipe {
        Some(path) => Recipe::read(path)?,
        None => Recipe::default(),
    };
    match args.arch.as_deref() {
        Some("pointnet") => recipe.cpl = None,
        Some(_) => recipe.cpl = Some(recipe.cpl.unwrap_or_default()),
        None => {}
    }
    if let Some(cpl) = &mut recipe.cpl {
        if let Some(Front(widths)) = &args.front {
            cpl.front.clone_from(widths);
        }
        cpl.keep = args.keep.unwrap_or(cpl.keep);
    } else {
        ensure!(
            args.front.is_none() && args.keep.is_none(),
            "--front and --keep are for --arch cpl"
        );
    }
    recipe.points = args.points.unwrap_or(recipe.points);
    recipe.epochs = args.epochs.unwrap_or(recipe.epochs);
    recipe.seed = args.seed.unwrap_or(recipe.seed);
    recipe.check()?;
    Ok(recipe)
}

/// Points of a text file that are read: the baseline's loader takes the first
/// of them, other samplers and surroundings want all that there are.
fn points_to_read(recipe: &Recipe) -> usize {
    let is_baseline = recipe.sampling == Sampling::First && recipe.network.edges.is_empty();
    if is_baseline { recipe.points } else { MOST_POINTS }
}

fn check(clouds: &Clouds, recipe: &Recipe, data: &str) -> anyhow::Result<()> {
    let n_points = clouds.set.n_points;
    ensure!(
        n_points >= recipe.points,
        "{data}: clouds of {n_points} points; the recipe wants {}",
        recipe.points
    );
    ensure!(clouds.classes.len() > 1, "{data}: one class only");
    for (class, name) in clouds.classes.iter().enumerate() {
        ensure!(
            clouds.set.labels.contains(&class),
            "{data}: no cloud of class {class} ({name}) to learn from"
        );
    }
    Ok(())
}

/// A run and its folder.
struct Run {
    folder: PathBuf,
    trainer: Trainer,
    metrics: Metrics,
    classes: Vec<String>,
    training_set: String,
}

impl Run {
    fn open(folder: PathBuf, job: &Job<'_>) -> anyhow::Result<Self> {
        let classes = job.clouds.classes.clone();
        let mut trainer = Trainer::new(job.recipe.clone(), classes.len())?;
        let checkpoint = folder.join("checkpoint.safetensors");
        let metrics = if checkpoint.is_file() {
            let notes = checkpoint::read(&checkpoint, &mut trainer)?;
            eprintln!("going on after epoch {} of {}", trainer.epoch, trainer.recipe.epochs);
            Metrics::from_notes(&notes)?
        } else {
            Metrics::default()
        };
        let text = toml::to_string(&trainer.recipe)?;
        atomic::write_bytes(&folder.join("recipe.toml"), &text)?;
        let training_set = job.data_name.to_owned();
        Ok(Self { folder, trainer, metrics, classes, training_set })
    }

    fn epoch(&mut self, clouds: &Clouds, held: &Clouds) -> anyhow::Result<()> {
        let (epoch, epochs) = (self.trainer.epoch + 1, self.trainer.recipe.epochs);
        let bar = ProgressBar::new(batches::count(clouds.len(), &self.trainer.recipe) as u64);
        let template = "epoch {prefix} {bar:30} {pos}/{len} {msg} {eta} left";
        bar.set_style(ProgressStyle::with_template(template)?);
        bar.set_prefix(format!("{epoch}/{epochs}"));
        let learnt = self.trainer.learn(clouds, |progress| {
            bar.set_position(progress.step as u64);
            bar.set_message(format!(
                "loss {:.3}, {:.1} %",
                progress.loss,
                100.0 * progress.accuracy
            ));
        })?;
        bar.finish_and_clear();
        let current = self.folder.join("current.safetensors");
        let card = self.card(None);
        model::write(&current, &mut self.trainer.model, &card)?;
        let validated = if held.is_empty() {
            None
        } else {
            Some(confusion(&current, held, &Options::default())?)
        };
        self.note(epoch, &learnt, validated.as_ref());
        // With nothing to choose by, the last is the best.
        if validated.is_none() || self.metrics.is_best(epoch) {
            model::write(&self.folder.join("best.safetensors"), &mut self.trainer.model, &card)?;
        }
        self.metrics.write(&self.folder)?;
        let notes = self.metrics.to_notes()?;
        let path = self.folder.join("checkpoint.safetensors");
        Ok(checkpoint::write(&path, &mut self.trainer, &notes)?)
    }

    fn note(&mut self, epoch: u32, learnt: &Learnt, validated: Option<&Evaluation>) {
        let recipe = &self.trainer.recipe;
        let factor = recipe.schedule.factor(f64::from(epoch - 1), recipe.epochs);
        let row = Row {
            epoch,
            rate: recipe.adam.rate * factor,
            loss: learnt.loss,
            accuracy: learnt.accuracy,
            validation_instance: validated.map(Evaluation::instance_accuracy),
            validation_class: validated.map(|found| found.class_accuracy().0),
            seconds: learnt.time.as_secs_f64(),
            clouds_per_second: learnt.clouds as f64 / learnt.time.as_secs_f64(),
        };
        eprintln!("{row}");
        self.metrics.rows.push(row);
    }

    fn card(&self, accuracy: Option<String>) -> ModelCard {
        let recipe = &self.trainer.recipe;
        let (sampler, points) = match (&recipe.cpl, recipe.sampling) {
            (Some(cpl), _) => ("cpl", cpl.keep),
            (None, Sampling::First) => ("first", recipe.points),
            (None, Sampling::Random) => ("random", recipe.points),
            (None, Sampling::Fps) => ("fps", recipe.points),
        };
        ModelCard {
            classes: self.classes.clone(),
            sampler: Some(sampler.to_owned()),
            points: Some(points),
            edge_radii: recipe.network.edges.iter().map(|edge| edge.radius).collect(),
            training_set: Some(self.training_set.clone()),
            accuracy,
            provenance: Some(format!("edgepuck train, seed {}", recipe.seed)),
            ..ModelCard::default()
        }
    }

    /// Writes the best weights as they are shipped, and reads the test half,
    /// once, with those.
    fn finish(
        &mut self,
        job: &Job<'_>,
        test: Option<&Path>,
        clouds: &Clouds,
    ) -> anyhow::Result<()> {
        model::read(&self.folder.join("best.safetensors"), &mut self.trainer.model)?;
        let shipped = self.folder.join("shipped.safetensors");
        model::ship(&shipped, &self.trainer.model, &self.card(None))?;
        let accuracy = test.map(|path| self.test(&shipped, path, job.data)).transpose()?;
        let activation_ranges = infer_cpu::activation_ranges_of_set(&shipped, &clouds.set)?;
        let card = ModelCard { activation_ranges, ..self.card(accuracy) };
        model::ship(&shipped, &self.trainer.model, &card)?;
        // Whatever a kill leaves half-written lies in the run's folder, which
        // the next run sweeps.
        fs::rename(&shipped, job.out).with_context(|| format!("cannot write {}", job.out.display()))
    }

    fn test(&self, model: &Path, test: &Path, data: &str) -> anyhow::Result<String> {
        let clouds = Clouds::read(test, Split::Test, points_to_read(&self.trainer.recipe))?;
        ensure!(
            clouds.classes == self.classes,
            "{}: its classes are not those of {data}",
            test.display()
        );
        let found = confusion(model, &clouds, &Options::default())?;
        let line = report::line(&found, test);
        println!("{line}");
        Ok(line)
    }
}
