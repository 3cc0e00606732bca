//! Collects the surfaces of a shape, tessellated at a given edge length.

use std::ops::Range;

use glam::{DAffine3, DVec3, dvec3};

use edgepuck_mesh::TriangleMesh;

/// A mesh under construction.
///
/// Primitives ask the builder for the number of segments and pass it grids of points, which it
/// transforms by the current placement.
#[derive(Clone, Debug)]
pub struct Builder {
    mesh: TriangleMesh,
    parts: Vec<usize>,
    glass: Vec<Range<usize>>,
    edge_m: f64,
    flat_edge_m: f64,
    placement: DAffine3,
}

impl Builder {
    /// Starts with an empty mesh. Curved surfaces get edges of about `edge_m`, flat ones of
    /// `flat_ratio` times that; infinity gives the coarsest mesh.
    pub fn new(edge_m: f64, flat_ratio: f64) -> Self {
        Self {
            mesh: TriangleMesh::default(),
            parts: Vec::new(),
            glass: Vec::new(),
            edge_m,
            flat_edge_m: edge_m * flat_ratio,
            placement: DAffine3::IDENTITY,
        }
    }

    pub fn n_triangles(&self) -> usize {
        self.mesh.triangles.len()
    }

    pub fn mesh(&self) -> &TriangleMesh {
        &self.mesh
    }

    /// The mesh, and the index of the first triangle of each of its parts.
    pub fn finish(self) -> (TriangleMesh, Vec<usize>) {
        (self.mesh, self.parts)
    }

    /// Runs `build`, whose triangles are glass.
    pub fn glass(&mut self, build: impl FnOnce(&mut Self)) {
        let start = self.n_triangles();
        build(self);
        self.glass.push(start..self.n_triangles());
    }

    /// The mesh with the triangles of glass last, and their range.
    pub fn finish_with_glass(self) -> (TriangleMesh, Range<u32>) {
        let Self { mut mesh, glass, .. } = self;
        let is_glass = |i: usize| glass.iter().any(|range| range.contains(&i));
        let (panes, mut opaque): (Vec<_>, Vec<_>) =
            mesh.triangles.iter().enumerate().partition(|&(i, _)| is_glass(i));
        let first = opaque.len() as u32;
        opaque.extend(panes);
        let triangles: Vec<_> = opaque.into_iter().map(|(_, &triangle)| triangle).collect();
        let end = triangles.len() as u32;
        mesh.triangles = triangles;
        (mesh, first..end)
    }

    /// Runs `build` in `frame`, which is relative to the current frame.
    pub fn place(&mut self, frame: DAffine3, build: impl FnOnce(&mut Self)) {
        let outer = self.placement;
        self.placement = outer * frame;
        build(self);
        self.placement = outer;
    }

    pub fn shifted(&mut self, origin: DVec3, build: impl FnOnce(&mut Self)) {
        self.place(DAffine3::from_translation(origin), build);
    }

    pub fn turned(&mut self, origin: DVec3, turn: DAffine3, build: impl FnOnce(&mut Self)) {
        self.place(DAffine3::from_translation(origin) * turn, build);
    }

    /// Runs `build` twice, the second time mirrored at the plane x = 0.
    pub fn mirrored_x(&mut self, build: impl Fn(&mut Self)) {
        build(self);
        self.place(DAffine3::from_scale(dvec3(-1.0, 1.0, 1.0)), build);
    }

    pub fn mirrored_y(&mut self, build: impl Fn(&mut Self)) {
        build(self);
        self.place(DAffine3::from_scale(dvec3(1.0, -1.0, 1.0)), build);
    }

    /// The number of segments of a circle of `radius_m`, at least `least`.
    pub fn around(&self, radius_m: f64, least: usize) -> usize {
        self.curved(std::f64::consts::TAU * radius_m, least)
    }

    /// The number of segments of a curve of `length_m`, at least `least`.
    pub fn curved(&self, length_m: f64, least: usize) -> usize {
        ((length_m / self.edge_m).round() as usize).max(least)
    }

    /// The number of segments of a straight edge of `length_m`, at least one.
    pub fn straight(&self, length_m: f64) -> usize {
        ((length_m / self.flat_edge_m).round() as usize).max(1)
    }

    /// Adds the surface through rows of points, as a separate part.
    ///
    /// All rows have the same number of points, or one point, which makes a fan. `wrap` joins the
    /// last point of each row to its first. Front faces look along (direction in a row) x
    /// (direction from row to row).
    pub fn grid(&mut self, rows: &[Vec<DVec3>], wrap: bool) {
        self.parts.push(self.mesh.triangles.len());
        let mut below: Option<(u32, u32)> = None;
        for row in rows {
            let start = self.mesh.vertices.len() as u32;
            let len = row.len() as u32;
            let placement = self.placement;
            self.mesh.vertices.extend(row.iter().map(|&p| placement.transform_point3(p)));
            if let Some(below) = below {
                self.join(below, (start, len), wrap);
            }
            below = Some((start, len));
        }
    }

    /// Adds the surface `at(u, v)`, u and v in 0..=1, in `n_u` by `n_v` segments.
    pub fn surface(&mut self, [n_u, n_v]: [usize; 2], at: impl Fn(f64, f64) -> DVec3) {
        let share = |k: usize, n: usize| k as f64 / n as f64;
        let row = |j| (0..=n_u).map(|i| at(share(i, n_u), share(j, n_v))).collect();
        let rows: Vec<Vec<DVec3>> = (0..=n_v).map(row).collect();
        self.grid(&rows, false);
    }

    /// Joins two rows, each given as (first vertex, length).
    fn join(&mut self, below: (u32, u32), above: (u32, u32), wrap: bool) {
        let longest = below.1.max(above.1);
        let columns = if wrap { longest } else { longest - 1 };
        let vertex = |row: (u32, u32), column: u32| row.0 + column % row.1;
        for c in 0..columns {
            let [a, b] = [vertex(below, c), vertex(below, c + 1)];
            let [d, e] = [vertex(above, c), vertex(above, c + 1)];
            if a != b {
                self.mesh.triangles.push([a, b, e]);
            }
            if d != e {
                self.mesh.triangles.push([a, e, d]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pole_makes_a_fan_and_a_wrapped_row_closes() {
        let ring: Vec<DVec3> = (0..5)
            .map(|k| (f64::from(k) * std::f64::consts::TAU / 5.0).sin_cos())
            .map(|(y, x)| dvec3(x, y, 0.0))
            .collect();
        let mut builder = Builder::new(1.0, 1.0);
        builder.grid(&[ring, vec![DVec3::Z]], true);
        let (mesh, parts) = builder.finish();
        assert_eq!(mesh.triangles, [[0, 1, 5], [1, 2, 5], [2, 3, 5], [3, 4, 5], [4, 0, 5]]);
        assert_eq!(parts, [0]);
    }

    #[test]
    fn infinite_edges_give_the_least_number_of_segments() {
        let coarse = Builder::new(f64::INFINITY, 2.0);
        assert_eq!([coarse.around(1.0, 7), coarse.straight(9.0)], [7, 1]);
    }

    #[test]
    fn mirroring_adds_the_same_part_on_the_other_side() {
        let mut builder = Builder::new(1.0, 1.0);
        builder.mirrored_x(|b| {
            b.grid(&[vec![DVec3::X, DVec3::X * 2.0], vec![dvec3(1.0, 1.0, 0.0)]], false);
        });
        let (mesh, _) = builder.finish();
        assert_eq!(mesh.vertices[4], dvec3(-2.0, 0.0, 0.0));
        assert_eq!(mesh.triangles.len(), 2);
    }
}
