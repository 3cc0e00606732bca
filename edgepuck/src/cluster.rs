//! `edgepuck cluster`: prints a job file for making a dataset on many machines. The user reads and
//! submits it.

use crate::shell::posix_quoted;
use crate::{Outcome, Usage, gen_dataset};
use std::fmt::Write;

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

/// Flags of `cluster`.
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

    /// After `--`, the arguments of gen-dataset: the meshes, the output folder, which all tasks share,
    /// and the contents of the dataset
    #[arg(last = true, required = true, value_name = "WORDS")]
    words: Vec<String>,
}

/// Prints the job file.
pub fn run(args: &ClusterArgs) -> anyhow::Result<Outcome> {
    print!("{}", job_file(args)?);
    Ok(Outcome::Success)
}

fn job_file(args: &ClusterArgs) -> anyhow::Result<String> {
    let own = ["--shard", "--resume", "--overwrite", "--verify"];
    if let Some(word) = args.words.iter().find(|word| own.iter().any(|own| word.starts_with(own))) {
        return Err(Usage(format!("{word}: the job file sets this flag for each task")).into());
    }
    gen_dataset::check_words_of_tasks(&args.words)?;
    let words: Vec<String> = args.words.iter().map(|word| quoted(word)).collect();
    let command =
        format!("edgepuck gen-dataset {} --resume --shard auto/{}", words.join(" "), args.parts);
    Ok(match args.scheduler {
        Scheduler::Slurm => slurm(args, &command),
        Scheduler::Kubernetes => kubernetes(args, &command),
        Scheduler::Hyperqueue => hyperqueue(args, &command),
    })
}

fn slurm(ClusterArgs { parts, cpus, memory, hours, .. }: &ClusterArgs, command: &str) -> String {
    let last = parts - 1;
    format!(
        "#!/bin/bash
# A job array of Slurm: sbatch THIS_FILE. Interrupted tasks are queued again and resume.
#SBATCH --job-name=edgepuck
#SBATCH --array=0-{last}
#SBATCH --cpus-per-task={cpus}
#SBATCH --mem={memory}G
#SBATCH --time={hours}:00:00
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=edgepuck-%a.log
# A minute before the time limit, Slurm sends SIGTERM; the program ends and drops its unfinished tar.
#SBATCH --signal=TERM@60

export RAYON_NUM_THREADS=\"$SLURM_CPUS_PER_TASK\"
srun {command}
code=$?
case $code in
    0) ;;
    3) echo 'Done, except for the meshes above.' ;;
    75 | 143) scontrol requeue \"${{SLURM_ARRAY_JOB_ID}}_$SLURM_ARRAY_TASK_ID\" ;;
    *) exit $code ;;
esac
"
    )
}

fn hyperqueue(ClusterArgs { parts, cpus, .. }: &ClusterArgs, command: &str) -> String {
    let (last, task) = (parts - 1, quoted(&script(command)));
    format!(
        "#!/bin/sh
# A task array of HyperQueue: sh THIS_FILE, where a server runs and workers wait (`hq worker start`).
# A task that was terminated counts as failed. Submit this file again to resume; finished tars stay.
exec hq submit --name edgepuck --array 0-{last} --cpus {cpus} --crash-limit 20 -- sh -c {task}
"
    )
}

fn kubernetes(
    ClusterArgs { parts, cpus, memory, image, .. }: &ClusterArgs,
    command: &str,
) -> String {
    let mut lines = String::new();
    for line in script(command).lines() {
        writeln!(lines, "              {line}").expect("invariant: a string takes all");
    }
    let image = serde_json::Value::from(image.as_str());
    format!(
        "# An Indexed Job of Kubernetes: kubectl apply --filename THIS_FILE. The claim `edgepuck` is a volume
# that all pods may write, with the meshes and the output folder in /data.
apiVersion: batch/v1
kind: Job
metadata:
  name: edgepuck
spec:
  completionMode: Indexed
  completions: {parts}
  parallelism: {parts}
  backoffLimitPerIndex: 6
  podFailurePolicy:
    rules:
      # The eviction of a pod is not a failure.
      - action: Ignore
        onPodConditions:
          - type: DisruptionTarget
      # A wrong command line fails on every try.
      - action: FailJob
        onExitCodes:
          containerName: edgepuck
          operator: In
          values: [2]
  template:
    spec:
      restartPolicy: Never
      # The program ends within seconds of SIGTERM.
      terminationGracePeriodSeconds: 60
      containers:
        - name: edgepuck
          image: {image}
          workingDir: /data
          command:
            - sh
            - -c
            - |
{lines}          resources:
            requests: {{cpu: \"{cpus}\", memory: {memory}Gi}}
            limits: {{memory: {memory}Gi}}
          volumeMounts:
            - {{name: data, mountPath: /data}}
      volumes:
        - name: data
          persistentVolumeClaim: {{claimName: edgepuck}}
"
    )
}

/// A script that runs `command` and forwards SIGTERM to it. Refused meshes do not make it fail.
fn script(command: &str) -> String {
    format!(
        "{command} &
p=$!
trap 'kill -TERM \"$p\"' TERM
wait \"$p\"; code=$?
# A signal ends the first wait.
[ \"$code\" -le 128 ] || {{ wait \"$p\"; code=$?; }}
[ \"$code\" -ne 3 ] || code=0
exit \"$code\"
"
    )
}

/// `word` for a POSIX shell, quoted if necessary.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./,=:@+".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    posix_quoted(word)
}
