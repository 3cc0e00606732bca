//! The steps of a training, and the checks before the first.

use std::fs::{self, File, TryLockError};
use std::path::Path;

use formats::split::Split;
use formats::{FormatError, InvalidValue, atomic};

use crate::batches;
use crate::clouds::Clouds;
use crate::error::Error;
use crate::job::{Job, Progress};
use crate::recipe::Recipe;
use crate::run::Run;

impl Job<'_> {
    /// Trains, continuing an interrupted run, and writes the model. At the end, measures the model
    /// on the clouds at `test` and returns the accuracy as a line of text. Calls `report` as the
    /// run goes on.
    pub fn run(
        self,
        test: Option<&Path>,
        report: &mut dyn FnMut(Progress<'_>),
    ) -> Result<Option<String>, Error> {
        let Job { recipe, clouds: all, data, out, .. } = &self;
        recipe.check()?;
        check(all, recipe, data)?;
        let (clouds, held) = all.split_validation(recipe.validation, recipe.seed);
        if batches::count(clouds.len(), recipe) == 0 {
            let (batch, n) = (recipe.batch, clouds.len());
            let cause = format!("expected a batch of {batch} clouds to learn from, found {n}");
            return Err(Error::data(*data, cause + ": set a smaller `batch` in the recipe"));
        }
        // A run ends with its test, which would fail after hours.
        let test = test.map(|path| test_clouds(path, all, &self)).transpose()?;
        let folder = out.with_extension("run");
        fs::create_dir_all(&folder).map_err(|source| FormatError::io(&folder, source))?;
        let _lock = lock(&folder)?;
        atomic::sweep_leftovers(&folder)?;
        let mut run = Run::open(folder, &self, &clouds, report)?;
        while run.trainer.epoch < recipe.epochs {
            run.epoch(&clouds, &held)?;
        }
        run.finish(&self, test.as_ref(), &clouds, &held)
    }
}

/// The clouds at `path`, on which the finished network is measured.
fn test_clouds<'a>(
    path: &'a Path,
    all: &Clouds,
    Job { recipe, data, .. }: &Job<'_>,
) -> Result<(&'a Path, Clouds), Error> {
    let clouds = Clouds::read(recipe.normalization, path, Split::Test)?;
    if clouds.classes != all.classes {
        let cause = format!("expected the classes of {data}, found {:?}", clouds.classes);
        return Err(Error::data(path, cause));
    }
    Ok((path, clouds))
}

/// Locks the run's `folder` until the returned file is dropped, or the process ends.
fn lock(folder: &Path) -> Result<File, Error> {
    // The file stays: if it were removed, two processes could hold locks on two files of its name.
    let path = folder.join("lock");
    let file = File::options().create(true).truncate(false).write(true).open(&path);
    let file = file.map_err(|source| FormatError::io(&path, source))?;
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => Err(Error::data(
            folder,
            "expected the folder of a run that no other process trains, found another `train` in \
             it: wait until that ends, or choose another --out",
        )),
        // Some network file systems have no locks.
        Ok(()) | Err(TryLockError::Error(_)) => Ok(file),
    }
}

/// Checks that a network for `recipe` can be trained on `clouds`.
fn check(clouds: &Clouds, recipe: &Recipe, data: &str) -> Result<(), Error> {
    let n_points = clouds.set.smallest_cloud();
    let refuse = |cause: String| Err(Error::data(data, cause));
    // A cluster in metres may have any number of points.
    if !recipe.normalization.is_metric() && n_points < recipe.points {
        let wanted = recipe.points;
        return refuse(format!(
            "expected clouds of {wanted} points or more, found {n_points}: give at most {n_points} \
             by --points, or a recipe for clusters, such as --recipe street-128"
        ));
    }
    if clouds.classes.len() < 2 {
        return refuse("expected two classes or more, found one".to_owned());
    }
    let missing = (0..clouds.classes.len()).find(|class| !clouds.set.labels.contains(class));
    if let Some(class) = missing {
        let name = &clouds.classes[class];
        let way = if recipe.normalization.is_metric() {
            "more --sweeps of gen-scenes, or a recipe that places it, give some"
        } else {
            "make the data with a mesh of it in the train split, or with a smaller --min-points"
        };
        return refuse(format!("expected clouds of every class, found none of {name}: {way}"));
    }
    let lacks = |name: &&String| !clouds.classes.contains(name);
    if let Some(name) = recipe.unknown.iter().find(lacks) {
        let cause = format!("expected some of the classes {:?}, found `{name}`", clouds.classes);
        return Err(InvalidValue::new("unknown", cause).into());
    }
    Ok(())
}
