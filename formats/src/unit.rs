//! Units of length.

use serde::{Deserialize, Serialize};

crate::named! {
    /// The unit of a file's coordinates.
    #[derive(Default, Serialize, Deserialize)]
    pub enum Unit: "unit" {
        /// 1 m.
        #[default]
        #[serde(rename = "m")]
        Metre = "m",
        /// 0.001 m.
        #[serde(rename = "mm")]
        Millimetre = "mm",
        /// 0.01 m.
        #[serde(rename = "cm")]
        Centimetre = "cm",
        /// 0.0254 m.
        #[serde(rename = "in")]
        Inch = "in",
        /// 0.3048 m.
        #[serde(rename = "ft")]
        Foot = "ft",
    }
}

impl Unit {
    /// Its length in metres (international yard and pound agreement of 1959).
    #[must_use]
    pub const fn metres(self) -> f64 {
        match self {
            Self::Metre => 1.0,
            Self::Millimetre => 1e-3,
            Self::Centimetre => 1e-2,
            Self::Inch => 0.0254,
            Self::Foot => 0.3048,
        }
    }

    /// `millimetres`.
    #[must_use]
    pub const fn plural(self) -> &'static str {
        match self {
            Self::Metre => "metres",
            Self::Millimetre => "millimetres",
            Self::Centimetre => "centimetres",
            Self::Inch => "inches",
            Self::Foot => "feet",
        }
    }
}
