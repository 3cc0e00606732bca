//! `gen-dataset --card`: describes a finished dataset for those who look for one.

use crate::Outcome;
use crate::flags::dataset_folder;
use anyhow::Context;
use edgepuck_dataset::{Publication, publish};
use program::outputs::Overwrite;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
#[command(next_help_heading = "The card of a finished dataset")]
pub struct CardArgs {
    /// Only write a card (README.md) and Croissant metadata for publishing the finished dataset
    #[arg(long, value_name = "DIR", hide_short_help = true,
          conflicts_with_all = ["meshes", "out", "resume", "shard"])]
    pub card: Option<PathBuf>,

    /// Name of the dataset [default: the folder's]
    #[arg(long, value_name = "NAME", requires = "card", hide_short_help = true)]
    name: Option<String>,

    /// Licence of the dataset, an SPDX identifier such as CC-BY-4.0. It depends on the licence of
    /// your meshes, from which the scans derive
    #[arg(long, value_name = "SPDX", requires = "card", hide_short_help = true, value_parser = license)]
    license: Option<String>,

    /// Address at which the dataset will be published
    #[arg(long, value_name = "URL", requires = "card", hide_short_help = true)]
    url: Option<String>,

    /// Creator of the dataset
    #[arg(long, value_name = "NAME", requires = "card", hide_short_help = true)]
    creator: Option<String>,

    /// Date of publication
    #[arg(long, value_name = "YYYY-MM-DD", requires = "card", hide_short_help = true, value_parser = day)]
    published: Option<String>,
}

impl CardArgs {
    /// Writes the card of the dataset in `folder`.
    pub fn write(&self, folder: &Path, overwrite: bool) -> anyhow::Result<Outcome> {
        let folder = dataset_folder(folder);
        let full = folder.canonicalize().with_context(|| folder.display().to_string())?;
        let own_name = || full.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let publication = Publication {
            name: self.name.clone().unwrap_or_else(own_name),
            license: self.license.clone(),
            url: self.url.clone(),
            creator: self.creator.clone(),
            published: self.published.clone(),
        };
        let files = ["README.md", "croissant.json"].map(|name| folder.join(name));
        Overwrite::of(overwrite).check(files.iter().map(PathBuf::as_path))?;
        if self.license.is_none() {
            program::say!(
                "warning: the card names no licence, without which nobody may use the data: --license \
                 CC-BY-4.0, say"
            );
        }
        for file in publish(folder, &publication, overwrite)? {
            program::say!("{}", file.display());
        }
        Ok(Outcome::Success)
    }
}

/// Parses an SPDX identifier, <https://spdx.org/licenses/>.
fn license(text: &str) -> Result<String, &'static str> {
    let is_id = |c: char| c.is_ascii_alphanumeric() || "-.+".contains(c);
    let is_one = !text.is_empty() && text.chars().all(is_id);
    is_one.then(|| text.to_owned()).ok_or("expected an identifier of SPDX such as CC-BY-4.0")
}

/// Parses a date in the form of ISO 8601, which TOML's dates have.
fn day(text: &str) -> Result<String, &'static str> {
    let is_day = |it: &toml::value::Datetime| it.date.is_some() && it.time.is_none();
    let day = text.parse().ok().filter(is_day);
    day.map(|_| text.to_owned()).ok_or("expected a day such as 2026-11-25")
}
