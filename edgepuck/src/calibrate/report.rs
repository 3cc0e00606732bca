//! The figures as text, as JSON, and as a profile.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::{Value, json};
use sim_gpu::sensors::SensorProfile;

use super::estimate::{Estimate, rounded};
use super::figures::{Figures, Part};
use super::firings::Recording;
use program::significant_digits::digits;

/// A table of the figures, and how commands are asked for those that a profile does not hold.
pub fn text(found: &Figures, recording: &Recording, out: &Path) -> String {
    let (n_turns, n_rings) = (recording.n_turns, recording.rings.len());
    let mut lines = vec![
        format!(
            "{n_turns} turns, {n_rings} rings, {} directions that return turn after turn; in \
             brackets the 95 % interval and the number of values",
            found.n_directions
        ),
        format!("{:<22} {:<38} missing returns, %", "", "repeatability, mm"),
    ];
    let mut row = |name: &str, repeatability_m: Option<Estimate>, missing: Option<Estimate>| {
        let [repeatability, missing] = [(repeatability_m, 1e3), (missing, 100.0)]
            .map(|(figure, scale)| figure.map(|figure| shown(&figure, scale)).unwrap_or_default());
        lines.push(format!("{name:<22} {repeatability:<38} {missing}").trim_end().to_owned());
    };
    row("all", Some(found.repeatability_m), Some(found.missing));
    for part in found.bins.iter().chain(&found.rings) {
        row(&part.name, part.repeatability_m, part.missing);
    }
    let mut line = |name: &str, figure: &Estimate, scale: f64, unit: &str| {
        lines.push(format!("{:<22} {}", format!("{name}{unit}"), shown(figure, scale)));
    };
    line("jumping directions", &found.jumping, 100.0, ", %");
    if let Some(quantum) = &found.quantum_m {
        line("quantum of ranges", quantum, 1e3, ", mm");
    }
    if let Some(turning) = &found.turning {
        line("rate", &turning.rpm, 1.0, ", rpm");
        line("its deviation", &turning.between_rpm, 1.0, ", rpm");
        line("angle's deviation", &turning.within_deg, 1.0, ", deg");
    }
    let [least_m, largest_m] = found.ranges_m.map(digits);
    lines.push(format!(
        "ranges seen            {least_m} to {largest_m} m; the limits may lie beyond"
    ));
    if found.turning.as_ref().is_some_and(|turning| !turning.is_clockwise) {
        lines.push("The head turns counterclockwise; the profile's turns clockwise.".to_owned());
    }
    lines.push(asked(found, out));
    lines.join("\n") + "\n"
}

/// A figure, its interval and its number, with the digits that the interval tells.
fn shown(found: &Estimate, scale: f64) -> String {
    let half = 0.5 * (found.high - found.low) * scale;
    let decimals =
        if half > 0.0 { (1.0 - libm::log10(half).floor()).clamp(0.0, 6.0) as usize } else { 4 };
    let number = |value: f64| {
        let text = format!("{:.decimals$}", value * scale);
        match text.contains('.') {
            true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
            false => text,
        }
    };
    let [value, low, high] = [found.value, found.low, found.high].map(number);
    format!("{value} ({low} to {high}, {})", found.n)
}

/// How commands are asked for the figures.
fn asked(found: &Figures, out: &Path) -> String {
    let noise_m = rounded(found.repeatability_m.value);
    let dropout = rounded(found.missing.value);
    let [flag, line, table] = match found.quantum_m {
        Some(_) => [" --quantise", "quantise_m = true\n", ", effects = { quantise_m = true }"],
        None => [""; 3],
    };
    let name = out.file_name().unwrap_or_default().to_string_lossy();
    format!(
        "The profile holds repeatability, quantum and rate. Commands apply noise, missing returns and \
         rounding if they are asked:\n\
         scan and gen-dataset: --noise {noise_m} --dropout {dropout}{flag}\n\
         scene:\n[effects]\n\
         noise = {{ sigma_m = {noise_m} }}\n\
         dropout = {{ probability = {dropout} }}\n\
         {line}\
         recipe: sensor = [{{ profile = \"{name}\", dropout = {dropout}{table} }}]"
    )
}

pub fn json(found: &Figures, recording: &Recording) -> Value {
    let parts = |parts: &[Part]| -> Vec<Value> {
        let part = |part: &Part| json!({ "of": part.name, "repeatability_m": part.repeatability_m, "missing": part.missing });
        parts.iter().map(part).collect()
    };
    let [least_m, largest_m] = found.ranges_m;
    json!({
        "turns": recording.n_turns,
        "directions": found.n_directions,
        "jumping": found.jumping,
        "drift": found.drift,
        "repeatability_m": found.repeatability_m,
        "missing": found.missing,
        "quantum_m": found.quantum_m,
        "rpm": found.turning.as_ref().map(|turning| turning.rpm),
        "rpm_between_turns": found.turning.as_ref().map(|turning| turning.between_rpm),
        "unevenness_deg": found.turning.as_ref().map(|turning| turning.within_deg),
        "clockwise": found.turning.as_ref().map(|turning| turning.is_clockwise),
        "least_range_m": least_m,
        "largest_range_m": largest_m,
        "by_range": parts(&found.bins),
        "by_ring": parts(&found.rings),
    })
}

/// The profile in TOML, under the table as comments.
pub fn profile(profile: &SensorProfile, table: &str) -> anyhow::Result<String> {
    let mut text = String::new();
    for line in table.lines() {
        writeln!(text, "{}", format!("# {line}").trim_end())?;
    }
    text.push_str(&toml::to_string(profile)?);
    // As every command reads it.
    toml::from_str::<SensorProfile>(&text)?;
    Ok(text)
}
