use super::details;
use super::fuselage::Fuselage;
use super::wing::{Wing, fin};
use crate::primitives::{Builder, DVec3, Sampler, dvec3};

/// A fighter with thin wings, one or two fins and a canopy. One with `delta` wings has no tail.
pub fn fighter(b: &mut Builder, s: &mut Sampler, delta: bool) {
    let length_m = s.uniform(11.0, 20.0);
    let body =
        Fuselage { slender: s.uniform(8.0, 12.0), nose: 0.3, tail: 0.12, length_m, upsweep: 0.0 };
    let r = body.radius_m();
    body.build(b);
    details::canopy(b, dvec3(0.0, -0.25 * length_m, 0.6 * r), 0.8 * r, 0.12 * length_m);
    let chord_m = length_m * if delta { s.uniform(0.42, 0.55) } else { s.uniform(0.24, 0.34) };
    let wing = Wing {
        root: dvec3(0.0, 0.4 * length_m - chord_m, s.uniform(-0.4, 0.4) * r),
        half_span_m: length_m * s.uniform(0.26, 0.38),
        root_chord_m: chord_m,
        taper: if delta { s.uniform(0.05, 0.15) } else { s.uniform(0.2, 0.4) },
        sweep: if delta { s.uniform(0.9, 1.4) } else { s.uniform(0.4, 0.9) },
        dihedral: s.uniform(-0.05, 0.03),
        thickness: 0.04,
    };
    wing.build(b);
    let fin_m = length_m * s.uniform(0.12, 0.18);
    let root = dvec3(0.0, 0.46 * length_m - fin_m, 0.5 * r);
    if s.chance(0.5) {
        let aside = 0.8 * r * DVec3::X;
        b.mirrored_x(|b| fin(b, root + aside, fin_m, fin_m, 0.7));
    } else {
        fin(b, root, fin_m, 1.1 * fin_m, 0.8);
    }
    if !delta {
        let stabilizer = Wing {
            root: dvec3(0.0, 0.49 * length_m - fin_m, 0.0),
            half_span_m: 0.5 * wing.half_span_m + r,
            root_chord_m: fin_m,
            ..wing
        };
        stabilizer.build(b);
    }
    let intake_m = 0.6 * r;
    let at = dvec3(1.1 * r, -0.1 * length_m, -0.1 * r);
    b.mirrored_x(|b| details::nacelle(b, at, intake_m, 0.55 * length_m));
    if s.chance(0.4) {
        let tip = wing.leading_edge(0.98) - 0.03 * length_m * DVec3::Y;
        b.mirrored_x(|b| details::nacelle(b, tip, 0.12 * r, 0.18 * length_m));
    }
}
