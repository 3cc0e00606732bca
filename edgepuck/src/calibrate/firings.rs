//! The firings of a sensor at rest, by ring and angle: those with a return, and those without one,
//! which the gaps between returns tell.

use std::ops::ControlFlow;
use std::path::PathBuf;

use anyhow::{Context, bail, ensure};
use formats::turns::read_turns;
use formats::velodyne::Model;
use formats::{Scan, Senders, ouster};
use glam::{DMat3, DVec3};

use super::median::median;
use crate::Usage;
use crate::points::{PointsArgs, warn_of_packets};

/// The most turns that are used, so that long captures fit into the memory.
const MOST_TURNS: usize = 100;

/// The fewest returns of a ring that is used.
const LEAST_RETURNS: usize = 50;

/// Neighbours on a ring that are farther apart in time are of different turns, seconds.
const APART_S: f64 = 5e-3;

/// One firing of one laser.
#[derive(Clone, Copy, Debug)]
pub struct Firing {
    /// Clockwise turns since the start of the recording; the fraction is the azimuth.
    pub turns: f64,
    /// NaN without a return.
    pub range_m: f64,
    /// Seconds since the start of the capture or of the sweep; NaN if unknown.
    pub time_s: f64,
    /// Grows where firings may be missing: at gaps between packets, and with each sweep.
    piece: u32,
}

/// The firings of one laser in the order of their angles, and the angle from one to the next, turns.
pub struct Ring {
    pub number: u16,
    pub firings: Vec<Firing>,
    pub step: f64,
}

/// What was recorded.
pub struct Recording {
    pub rings: Vec<Ring>,
    /// Where the first turn starts, and the number of complete turns from there.
    pub start: f64,
    pub n_turns: usize,
    /// The sensor that its packets name.
    pub model: Option<Model>,
}

/// Reads captures, one after the other, or sweeps of one turn each.
pub fn read(files: &[PathBuf], points: &PointsArgs) -> anyhow::Result<Recording> {
    let is_sweeps = !points.is_capture(&files[0]);
    if let Some(other) = files.iter().find(|file| points.is_capture(file) == is_sweeps) {
        let [first, other] = [&files[0], other].map(|file| file.display());
        bail!(Usage(format!(
            "expected captures or sweeps, found one of each: {first} and {other}"
        )));
    }
    let mut recorded = Vec::new();
    let mut model = None;
    let whole = match is_sweeps {
        true => read_sweeps(files, points, &mut recorded)?,
        false => read_captures(files, points, &mut recorded, &mut model)?,
    };
    if !whole {
        program::say!("warning: only the first {MOST_TURNS} turns are used");
    }
    let rings = (0..).zip(recorded).map(|(ring, all)| Ring::of(ring, all));
    let rings: Vec<_> = rings.filter_map(Result::transpose).collect::<Result<_, _>>()?;
    let ends = |end: fn(&Vec<Firing>) -> Option<&Firing>| {
        rings.iter().filter_map(move |ring| end(&ring.firings)).map(|firing| firing.turns)
    };
    let first = ends(|firings| firings.first()).fold(f64::INFINITY, f64::min);
    // Sweeps have the turns from whole number to whole number.
    let start = if is_sweeps { 0.0 } else { first };
    let last = ends(|firings| firings.last()).fold(f64::NEG_INFINITY, f64::max);
    // The last firing of a turn is a step before its end.
    let n_turns = (last - start + 0.02).max(0.0) as usize;
    Ok(Recording { rings, start, n_turns, model })
}

/// Reads captures into the firings of each ring. Returns whether they were read to their ends.
fn read_captures(
    files: &[PathBuf],
    points: &PointsArgs,
    rings: &mut Vec<Vec<Firing>>,
    model: &mut Option<Model>,
) -> anyhow::Result<bool> {
    let metadata = points.metadata.as_deref().map(ouster::Metadata::read).transpose()?;
    let (mut start, mut piece, mut time_s) = (None::<f64>, 0, 0.0);
    for file in files {
        let mut senders = Senders::new(points.from);
        let (mut offset, mut last, mut whole) = (None, 0.0, true);
        let (first_piece, first_s) = (piece + 1, time_s);
        let (found, counts) = read_turns(file, metadata.as_ref(), &mut senders, |turned| {
            // Another capture goes on with the next turn.
            let offset = *offset.get_or_insert_with(|| {
                start.map_or(0.0, |_| (last_of(rings) - turned.turns).ceil())
            });
            let turns = turned.turns + offset;
            if turns - *start.get_or_insert(turns) > MOST_TURNS as f64 + 0.1 {
                whole = false;
                return ControlFlow::Break(());
            }
            (piece, time_s, last) = (first_piece + turned.gaps, first_s + turned.time_s, turns);
            let range_m = turned.found.range_m.into();
            push(rings, turned.found.ring, Firing { turns, range_m, time_s, piece });
            ControlFlow::Continue(())
        })?;
        let name = file.display();
        warn_of_packets(file, &senders, &counts);
        if let (Some(expected), Some(found)) = (*model, found)
            && expected != found
        {
            bail!(
                "{name}: expected packets of a {expected}, as in {}, found those of a {found}: \
                   calibrate one sensor at a time",
                files[0].display()
            );
        }
        *model = found;
        if !whole {
            return Ok(false);
        }
    }
    Ok(true)
}

fn last_of(rings: &[Vec<Firing>]) -> f64 {
    let last = rings.iter().filter_map(|firings| firings.last()).map(|firing| firing.turns);
    last.fold(0.0, f64::max)
}

fn push(rings: &mut Vec<Vec<Firing>>, ring: u16, firing: Firing) {
    if rings.len() <= usize::from(ring) {
        rings.resize_with(usize::from(ring) + 1, Vec::new);
    }
    rings[usize::from(ring)].push(firing);
}

/// As [`read_captures`], of sweeps.
fn read_sweeps(
    files: &[PathBuf],
    points: &PointsArgs,
    rings: &mut Vec<Vec<Firing>>,
) -> anyhow::Result<bool> {
    let mut elevations_deg = Vec::new();
    for (number, file) in (0..).zip(files.iter().take(MOST_TURNS)) {
        let sweep = points.read(file)?;
        let found = add_sweep(&sweep, number, rings).with_context(|| file.display().to_string())?;
        let differs = |(a, b): (&f64, &f64)| (a - b).abs() > MOST_APART_DEG;
        if number == 0 {
            elevations_deg = found;
        } else if found.iter().zip(&elevations_deg).any(differs) {
            bail!(
                "{}: expected the rings of {}, found other elevations: calibrate one sensor at a time",
                file.display(),
                files[0].display()
            );
        }
    }
    Ok(files.len() <= MOST_TURNS)
}

/// Sweeps whose rings are farther apart in elevation are of different sensors.
const MOST_APART_DEG: f64 = 0.5;

/// The points of a ring lie closer to its elevation, even near ones of heads whose beams do not start
/// in one place.
const WIDEST_RING_DEG: f64 = 2.0;

/// Adds sweep `number` to the firings of each ring, and returns the rings' median elevations in
/// degrees, NaN for one with few points.
fn add_sweep(sweep: &Scan, number: u32, rings: &mut Vec<Vec<Firing>>) -> anyhow::Result<Vec<f64>> {
    let expected = "expected a sweep with rings (a column `ring`) of a head that turns";
    let ring = sweep.ring.as_ref().with_context(|| format!("{expected}, found none"))?;
    let sensor_m = DVec3::from_array(sweep.sensor_position_m());
    let sensor_from_world = sweep.pose.map_or(DMat3::IDENTITY, |pose| {
        // The rows of the rotation are the columns of its inverse.
        DMat3::from_cols_array(&[0, 1, 2, 4, 5, 6, 8, 9, 10].map(|i| pose[i]))
    });
    let mut elevations_deg: Vec<Vec<f64>> = Vec::new();
    for (i, &ring) in ring.iter().enumerate() {
        let point = DVec3::from_array(sweep.positions[i].map(f64::from));
        let beam = sensor_from_world * (point + DVec3::from_array(sweep.origin) - sensor_m);
        let range_m = sweep.range_m.as_ref().map_or(beam.length(), |all| all[i].into());
        if !(range_m > 0.0 && range_m.is_finite() && beam.is_finite()) {
            continue;
        }
        let azimuth = (-libm::atan2(beam.y, beam.x) / std::f64::consts::TAU).rem_euclid(1.0);
        let time_s = sweep.time_s.as_ref().map_or(f64::NAN, |all| all[i].into());
        let turns = f64::from(number) + azimuth;
        push(rings, ring, Firing { turns, range_m, time_s, piece: number });
        let flat = libm::hypot(beam.x, beam.y);
        elevations_deg.resize_with(elevations_deg.len().max(usize::from(ring) + 1), Vec::new);
        elevations_deg[usize::from(ring)].push(libm::atan2(beam.z, flat).to_degrees());
    }
    let middle = |angles: &mut Vec<f64>| {
        let enough = median(angles).filter(|_| angles.len() >= LEAST_RETURNS);
        let Some(middle) = enough else { return Ok(f64::NAN) };
        let apart = angles.iter().filter(|angle| (*angle - middle).abs() > WIDEST_RING_DEG).count();
        ensure!(2 * apart <= angles.len(), "{expected}, found rings of many elevations");
        Ok(middle)
    };
    elevations_deg.iter_mut().map(middle).collect()
}

impl Ring {
    /// The firings of laser `number`, of which those with a return were recorded, or `None` if these
    /// are too few to tell the others.
    fn of(number: u16, mut found: Vec<Firing>) -> Result<Option<Self>, Usage> {
        found.sort_by(|a, b| a.turns.total_cmp(&b.turns));
        let mut steps: Vec<f64> =
            found.windows(2).map(|pair| pair[1].turns - pair[0].turns).collect();
        // Further returns of a beam have the same angle.
        steps.retain(|&step| step > 1e-5);
        let enough = median(&mut steps).filter(|_| steps.len() >= LEAST_RETURNS);
        let Some(step) = enough else { return Ok(None) };
        let (n_found, mut n_again) = (found.len(), 0);
        let mut firings: Vec<Firing> = Vec::with_capacity(n_found);
        for firing in found {
            if let Some(&before) = firings.last() {
                let gap = firing.turns - before.turns;
                let is_again = firing.piece == before.piece && gap < 1.5 * step;
                let apart_s = (firing.time_s - before.time_s).abs();
                n_again += usize::from(is_again && apart_s > APART_S);
                if gap < 0.3 * step {
                    continue;
                }
                // A laser that saw nothing for half a turn looks at the sky.
                let n = if firing.piece == before.piece && gap < 0.5 {
                    (gap / step).round()
                } else {
                    1.0
                };
                firings.extend((1..n as u32).map(|i| Firing {
                    turns: before.turns + gap * f64::from(i) / n,
                    range_m: f64::NAN,
                    time_s: f64::NAN,
                    piece: before.piece,
                }));
            }
            firings.push(firing);
        }
        if 4 * n_again > n_found {
            let cause = "expected sweeps of one turn each, found several turns in a file: cut it \
                         by the times of its points";
            return Err(Usage(cause.to_owned()));
        }
        Ok(Some(Self { number, firings, step }))
    }
}
