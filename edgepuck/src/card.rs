use crate::Outcome;
use crate::flags::dataset_folder;
use anyhow::Context;
use edgepuck_dataset::{Publication, publish};
use std::path::PathBuf;

#[derive(Clone, clap::Args)]
pub struct CardArgs {
    /// Folder of a finished dataset
    #[arg(value_name = "DIR")]
    folder: PathBuf,

    /// Name of the dataset [default: the folder's]
    #[arg(long, value_name = "NAME")]
    name: Option<String>,

    /// Licence of the dataset, an SPDX identifier such as CC-BY-4.0. It depends on the licence of
    /// your meshes, from which the scans derive
    #[arg(long, value_name = "SPDX", value_parser = license)]
    license: Option<String>,

    /// Address at which the dataset will be published
    #[arg(long, value_name = "URL")]
    url: Option<String>,

    /// Creator of the dataset
    #[arg(long, value_name = "NAME")]
    creator: Option<String>,

    /// Date of publication
    #[arg(long, value_name = "YYYY-MM-DD", value_parser = day)]
    published: Option<String>,

    /// Replace an existing card and metadata
    #[arg(long)]
    overwrite: bool,
}

pub fn run(args: &CardArgs) -> anyhow::Result<Outcome> {
    let CardArgs { folder, name, license, url, creator, published, overwrite } = args.clone();
    let folder = dataset_folder(&folder);
    let full = folder.canonicalize().with_context(|| folder.display().to_string())?;
    let own_name = || full.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let name = name.unwrap_or_else(own_name);
    let publication = Publication { name, license, url, creator, published };
    for file in publish(folder, &publication, overwrite)? {
        formats::say!("{}", file.display());
    }
    Ok(Outcome::Success)
}

/// Parses an SPDX identifier, <https://spdx.org/licenses/>.
fn license(text: &str) -> Result<String, String> {
    let is_id = |c: char| c.is_ascii_alphanumeric() || "-.+".contains(c);
    match !text.is_empty() && text.chars().all(is_id) {
        true => Ok(text.to_owned()),
        false => Err("expected an identifier of SPDX such as CC-BY-4.0".to_owned()),
    }
}

/// Parses a date in the form of ISO 8601.
fn day(text: &str) -> Result<String, String> {
    let numbers: Vec<u32> = text.split('-').filter_map(|part| part.parse().ok()).collect();
    let is_written = |year: u32, month: u32, day: u32| {
        (1..=12).contains(&month)
            && (1..=31).contains(&day)
            && text == format!("{year:04}-{month:02}-{day:02}")
    };
    match numbers[..] {
        [year, month, day] if is_written(year, month, day) => Ok(text.to_owned()),
        _ => Err("expected a day such as 2026-11-25".to_owned()),
    }
}
