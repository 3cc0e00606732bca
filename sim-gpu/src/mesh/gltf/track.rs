//! Values of an animation over time.

use glam::{DQuat, DVec4};
use gltf::Gltf;
use gltf::accessor::Dimensions;
use gltf::json::animation::{Interpolation, Sampler};
use gltf::json::validation::Checked;

use super::buffers::Buffers;

/// Values that differ by less, relative to 1 and to themselves, are those of a node at rest, of which
/// some programs write each frame.
const STILL: f64 = 1e-6;

/// Values over time.
pub struct Track {
    /// Ascending, at least one.
    pub times: Vec<f64>,
    /// One for each time; of cubic splines, an in-tangent, a value and an out-tangent.
    values: Vec<DVec4>,
    pub kind: Interpolation,
    is_rotation: bool,
}

impl Track {
    pub fn read(
        file: &Gltf,
        buffers: &Buffers,
        sampler: &Sampler,
        is_rotation: bool,
    ) -> Result<Self, String> {
        let kind = match sampler.interpolation {
            Checked::Valid(kind) => kind,
            Checked::Invalid => {
                return Err("expected LINEAR, STEP or CUBICSPLINE as interpolation".to_owned());
            }
        };
        let accessor = |index: usize| {
            file.accessors().nth(index).ok_or_else(|| format!("expected accessors[{index}]"))
        };
        let (input, output) = (accessor(sampler.input.value())?, accessor(sampler.output.value())?);
        let (mut times, mut values) = (Vec::new(), Vec::new());
        buffers.each(&input, Dimensions::Scalar, |time| times.push(time[0]))?;
        let dimensions = if is_rotation { Dimensions::Vec4 } else { Dimensions::Vec3 };
        buffers.each(&output, dimensions, |value| values.push(DVec4::from_array(*value)))?;
        let is_ascending = times.is_sorted_by(|a, b| a < b);
        if times.is_empty() || !is_ascending || !times.iter().all(|time| time.is_finite()) {
            let place = format!("accessors[{}]", input.index());
            return Err(format!("{place}: expected finite ascending times, found others"));
        }
        let place = format!("accessors[{}]", output.index());
        let each = if kind == Interpolation::CubicSpline { 3 } else { 1 };
        let (expected, found) = (each * times.len(), values.len());
        if found != expected {
            return Err(format!("{place}: expected {expected} values, found {found}"));
        }
        if !values.iter().all(|value| value.is_finite()) {
            return Err(format!("{place}: expected finite values, found others"));
        }
        let mut track = Self { times, values, kind, is_rotation };
        for value in track.values.iter_mut().skip(each / 2).step_by(each).filter(|_| is_rotation) {
            let unit = value.try_normalize();
            *value =
                unit.ok_or_else(|| format!("{place}: expected rotations of length 1, found 0"))?;
        }
        Ok(track)
    }

    pub fn first_value(&self) -> DVec4 {
        self.values[self.first()]
    }

    /// The index of the first value.
    fn first(&self) -> usize {
        usize::from(self.kind == Interpolation::CubicSpline)
    }

    pub fn is_still(&self) -> bool {
        let is_value = |i: usize| self.first() == 0 || i % 3 == 1;
        let first = self.values[self.first()];
        self.values.iter().enumerate().all(|(i, value)| {
            let off = if is_value(i) { *value - first } else { *value };
            off.abs().max_element() <= STILL * first.abs().max_element().max(1.0)
        })
    }

    pub fn at(&self, time_s: f64) -> DVec4 {
        let after = self.times.partition_point(|at_s| *at_s <= time_s);
        let (each, first) = (2 * self.first() + 1, self.first());
        let value = |key: usize| self.values[each * key + first];
        if after == 0 || after == self.times.len() {
            return value(after.saturating_sub(1));
        }
        let (a, b) = (value(after - 1), value(after));
        let span_s = self.times[after] - self.times[after - 1];
        let share = (time_s - self.times[after - 1]) / span_s;
        match self.kind {
            Interpolation::Step => a,
            Interpolation::Linear if self.is_rotation => {
                let [a, b] = [a, b].map(DQuat::from_vec4);
                a.slerp(b, share).normalize().into()
            }
            Interpolation::Linear => a.lerp(b, share),
            Interpolation::CubicSpline => {
                // glTF 2.0, appendix C.5.
                let (s, s2, s3) = (share, share * share, share.powi(3));
                let [leaving, arriving] =
                    [3 * after - 1, 3 * after].map(|tangent| span_s * self.values[tangent]);
                let at = (2.0 * s3 - 3.0 * s2 + 1.0) * a
                    + (s3 - 2.0 * s2 + s) * leaving
                    + (3.0 * s2 - 2.0 * s3) * b
                    + (s3 - s2) * arriving;
                if self.is_rotation { at.try_normalize().unwrap_or(a) } else { at }
            }
        }
    }
}
