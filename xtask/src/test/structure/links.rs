//! Links of Markdown files to other files of the repository.

use anyhow::Context;
use std::fs;
use std::path::Path;
use xtask::workspace::{output, root};

/// The links of tracked Markdown files that lead to no file, and the pages of `docs` that its list
/// of contents leaves out.
pub fn broken() -> anyhow::Result<Vec<String>> {
    let mut git = std::process::Command::new("git");
    let files = output(git.args(["ls-files", "*.md"]).current_dir(root()))?;
    let mut faults = Vec::new();
    for file in files.lines() {
        let text = fs::read_to_string(root().join(file)).with_context(|| file.to_owned())?;
        let folder = Path::new(file).parent().unwrap_or(Path::new(""));
        let missing = targets(&text).filter(|target| !root().join(folder).join(target).exists());
        faults.extend(missing.map(|target| format!("{file} links to {target}, which is missing")));
        if let Some(page) = file.strip_prefix("docs/src/").filter(|page| *page != "SUMMARY.md") {
            let contents = fs::read_to_string(root().join("docs/src/SUMMARY.md"))?;
            if !targets(&contents).any(|listed| listed == page) {
                faults.push(format!("docs/src/SUMMARY.md leaves out {page}"));
            }
        }
    }
    Ok(faults)
}

/// The files that `[text](file#section)` names, without those of other sites and code.
fn targets(text: &str) -> impl Iterator<Item = &str> {
    let prose = text.split("```").step_by(2);
    let links = prose.flat_map(|prose| prose.split("](").skip(1));
    let targets = links.filter_map(|rest| rest.split([')', '#', ' ']).next());
    targets.filter(|target| !target.is_empty() && !target.contains("://"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_to_files_are_found_outside_of_code() {
        let text =
            "[a](b.md#c), ![d](e/f.png) and [g](https://h) [i](#j)\n```sh\n[k](l)\n```\n[m](n)";
        assert_eq!(targets(text).collect::<Vec<_>>(), ["b.md", "e/f.png", "n"]);
    }
}
