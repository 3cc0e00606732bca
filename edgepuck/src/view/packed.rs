//! The points of a page, with their attributes, in few bytes.

use super::frame::{Labels, Points};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use formats::scan::{Attribute, Column};
use glam::DVec3;
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};
use std::io::Write;

/// Numbers as `unpacked` in assets/view/src/main.js takes them: `low + step * z`, in turn for each `low`. Of the
/// whole numbers `z`, the differences are compressed, the lowest bytes of all first.
#[derive(Serialize)]
struct Packed {
    low: Vec<f64>,
    step: f64,
    z: String,
}

impl Packed {
    fn of_whole(values: Vec<u32>) -> Self {
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
        for byte in 0..4 {
            let before = std::iter::once(&0).chain(&values);
            let bytes = values.iter().zip(before).map(|(value, before)| {
                let difference = value.wrapping_sub(*before) as i32;
                // Those of either sign are small.
                ((difference << 1) ^ (difference >> 31)).to_le_bytes()[byte]
            });
            let bytes: Vec<u8> = bytes.collect();
            encoder.write_all(&bytes).expect("invariant: memory takes all bytes");
        }
        let z = STANDARD.encode(encoder.finish().expect("invariant: memory takes all bytes"));
        Self { low: vec![0.0], step: 1.0, z }
    }

    /// The values of a column: as the bits of numbers, if some are not finite, or if few are so far from the
    /// others that these would have less than a hundred steps between them.
    fn of_f32(values: Vec<f32>) -> Self {
        let mut sorted: Vec<f32> = values.iter().copied().filter(|x| x.is_finite()).collect();
        sorted.sort_unstable_by(f32::total_cmp);
        let at = |share: usize| sorted.get(share * sorted.len() / 10).copied().unwrap_or_default();
        let (most_span, span) = (at(9) - at(1), sorted.last().copied().unwrap_or_default() - at(0));
        if sorted.len() < values.len() || most_span > 0.0 && span > 600.0 * most_span {
            let bits = values.into_iter().map(f32::to_bits).collect();
            return Self { step: 0.0, ..Self::of_whole(bits) };
        }
        Self::of_real(&[values.into_iter().map(f64::from).collect()], f64::MAX)
    }

    /// The values of each axis, to half of a step: a 65,535th of the largest span, and at most `most`.
    fn of_real(axes: &[Vec<f64>], most: f64) -> Self {
        let bounds = axes.iter().map(|values| {
            values.iter().fold([f64::MAX, f64::MIN], |[low, high], x| [low.min(*x), high.max(*x)])
        });
        let bounds: Vec<[f64; 2]> = bounds.collect();
        let span = bounds.iter().fold(0.0, |span: f64, [low, high]| span.max(high - low));
        let step = (span / 65_535.0).min(most).max(span / 4e9).max(f64::MIN_POSITIVE);
        let whole = axes.iter().zip(&bounds).flat_map(|(values, [low, _])| {
            values.iter().map(move |value| ((value - low) / step).round() as u32)
        });
        Self {
            low: bounds.iter().map(|[low, _]| *low).collect(),
            step,
            ..Self::of_whole(whole.collect())
        }
    }
}

#[derive(Serialize)]
struct Values<'a> {
    name: &'a str,
    unit: &'a str,
    kind: &'a str,
    values: Packed,
    names: Option<Vec<&'a str>>,
}

impl Points {
    /// The indices of the points, those of one ring together: they are near to each other.
    fn order(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.scan.len()).collect();
        if let Some(ring) = &self.scan.ring {
            order.sort_by_key(|i| ring[*i]);
        }
        order
    }

    /// Whether these ranges are the distances from the sensor, which the viewer computes.
    fn are_distances(&self, range_m: &[f32]) -> bool {
        let (scan, at) = (&self.scan, self.scan.sensor_position_m());
        let far_m = |i: usize| {
            let off = |axis| f64::from(scan.positions[i][axis]) + scan.origin[axis] - at[axis];
            DVec3::from([0, 1, 2].map(off)).length()
        };
        (0..scan.len()).all(|i| (f64::from(range_m[i]) - far_m(i)).abs() < 1e-3)
    }

    /// A column of the scan for the page; none if the page does not show it.
    fn packed(
        &self,
        attribute: Attribute,
        column: Column<'_>,
        order: &[usize],
    ) -> Option<Values<'_>> {
        const MEDIA: [&str; 5] = ["surface", "rain", "snow", "fog", "dust"];
        let objects = &self.scan.object_texts[0];
        let (unit, kind, names) = match attribute {
            Attribute::Range => ("m", "number", None),
            Attribute::Time => ("s", "number", None),
            Attribute::Object if !objects.is_empty() => {
                ("", "class", Some(objects.iter().map(|name| &**name).collect()))
            }
            Attribute::Object | Attribute::Triangle | Attribute::Return => ("", "id", None),
            Attribute::Medium => ("", "class", Some(MEDIA.to_vec())),
            _ => ("", "number", None),
        };
        let whole =
            |of: &dyn Fn(usize) -> u32| Packed::of_whole(order.iter().map(|i| of(*i)).collect());
        let values = match column {
            Column::F32(of) if attribute == Attribute::Range && self.are_distances(of) => {
                return None;
            }
            Column::F32(of) => Packed::of_f32(order.iter().map(|i| of[*i]).collect()),
            Column::U8(of) => whole(&|i| of[i].into()),
            // Rings give the others their order.
            Column::U16(of) => Packed::of_whole(of.iter().map(|ring| (*ring).into()).collect()),
            Column::U32(of) => whole(&|i| of[i]),
            Column::Vector(_) => return None,
        };
        Some(Values { name: attribute.name(), unit, kind, values, names })
    }
}

impl Serialize for Points {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        /// Points are where they are to half of this, metres.
        const STEP_M: f64 = 1.0 / 128.0;
        let (scan, order) = (&self.scan, self.order());
        let labels = self.labels.iter().map(|Labels { name, values, names }| Values {
            name,
            unit: "",
            kind: if names.is_some() { "class" } else { "id" },
            values: Packed::of_whole(order.iter().map(|i| values[*i]).collect()),
            names: names.as_ref().map(|names| names.iter().map(|name| &**name).collect()),
        });
        let of_scan = scan.columns().filter_map(|(name, column)| self.packed(name, column, &order));
        let axes = [0, 1, 2].map(|axis| {
            order.iter().map(|i| f64::from(scan.positions[*i][axis])).collect::<Vec<_>>()
        });
        let mut fields = serializer.serialize_struct("Points", 4)?;
        fields.serialize_field("count", &scan.len())?;
        fields.serialize_field("position", &Packed::of_real(&axes, STEP_M))?;
        fields.serialize_field("origin", &scan.origin)?;
        fields.serialize_field("columns", &labels.chain(of_scan).collect::<Vec<_>>())?;
        fields.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::read::ZlibDecoder;
    use formats::Scan;
    use serde_json::Value;
    use std::io::Read;

    /// The numbers of `packed`, as the comment on it says.
    fn unpacked(packed: &Value) -> Vec<f64> {
        let z = STANDARD.decode(packed["z"].as_str().unwrap()).unwrap();
        let mut bytes = Vec::new();
        ZlibDecoder::new(&z[..]).read_to_end(&mut bytes).unwrap();
        let n = bytes.len() / 4;
        let folded = (0..n).map(|i| u32::from_le_bytes([0, 1, 2, 3].map(|b| bytes[b * n + i])));
        let numbers = folded.scan(0u32, |last, folded| {
            *last = last.wrapping_add((folded >> 1) ^ 0u32.wrapping_sub(folded & 1));
            Some(*last)
        });
        let (low, step) = (packed["low"].as_array().unwrap(), packed["step"].as_f64().unwrap());
        let each = n / low.len();
        let value = |(i, z): (usize, u32)| match step {
            0.0 => f64::from(f32::from_bits(z)),
            _ => low[i / each].as_f64().unwrap() + step * f64::from(z),
        };
        numbers.enumerate().map(value).collect()
    }

    /// Three points of rings 1, 0 and 1.
    fn points(intensity: Vec<f32>, range_m: Vec<f32>) -> Points {
        let scan = Scan {
            origin: [500.0, 0.0, 0.0],
            pose: Some([1., 0., 0., 500., 0., 1., 0., 2., 0., 0., 1., 0., 0., 0., 0., 1.]),
            positions: vec![[3.0, 2.0, 4.0], [0.0, 2.0, -1.0], [60.0, -8.0, 0.0]],
            ring: Some(vec![1, 0, 1]),
            intensity: Some(intensity),
            range_m: Some(range_m),
            ..Scan::default()
        };
        let names = Some(vec!["car".to_owned(), "bus".to_owned()]);
        Points { scan, labels: vec![Labels { name: "class", values: vec![1, 1, 0], names }] }
    }

    fn column<'a>(points: &'a Value, name: &str) -> Option<&'a Value> {
        points["columns"].as_array().unwrap().iter().find(|column| column["name"] == name)
    }

    #[test]
    fn numbers_of_a_page_are_those_of_the_points_ring_by_ring() {
        let written = serde_json::to_value(points(vec![0.5, 0.25, 1.0], vec![9.0; 3])).unwrap();
        let numbers = |name: &str| unpacked(&column(&written, name).unwrap()["values"]);
        assert_eq!(numbers("ring"), [1.0, 0.0, 1.0]);
        assert_eq!(numbers("class"), [1.0, 1.0, 0.0]);
        assert_eq!(column(&written, "class").unwrap()["names"], serde_json::json!(["car", "bus"]));
        for (found, expected) in numbers("intensity").iter().zip([0.25, 0.5, 1.0]) {
            assert!((found - expected).abs() < 1e-5, "{found}");
        }
        let place = unpacked(&written["position"]);
        let expected = [0.0, 3.0, 60.0, 2.0, 2.0, -8.0, -1.0, 4.0, 0.0];
        for (found, expected) in place.iter().zip(expected) {
            assert!((found - expected).abs() <= 1.0 / 256.0, "{place:?}");
        }
        assert_eq!(numbers("range"), [9.0; 3], "ranges that the viewer would not compute");
    }

    #[test]
    fn ranges_from_the_sensor_are_left_out_and_far_values_leave_others_as_they_are() {
        let mut shown = points(vec![0.0; 3], vec![5.0, 1.0, 60.827_625]);
        shown.scan.intensity = None;
        let written = serde_json::to_value(&shown).unwrap();
        assert!(column(&written, "range").is_none());
        let near = (0..1000).map(|i| 1e-3 * i as f32);
        for far in [1e9, f32::INFINITY, f32::NAN] {
            let values: Vec<f32> = near.clone().chain([far]).collect();
            let found = unpacked(&serde_json::to_value(Packed::of_f32(values)).unwrap());
            assert!(near.clone().zip(&found).all(|(value, found)| f64::from(value) == *found));
            assert!(found[1000] == f64::from(far) || far.is_nan() && found[1000].is_nan());
        }
        let values: Vec<f32> = near.clone().collect();
        let found = unpacked(&serde_json::to_value(Packed::of_f32(values)).unwrap());
        let is_near = |(value, found): (f32, &f64)| (f64::from(value) - found).abs() < 1e-5;
        assert!(near.zip(&found).all(is_near));
    }
}
