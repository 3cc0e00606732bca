//! Whether a mesh has a size of things that LiDARs see.

use super::Warning;
use crate::unit::Unit;

/// Sizes of meshes that are expected, metres: beyond them, the unit is probably another.
const EXPECTED_M: std::ops::RangeInclusive<f64> = 0.01..=100.0;

fn largest(size_m: [f64; 3]) -> f64 {
    size_m.into_iter().fold(0.0, f64::max)
}

/// Why the unit of a mesh of this size, metres, is probably not `unit`. A user names another by `remedy`,
/// if there is one in which the size is expected.
#[must_use]
pub fn mesh_size(size_m: [f64; 3], unit: Unit, remedy: &'static str) -> Option<Warning> {
    let most = largest(size_m);
    let is_expected = most == 0.0 || EXPECTED_M.contains(&most);
    let fits = |other: &Unit| EXPECTED_M.contains(&(most / unit.metres() * other.metres()));
    (!is_expected).then(|| {
        let likely = Unit::ALL.into_iter().find(fits);
        Warning::MeshSize { size_m, unit, likely, remedy }
    })
}

/// Why the unit of an object of a scene, of this size in metres, is probably not `unit`, or not the metre
/// if its user names none. The object may be a terrain or a building: only a solid of more than 100 m, or
/// of 200 m if its unit is named, or a thing of less than 1 cm has an odd size. `is_around` a sensor, an
/// object of unnamed unit and more than 20 m may be a small one in millimetres.
#[must_use]
pub fn mesh_in_scene(size_m: [f64; 3], unit: Option<Unit>, is_around: bool) -> Vec<Warning> {
    let (least, most) = (size_m.into_iter().fold(f64::INFINITY, f64::min), largest(size_m));
    let is_solid = least > most / 10.0;
    let is_odd = is_solid && most > if unit.is_some() { 200.0 } else { 100.0 } || most < 0.01;
    let remedy = "`units` of the object names another unit";
    let size = mesh_size(size_m, unit.unwrap_or_default(), remedy).filter(|_| is_odd);
    let is_inside = is_around && is_solid && (size.is_some() || unit.is_none() && most > 20.0);
    let elsewhere = "another place, or `units` of the object (\"mm\", or \"m\" if it is a hall)";
    let inside = is_inside.then(|| Warning::SensorInside(elsewhere.to_owned()));
    size.into_iter().chain(inside).collect()
}

/// The unit of a mesh with these bounds whose scan `points`, metres, are: that with most of them in the mesh's
/// bounding box, with a tenth of its size around it; a fifth or more, which span 0.4 of the size. `None` of
/// something else's.
#[must_use]
pub fn unit_of_scanned(
    mesh: [[f64; 3]; 2],
    points: impl Iterator<Item = [f64; 3]> + Clone,
) -> Option<Unit> {
    let size = |[low, high]: [[f64; 3]; 2]| largest([0, 1, 2].map(|axis| high[axis] - low[axis]));
    let fit = |unit: Unit| {
        let [low, high] = mesh.map(|at| at.map(|x| x * unit.metres()));
        let room = 0.1 * size([low, high]);
        let is_in =
            |at: &[f64; 3], axis| (low[axis] - room..=high[axis] + room).contains(&at[axis]);
        let on = points.clone().filter(|at| (0..3).all(|axis| is_in(at, axis)));
        let spanned = size(bounds(on.clone())) / size([low, high]);
        let n_on = on.count();
        (spanned >= 0.4 && 5 * n_on >= points.clone().count()).then_some((n_on, spanned, unit))
    };
    let fits = Unit::ALL.into_iter().filter_map(fit);
    let best = fits.max_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    best.map(|(.., unit)| unit)
}

/// The least and the largest coordinates of places.
#[must_use]
pub fn bounds(places: impl Iterator<Item = [f64; 3]>) -> [[f64; 3]; 2] {
    let none = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    places.fold(none, |[low, high], at| {
        [[0, 1, 2].map(|i| low[i].min(at[i])), [0, 1, 2].map(|i| high[i].max(at[i]))]
    })
}

/// Why the form of a mesh of this size, metres, is not to be seen in scans: noise of a standard deviation
/// or a quantum of ranges that are as large.
#[must_use]
pub fn effect_on_mesh(
    size_m: [f64; 3],
    noise_m: Option<f64>,
    quantum_m: Option<f64>,
) -> Option<Warning> {
    let effects = [("noise", noise_m), ("a quantum", quantum_m)];
    let mut known = effects.into_iter().filter_map(|(what, m)| Some((what, m?)));
    let (what, found_m) = known.find(|(_, m)| *m >= largest(size_m))?;
    Some(Warning::EffectOnMesh { what, size_m, found_m })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_of_another_unit_are_named_with_both_sizes() {
        for (size, unit, expected) in [
            (
                950.0,
                Unit::Metre,
                Some("is the metre (0.95 x 0.95 x 0.95 m if it is millimetres); -"),
            ),
            (0.002, Unit::Metre, Some("0.002 x 0.002 x 0.002 m if its unit is the metre.")),
            (9e5, Unit::Metre, Some("x 900000 m if its unit is the metre.")),
            (
                0.002,
                Unit::Millimetre,
                Some("its unit is millimetres (2 x 2 x 2 m if it is metres)"),
            ),
            (900.0, Unit::Millimetre, Some("found 900 x 900 x 900 m if its unit is millimetres.")),
            (304.8, Unit::Foot, Some("is feet (1 x 1 x 1 m if it is millimetres)")),
            (0.0, Unit::Metre, None),
            (0.01, Unit::Metre, None),
            (100.0, Unit::Inch, None),
        ] {
            let found = mesh_size([size; 3], unit, "--units").map(|warning| format!("{warning}."));
            assert_eq!(found.is_some(), expected.is_some(), "{size}: {found:?}");
            let (found, part) = (found.unwrap_or_default(), expected.unwrap_or_default());
            assert!(found.contains(part), "{found}");
        }
    }

    #[test]
    fn terrain_in_a_scene_is_plausible() {
        let n = |size_m, unit, is_around| mesh_in_scene(size_m, unit, is_around).len();
        let solids = |unit, is_around| {
            [0.001, 1.0, 30.0, 150.0, 4300.0].map(|size| n([size; 3], unit, is_around))
        };
        assert_eq!(solids(Some(Unit::Metre), false), [1, 0, 0, 0, 1]);
        assert_eq!(solids(None, false), [1, 0, 0, 1, 1]);
        assert_eq!(solids(Some(Unit::Metre), true), [2, 0, 0, 0, 2]);
        assert_eq!(solids(None, true), [2, 0, 1, 2, 2]);
        assert_eq!(n([900.0, 900.0, 30.0], None, true), 0);
    }

    /// A bracket: of its base and its wall, a sensor sees the insides.
    #[test]
    fn the_unit_of_a_scanned_mesh_is_that_in_which_all_points_are_on_it() {
        let bracket = [[0.0; 3], [200.0, 80.0, 120.0]];
        let steps = || (0..40).map(f64::from);
        let seen = |unit: Unit, away_m: [f64; 3]| {
            let base = steps().flat_map(|x| steps().map(move |y| [5.0 * x, 2.0 * y, 8.0]));
            let wall = steps().flat_map(|y| steps().map(move |z| [8.0, 2.0 * y, 3.0 * z]));
            let of = |at: [f64; 3]| [0, 1, 2].map(|i| unit.metres() * at[i] + away_m[i]);
            base.chain(wall).map(of).collect::<Vec<_>>()
        };
        for unit in Unit::ALL {
            let found = unit_of_scanned(bracket, seen(unit, [0.0; 3]).into_iter());
            assert_eq!(found, Some(unit));
            let away_m = [1e3 * unit.metres(); 3];
            assert_eq!(unit_of_scanned(bracket, seen(unit, away_m).into_iter()), None, "{unit}");
        }
    }

    #[test]
    fn noise_and_quanta_as_large_as_the_mesh_are_named() {
        for (noise_m, quantum_m, expected) in [
            (Some(1.9), Some(1.9), None),
            (Some(2.0), None, Some("noise smaller than the mesh, 2 x 2 x 2 m, found 2 m")),
            (None, Some(4.0), Some("a quantum smaller than the mesh, 2 x 2 x 2 m, found 4 m")),
            (None, None, None),
        ] {
            let found = effect_on_mesh([2.0; 3], noise_m, quantum_m).map(|it| it.to_string());
            assert_eq!(found, expected.map(|it| format!("expected {it}")));
        }
    }
}
