mod details;
mod fuselage;
mod jet;
mod wing;

use crate::primitives::{Builder, DVec3, Makes, Sampler, dvec3};
use details::{gear, jet_engine, propeller, struts};
use fuselage::Fuselage;
use jet::fighter;
use wing::{Wing, fin};

/// The makes, with their weights. Airplanes have the size of real ones and fly to -y.
pub const MAKES: Makes = &[
    (3, liner),
    (2, light),
    (1, biplane),
    (2, |b, s| fighter(b, s, false)),
    (1, |b, s| fighter(b, s, true)),
    (1, glider),
    (1, flying_wing),
];

/// A low or high swept wing, engines under it or at the tail.
fn liner(b: &mut Builder, s: &mut Sampler) {
    let length_m = s.log_uniform(20.0, 70.0);
    let body =
        Fuselage { slender: s.uniform(8.0, 13.0), nose: 0.1, tail: 0.32, length_m, upsweep: 0.6 };
    let r = body.radius_m();
    body.build(b);
    let sweep = s.uniform(0.15, 0.6);
    let high = s.chance(0.2);
    let wing = Wing {
        root: dvec3(0.0, -0.12 * length_m, if high { 0.75 * r } else { -0.55 * r }),
        half_span_m: length_m * s.uniform(0.4, 0.56),
        root_chord_m: length_m * s.uniform(0.15, 0.23),
        taper: s.uniform(0.2, 0.4),
        sweep,
        dihedral: if high { -0.03 } else { s.uniform(0.04, 0.12) },
        thickness: 0.11,
    };
    wing.build(b);
    if s.chance(0.35) {
        wing.winglets(b, 0.06 * length_m);
    }
    let rear_engines = !high && s.chance(0.3);
    let t_tail = rear_engines || s.chance(0.1);
    tail(b, s, &body, t_tail);
    let engine_m = length_m * s.uniform(0.055, 0.09);
    if rear_engines {
        let at = dvec3(1.45 * r, 0.27 * length_m, 0.45 * r);
        b.mirrored_x(|b| jet_engine(b, at, 0.3 * engine_m, 1.2 * engine_m));
    } else {
        engines(b, s, &wing, engine_m, high);
    }
    if s.chance(0.3) {
        gear(b, &body, -r - 0.9 * engine_m, 0.35 * engine_m);
    }
}

/// Jets or propellers on the wing, one or two a side.
fn engines(b: &mut Builder, s: &mut Sampler, wing: &Wing, size_m: f64, high: bool) {
    let stations: &[f64] = s.pick(&[&[0.33], &[0.33], &[0.3, 0.58]]);
    let props = high && s.chance(0.6);
    for &station in stations {
        let nose = wing.leading_edge(station);
        let radius_m = 0.32 * size_m;
        b.mirrored_x(|b| {
            if props {
                let front = nose - 0.7 * size_m * DVec3::Y;
                details::nacelle(b, front, 0.25 * size_m, 2.0 * size_m);
                propeller(b, front, 1.1 * size_m, 4);
            } else {
                let hung = nose - dvec3(0.0, 0.35 * size_m, 1.05 * radius_m);
                jet_engine(b, hung, radius_m, 1.2 * size_m);
            }
        });
    }
}

/// A conventional, T-shaped or cruciform tail.
fn tail(b: &mut Builder, s: &mut Sampler, body: &Fuselage, t_tail: bool) {
    let length_m = body.length_m;
    let high_m = length_m * s.uniform(0.11, 0.17);
    let chord_m = high_m * s.uniform(0.8, 1.2);
    let sweep = s.uniform(0.3, 0.8);
    let root = body.spine(0.97) - chord_m * DVec3::Y;
    fin(b, root, high_m, chord_m, sweep);
    let stabilizer_chord_m = 0.75 * chord_m;
    let y = 0.47 * length_m - stabilizer_chord_m;
    let at = if t_tail {
        root + dvec3(0.0, sweep * high_m, 0.97 * high_m)
    } else {
        dvec3(0.0, y, root.z + 0.05 * high_m)
    };
    let stabilizer = Wing {
        root: at,
        half_span_m: high_m * s.uniform(0.9, 1.4),
        root_chord_m: stabilizer_chord_m,
        taper: s.uniform(0.35, 0.7),
        sweep: 0.7 * sweep,
        dihedral: 0.03,
        thickness: 0.09,
    };
    stabilizer.build(b);
}

/// A propeller airplane for a few people: high wing on struts or low wing.
fn light(b: &mut Builder, s: &mut Sampler) {
    let length_m = s.uniform(6.0, 12.0);
    let body =
        Fuselage { slender: s.uniform(5.5, 8.0), nose: 0.22, tail: 0.6, length_m, upsweep: 0.7 };
    let r = body.radius_m();
    body.build(b);
    let high = s.chance(0.5);
    let wing = Wing {
        root: dvec3(0.0, -0.2 * length_m, if high { 0.95 * r } else { -0.7 * r }),
        half_span_m: length_m * s.uniform(0.5, 0.75),
        root_chord_m: length_m * s.uniform(0.16, 0.24),
        taper: s.uniform(0.45, 1.0),
        sweep: s.uniform(0.0, 0.08),
        dihedral: s.uniform(0.0, 0.09),
        thickness: 0.13,
    };
    wing.build(b);
    if high {
        struts(b, &wing, -0.8 * r);
    }
    if !high || s.chance(0.4) {
        details::canopy(b, dvec3(0.0, -0.06 * length_m, 0.75 * r), r, 0.13 * length_m);
    }
    let t_tail = s.chance(0.15);
    tail(b, s, &body, t_tail);
    if s.chance(0.75) {
        propeller(b, body.nose(), 0.9 * r + 0.06 * length_m, s.pick(&[2, 3, 3]));
    } else {
        engines(b, s, &wing, 0.1 * length_m, true);
    }
    if s.chance(0.7) {
        gear(b, &body, -1.9 * r, 0.28 * r);
    }
}

/// Two wings one above the other, with struts between.
fn biplane(b: &mut Builder, s: &mut Sampler) {
    let length_m = s.uniform(6.0, 9.0);
    let body =
        Fuselage { slender: s.uniform(6.0, 8.0), nose: 0.12, tail: 0.65, length_m, upsweep: 0.4 };
    let r = body.radius_m();
    body.build(b);
    let lower = Wing {
        root: dvec3(0.0, -0.25 * length_m, -0.7 * r),
        half_span_m: length_m * s.uniform(0.45, 0.62),
        root_chord_m: length_m * s.uniform(0.15, 0.2),
        taper: s.uniform(0.8, 1.0),
        sweep: 0.0,
        dihedral: s.uniform(0.0, 0.06),
        thickness: 0.08,
    };
    let gap_m = r * s.uniform(2.2, 3.0);
    let stagger_m = -s.uniform(0.0, 0.08) * length_m;
    let upper = Wing { root: lower.root + dvec3(0.0, stagger_m, gap_m), ..lower };
    lower.build(b);
    upper.build(b);
    for station in [0.12, 0.75] {
        details::wing_struts(b, &lower, &upper, station);
    }
    tail(b, s, &body, false);
    propeller(b, body.nose(), 0.16 * length_m, 2);
    gear(b, &body, -2.0 * r, 0.35 * r);
}

/// A sailplane: very long slender wings, a thin tail boom, a T-tail.
fn glider(b: &mut Builder, s: &mut Sampler) {
    let length_m = s.uniform(6.0, 8.5);
    let body =
        Fuselage { slender: s.uniform(9.0, 12.0), nose: 0.2, tail: 0.65, length_m, upsweep: 0.5 };
    let r = body.radius_m();
    body.build(b);
    details::canopy(b, dvec3(0.0, -0.3 * length_m, 0.55 * r), 0.75 * r, 0.12 * length_m);
    let wing = Wing {
        root: dvec3(0.0, -0.15 * length_m, 0.6 * r),
        half_span_m: length_m * s.uniform(0.9, 1.4),
        root_chord_m: length_m * s.uniform(0.1, 0.15),
        taper: s.uniform(0.3, 0.6),
        sweep: s.uniform(-0.02, 0.04),
        dihedral: s.uniform(0.03, 0.08),
        thickness: 0.13,
    };
    wing.build(b);
    if s.chance(0.4) {
        wing.winglets(b, 0.05 * length_m);
    }
    let t_tail = s.chance(0.8);
    tail(b, s, &body, t_tail);
}

/// Wings only, thick in the middle, with engine humps.
fn flying_wing(b: &mut Builder, s: &mut Sampler) {
    let half_span_m = s.uniform(8.0, 26.0);
    let wing = Wing {
        root: dvec3(0.0, -0.3 * half_span_m, 0.0),
        half_span_m,
        root_chord_m: half_span_m * s.uniform(0.45, 0.65),
        taper: s.uniform(0.12, 0.3),
        sweep: s.uniform(0.45, 0.75),
        dihedral: s.uniform(0.0, 0.04),
        thickness: s.uniform(0.12, 0.18),
    };
    wing.build(b);
    let body = Fuselage {
        slender: s.uniform(4.0, 6.0),
        nose: 0.3,
        tail: 0.4,
        length_m: 1.05 * wing.root_chord_m,
        upsweep: 0.0,
    };
    b.shifted(wing.root + 0.5 * wing.root_chord_m * DVec3::Y, |b| body.build(b));
    let hump = wing.leading_edge(0.16) + dvec3(0.0, 0.1, 0.04) * half_span_m;
    b.mirrored_x(|b| details::nacelle(b, hump, 0.04 * half_span_m, 0.35 * half_span_m));
    if s.chance(0.4) {
        wing.winglets(b, 0.15 * half_span_m);
    }
}
