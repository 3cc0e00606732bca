//! The ground: a rough slope with a road between two pavements.

use edgepuck_mesh::TriangleMesh;
use edgepuck_shapes::Sampler;
use formats::rng::StreamKey;
use glam::{DVec2, DVec3};

use crate::recipe;

/// The least and the greatest width of a pavement, metres.
pub(crate) const PAVEMENT_M: [f64; 2] = [1.5, 4.5];

/// The radius around the sensor that its own vehicle covers, metres.
pub(crate) const OWN_RADIUS_M: f64 = 1.2;

/// The spacing of the grid near the sensor, metres; it grows with the distance.
const STEP_M: f64 = 0.5;

/// The ratio of two neighbouring spacings of the grid.
const GROWTH: f64 = 1.08;

/// The width of a kerb's face, metres: kerbs lean back a little.
const KERB_FACE_M: f64 = 0.03;

/// The ground of one scene. The origin is on it, below the sensor.
#[derive(Clone, Debug)]
pub(crate) struct Ground {
    /// Half the length of its edge.
    pub(crate) half_m: f64,
    /// The rise for each metre along x and along y.
    slope: DVec2,
    roughness_m: f64,
    /// y of the middle of the road.
    pub(crate) road_y_m: f64,
    pub(crate) road_half_m: f64,
    kerb_m: f64,
    stream: StreamKey,
}

impl Ground {
    pub(crate) fn draw(
        recipe: &recipe::Ground,
        road_y_m: f64,
        s: &mut Sampler,
        stream: StreamKey,
    ) -> Self {
        let mut within = |span: recipe::Span| span.at(s.uniform(0.0, 1.0));
        let steepness = libm::tan(within(recipe.slope_deg).to_radians());
        let [roughness_m, width_m, kerb_m] =
            [recipe.roughness_m, recipe.road_width_m, recipe.kerb_m].map(&mut within);
        let slope = DVec2::from_angle(s.uniform(0.0, std::f64::consts::TAU)) * steepness;
        let (half_m, road_half_m) = (recipe.half_m, width_m / 2.0);
        Self { half_m, slope, roughness_m, road_y_m, road_half_m, kerb_m, stream }
    }

    /// The height at (x, y) without the roughness.
    pub(crate) fn height_m(&self, at: DVec2) -> f64 {
        let on_road = |y: f64| (y - self.road_y_m).abs() <= self.road_half_m;
        let step_m = |y: f64| if on_road(y) { 0.0 } else { self.kerb_m };
        self.slope.dot(at) + step_m(at.y) - step_m(0.0)
    }

    /// The point of the slope `x_m` along the road from the origin.
    pub(crate) fn along(&self, x_m: f64) -> DVec3 {
        DVec3::new(x_m, 0.0, self.slope.x * x_m)
    }

    pub(crate) fn mesh(&self) -> TriangleMesh {
        let xs = self.lines(&[]);
        self.surface(&xs, |row, column| (row * xs.len() + column) as u64)
    }

    /// Tile `number` of an endless ground: it begins at x = `number` * `length_m` and is
    /// `length_m` long. Neighbouring tiles share the vertices on their border.
    pub(crate) fn tile(&self, number: i32, length_m: f64) -> TriangleMesh {
        let n_steps = if self.roughness_m > 0.0 { (length_m / STEP_M).ceil() as i32 } else { 1 };
        let line = |column: i32| number * n_steps + column;
        let step_m = length_m / f64::from(n_steps);
        let xs: Vec<f64> = (0..=n_steps).map(|column| f64::from(line(column)) * step_m).collect();
        self.surface(&xs, |row, column| u64::from(line(column as i32) as u32) << 32 | row as u64)
    }

    /// The surface above the grid lines `xs`. `vertex` numbers the vertex at a row and a column;
    /// the number keys its roughness.
    fn surface(&self, xs: &[f64], vertex: impl Fn(usize, usize) -> u64) -> TriangleMesh {
        let kerbs = [-1.0, 1.0].map(|side| self.road_y_m + side * self.road_half_m);
        let faces = [kerbs[0] - KERB_FACE_M, kerbs[0], kerbs[1], kerbs[1] + KERB_FACE_M];
        let ys = self.lines(&faces);
        let n = xs.len();
        let mut mesh = TriangleMesh::default();
        for (row, &y) in ys.iter().enumerate() {
            mesh.vertices.extend(xs.iter().enumerate().map(|(column, &x)| {
                let rough_m = self.roughness_m * self.bump(vertex(row, column));
                DVec3::new(x, y, self.height_m(DVec2::new(x, y)) + rough_m)
            }));
        }
        for row in 0..ys.len() - 1 {
            for column in 0..n - 1 {
                let [a, b] = [row * n + column, row * n + column + 1].map(|i| i as u32);
                let [c, d] = [a + n as u32, b + n as u32];
                mesh.triangles.extend([[a, b, d], [a, d, c]]);
            }
        }
        mesh
    }

    /// The coordinates of the grid's lines in ascending order, with those in `required`. Even
    /// ground needs only these and the lines at its ends.
    fn lines(&self, required: &[f64]) -> Vec<f64> {
        let mut lines = vec![-self.half_m, self.half_m];
        lines.extend(required.iter().filter(|at| at.abs() < self.half_m));
        if self.roughness_m > 0.0 {
            lines.push(0.0);
            let (mut at_m, mut step_m) = (STEP_M, STEP_M);
            while at_m < self.half_m {
                lines.extend([-at_m, at_m]);
                step_m *= GROWTH;
                at_m += step_m;
            }
        }
        lines.sort_by(f64::total_cmp);
        lines.dedup();
        lines
    }

    /// A random number of mean 0 and variance 1 for one vertex. It is uniform, because the height
    /// of gravel is bounded.
    fn bump(&self, vertex: u64) -> f64 {
        (2.0 * self.stream.unit(vertex) - 1.0) * 3f64.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Neighbouring vertices have nothing in common, nor have those of two tiles but on their border.
    #[test]
    fn tiles_are_rough_everywhere_and_fit_together() {
        let spans = [[0.0; 2], [0.02; 2], [6.0; 2], [0.0; 2]].map(recipe::Span::from);
        let [slope_deg, roughness_m, road_width_m, kerb_m] = spans;
        let even = recipe::Ground::default();
        let recipe = recipe::Ground { slope_deg, roughness_m, road_width_m, kerb_m, ..even };
        let key = StreamKey::new(1, "ground", 0);
        let ground = Ground::draw(&recipe, 0.0, &mut Sampler::new(key), key);
        let [before, tile] = [-1, 0].map(|number| ground.tile(number, 20.0).vertices);
        // Steps of 0.5 m.
        let row = 41;
        assert!((0..tile.len()).step_by(row).all(|i| before[i + 40] == tile[i]));
        for (what, of, by) in [("along", &tile, 1), ("across", &tile, row), ("tiles", &before, 0)] {
            let pairs = tile.iter().zip(&of[by..]).map(|(a, b)| [a.z, b.z]);
            test_support::assert_uncorrelated(what, &pairs.collect::<Vec<_>>());
        }
    }
}
