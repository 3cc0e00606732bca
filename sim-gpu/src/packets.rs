//! Scans as packets of a VLP-32C: the sensors that have them, and the requirements for a scan.
//! [`formats::vlp32c`] writes them and documents their decoding.

use formats::scan::{Attribute, AttributeSet};
use formats::vlp32c::{
    AZIMUTH_UNIT_DEG, BEAM_CROSSING_M, FARTHEST_M, Returns, Revolution, SEQUENCE_US,
};

use crate::config::{InvalidValue, within};
use crate::effects::{Effects, NoiseModel, ReturnMode};
use crate::sensor::{Layout, Rotating, SensorProfile};

/// The attributes that [`formats::vlp32c`] reads, with these `effects` and these `wanted`
/// attributes: the calibrated reflectivity or else the intensity, if there is either.
#[must_use]
pub fn attributes(effects: &Effects, wanted: &AttributeSet) -> AttributeSet {
    let brightness = if wanted.contains(&Attribute::Reflectivity) {
        Some(Attribute::Reflectivity)
    } else {
        effects.intensity.map(|_| Attribute::Intensity)
    };
    [Attribute::Beam, Attribute::Range].into_iter().chain(brightness).collect()
}

/// `sensor` with its beams as packets encode them: they start on the axis, and azimuths are
/// whole units at the start of a sequence.
pub fn with_packet_geometry(sensor: &SensorProfile) -> Result<SensorProfile, InvalidValue> {
    let mut sensor = sensor.clone();
    if let Layout::Rotating(rotating) = &mut sensor.layout {
        rotating.beam_crossing_m.get_or_insert(BEAM_CROSSING_M);
        rotating.sequence_quantum_deg.get_or_insert(AZIMUTH_UNIT_DEG);
    }
    revolution(&sensor)?;
    Ok(sensor)
}

/// One revolution of `sensor`, as its packets encode it.
pub fn revolution(sensor: &SensorProfile) -> Result<Revolution, InvalidValue> {
    let Layout::Rotating(rotating) = &sensor.layout else {
        return Err(no_packets("rotating", "missing"));
    };
    check_head(rotating)?;
    check_aim(rotating)?;
    if sensor.decimation.get() != 1 {
        return Err(no_packets("decimation", "leaves out firing sequences"));
    }
    if sensor.revolutions.get() != 1 {
        return Err(no_packets("revolutions", "is not 1"));
    }
    within("range.max_m", sensor.range.max_m, 0.0..=FARTHEST_M)?;
    // At most 2^26, the limit of patterns.
    Ok(Revolution { rpm: rotating.rpm, n_beams: rotating.rays_per_revolution() as u32 })
}

/// The returns in the packets of a scan with these `effects`, if they agree with `wanted`.
pub fn returns(effects: &Effects, wanted: Option<Returns>) -> Result<Returns, InvalidValue> {
    if effects.noise.is_some_and(|noise| noise.model != NoiseModel::Range) {
        let cause = "moves points off their beams; take \"range\"";
        return Err(no_packets("effects.noise.model", cause));
    }
    let Some(mode) = effects.returns else { return Ok(wanted.unwrap_or_default()) };
    let held = match mode {
        ReturnMode::Strongest => Some(Returns::Strongest),
        ReturnMode::Last => Some(Returns::Last),
        ReturnMode::Dual => Some(Returns::Dual),
        ReturnMode::First | ReturnMode::SecondStrongest => None,
    };
    match held {
        None => Err(no_packets("effects.returns", format!("\"{mode}\" is not among theirs"))),
        Some(held) if wanted.is_some_and(|wanted| wanted != held) => {
            let cause =
                format!("expected the returns that the packets are to hold, found \"{mode}\"");
            Err(InvalidValue::new("effects.returns", cause))
        }
        Some(held) => Ok(held),
    }
}

/// As [`returns`]; if beams may have several returns, in weather or with a width, and `effects` do
/// not select any, sets those `wanted`.
pub fn settle_returns(
    effects: &mut Effects,
    wanted: Option<Returns>,
) -> Result<Returns, InvalidValue> {
    let held = returns(effects, wanted)?;
    if effects.footprint.is_some() || effects.weather.is_some() {
        effects.returns.get_or_insert(match held {
            Returns::Strongest => ReturnMode::Strongest,
            Returns::Last => ReturnMode::Last,
            Returns::Dual => ReturnMode::Dual,
        });
    }
    Ok(held)
}

/// Checks that the head is a VLP-32C's: packets name lasers, whose angles are in drivers' tables.
fn check_head(rotating: &Rotating) -> Result<(), InvalidValue> {
    let Some(SensorProfile { layout: Layout::Rotating(vlp32c), .. }) =
        SensorProfile::builtin("vlp32c")
    else {
        unreachable!("invariant: the built-in vlp32c rotates");
    };
    if rotating.sequence_us != SEQUENCE_US {
        let cause = format!("expected {SEQUENCE_US}, found {}", rotating.sequence_us);
        return Err(no_packets("rotating.sequence_us", cause));
    }
    let (found, expected) = (rotating.firing_order(), vlp32c.firing_order());
    if found.len() != expected.len() {
        let cause = format!("expected {} beams, found {}", expected.len(), found.len());
        return Err(no_packets("rotating.beam", cause));
    }
    let differs =
        |&(&found, &expected): &(&usize, &usize)| rotating.beam[found] != vlp32c.beam[expected];
    if let Some((found, expected)) = found.iter().zip(&expected).find(differs) {
        let cause = format!("expected laser {expected} of a VLP-32C, which decoders take it for");
        return Err(no_packets(format!("rotating.beam[{found}]"), cause));
    }
    // VLP-32C User Manual 63-9325, 8.3.
    within("rotating.rpm", rotating.rpm, 300.0..=1200.0)
}

/// Checks that beams start and point as packets encode them.
fn check_aim(rotating: &Rotating) -> Result<(), InvalidValue> {
    let expect = |key: &str, found: Option<f64>, expected: Option<f64>| {
        if found == expected {
            return Ok(());
        }
        let written =
            |value: Option<f64>| value.map_or("none".to_owned(), |value| value.to_string());
        Err(no_packets(key, format!("expected {}, found {}", written(expected), written(found))))
    };
    expect("rotating.beam_crossing_m", rotating.beam_crossing_m, Some(BEAM_CROSSING_M))?;
    let quantum_deg = rotating.sequence_quantum_deg;
    expect("rotating.sequence_quantum_deg", quantum_deg, Some(AZIMUTH_UNIT_DEG))
}

fn no_packets(key: impl Into<String>, cause: impl std::fmt::Display) -> InvalidValue {
    InvalidValue::new(key, format!("{cause}; packets can be written for Velodyne's VLP-32C only"))
}
