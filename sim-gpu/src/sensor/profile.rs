//! A sensor's profile as TOML holds it, and its checks.

use std::num::NonZeroU32;
use std::path::Path;

use serde::Deserialize;

use super::{
    BeamShape, DetectionLimit, Grid, LARGEST_M, Layout, RangeLimits, Risley, Rotating,
    SensorProfile, Table, TypicalNoise, Uniform,
};
use crate::config::{self, ConfigError, InvalidValue, positive, within};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Profile {
    name: String,
    #[serde(default)]
    description: String,
    #[serde(default)]
    sources: Vec<String>,
    range: RangeLimits,
    noise: Option<TypicalNoise>,
    detection: Option<DetectionLimit>,
    footprint: Option<BeamShape>,
    /// A head of lasers that turns. Each profile has this layout or one of the next four.
    rotating: Option<Rotating>,
    /// A regular grid of angles.
    uniform: Option<Uniform>,
    /// The pixels of a camera.
    grid: Option<Grid>,
    /// Lines of lasers behind turning prisms.
    risley: Option<Risley>,
    /// A table of directions.
    table: Option<Table>,
    #[serde(default = "one")]
    decimation: NonZeroU32,
    #[serde(default = "one")]
    revolutions: NonZeroU32,
}

fn one() -> NonZeroU32 {
    NonZeroU32::MIN
}

impl Profile {
    /// Reads the table of directions that the profile names, relative to its own `file`.
    fn load_table(&mut self, file: &Path) -> Result<(), InvalidValue> {
        self.table.as_mut().map_or(Ok(()), |table| table.load(file))
    }
}

pub(super) fn parse(text: &str, file: &Path) -> Result<SensorProfile, ConfigError> {
    config::parse(text, file, Profile::checked)
}

pub(super) fn load(file: &Path) -> Result<SensorProfile, ConfigError> {
    config::read(file, "a sensor's profile", |mut profile: Profile| {
        profile.load_table(file)?;
        profile.checked()
    })
}

impl TryFrom<Profile> for SensorProfile {
    type Error = InvalidValue;

    fn try_from(profile: Profile) -> Result<Self, InvalidValue> {
        profile.checked().map_err(|mut all| all.swap_remove(0))
    }
}

impl Profile {
    fn checked(self) -> Result<SensorProfile, Vec<InvalidValue>> {
        let profile = self;
        let name = match profile.name.trim() {
            "" => Err(InvalidValue::new("name", "expected a name, found none")),
            _ => Ok(()),
        };
        let sigma_m = profile.noise.map(|noise| noise.typical_sigma_m);
        let repeatability_m = profile.noise.and_then(|noise| noise.repeatability_m);
        let layout = only_layout([
            profile.rotating.map(Layout::Rotating),
            profile.uniform.map(Layout::Uniform),
            profile.grid.map(Layout::Grid),
            profile.risley.map(Layout::Risley),
            profile.table.map(Layout::Table),
        ]);
        config::all([
            name,
            check_range(&profile.range),
            within("noise.typical_sigma_m", sigma_m, 0.0..=f64::MAX),
            within("noise.repeatability_m", repeatability_m, 0.0..=f64::MAX),
            profile.detection.map_or(Ok(()), |limit| limit.validate("detection")),
            profile.footprint.map_or(Ok(()), |footprint| footprint.validate("footprint")),
            layout.as_ref().map_err(Clone::clone).map(|_| ()),
        ])?;
        let layout = layout?;
        let sensor = SensorProfile {
            name: profile.name,
            description: profile.description,
            sources: profile.sources,
            range: profile.range,
            noise: profile.noise,
            detection: profile.detection,
            footprint: profile.footprint,
            layout,
            decimation: profile.decimation,
            revolutions: profile.revolutions,
        };
        sensor.check_revolutions()?;
        Ok(sensor)
    }
}

fn only_layout(layouts: [Option<Layout>; 5]) -> Result<Layout, InvalidValue> {
    let mut found = layouts.into_iter().flatten();
    let expected = "expected one of [rotating], [uniform], [grid], [risley] and [table]";
    let Some(layout) = found.next() else {
        return Err(InvalidValue::new("rotating", format!("{expected}, found none")));
    };
    if found.next().is_some() {
        return Err(InvalidValue::new("rotating", format!("{expected}, found several")));
    }
    match &layout {
        Layout::Rotating(rotating) => rotating.validate()?,
        Layout::Uniform(uniform) => uniform.validate()?,
        Layout::Grid(grid) => grid.validate()?,
        Layout::Risley(risley) => risley.validate()?,
        Layout::Table(table) => table.validate()?,
    }
    Ok(layout)
}

fn check_range(range: &RangeLimits) -> Result<(), InvalidValue> {
    within("range.min_m", range.min_m, 0.0..=f64::MAX)?;
    positive("range.max_m", range.max_m)?;
    within("range.max_m", range.max_m, 0.0..=LARGEST_M)?;
    if range.min_m >= range.max_m {
        let (min_m, max_m) = (range.min_m, range.max_m);
        let cause = format!("expected a number above range.min_m = {min_m}, found {max_m}");
        return Err(InvalidValue::new("range.max_m", cause));
    }
    positive("range.quantum_m", range.quantum_m)
}
