mod descriptors;
mod separability;
mod soundness;

use rayon::prelude::*;

use super::{ShapeClass, generate};
use edgepuck_mesh::TriangleMesh;

const INSTANCES: u32 = 100;
const SEED: u64 = 11;

/// Runs the assertions `holds` on many shapes of every class, on all cores.
fn for_all(holds: impl Fn(ShapeClass, u32, &TriangleMesh) + Sync) {
    for class in ShapeClass::ALL {
        (0..INSTANCES).into_par_iter().for_each(|k| holds(class, k, &generate(class, SEED, k)));
    }
}

#[test]
fn an_instance_is_a_function_of_class_seed_and_number() {
    for class in ShapeClass::ALL {
        assert_eq!(generate(class, 1, 2), generate(class, 1, 2));
        assert_ne!(generate(class, 1, 2), generate(class, 2, 2));
    }
}

#[test]
fn triangle_counts_spread_evenly_over_their_decades() {
    let all: Vec<_> =
        ShapeClass::ALL.iter().flat_map(|class| (0..60).map(|k| (*class, k))).collect();
    let counts: Vec<usize> =
        all.into_par_iter().map(|(class, k)| generate(class, SEED, k).triangles.len()).collect();
    // A log-uniform distribution from 200 to 50,000 has 29 % up to 1,000, 42 % from there up to
    // 10,000, and the rest above. Many parts need more triangles, so that the lowest share is
    // smaller and the next one larger; half of each expected share is required.
    let share = |low: usize, high: usize| {
        counts.iter().filter(|&&n| (low..high).contains(&n)).count() as f64 / counts.len() as f64
    };
    let shares = [share(0, 1000), share(1000, 10_000), share(10_000, 60_000)];
    println!("up to 1,000, 10,000, 50,000 triangles: {shares:.2?}");
    assert!(shares[0] > 0.145 && shares[1] > 0.21 && shares[2] > 0.145, "{shares:?}");
}
