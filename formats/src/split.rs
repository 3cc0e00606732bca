//! The two halves of a dataset.

use serde::{Deserialize, Serialize};

crate::named! {
    /// Which half of a dataset an instance belongs to.
    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Split: "split" {
        /// What a network learns from.
        Train = "train",
        /// What it is measured on.
        Test = "test",
    }
}
