//! Plans: TOML files with the sizes of a study.

use anyhow::Context;
use serde::de::DeserializeOwned;
use std::path::Path;

pub trait Plan: DeserializeOwned {
    const FULL: &'static str;
    const QUICK: &'static str;

    fn check(&self) -> anyhow::Result<()>;
}

pub fn read<P: Plan>(path: Option<&Path>, quick: bool) -> anyhow::Result<P> {
    let (name, text) = match path {
        Some(path) => {
            let name = path.display().to_string();
            let text = std::fs::read_to_string(path);
            (name.clone(), text.with_context(|| format!("cannot read {name}"))?)
        }
        None if quick => ("quick.toml".to_owned(), P::QUICK.to_owned()),
        None => ("full.toml".to_owned(), P::FULL.to_owned()),
    };
    let plan: P = toml::from_str(&text).with_context(|| format!("{name}: not a valid plan"))?;
    plan.check().with_context(|| name)?;
    Ok(plan)
}
