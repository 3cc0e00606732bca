//! The ground: a slope with a road between two pavements, more or less rough.

use edgepuck_shapes::Sampler;
use formats::rng::StreamKey;
use glam::{DVec2, DVec3};
use sim_gpu::mesh::Mesh;

use crate::recipe;

/// Spacing of the grid near the sensor, metres; it grows with the distance.
const STEP_M: f64 = 0.5;

/// How much the spacing grows from one line to the next.
const GROWTH: f64 = 1.08;

/// The width of a kerb's face, metres: kerbs lean back a little.
const KERB_FACE_M: f64 = 0.03;

/// The ground of one scene; the origin is on it, below the sensor.
#[derive(Clone, Debug)]
pub(crate) struct Ground {
    /// Half of its edge.
    pub(crate) half_m: f64,
    /// Rise for each metre along x and y.
    slope: DVec2,
    roughness_m: f64,
    /// Where the middle of the road is.
    pub(crate) road_y_m: f64,
    /// Half of the road's width.
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
        let steepness = within(recipe.slope_deg).to_radians().tan();
        let [roughness_m, width_m, kerb_m] =
            [recipe.roughness_m, recipe.road_width_m, recipe.kerb_m].map(&mut within);
        let slope = DVec2::from_angle(s.uniform(0.0, std::f64::consts::TAU)) * steepness;
        let (half_m, road_half_m) = (recipe.half_m, width_m / 2.0);
        Self { half_m, slope, roughness_m, road_y_m, road_half_m, kerb_m, stream }
    }

    /// Height at (x, y), roughness aside.
    pub(crate) fn height_m(&self, at: DVec2) -> f64 {
        let on_road = |y: f64| (y - self.road_y_m).abs() <= self.road_half_m;
        let step_m = |y: f64| if on_road(y) { 0.0 } else { self.kerb_m };
        self.slope.dot(at) + step_m(at.y) - step_m(0.0)
    }

    /// `x_m` along the road.
    pub(crate) fn along(&self, x_m: f64) -> DVec3 {
        DVec3::new(x_m, 0.0, self.slope.x * x_m)
    }

    /// The surface as triangles.
    pub(crate) fn mesh(&self) -> Mesh {
        let xs = self.lines(&[]);
        self.surface(&xs, |row, column| (row * xs.len() + column) as u64)
    }

    /// The part of an endless surface from x = `number` x `length_m` on, `length_m` long.
    /// Neighbours have the vertices between them in common.
    pub(crate) fn part(&self, number: i32, length_m: f64) -> Mesh {
        let n_steps = if self.roughness_m > 0.0 { (length_m / STEP_M).ceil() as i32 } else { 1 };
        let line = |column: i32| number * n_steps + column;
        let step_m = length_m / f64::from(n_steps);
        let xs: Vec<f64> = (0..=n_steps).map(|column| f64::from(line(column)) * step_m).collect();
        self.surface(&xs, |row, column| u64::from(line(column as i32) as u32) << 32 | row as u64)
    }

    /// The surface above the lines `xs`; `vertex` numbers what lies at a row and a column.
    fn surface(&self, xs: &[f64], vertex: impl Fn(usize, usize) -> u64) -> Mesh {
        let kerbs = [-1.0, 1.0].map(|side| self.road_y_m + side * self.road_half_m);
        let faces = [kerbs[0] - KERB_FACE_M, kerbs[0], kerbs[1], kerbs[1] + KERB_FACE_M];
        let ys = self.lines(&faces);
        let n = xs.len();
        let mut mesh = Mesh::default();
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

    /// Coordinates of the grid's lines, ascending, those at `besides` among them.
    /// Even ground needs no others than its ends.
    fn lines(&self, besides: &[f64]) -> Vec<f64> {
        let mut lines = vec![-self.half_m, self.half_m];
        lines.extend(besides.iter().filter(|at| at.abs() < self.half_m));
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

    /// A number of mean 0 and variance 1 for one vertex: uniform, since no gravel
    /// stands out by more.
    fn bump(&self, vertex: u64) -> f64 {
        (2.0 * self.stream.unit(vertex) - 1.0) * 3f64.sqrt()
    }
}
