//! What is probably wrong with the unit or the place of a mesh.

use super::{Instance, Mesh};
use crate::effects::Effects;
use crate::mesh::frame::Unit;
use crate::mesh::unit_frame::bounding_box;
use crate::pose::Pose;
use glam::DVec3;

/// Sizes of meshes that are expected, metres: beyond them, the unit is probably another.
const EXPECTED_M: std::ops::RangeInclusive<f64> = 0.01..=100.0;

/// A bounding box, metres.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// The least coordinates.
    pub low: DVec3,
    /// The largest coordinates.
    pub high: DVec3,
}

impl Mesh {
    /// Its bounding box.
    #[doc(hidden)]
    #[must_use]
    pub fn extent(&self) -> Extent {
        let [low, high] = self.bounds_m().map(DVec3::from_array);
        Extent { low, high }
    }
}

impl Instance {
    /// Its bounding box in the world; if it moves, at time 0.
    #[doc(hidden)]
    #[must_use]
    pub fn extent(&self) -> Extent {
        let at = self.motion.as_ref().map_or(Pose::IDENTITY, |motion| motion.at(0.0));
        let vertices = self.mesh.vertices().iter().map(|vertex| {
            at.rotation * (self.pose.rotation * (self.scale * *vertex) + self.pose.position_m)
        });
        let (low, high) = bounding_box(vertices);
        Extent { low: low + at.position_m, high: high + at.position_m }
    }
}

impl Extent {
    /// The box around both.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Why the unit of its source is probably not `unit`, if its size says so.
    #[must_use]
    pub fn doubtful_size(&self, unit: Unit) -> Option<String> {
        let size = self.high - self.low;
        let is_expected = size == DVec3::ZERO || EXPECTED_M.contains(&size.max_element());
        (!is_expected).then(|| {
            let likely = match unit {
                _ if size.max_element() > 1.0 => Unit::Millimetre,
                Unit::Metre => Unit::Inch,
                _ => Unit::Metre,
            };
            let found = shown(size);
            let named = if unit == Unit::Metre { "the metre" } else { unit.plural() };
            let doubt =
                format!("expected a size of 1 cm to 100 m, found {found} if its unit is {named}");
            if likely == unit {
                return doubt;
            }
            let other = shown(size * (likely.metres() / unit.metres()));
            format!("{doubt} ({other} if it is {})", likely.plural())
        })
    }

    /// As [`Extent::doubtful_size`], of a mesh of a scene, which may be a terrain: only a solid of more
    /// than 200 m, or of less than 1 cm, is doubted.
    pub(crate) fn doubtful_unit(&self, unit: Unit) -> Option<String> {
        let size = self.high - self.low;
        let (least, most) = (size.min_element(), size.max_element());
        let is_doubtful = most > 200.0 && least > most / 10.0 || most < 0.01;
        self.doubtful_size(unit).filter(|_| is_doubtful)
    }

    /// Why its form is not to be seen in scans with `effects`: noise or a quantum as large as it is.
    #[must_use]
    pub fn doubtful_effects(&self, effects: &Effects) -> Option<String> {
        let size = self.high - self.low;
        let noise = effects.noise.map(|noise| ("noise", noise.sigma_m));
        let quantum = effects.quantum.and_then(|quantum| Some(("a quantum", quantum.step_m?)));
        let largest = noise.into_iter().chain(quantum).find(|(_, m)| *m >= size.max_element())?;
        let (what, found_m) = largest;
        Some(format!("expected {what} smaller than the mesh, {}, found {found_m} m", shown(size)))
    }

    /// Whether one of `sensors_m` stands inside its bounding box: it then sees the mesh from inside.
    #[must_use]
    pub fn surrounds(&self, sensors_m: &[DVec3]) -> bool {
        let is_inside =
            |sensor: &DVec3| sensor.cmpgt(self.low).all() && sensor.cmplt(self.high).all();
        sensors_m.iter().any(is_inside)
    }
}

/// `0.45 x 0.4 x 0.9 m`.
fn shown(size: DVec3) -> String {
    let [x, y, z] = size.to_array().map(|side| format!("{:.3e}", side).parse().unwrap_or(side));
    format!("{x} x {y} x {z} m")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron(size: f64) -> Mesh {
        let corners = [[0.0; 3], [size, 0.0, 0.0], [0.0, size, 0.0], [0.0, 0.0, size]];
        Mesh::from_triangles(corners.to_vec(), vec![[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]])
            .unwrap()
    }

    #[test]
    fn sizes_of_another_unit_are_doubted_with_both_sizes() {
        for (size, unit, expected) in [
            (
                950.0,
                Unit::Metre,
                Some(
                    "950 x 950 x 950 m if its unit is the metre (0.95 x 0.95 x 0.95 m if it is millimetres)",
                ),
            ),
            (0.002, Unit::Metre, Some("0.002 x 0.002 x 0.002 m")),
            (
                0.002,
                Unit::Millimetre,
                Some("if its unit is millimetres (2 x 2 x 2 m if it is metres)"),
            ),
            (900.0, Unit::Millimetre, Some("found 900 x 900 x 900 m if its unit is millimetres")),
            (304.8, Unit::Foot, Some("is feet (1 x 1 x 1 m if it is millimetres)")),
            (0.0, Unit::Metre, None),
            (0.01, Unit::Metre, None),
            (100.0, Unit::Inch, None),
        ] {
            let found = tetrahedron(size).extent().doubtful_size(unit);
            assert_eq!(found.is_some(), expected.is_some(), "{size}: {found:?}");
            let (found, part) = (found.unwrap_or_default(), expected.unwrap_or_default());
            assert!(found.contains(part), "{found}");
        }
    }

    #[test]
    fn of_a_scene_s_meshes_terrains_are_not_doubted() {
        let solid = |size| tetrahedron(size).extent().doubtful_unit(Unit::Metre).is_some();
        assert_eq!([0.001, 1.0, 150.0, 4300.0].map(solid), [true, false, false, true]);
        let corners = [[0.0; 3], [900.0, 0.0, 0.0], [0.0, 900.0, 30.0]];
        let terrain = Mesh::from_triangles(corners.to_vec(), vec![[0, 1, 2]]).unwrap();
        assert_eq!(terrain.extent().doubtful_unit(Unit::Metre), None);
    }

    #[test]
    fn noise_and_quanta_as_large_as_the_mesh_are_doubted() {
        for (effects, doubt) in [
            ("noise = { sigma_m = 1.9 }\nquantise_m = 1.9", None),
            (
                "noise = { sigma_m = 2 }",
                Some("noise smaller than the mesh, 2 x 2 x 2 m, found 2 m"),
            ),
            ("quantise_m = 4", Some("a quantum smaller than the mesh, 2 x 2 x 2 m, found 4 m")),
            ("quantise_m = true", None),
        ] {
            let effects: Effects = toml::from_str(effects).unwrap();
            let found = tetrahedron(2.0).extent().doubtful_effects(&effects);
            assert_eq!(found, doubt.map(|doubt| format!("expected {doubt}")));
        }
    }

    #[test]
    fn a_sensor_inside_the_bounding_box_is_found() {
        let mesh = tetrahedron(2.0);
        assert!(mesh.extent().surrounds(&[DVec3::splat(9.0), DVec3::splat(1.9)]));
        assert!(!mesh.extent().surrounds(&[DVec3::new(1.0, 1.0, 2.0), DVec3::splat(-0.1)]));
    }
}
