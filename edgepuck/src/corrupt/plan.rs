use edgepuck_assets::CORRUPTIONS;
use serde::Deserialize;
use sim_gpu::errors::InvalidValue;
use sim_gpu::recorded::Corruption;
use sim_gpu::settings;
use std::path::Path;

use crate::Usage;

/// The corruptions of sweeps.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    pub sweep: Vec<Entry>,
}

/// A corruption.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    pub name: String,
    /// The physical cause.
    pub by: String,
    /// The parameters of each severity, beginning with severity 1, the mildest.
    pub severity: Vec<Corruption>,
}

impl Plan {
    /// The plan in `file`, or the built-in one.
    pub fn read(file: Option<&Path>) -> anyhow::Result<Self> {
        let checked = |plan: Self| plan.check().map(|()| plan);
        Ok(match file {
            Some(file) => settings::read(file, "corruptions of sweeps", checked)?,
            None => settings::parse(CORRUPTIONS, Path::new("corruptions.toml"), checked)?,
        })
    }

    /// Checks that the names of corruptions are valid and unique, and that their parameters are valid.
    fn check(&self) -> Result<(), InvalidValue> {
        for (i, Entry { name, severity, .. }) in self.sweep.iter().enumerate() {
            let wrong =
                |field: &str, cause| Err(InvalidValue::new(format!("sweep[{i}].{field}"), cause));
            let is_allowed = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
            if name.is_empty() || !name.chars().all(is_allowed) {
                return wrong("name", format!("expected letters, digits and -, found \"{name}\""));
            }
            if let Some(first) = self.sweep[..i].iter().position(|other| other.name == *name) {
                return wrong("name", format!("\"{name}\" is the name of sweep[{first}] too"));
            }
            if severity.is_empty() {
                return wrong("severity", "expected one at least, found none".to_owned());
            }
            for (n, corruption) in severity.iter().enumerate() {
                corruption.validate(&format!("sweep[{i}].severity[{n}]"))?;
            }
        }
        Ok(())
    }
}

/// A corruption, one of its severities, and the parameters of that severity.
pub type Chosen<'a> = (&'a Entry, u32, &'a Corruption);

/// Chooses the `entries` with these `names`, at these `severities`. An empty list stands for all
/// names or all severities.
pub fn chosen<'a>(
    entries: &'a [Entry],
    names: &[String],
    severities: &[u32],
) -> Result<Vec<Chosen<'a>>, Usage> {
    if entries.is_empty() {
        return Err(Usage("--plan: expected a corruption, found none".to_owned()));
    }
    let known = || entries.iter().map(|entry| entry.name.as_str()).collect::<Vec<_>>().join(", ");
    if let Some(name) = names.iter().find(|name| entries.iter().all(|e| e.name != **name)) {
        return Err(Usage(format!("--only: expected some of {}, found {name}", known())));
    }
    let is_wanted = |entry: &&Entry| names.is_empty() || names.contains(&entry.name);
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
