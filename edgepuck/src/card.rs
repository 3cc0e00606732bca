//! `edgepuck card`: what a finished dataset is published with.

use crate::Outcome;
use anyhow::Context;
use edgepuck_dataset::publish::{Publication, publish};
use std::path::PathBuf;

/// Flags of `card`.
#[derive(Clone, clap::Args)]
pub struct Args {
    /// Folder of a finished dataset
    #[arg(value_name = "DIR")]
    folder: PathBuf,

    /// Name of the dataset [default: the folder's]
    #[arg(long, value_name = "NAME")]
    name: Option<String>,

    /// Licence of the dataset, as an identifier of SPDX, such as CC-BY-4.0. It is yours to know: the
    /// scans derive from your meshes
    #[arg(long, value_name = "SPDX", value_parser = license)]
    license: Option<String>,

    /// Address where the dataset will be found
    #[arg(long, value_name = "URL")]
    url: Option<String>,

    /// Who made the dataset
    #[arg(long, value_name = "NAME")]
    creator: Option<String>,

    /// Day of publication
    #[arg(long, value_name = "YYYY-MM-DD", value_parser = day)]
    published: Option<String>,

    /// Replace a card and metadata that are there
    #[arg(long)]
    overwrite: bool,
}

/// Writes the card and the metadata.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let Args { folder, name, license, url, creator, published, overwrite } = args.clone();
    let full = folder.canonicalize().with_context(|| folder.display().to_string())?;
    let own_name = || full.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let name = name.unwrap_or_else(own_name);
    let publication = Publication { name, license, url, creator, published };
    for file in publish(&folder, &publication, overwrite)? {
        eprintln!("{}", file.display());
    }
    Ok(Outcome::Success)
}

/// An identifier of SPDX, <https://spdx.org/licenses/>.
fn license(text: &str) -> Result<String, String> {
    let is_id = |c: char| c.is_ascii_alphanumeric() || "-.+".contains(c);
    match !text.is_empty() && text.chars().all(is_id) {
        true => Ok(text.to_owned()),
        false => Err("expected an identifier of SPDX such as CC-BY-4.0".to_owned()),
    }
}

/// A day, as ISO 8601 writes it.
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
