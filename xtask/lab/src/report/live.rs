//! A turn of a simulated drive, whose clusters have the colours of their classes.

use crate::render::page::Cloud;
use anyhow::Result;
use edgepuck_assets::SCENE_RECIPES;
use edgepuck_program::detect::{Detections, Detector};
use edgepuck_scenes::{Drive, Recipe, Stage};
use edgepuck_segment::Label;
use formats::Scan;
use formats::vlp32c::{SEQUENCE_US, SEQUENCES_PER_PACKET};
use infer_cpu::Options;
use maud::{Markup, html};
use sim_gpu::internals::sensor::SensorProfile;
use std::collections::BTreeMap;
use std::path::Path;

const RECIPE: &str = "street";
const SENSOR: &str = "vlp32c";
const MODEL: &str = "street-128";
/// As `gen-drive` has it, metres a second.
const SPEED_M_S: f64 = 5.0;
/// Packets of 0.66 ms of a turn at 10 Hz.
const PACKETS: u32 = 151;
/// As `infer-cpu live` has it.
const MIN_POINTS: usize = 20;
/// What is shown, metres from the sensor, and how many of them are the page's thousand units.
const SHOWN_M: f32 = 35.0;
const UNIT_M: f32 = 17.0;
/// Of the ground every so manieth point is shown, so that a phone turns them; no divisor of 32, or
/// lasers would go.
const GROUND_STEP: usize = 3;

/// Of points of the ground and of others, pixels.
const RADII: [f32; 2] = [1.0, 1.5];

/// What a colour means, and the colour. The first are of what has no class.
const COLOURS: [(&str, &str); 8] = [
    ("ground", "#b0b6be"),
    ("too few points", "#a08a6a"),
    ("unknown", "#5b6470"),
    ("car", "#1763c7"),
    ("person", "#d1341b"),
    ("two-wheeler", "#12924f"),
    ("truck", "#8a3ffc"),
    ("bus", "#e08a00"),
];
const SMALL: usize = 1;
const UNKNOWN: usize = 2;

/// A turn of the street, and what the network says of it.
pub fn body() -> Result<Markup> {
    let (scan, classes) = turn()?;
    let found = Detector::open(Path::new(MODEL), &Options::default(), MIN_POINTS)?.detect(&scan)?;
    let answers = answers(&found);
    let colour = |label: &Label| match label {
        Label::Ground => 0,
        Label::Cluster(number) => answers[*number as usize],
        Label::Small | Label::Invalid => SMALL,
    };
    let colours: Vec<usize> = found.labels.iter().map(colour).collect();
    let (points, digits) = shown(&scan, &colours);
    let palette = COLOURS.map(|(_, colour)| colour).join(" ");
    let count = |colour: usize| answers.iter().filter(|&&answer| answer == colour).count();
    Ok(html! {
        p { "One turn of a VLP-32C in the simulated " (RECIPE) ", its packets cast and its clusters named "
            "now, on the CPU, as " code { "gen-drive" } " and " code { "infer-cpu live" } " do it. The "
            "names are " code { (MODEL) } "'s, by this turn alone; what they should be is our own "
            "simulation's truth." }
        (Cloud { points: &points, colours: &digits, palette: &palette, pixels: [960, 560], radii: RADII, elevation_rad: 0.6 }
            .figure(&html! {
                (scan.len()) " points; those within " (SHOWN_M) " m are shown, a third of the ground's. Drag to rotate."
            }))
        ul class="legend" { @for (i, (name, colour)) in COLOURS.into_iter().enumerate() {
            li { span style={ "background:" (colour) } {} (name) @if i >= UNKNOWN { ": " (count(i)) } }
        } }
        (table(&scan, &found, &answers, &classes))
    })
}

/// The turn in the sensor's frame, and the class of each object in it; of the ground it is empty.
fn turn() -> Result<(Scan, Vec<String>)> {
    let (_, text) = SCENE_RECIPES
        .into_iter()
        .find(|(name, _)| *name == RECIPE)
        .expect("invariant: the recipe is built in");
    let mut recipe = Recipe::parse(text, Path::new(RECIPE))?;
    recipe.use_sensors(&[SENSOR.to_owned()]);
    let stage = Stage::new(recipe, Path::new(RECIPE), None, 0)?;
    let mut drive = Drive::new(&stage, SPEED_M_S)?;
    let (mut scan, mut objects, mut rings) = (Scan::default(), Vec::new(), Vec::new());
    let pattern = SensorProfile::builtin(SENSOR).expect("invariant: it is built in").pattern();
    let packet_s = SEQUENCE_US * 1e-6 * f64::from(SEQUENCES_PER_PACKET);
    for (packet, number) in drive.fire(0..PACKETS)?.into_iter().zip(0u32..) {
        let pose = drive.pose((f64::from(number) + 0.5) * packet_s);
        let to_sensor = |point: &[f32; 3]| {
            let at = glam::DVec3::from(point.map(f64::from)) - pose.position_m;
            (pose.rotation.inverse() * at).as_vec3().to_array()
        };
        scan.positions.extend(packet.scan.positions.iter().map(to_sensor));
        // The lasers of each sequence fire in the same order.
        let beams = packet.scan.beam.unwrap_or_default();
        rings.extend(beams.into_iter().map(|beam| pattern.ring[beam as usize]));
        objects.extend(packet.scan.object.unwrap_or_default());
    }
    let most = objects.iter().copied().max().unwrap_or_default();
    let class = |object| {
        let class = |entry: usize| stage.recipe().object[entry].class.clone();
        drive.object(object).map_or_else(String::new, |object| class(object.placed.entry))
    };
    let classes = (0..=most).map(class).collect();
    (scan.ring, scan.object) = (Some(rings), Some(objects));
    Ok((scan, classes))
}

/// The colour of each cluster.
fn answers(found: &Detections) -> Vec<usize> {
    let number = |label: &Label| match label {
        Label::Cluster(number) => Some(*number as usize + 1),
        _ => None,
    };
    let n_clusters = found.labels.iter().filter_map(number).max().unwrap_or_default();
    let mut answers = vec![UNKNOWN; n_clusters];
    for object in &found.objects {
        let colour = COLOURS.iter().position(|(name, _)| *name == object.class);
        answers[object.cluster as usize] = colour.unwrap_or(UNKNOWN);
    }
    answers
}

/// Points and colours as the page's script takes them.
fn shown(scan: &Scan, colours: &[usize]) -> (String, String) {
    let is_shown = |(i, (point, colour)): &(usize, (&[f32; 3], &usize))| {
        point[0].hypot(point[1]) < SHOWN_M && (**colour > 0 || i % GROUND_STEP == 0)
    };
    let points = scan.positions.iter().zip(colours).enumerate().filter(is_shown);
    let (mut numbers, mut digits) = (Vec::new(), String::new());
    for (_, (point, colour)) in points {
        numbers.extend(point.map(|x| format!("{:.0}", x / UNIT_M * 1e3)));
        digits += &colour.to_string();
    }
    (numbers.join(" "), digits)
}

/// What clusters are said to be, by what most of their points lie on.
fn table(scan: &Scan, found: &Detections, answers: &[usize], classes: &[String]) -> Markup {
    let mut points: Vec<BTreeMap<&str, usize>> = vec![BTreeMap::new(); answers.len()];
    let objects = scan.object.as_deref().unwrap_or_default();
    for (label, object) in found.labels.iter().zip(objects) {
        if let Label::Cluster(number) = label {
            *points[*number as usize].entry(&classes[*object as usize]).or_default() += 1;
        }
    }
    let mut rows: BTreeMap<&str, [usize; COLOURS.len()]> = BTreeMap::new();
    for (points, answer) in points.iter().zip(answers) {
        if let Some((class, _)) = points.iter().max_by_key(|(_, n)| **n) {
            rows.entry(class).or_default()[*answer] += 1;
        }
    }
    let is_right = |class: &str, colour: usize| {
        let named = COLOURS[UNKNOWN + 1..].iter().any(|(name, _)| *name == class);
        if named { COLOURS[colour].0 == class } else { colour == UNKNOWN }
    };
    let right: usize = rows
        .iter()
        .flat_map(|(class, row)| {
            row.iter().enumerate().map(move |(colour, n)| (*class, colour, *n))
        })
        .filter(|(class, colour, _)| is_right(class, *colour))
        .map(|(.., n)| n)
        .sum();
    html! {
        p { (right) " of " (answers.len()) " clusters of " (MIN_POINTS) " points or more are named as they "
            "should be: things that are no road user are to be " code { "unknown" } "." }
        div class="scroll" { table {
            tr { th { "truth" } @for (name, _) in &COLOURS[UNKNOWN..] { th { (name) } } }
            @for (class, row) in &rows {
                tr { td { @if class.is_empty() { "ground" } @else { (class) } }
                    @for n in &row[UNKNOWN..] { td { @if *n > 0 { (n) } } } }
            }
        } }
    }
}
