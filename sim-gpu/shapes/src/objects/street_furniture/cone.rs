use crate::primitives::{Builder, DVec2, Profile, Sampler, Section, outline, prism};

/// Builds a traffic cone: 0.3, 0.5, 0.75 or 1 m high (EN 13422) or 0.45, 0.7 or 0.9 m (MUTCD: 18,
/// 28 and 36 inches).
pub fn build(b: &mut Builder, s: &mut Sampler) {
    let height_m = s.pick(&[0.3, 0.45, 0.5, 0.5, 0.7, 0.75, 0.75, 0.9, 1.0]);
    let slim = height_m > 0.6 && s.chance(0.2);
    let foot_m = height_m * if slim { 0.08 } else { s.uniform(0.15, 0.19) };
    let tip_m = s.uniform(0.02, 0.035);
    let plate_m = height_m * s.uniform(0.26, 0.29);
    let plate = match s.count(0, 2) {
        0 => outline::rectangle(DVec2::splat(plate_m)),
        1 => outline::ellipse(1.1 * DVec2::splat(plate_m), 8),
        _ => outline::rounded_rectangle(DVec2::splat(plate_m), 0.3 * plate_m, 2),
    };
    prism(b, &plate, 0.0, 0.03, 0.95);
    Profile::from(foot_m, 0.03)
        .line(tip_m, height_m)
        .line(0.0, height_m)
        .revolve(b, Section::Round);
}
