use crate::primitives::{Builder, DAffine3, DVec3, cap, dvec3, outline, skin};

/// A pair of wings. Slopes are per metre of span.
#[derive(Clone, Copy)]
pub struct Wing {
    /// The leading edge at the plane of symmetry.
    pub root: DVec3,
    pub half_span_m: f64,
    pub root_chord_m: f64,
    /// Chord at the tip over that at the root.
    pub taper: f64,
    /// The slope of the leading edge to the rear.
    pub sweep: f64,
    /// The slope of the wing upwards.
    pub dihedral: f64,
    /// Thickness over chord.
    pub thickness: f64,
}

impl Wing {
    /// The leading edge of the right wing at a fraction of the half span.
    pub fn leading_edge(&self, share: f64) -> DVec3 {
        let out_m = share * self.half_span_m;
        self.root + dvec3(1.0, self.sweep, self.dihedral) * out_m
    }

    pub fn chord_m(&self, share: f64) -> f64 {
        self.root_chord_m * (1.0 + share * (self.taper - 1.0))
    }

    pub fn build(&self, b: &mut Builder) {
        let section = outline::airfoil(self.thickness, b.curved(self.root_chord_m, 4));
        let ends = [0.0, 1.0].map(|share| {
            let (nose, chord) = (self.leading_edge(share), self.chord_m(share));
            section.iter().map(|p| nose + chord * dvec3(0.0, p.x, p.y)).collect()
        });
        b.mirrored_x(|b| open_at_root(b, &ends));
    }

    pub fn winglets(&self, b: &mut Builder, high_m: f64) {
        let chord = self.chord_m(1.0);
        let tip = self.leading_edge(1.0);
        b.mirrored_x(|b| fin(b, tip, high_m, chord, 0.7));
    }
}

/// An upright fin. Its leading edge starts at `root` and moves back by `sweep` per metre of height.
pub fn fin(b: &mut Builder, root: DVec3, high_m: f64, chord_m: f64, sweep: f64) {
    let section = outline::airfoil(0.09, b.curved(chord_m, 4));
    let ends = [(0.0, chord_m), (high_m, 0.5 * chord_m)].map(|(up, chord)| {
        section.iter().map(|p| dvec3(chord * p.y, sweep * up + chord * p.x, up)).collect()
    });
    // With x and y exchanged, the outline runs clockwise; mirrored, it looks outwards.
    b.turned(root, DAffine3::from_scale(dvec3(-1.0, 1.0, 1.0)), |b| open_at_root(b, &ends));
}

/// The surface from the first section, which stays open, to the last, which is closed.
fn open_at_root(b: &mut Builder, ends: &[Vec<DVec3>; 2]) {
    skin(b, ends);
    cap(b, &ends[1]);
}
