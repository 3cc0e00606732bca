use std::f64::consts::PI;
use std::sync::LazyLock;

use glam::DVec3;
use proptest::prelude::*;

use super::*;

static PATTERNS: LazyLock<Vec<BeamPattern>> = LazyLock::new(|| {
    let thin = |name: &str, k: u32| sensor(name).decimated(NonZeroU32::new(k).unwrap()).pattern();
    vec![thin("vlp32c", 8), thin("blainder-ultrapuck", 31), thin("generic-static", 1), poles()]
});

/// Straight up and down among others, opposite rays in one block.
fn poles() -> BeamPattern {
    parse(&TINY.replace("= 5\n", "= 90\n").replace("= -5\n", "= -90\n")).unwrap().pattern()
}

/// The angle between two unit vectors, accurate when small too (Kahan).
fn angle_rad(a: DVec3, b: DVec3) -> f64 {
    2.0 * (a - b).length().atan2((a + b).length())
}

/// Asserts that all rays inside are found, none far outside, and in order.
fn assert_culls(pattern: &BeamPattern, cone: &Cone) {
    let found = pattern.within(cone);
    let mut next = found.iter().peekable();
    for &ray in &pattern.order {
        let outside_rad =
            angle_rad(cone.axis, pattern.directions[ray as usize]) - cone.half_angle_rad;
        if next.next_if(|&&found| found == ray).is_some() {
            // 4e-15 in the cosine of a cone thinner than 1e-7 rad.
            assert!(outside_rad < 1.1e-7, "{cone:?} found {ray}, {outside_rad} outside");
        } else {
            assert!(outside_rad > 0.0, "{cone:?} lost {ray}, {} inside", -outside_rad);
        }
    }
    assert!(next.next().is_none());
}

fn any_unit() -> impl Strategy<Value = DVec3> {
    (-1.0..1.0f64, -PI..PI).prop_map(|(z, azimuth)| {
        let (sin, cos) = azimuth.sin_cos();
        let level = (1.0 - z * z).sqrt();
        DVec3::new(level * cos, level * sin, z).normalize()
    })
}

proptest! {
    #[test]
    fn culling_equals_brute_force(
        axis in any_unit(),
        half_angle_rad in prop_oneof![0.0..0.5f64, 0.0..PI, 1e-9..1e-3],
        which in 0usize..4,
    ) {
        assert_culls(&PATTERNS[which], &Cone { axis, half_angle_rad });
    }

    #[test]
    fn a_ray_on_the_edge_is_never_lost(
        edge in any::<prop::sample::Index>(),
        axis in any_unit(),
        which in 0usize..4,
    ) {
        let pattern = &PATTERNS[which];
        let ray = edge.index(pattern.len());
        let direction = pattern.directions[ray];
        for (axis, half_angle_rad) in [(direction, 0.0), (axis, angle_rad(axis, direction))] {
            let found = pattern.within(&Cone { axis, half_angle_rad });
            prop_assert!(found.contains(&(ray as u32)));
        }
    }
}

#[test]
fn a_cone_of_all_directions_gives_all_rays() {
    for pattern in PATTERNS.iter() {
        for half_angle_rad in [PI, 4.0, f64::INFINITY, f64::NAN] {
            let found = pattern.within(&Cone { axis: DVec3::Z, half_angle_rad });
            assert_eq!(found, pattern.order);
        }
        let nowhere = Cone { axis: DVec3::NAN, half_angle_rad: 0.1 };
        assert_eq!(pattern.within(&nowhere), pattern.order);
    }
}

#[test]
fn a_cone_away_from_all_beams_gives_none() {
    let pattern = sensor("vlp32c").pattern();
    assert!(pattern.within(&Cone { axis: DVec3::Z, half_angle_rad: 1.0 }).is_empty());
    let empty = BeamPattern::new(Vec::new(), Vec::new(), Vec::new());
    assert!(empty.is_empty());
    assert!(empty.within(&Cone { axis: DVec3::X, half_angle_rad: 1.0 }).is_empty());
}
