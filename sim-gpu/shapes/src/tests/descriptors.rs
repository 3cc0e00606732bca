//! Simple descriptors of a shape for a nearest-neighbour classifier.

use glam::DVec3;

use super::soundness::corners;
use crate::sampler::Sampler;
use crate::tessellation::bounds;
use edgepuck_mesh::TriangleMesh;
use formats::rng::StreamKey;

const BINS: usize = 24;
const PAIRS: usize = 4000;

/// The logarithms of the sides of the bounding box over its height, the longer side first, so that
/// a quarter turn has no effect.
pub fn aspect_ratios(mesh: &TriangleMesh) -> Vec<f64> {
    let [low, high] = bounds(mesh);
    let size = high - low;
    let [long, short] = [size.x.max(size.y), size.x.min(size.y)];
    vec![(long / size.z).ln(), (short / size.z).ln()]
}

/// The D2 shape distribution (Osada et al., "Shape distributions", ACM Transactions on Graphics
/// 2002): the histogram of the distances between two random points of the surface, over the mean.
/// The values are square roots, so that the Euclidean distance is Hellinger's.
pub fn shape_distribution(mesh: &TriangleMesh) -> Vec<f64> {
    let points = surface_points(mesh, 2 * PAIRS);
    let distances: Vec<f64> = points.chunks(2).map(|pair| pair[0].distance(pair[1])).collect();
    let mean = distances.iter().sum::<f64>() / PAIRS as f64;
    let mut histogram = vec![0.0; BINS];
    for distance in distances {
        let bin = (distance / mean * BINS as f64 / 3.0) as usize;
        histogram[bin.min(BINS - 1)] += 1.0 / PAIRS as f64;
    }
    histogram.into_iter().map(f64::sqrt).collect()
}

/// The distribution of the surface's area over the height, in eighths, and its mean distance from
/// the vertical axis there, over the height.
pub fn height_profile(mesh: &TriangleMesh) -> Vec<f64> {
    let [low, high] = bounds(mesh);
    let height = high.z - low.z;
    let middle = (low + high) / 2.0;
    let points = surface_points(mesh, 2 * PAIRS);
    let mut slabs = [(0.0, 0.0); 8];
    for p in &points {
        let slab = (((p.z - low.z) / height * 8.0) as usize).min(7);
        slabs[slab].0 += 1.0;
        slabs[slab].1 += (p - middle).truncate().length() / height;
    }
    let shares = slabs.iter().map(|(n, _)| f64::sqrt(n / points.len() as f64));
    let radii = slabs.iter().map(|(n, sum)| (sum / f64::max(*n, 1.0)).min(2.0));
    shares.chain(radii).collect()
}

fn surface_points(mesh: &TriangleMesh, n: usize) -> Vec<DVec3> {
    let mut sums = Vec::with_capacity(mesh.triangles.len());
    let mut sum = 0.0;
    for &triangle in &mesh.triangles {
        let [a, b, c] = corners(mesh, triangle);
        sum += (b - a).cross(c - a).length();
        sums.push(sum);
    }
    let mut s = Sampler::new(StreamKey::new(0, "surface points", 0));
    (0..n)
        .map(|_| {
            let area = s.uniform(0.0, sum);
            let at = sums.partition_point(|&up_to| up_to <= area).min(sums.len() - 1);
            let [a, b, c] = corners(mesh, mesh.triangles[at]);
            let (root, v) = (s.uniform(0.0, 1.0).sqrt(), s.uniform(0.0, 1.0));
            a * (1.0 - root) + b * (root * (1.0 - v)) + c * (root * v)
        })
        .collect()
}
