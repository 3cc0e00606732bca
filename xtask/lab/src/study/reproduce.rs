//! `cargo xtask reproduce`: makes the datasets that the paper's experiments
//! need and hands them to `train`, which runs the experiments.

use anyhow::{Context, bail};
use edgepuck_program::flags::need_folder_of_meshes;
use edgepuck_program::{Outcome, trainer as train};
use formats::atomic;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::SystemTime;
use xtask::workspace;
use xtask::workspace::command_line;

/// Flags of `reproduce`.
#[derive(clap::Args)]
pub struct Args {
    /// ModelNet40's clouds, as `train --data` takes them [default: points of the meshes' surfaces]
    #[arg(long, value_name = "PATH")]
    clouds: Option<PathBuf>,

    /// What the report calls them [default: their path]
    #[arg(long, value_name = "TEXT", requires = "clouds")]
    clouds_name: Option<String>,

    /// A folder of meshes, as gen-dataset takes it [default: shapes of our own]
    #[arg(long, value_name = "DIR")]
    meshes: Option<PathBuf>,

    /// What the report calls those [default: their path]
    #[arg(long, value_name = "TEXT", requires = "meshes")]
    meshes_name: Option<String>,

    /// A subset, in ten minutes on two cores
    #[arg(long, conflicts_with = "plan")]
    quick: bool,

    /// Sizes of the experiments, as the files in assets/reproduce
    #[arg(long, value_name = "TOML")]
    plan: Option<PathBuf>,

    /// Where the report goes, with all that it is made from; a run goes on from what is there
    #[arg(long, value_name = "DIR", default_value = "data/reproduce")]
    out: PathBuf,
}

/// Noise of the datasets besides gen-dataset's default, metres.
const SIGMAS: [&str; 3] = ["0.02", "0.05", "0.1"];

/// Runs the experiments.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    need_folder_of_meshes(args.meshes.as_deref())?;
    let scans = args.out.join("data");
    let meshes = match &args.meshes {
        Some(folder) => folder.clone(),
        None => {
            let folder = scans.join("shapes");
            run_edgepuck(&["gen-shapes"], &[("--out", &folder)], &folder.join("vase"))?;
            folder
        }
    };
    make_datasets(&meshes, &scans)?;
    let meshes_are = match &args.meshes {
        Some(folder) => named(args.meshes_name.as_ref(), "meshes of", folder),
        None => "shapes of our own".to_owned(),
    };
    let surfaces = scans.join("surfaces/surface");
    let (clouds, clouds_are) = match &args.clouds {
        Some(path) => (path.clone(), named(args.clouds_name.as_ref(), "clouds of", path)),
        None => (surfaces, format!("surface points of {meshes_are}, in place of ModelNet40's")),
    };
    let mut flags: Vec<OsString> = vec![
        "--clouds".into(),
        clouds.into(),
        "--clouds-are".into(),
        clouds_are.into(),
        "--scans".into(),
        scans.into(),
        "--meshes-are".into(),
        meshes_are.into(),
        "--out".into(),
        args.out.clone().into(),
        "--command".into(),
        command_line().into(),
    ];
    if let Some(plan) = &args.plan {
        flags.extend(["--plan".into(), plan.clone().into()]);
    }
    if args.quick {
        flags.push("--quick".into());
    }
    train::run("reproduce", &train::Args::from(flags))
}

fn named(name: Option<&String>, what: &str, path: &Path) -> String {
    name.cloned().unwrap_or_else(|| format!("{what} {}", path.display()))
}

/// Everything that is not there yet: a finished dataset is left as it is.
fn make_datasets(meshes: &Path, scans: &Path) -> anyhow::Result<()> {
    keep_source(meshes, scans)?;
    let surfaces = scans.join("surfaces");
    let last = surfaces.join("seen-test.npz");
    if !last.is_file() {
        run_edgepuck(&["sample-surfaces"], &[("", meshes), ("--out", &surfaces)], &last)?;
    }
    let gen_dataset = ["gen-dataset", "--resume", "--min-points", "16"];
    let out = scans.join("lidar");
    run_edgepuck(&gen_dataset, &[("", meshes), ("--out", &out)], &out.join("manifest.json"))?;
    for sigma in SIGMAS {
        let more = ["--sensor", "vlp32c", "--noise", sigma];
        let out = scans.join(format!("noise-{sigma}"));
        let words = [&gen_dataset[..], &more[..]].concat();
        run_edgepuck(&words, &[("", meshes), ("--out", &out)], &out.join("manifest.json"))?;
    }
    Ok(())
}

/// Notes which meshes the datasets in `scans` are of, and refuses others.
fn keep_source(meshes: &Path, scans: &Path) -> anyhow::Result<()> {
    let path = scans.join("meshes.txt");
    let source = meshes.canonicalize()?.display().to_string();
    match std::fs::read_to_string(&path) {
        Ok(earlier) if earlier == source => Ok(()),
        Ok(earlier) => bail!("{}: made of {earlier}; choose another --out", scans.display()),
        Err(_) => Ok(atomic::write_bytes(&path, &source)?),
    }
}

/// Runs a command of the program `edgepuck`, which writes `last` at its end. One
/// that left some inputs out, and named them, has it written all the same.
fn run_edgepuck(words: &[&str], paths: &[(&str, &Path)], last: &Path) -> anyhow::Result<()> {
    let mut command = workspace::cargo_command();
    command.args(["run", "--release", "--package", "edgepuck", "--manifest-path"]);
    command.arg(workspace::root().join("Cargo.toml")).arg("--").args(words);
    for (flag, path) in paths {
        if !flag.is_empty() {
            command.arg(flag);
        }
        command.arg(path);
    }
    eprintln!("== {}", workspace::words(&command));
    let begun = SystemTime::now();
    let status = command.status().with_context(|| format!("cannot run {}", words[0]))?;
    let some_left_out = status.code() == Some(1) && is_new(last, begun);
    if !(status.success() || some_left_out) {
        bail!("{} failed ({status})", words[0]);
    }
    Ok(())
}

/// Whether `path` was written since `begun`.
fn is_new(path: &Path, begun: SystemTime) -> bool {
    path.metadata().and_then(|data| data.modified()).is_ok_and(|written| written >= begun)
}
