//! `cluster`: job files that the schedulers can read, with the right tasks.

use crate::Folder;
use std::process::{Command, Stdio};
use std::{fs, io::Write};

const WORDS: &str = "--parts 3 -- meshes --layout webdataset --sensor vlp32c --out out";

fn job_file(folder: &Folder, scheduler: &str, words: &str) -> String {
    folder.succeeds(&format!("cluster {scheduler} {words}"))
}

fn is_script(script: &str) -> bool {
    let mut shell = Command::new("sh").arg("-n").stdin(Stdio::piped()).spawn().unwrap();
    shell.stdin.take().unwrap().write_all(script.as_bytes()).unwrap();
    shell.wait().unwrap().success()
}

#[test]
fn each_scheduler_is_told_the_tasks_and_their_needs() {
    let folder = Folder::new();
    let words = WORDS;
    let slurm = job_file(&folder, "slurm", &format!("--cpus 8 --memory 6 --hours 2 {words}"));
    for part in ["--array=0-2", "--cpus-per-task=8", "--mem=6G", "--time=2:00:00"] {
        assert!(slurm.contains(part), "{part}: {slurm}");
    }
    let hyperqueue = job_file(&folder, "hyperqueue", words);
    assert!(hyperqueue.contains("--array 0-2 --cpus 4"), "{hyperqueue}");
    let kubernetes = job_file(&folder, "kubernetes", &format!("--image repo/e:1 {words}"));
    for part in ["completions: 3", "image: \"repo/e:1\"", "cpu: \"4\"", "memory: 4Gi"] {
        assert!(kubernetes.contains(part), "{part}: {kubernetes}");
    }
    for text in [&slurm, &hyperqueue, &kubernetes] {
        assert!(text.contains("--resume --shard auto/3"), "{text}");
    }
    assert!(is_script(&slurm) && is_script(&hyperqueue));
}

#[test]
fn words_that_the_job_file_settles_are_refused() {
    let folder = Folder::new();
    let cases = [
        (
            "cluster slurm --parts 3 -- meshes --layout webdataset --shard 1/3",
            "--shard: the job file sets",
        ),
        ("cluster slurm --parts 3 -- meshes --out o", "expected --layout webdataset"),
        ("cluster slurm --parts 3 -- --layout webdataset --out o", "expected the folder"),
        ("cluster slurm --parts 3 -- meshes --layout webdataset", "expected --out"),
        ("cluster slurm --parts 3 -- meshes --out o --sensr vlp32c", "'--sensr'"),
        (
            "cluster slurm --parts 3 -- meshes --out o --layout webdataset --help",
            "--help: tasks make",
        ),
        (
            "cluster slurm --parts 3 -- m --out o --layout webdataset --sensor vlp32c --simplify auto",
            "--simplify",
        ),
        ("cluster slurm --parts 0 -- meshes", "--parts"),
        ("cluster pbs --parts 3 -- meshes", "pbs"),
        ("cluster slurm --parts 3", "WORDS"),
    ];
    folder.refuses(2, &cases);
}

#[test]
#[cfg(unix)]
fn tasks_of_kubernetes_make_the_whole() {
    let folder = Folder::with_meshes();
    let words = "--parts 3 -- meshes --layout webdataset --sensor vlp32c --points 64 --views 2 \
                 --adapter cpu --tar-clouds 5 --out out";
    let file = job_file(&folder, "kubernetes", words);
    let lines = file.lines().skip_while(|line| !line.ends_with("- |")).skip(1);
    let script: Vec<&str> =
        lines.take_while(|line| line.starts_with("              ")).map(str::trim).collect();
    let program = env!("CARGO_BIN_EXE_edgepuck");
    let script = script.join("\n").replacen("edgepuck", program, 1);
    for index in 0..3 {
        let mut task = Command::new("sh");
        task.args(["-c", &script])
            .current_dir(folder.at(""))
            .env("JOB_COMPLETION_INDEX", index.to_string());
        let done = task.output().unwrap();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    }
    folder.succeeds("gen-dataset --verify out");
    assert!(fs::read_to_string(folder.at("out/dataset.json")).unwrap().contains("of-0003"));
}
