//! `edgepuck cluster`: prints a job file for making a dataset on many machines. The user reads and
//! submits it.

use crate::shell::posix_quoted;
use crate::{Outcome, Usage, gen_dataset};
use edgepuck_assets::{HYPERQUEUE_JOB, KUBERNETES_JOB, SLURM_JOB, TASK_SCRIPT};
use std::io::Write;

formats::named! {
    /// A program that runs tasks on a cluster.
    pub enum Scheduler: "scheduler" {
        /// A job array of Slurm.
        Slurm = "slurm",
        /// An Indexed Job of Kubernetes.
        Kubernetes = "kubernetes",
        /// A task array of HyperQueue.
        Hyperqueue = "hyperqueue",
    }
}

#[derive(clap::Args)]
pub struct ClusterArgs {
    /// Scheduler of the tasks: slurm, kubernetes or hyperqueue
    #[arg(value_name = "SCHEDULER")]
    scheduler: Scheduler,

    /// Number of tasks, each of which makes one part
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    parts: u32,

    /// Processors of each task
    #[arg(long, default_value_t = 4, value_name = "N",
          value_parser = clap::value_parser!(u32).range(1..=1024))]
    cpus: u32,

    /// Memory of each task, GiB
    #[arg(long, default_value_t = 4, value_name = "GIB",
          value_parser = clap::value_parser!(u32).range(1..=4096))]
    memory: u32,

    /// Longest time of each task, hours (Slurm)
    #[arg(long, default_value_t = 4, value_name = "H",
          value_parser = clap::value_parser!(u32).range(1..=8760))]
    hours: u32,

    /// Container image with the program (Kubernetes)
    #[arg(long, default_value = "edgepuck:latest", value_name = "IMAGE")]
    image: String,

    /// After `--`, the arguments of gen-dataset: the meshes, the output folder, which all tasks
    /// share, and the contents of the dataset
    #[arg(last = true, required = true, value_name = "WORDS")]
    words: Vec<String>,
}

pub fn run(args: &ClusterArgs) -> anyhow::Result<Outcome> {
    std::io::stdout().write_all(job_file(args)?.as_bytes())?;
    Ok(Outcome::Success)
}

fn job_file(args: &ClusterArgs) -> anyhow::Result<String> {
    let own = ["--shard", "--resume", "--overwrite", "--verify"];
    if let Some(word) = args.words.iter().find(|word| own.iter().any(|own| word.starts_with(own))) {
        return Err(Usage(format!("{word}: the job file sets this flag for each task")).into());
    }
    gen_dataset::check_words_of_tasks(&args.words)?;
    let ClusterArgs { parts, cpus, memory, hours, image, words, .. } = args;
    let words: Vec<String> = words.iter().map(|word| quoted(word)).collect();
    let command = format!("edgepuck gen-dataset {} --resume --shard auto/{parts}", words.join(" "));
    // Forwards SIGTERM to the command, and succeeds if only some meshes were refused.
    let script = TASK_SCRIPT.replace("{command}", &command);
    let (template, command) = match args.scheduler {
        Scheduler::Slurm => (SLURM_JOB, command),
        Scheduler::Kubernetes => {
            (KUBERNETES_JOB, script.trim_end().replace('\n', "\n              "))
        }
        Scheduler::Hyperqueue => (HYPERQUEUE_JOB, quoted(&script)),
    };
    let image = serde_json::Value::from(image.as_str());
    let numbers = [("parts", *parts), ("last", parts - 1), ("cpus", *cpus), ("memory", *memory)];
    let fill = |text: String, (key, number): (&str, u32)| {
        text.replace(&format!("{{{key}}}"), &number.to_string())
    };
    let text = numbers.into_iter().chain([("hours", *hours)]).fold(template.to_owned(), fill);
    // The command comes last, because it may contain keys in braces.
    Ok(text.replace("{image}", &image.to_string()).replace("{command}", &command))
}

/// `word` for a POSIX shell, quoted if necessary.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./,=:@+".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    posix_quoted(word)
}
