//! The Chamfer distance of two clouds.

use kiddo::{ImmutableKdTree as Tree, SquaredEuclidean};

/// Chamfer distances of two clouds: the mean distance from the points of each to the nearest
/// point of the other, summed over both directions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Chamfer {
    /// Of squared distances, as in PyTorch3D's `chamfer_distance`.
    pub squared: f64,
    /// Of distances, as in some papers.
    pub plain: f64,
}

/// The distances between `a` and `b`; NaN if either has no point.
#[must_use]
pub fn chamfer(a: &[[f64; 3]], b: &[[f64; 3]]) -> Chamfer {
    let (there, back) = (to_nearest(a, b), to_nearest(b, a));
    Chamfer { squared: there.squared + back.squared, plain: there.plain + back.plain }
}

fn to_nearest(from: &[[f64; 3]], to: &[[f64; 3]]) -> Chamfer {
    let n = from.len() as f64;
    if from.is_empty() || to.is_empty() {
        return Chamfer { squared: f64::NAN, plain: f64::NAN };
    }
    let tree: Tree<f64, 3> = Tree::new_from_slice(to).expect("invariant: indices fit 64 bits");
    from.iter().fold(Chamfer::default(), |sum, point| {
        let query = tree.query(point).nearest_one::<SquaredEuclidean<f64>>();
        let squared = query.execute().distance;
        Chamfer { squared: sum.squared + squared / n, plain: sum.plain + squared.sqrt() / n }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_means_of_both_ways() {
        let a = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]];
        let b = [[0.0, 3.0, 0.0]];
        // There 9 and 10, back 9.
        let found = chamfer(&a, &b);
        assert!((found.squared - 18.5).abs() < 1e-12);
        let plain = (3.0 + 10f64.sqrt()) / 2.0 + 3.0;
        assert!((found.plain - plain).abs() < 1e-12);
    }

    #[test]
    fn a_cloud_is_at_no_distance_from_itself() {
        let a: Vec<[f64; 3]> =
            (0..100).map(|i| [f64::from(i % 7), f64::from(i % 3), f64::from(i)]).collect();
        assert_eq!(chamfer(&a, &a), Chamfer::default());
        let same = vec![[0.5; 3]; 5000];
        assert_eq!(chamfer(&same, &same[..1]), Chamfer::default());
        assert!(chamfer(&a, &[]).squared.is_nan());
    }
}
