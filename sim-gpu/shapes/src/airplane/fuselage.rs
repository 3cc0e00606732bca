use crate::primitives::{Builder, DVec2, DVec3, dvec3, loft, outline};

/// A body from its nose at y = -length / 2 to its tail at y = length / 2.
pub struct Fuselage {
    pub length_m: f64,
    /// Length over diameter.
    pub slender: f64,
    /// Share of the length in which the nose widens.
    pub nose: f64,
    /// Share of the length in which the tail narrows.
    pub tail: f64,
    /// The rise of the tail's end, over the radius.
    pub upsweep: f64,
}

impl Fuselage {
    pub fn radius_m(&self) -> f64 {
        0.5 * self.length_m / self.slender
    }

    pub fn nose(&self) -> DVec3 {
        dvec3(0.0, -0.5 * self.length_m, 0.0)
    }

    /// The middle of the section at a fraction of the length from the nose.
    pub fn spine(&self, share: f64) -> DVec3 {
        let rise = self.upsweep * self.radius_m() * self.along_tail(share).powi(2);
        dvec3(0.0, (share - 0.5) * self.length_m, rise)
    }

    /// 0 ahead of the tail, 1 at its end.
    fn along_tail(&self, share: f64) -> f64 {
        ((share - 1.0 + self.tail) / self.tail).max(0.0)
    }

    /// The radius at a fraction of the length: a quarter ellipse at the nose, a cylinder, and a
    /// tail that narrows to a fifth.
    fn radius_at(&self, share: f64) -> f64 {
        let ahead = (1.0 - share / self.nose).max(0.0);
        let nose = (1.0 - ahead * ahead).max(0.0).sqrt().max(0.06);
        let tail = 1.0 - 0.8 * libm::pow(self.along_tail(share), 1.4);
        self.radius_m() * nose * tail
    }

    pub fn build(&self, b: &mut Builder) {
        let n_around = b.around(self.radius_m(), 10);
        let n_nose = b.curved(self.nose * self.length_m, 4);
        let n_middle = b.straight((1.0 - self.nose - self.tail) * self.length_m);
        let n_tail = b.curved(self.tail * self.length_m, 4);
        // Squares put more sections where the nose is blunt.
        let nose = (0..n_nose).map(|k| self.nose * (k as f64 / n_nose as f64).powi(2));
        let middle = spread(self.nose, 1.0 - self.tail, n_middle);
        let tail = spread(1.0 - self.tail, 1.0, n_tail).chain([1.0]);
        let circle = outline::ellipse(DVec2::ONE, n_around);
        let sections: Vec<Vec<DVec3>> = nose
            .chain(middle)
            .chain(tail)
            .map(|share| {
                let (centre, radius) = (self.spine(share), self.radius_at(share));
                // Counter-clockwise about +y: x mirrored.
                circle.iter().map(|p| centre + radius * dvec3(-p.x, 0.0, p.y)).collect()
            })
            .collect();
        loft(b, &sections);
    }
}

/// `n` numbers from `low` (included) to `high` (not).
fn spread(low: f64, high: f64, n: usize) -> impl Iterator<Item = f64> {
    (0..n).map(move |k| low + (high - low) * k as f64 / n as f64)
}
