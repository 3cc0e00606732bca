//! Whatever the triangles, trees are well formed and hide no hit.

use glam::{DVec3, Vec3};
use proptest::prelude::*;
use sim_gpu::effects::Effects;
use sim_gpu::internals::bvh::{Builder, Bvh, LeafTriangle, assert_well_formed};
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::cpu::oracle;
use sim_gpu::internals::target::Target;
use tests::casting::{at, beams, hits, job, target_by, tree_bytes};
use tests::judge::judge;
use tests::meshes::unconnected;
use tests::random::Random;

const BUILDERS: [Builder; 2] = [Builder::Sah, Builder::Morton];

type Corners = [[f32; 3]; 3];

fn point() -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(-1.0..1.0f64).prop_map(DVec3::from_array)
}

fn soups() -> impl Strategy<Value = Vec<[DVec3; 3]>> {
    let triangle = || prop::array::uniform3(point());
    let anywhere = prop::collection::vec(triangle(), 0..300);
    let equal = (triangle(), 0..300usize).prop_map(|(t, n)| vec![t; n]);
    let in_a_row = (triangle(), point(), prop::collection::vec(-1.0..1.0f64, 0..300)).prop_map(
        |(t, step, places)| places.iter().map(|at| t.map(|v| v * 0.1 + step * *at)).collect(),
    );
    let clustered =
        prop::collection::vec((triangle(), point(), 0..12i32), 0..300).prop_map(|all| {
            let place = |(t, at, power): ([DVec3; 3], DVec3, i32)| {
                let scale = 10f64.powi(-power);
                t.map(|v| (at + v * 0.3) * scale)
            };
            all.into_iter().map(place).collect()
        });
    let flat = prop::collection::vec(triangle(), 0..300)
        .prop_map(|all| all.iter().map(|t| t.map(|v| v.with_z(0.25))).collect());
    prop_oneof![anywhere, equal, in_a_row, clustered, flat]
}

fn rounded(soup: &[[DVec3; 3]]) -> Vec<Corners> {
    soup.iter().map(|t| t.map(|v| v.as_vec3().to_array())).collect()
}

fn contents(bvh: &Bvh) -> Vec<(u32, [u32; 9])> {
    let mut all: Vec<_> =
        bvh.two_wide().triangles.iter().map(|t| (t.index, bits([t.a, t.b, t.c]))).collect();
    all.sort_unstable();
    all
}

fn bits(corners: Corners) -> [u32; 9] {
    let mut flat = [0; 9];
    for (bits, value) in flat.iter_mut().zip(corners.as_flattened()) {
        *bits = value.to_bits();
    }
    flat
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 200,
        failure_persistence: None,
        rng_seed: proptest::test_runner::RngSeed::Fixed(1),
        ..ProptestConfig::default()
    })]

    #[test]
    fn trees_are_well_formed_and_hold_every_triangle(soup in soups()) {
        let corners = rounded(&soup);
        let indices: Vec<u32> = (0..corners.len() as u32).map(|i| i * 3 + 1).collect();
        let mut expected: Vec<_> = corners
            .iter()
            .zip(&indices)
            .map(|(&t, &i)| (i, bits(sim_gpu::internals::bvh::canonical_corners(t))))
            .collect();
        expected.sort_unstable();
        for builder in BUILDERS {
            let bvh = Bvh::build(builder, &indices, |nth| corners[nth]);
            assert_well_formed(&bvh);
            prop_assert_eq!(&contents(&bvh), &expected);
        }
    }

    #[test]
    fn a_tree_hides_no_hit(soup in soups(), seed in 0..1000u32) {
        let mesh = unconnected(soup.into_iter().flatten().collect());
        let mut random = Random::new(&format!("brute force {seed}"));
        let sensor = random.in_cube() * 2.0;
        let pattern = beams((0..64).map(|_| random.in_cube() * 0.7 - sensor));
        let cpu = OpenCaster::Cpu(Effects::default());
        for builder in BUILDERS {
            let target = target_by(builder, &mesh);
            let job = job(&target, &at(sensor), &pattern);
            // One triangle is a tree of its own: no box of others can hide it.
            let alone: Vec<_> = target.bvh.two_wide().triangles.iter().map(|t| one_of(&target, t)).collect();
            for &direction in &pattern.directions {
                let ray = job.frame.ray(direction);
                let nearest = alone
                    .iter()
                    .filter_map(|tree| oracle::nearest(tree, &ray))
                    .min_by(|a, b| a.range_m.total_cmp(&b.range_m).then(a.index.cmp(&b.index)));
                prop_assert_eq!(oracle::nearest(&target, &ray), nearest);
            }
            let verdict = judge(&job, &pattern, &hits(&cpu, &job, &pattern));
            prop_assert!(verdict.broken.is_empty(), "{:?}", verdict.broken);
        }
    }
}

/// The same surface under a tree that knows one triangle only.
fn one_of(target: &Target, triangle: &LeafTriangle) -> Target {
    let corners = [triangle.a, triangle.b, triangle.c];
    let bvh = Bvh::build(Builder::Sah, &[triangle.index], |_| corners);
    Target { surface: target.surface.clone(), bvh: bvh.into() }
}

#[test]
fn every_small_number_of_triangles_makes_a_tree() {
    let mut random = Random::new("small");
    for n in 0..=64 {
        let corners: Vec<Corners> =
            (0..n).map(|_| [(); 3].map(|()| random.in_cube().as_vec3().to_array())).collect();
        let indices: Vec<u32> = (0..n).collect();
        for builder in BUILDERS {
            let bvh = Bvh::build(builder, &indices, |nth| corners[nth]);
            assert_well_formed(&bvh);
            assert_eq!(bvh.two_wide().triangles.len(), n as usize);
        }
    }
}

/// Each cluster a tenth of the one before: a split by the middle peels off one
/// triangle at a time, and depth must stay bounded none the less.
#[test]
fn shrinking_triangles_make_no_deep_tree() {
    let corners: Vec<Corners> = (0..3000)
        .map(|i| {
            let at = 0.99f32.powi(i);
            [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| (axis * at).to_array())
        })
        .collect();
    let indices: Vec<u32> = (0..3000).collect();
    for builder in BUILDERS {
        assert_well_formed(&Bvh::build(builder, &indices, |nth| corners[nth]));
    }
}

#[test]
fn a_tree_is_the_same_on_every_run_and_number_of_threads() {
    let mesh = tests::meshes::torus(160);
    for builder in BUILDERS {
        let [one, four] = [1, 4].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| target_by(builder, &mesh).bvh)
        });
        assert!(tree_bytes(&one) == tree_bytes(&four), "{builder:?}");
        assert_well_formed(&one);
    }
}
