//! `edgepuck card`: what a finished dataset is published with.

use crate::{Outcome, Usage};
use edgepuck_dataset::publish::{Publication, publish};
use std::path::PathBuf;

/// Flags of `card`.
#[derive(clap::Args)]
pub struct Args {
    /// Folder of a finished dataset
    #[arg(value_name = "DIR")]
    folder: PathBuf,

    /// Name of the dataset [default: the folder's]
    #[arg(long, value_name = "NAME")]
    name: Option<String>,

    /// Licence of the dataset, as an identifier of SPDX, such as CC-BY-4.0. It is yours to know: the
    /// scans derive from your meshes
    #[arg(long, value_name = "SPDX")]
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
    let own_name = || args.folder.canonicalize().ok()?.file_name()?.to_str().map(str::to_owned);
    let name = args.name.clone().or_else(own_name);
    let name = name.ok_or_else(|| Usage(format!("{}: expected a name", args.folder.display())))?;
    let Args { license, url, creator, published, .. } = args;
    let (license, url, creator) = (license.clone(), url.clone(), creator.clone());
    let publication = Publication { name, license, url, creator, published: published.clone() };
    for file in publish(&args.folder, &publication, args.overwrite)? {
        eprintln!("{}", file.display());
    }
    Ok(Outcome::Success)
}

/// A day, as ISO 8601 writes it.
fn day(text: &str) -> Result<String, String> {
    let is_of =
        |pattern: char, c: char| if pattern == '0' { c.is_ascii_digit() } else { c == pattern };
    let pattern = "0000-00-00";
    let is_day =
        text.len() == pattern.len() && pattern.chars().zip(text.chars()).all(|(p, c)| is_of(p, c));
    if is_day { Ok(text.to_owned()) } else { Err("expected a day such as 2026-11-25".to_owned()) }
}
