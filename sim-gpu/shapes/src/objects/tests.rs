use std::collections::BTreeSet;

use super::{ObjectKind, object};
use crate::tessellation::bounds;

const SEED: u64 = 5;
const INSTANCES: u32 = 8;

/// The smallest and the largest length, width and height of a kind, metres, with mirrors, loads,
/// leans and pushed things.
fn sizes(kind: ObjectKind) -> [[f64; 2]; 3] {
    use ObjectKind as K;
    match kind {
        K::Car => [[3.3, 6.2], [1.7, 2.7], [1.24, 3.1]],
        K::Truck => [[5.3, 19.0], [2.0, 3.1], [2.0, 4.4]],
        K::Bus => [[6.9, 18.9], [2.3, 3.1], [2.8, 4.3]],
        K::Bicycle => [[1.5, 2.1], [0.35, 1.0], [0.8, 1.35]],
        K::Cyclist => [[1.5, 2.1], [0.38, 1.0], [1.3, 2.1]],
        K::Motorcycle => [[1.6, 2.6], [0.55, 1.3], [0.9, 1.6]],
        K::Motorcyclist => [[1.6, 2.6], [0.55, 1.3], [1.2, 2.0]],
        K::Person => [[0.22, 2.2], [0.3, 1.3], [1.05, 2.5]],
        K::Child => [[0.13, 1.7], [0.18, 1.3], [0.6, 1.9]],
        K::Tree => [[0.8, 25.0], [0.8, 25.0], [2.0, 35.0]],
        K::Bush => [[0.3, 5.0], [0.3, 5.0], [0.3, 4.0]],
        K::Hedge => [[0.4, 20.0], [0.3, 20.0], [0.4, 4.5]],
        K::Trunk => [[0.08, 6.0], [0.08, 6.0], [0.8, 12.0]],
        K::Pole => [[0.03, 2.0], [0.03, 2.0], [0.4, 14.0]],
        K::LampPost => [[0.08, 6.0], [0.08, 6.0], [2.5, 15.0]],
        K::TrafficSign => [[0.03, 3.0], [0.2, 5.0], [1.2, 8.0]],
        K::TrafficLight => [[0.08, 9.0], [0.08, 9.0], [2.0, 9.0]],
        K::Wall => [[0.05, 30.0], [0.05, 30.0], [0.4, 5.0]],
        K::HouseFront => [[0.05, 40.0], [2.0, 40.0], [2.2, 30.0]],
        K::Fence => [[0.01, 30.0], [0.01, 30.0], [0.4, 4.0]],
        K::Barrier => [[0.1, 20.0], [0.1, 20.0], [0.4, 2.5]],
        K::Cone => [[0.15, 0.8], [0.15, 0.8], [0.28, 1.3]],
        K::Bench => [[0.3, 3.0], [0.3, 3.0], [0.35, 1.3]],
        K::Bin => [[0.2, 4.0], [0.2, 4.0], [0.4, 2.5]],
        K::Clutter => [[0.1, 4.0], [0.1, 4.0], [0.15, 3.0]],
        K::Chair => [[0.3, 1.3], [0.3, 1.3], [0.6, 1.6]],
        K::Table => [[0.3, 4.0], [0.3, 4.0], [0.3, 1.3]],
        K::Sofa => [[0.6, 3.5], [0.6, 4.0], [0.55, 1.3]],
        K::Shelf => [[0.15, 4.0], [0.3, 5.0], [0.6, 3.0]],
        K::Door => [[0.03, 2.0], [0.6, 3.0], [1.8, 3.2]],
        K::Cabinet => [[0.2, 3.0], [0.3, 4.0], [0.4, 2.8]],
    }
}

#[test]
fn every_object_is_a_sound_mesh_that_stands_about_the_origin_at_its_kind_s_size() {
    let all = ObjectKind::ALL.into_iter().flat_map(|kind| (0..INSTANCES).map(move |k| (kind, k)));
    for (kind, k) in all {
        let (what, object) = (format!("{kind} {k}"), object(kind, SEED, k));
        let mesh = &object.mesh;
        assert!(mesh.vertices.iter().all(|v| v.is_finite()), "{what}");
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|i| mesh.vertices[i as usize]);
            let area = (b - a).cross(c - a).length() / 2.0;
            // The area of a square of 10 micrometres; rounding leaves less of a line.
            assert!(area > 1e-10, "{what}: {a}, {b}, {c} have no area");
        }
        assert!(object.glass.start <= object.glass.end, "{what}");
        assert_eq!(object.glass.end as usize, mesh.triangles.len(), "{what}: glass comes last");
        let [low, high] = bounds(mesh);
        assert_eq!(low.z, 0.0, "{what}");
        // Two roundings of a few metres.
        assert!((low + high).truncate().length() < 1e-12, "{what}: {low} to {high}");
        for (size, [least, most]) in (high - low).to_array().into_iter().zip(sizes(kind)) {
            let size_m = high - low;
            assert!((least..=most).contains(&size), "{what}: {size_m:.2} m, {least} to {most}");
        }
    }
}

#[test]
fn an_object_is_a_function_of_kind_seed_and_number() {
    let bytes = |kind, seed, k| format!("{:?}", object(kind, seed, k));
    for kind in ObjectKind::ALL {
        assert_eq!(bytes(kind, SEED, 3), bytes(kind, SEED, 3));
        let drawn: BTreeSet<_> = (0..INSTANCES).map(|k| bytes(kind, SEED, k)).collect();
        assert_eq!(drawn.len(), INSTANCES as usize, "{kind}: two instances are the same");
        assert!(!drawn.contains(&bytes(kind, SEED + 1, 0)), "{kind}: the seed changes nothing");
    }
}

#[test]
fn vehicles_have_panes_and_a_gap_to_the_ground_between_their_wheels() {
    for kind in [ObjectKind::Car, ObjectKind::Truck, ObjectKind::Bus] {
        for k in 0..INSTANCES {
            let object = object(kind, SEED, k);
            assert!(!object.glass.is_empty(), "{kind} {k}");
            // Tyres touch the ground with a tenth of the vertices at most.
            let low = object.mesh.vertices.iter().filter(|v| v.z < 0.12).count();
            assert!(10 * low < object.mesh.vertices.len(), "{kind} {k}: {low} vertices are low");
        }
    }
}

#[test]
fn objects_keep_to_their_budget_of_triangles() {
    use ObjectKind::{Bus, Car, Child, Person};
    // A bus of 12 m has about 1,500 triangles; an articulated one has two bodies.
    for (kind, most) in [(Car, 3000), (Bus, 2400), (Person, 2500), (Child, 2500)] {
        for k in 0..INSTANCES {
            let n = object(kind, SEED, k).mesh.triangles.len();
            assert!(n <= most, "{kind} {k}: {n} triangles, at most {most} expected");
        }
    }
}
