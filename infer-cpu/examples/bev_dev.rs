use infer_cpu::{Precision, birdseye::BirdsEye, detect::Label};
use std::time::Instant;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let raw = std::fs::read(&a[2]).unwrap();
    let v: Vec<f32> =
        raw.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    let (mut p, mut l) = (vec![], vec![]);
    for c in v.chunks_exact(4) {
        p.push([c[0], c[1], c[2]]);
        l.push(match c[3] as i32 {
            -1 => Label::Ground,
            -3 => Label::Invalid,
            _ => Label::Small,
        });
    }
    let precision = if a[3] == "i8" { Precision::I8 } else { Precision::F32 };
    let net = BirdsEye::load(a[1].as_ref(), precision, a[4].parse().unwrap()).unwrap();
    for _ in 0..a.get(5).map_or(1, |n| n.parse().unwrap()) {
        let t = Instant::now();
        let o = net.objects(&p, &l, 0.05);
        eprintln!("{} objects {:?}", o.len(), t.elapsed());
    }
    for o in net.objects(&p, &l, 0.05) {
        println!(
            "{} {:.4} {:.3} {:.3} {:.3} {:.3} {:.3} {:.4}",
            o.class,
            o.score,
            o.centre_m[0],
            o.centre_m[1],
            o.size_m[0],
            o.size_m[1],
            o.size_m[2],
            o.yaw_rad
        );
    }
}
