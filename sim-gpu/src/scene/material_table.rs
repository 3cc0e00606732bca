//! A material as a scene's file has it: a name of the built-in table, or numbers.

use edgepuck_mesh::material::Material;
use serde::Deserialize;

use crate::config::{InvalidValue, within};

#[derive(Clone, Debug, Deserialize)]
#[serde(
    untagged,
    expecting = "expected the name of a built-in material, or a table of reflectivity and \
                 retroreflection as material"
)]
pub(crate) enum MaterialTable {
    Builtin(String),
    Own(Material),
}

impl MaterialTable {
    pub(crate) fn material(self, key: &str) -> Result<Material, InvalidValue> {
        match self {
            Self::Own(own) => {
                within(&format!("{key}.reflectivity"), own.reflectivity, 0.0..=1.0)?;
                within(&format!("{key}.retroreflection"), own.retroreflection, 0.0..=1.0)?;
                Ok(own)
            }
            Self::Builtin(name) => Material::builtin(&name).ok_or_else(|| {
                let known = Material::builtin_names().join(", ");
                InvalidValue::new(key, format!("expected one of {known}, found \"{name}\""))
            }),
        }
    }
}
