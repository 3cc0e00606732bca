use edgepuck_assets::CORRUPTIONS;
use edgepuck_dataset::ObjectCorruption;
use serde::Deserialize;
use sim_gpu::internals::config::{self, InvalidValue};
use sim_gpu::internals::corruption::Corruption;
use std::path::Path;

use crate::Usage;

/// The corruptions of sweeps and of objects, and those that are left out.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    #[serde(default)]
    pub sweep: Vec<Entry<Corruption>>,
    #[serde(default)]
    pub object: Vec<Entry<ObjectCorruption>>,
    #[serde(default)]
    pub left_out: Vec<LeftOut>,
}

/// A corruption.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry<T> {
    pub name: String,
    /// The physical cause.
    pub by: String,
    /// The parameters of each severity, beginning with severity 1, the mildest.
    pub severity: Vec<T>,
}

/// A corruption of another benchmark that is left out.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeftOut {
    pub name: String,
    /// The benchmark.
    pub of: String,
    pub because: String,
}

impl Plan {
    /// The plan in `file`, or the built-in one.
    pub fn read(file: Option<&Path>) -> anyhow::Result<Self> {
        let checked = |plan: Self| plan.check().map(|()| plan);
        Ok(match file {
            Some(file) => config::read(file, checked)?,
            None => config::parse(CORRUPTIONS, Path::new("corruptions.toml"), checked)?,
        })
    }

    fn check(&self) -> Result<(), InvalidValue> {
        check_all("sweep", &self.sweep, Corruption::validate)?;
        check_all("object", &self.object, ObjectCorruption::validate)
    }
}

/// Checks that the names of `entries` are valid and unique, and that their parameters are valid.
fn check_all<T>(
    kind: &str,
    entries: &[Entry<T>],
    validate: impl Fn(&T, &str) -> Result<(), InvalidValue>,
) -> Result<(), InvalidValue> {
    for (i, Entry { name, severity, .. }) in entries.iter().enumerate() {
        let wrong = |field: &str, cause: String| {
            Err(InvalidValue::new(format!("{kind}[{i}].{field}"), cause))
        };
        let is_allowed = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if name.is_empty() || !name.chars().all(is_allowed) {
            return wrong("name", format!("expected letters, digits and -, found \"{name}\""));
        }
        if let Some(first) = entries[..i].iter().position(|other| other.name == *name) {
            return wrong("name", format!("\"{name}\" is the name of {kind}[{first}] too"));
        }
        if severity.is_empty() {
            return wrong("severity", "expected one at least, found none".to_owned());
        }
        for (n, corruption) in severity.iter().enumerate() {
            validate(corruption, &format!("{kind}[{i}].severity[{n}]"))?;
        }
    }
    Ok(())
}

/// A corruption, one of its severities, and the parameters of that severity.
pub type Chosen<'a, T> = (&'a Entry<T>, u32, &'a T);

/// Chooses the `entries` with these `names`, at these `severities`. An empty list stands for all
/// names or all severities.
pub fn chosen<'a, T>(
    entries: &'a [Entry<T>],
    names: &[String],
    severities: &[u32],
) -> Result<Vec<Chosen<'a, T>>, Usage> {
    if entries.is_empty() {
        return Err(Usage("--plan: expected a corruption for this input, found none".to_owned()));
    }
    let known = || entries.iter().map(|entry| entry.name.as_str()).collect::<Vec<_>>().join(", ");
    if let Some(name) = names.iter().find(|name| entries.iter().all(|e| e.name != **name)) {
        return Err(Usage(format!("--only: expected some of {}, found {name}", known())));
    }
    let is_wanted = |entry: &&Entry<T>| names.is_empty() || names.contains(&entry.name);
    let most = entries.iter().filter(is_wanted).map(|entry| entry.severity.len()).max();
    let most = most.unwrap_or(0);
    if let Some(found) = severities.iter().find(|n| !(1..=most as u32).contains(n)) {
        return Err(Usage(format!("--severity: expected 1 to {most}, found {found}")));
    }
    let chosen = entries.iter().filter(is_wanted).flat_map(|entry| {
        let numbered = (1..).zip(&entry.severity);
        numbered
            .filter(|(n, _)| severities.is_empty() || severities.contains(n))
            .map(move |(n, numbers)| (entry, n, numbers))
    });
    Ok(chosen.collect())
}
