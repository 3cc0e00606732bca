//! Composes the WGSL of a shader variant from the sources of `edgepuck_shaders`. A variant contains
//! only the sources of the effects that it models.

use crate::bvh::MAX_DEPTH;
use crate::cpu::aim::BEFORE;
use crate::cpu::intersect::{DISPLACEMENT, EDGE_ROUNDING};
use crate::cpu::traverse::{FAR_SCALE, LEAST_COMPONENT};
use crate::effects::{Effects, RayEffect, RayInput};
use crate::ray::{AMBIGUOUS, MISS, NO_HIT, SENT};
use edgepuck_shaders as shaders;

/// The rays of a workgroup. From 32 to 256, the speed of Lavapipe and of GPUs is the same.
pub(super) const WORKGROUP_SIZE: usize = 64;

/// The sources of every variant.
const TRACE: [&str; 6] = [
    shaders::BVH,
    shaders::RAY,
    shaders::AIM,
    shaders::INTERSECT,
    shaders::TRAVERSE,
    shaders::TRACE,
];

/// The WGSL of the variant that traces rays and models `effects`.
#[must_use]
pub fn compose(effects: &Effects) -> String {
    let mut wgsl = constants() + &TRACE.join("\n");
    let modelled: Vec<RayEffect> = effects.per_ray().collect();
    if modelled.is_empty() {
        wgsl.push_str("\nfn finish(i: u32, ray: TraceRay, nearest: Nearest) {}\n");
        return wgsl;
    }
    let mut push = |source: &str| {
        wgsl.push('\n');
        wgsl.push_str(source);
    };
    push(shaders::EFFECT_OUTPUTS);
    if reads_random_bits(effects) {
        push(shaders::STREAM);
    }
    if reads(effects, RayInput::NormalDeviates) {
        push(shaders::NORMAL_DEVIATE);
    }
    modelled.iter().for_each(|effect| push(source(effect)));
    push(&finish(effects));
    wgsl
}

fn reads(effects: &Effects, input: RayInput) -> bool {
    effects.per_ray().any(|effect| effect.input() == input)
}

/// Whether any of `effects` reads the rays' random bits, directly or as normal deviates.
pub(super) fn reads_random_bits(effects: &Effects) -> bool {
    reads(effects, RayInput::RandomBits) || reads(effects, RayInput::NormalDeviates)
}

/// The constants that shaders share with their counterparts, which document them.
pub(super) fn constants() -> String {
    let floats = [
        ("DISPLACEMENT", DISPLACEMENT),
        ("EDGE_ROUNDING", EDGE_ROUNDING),
        ("FAR_SCALE", FAR_SCALE),
        ("LEAST_COMPONENT", LEAST_COMPONENT),
        ("NO_HIT", NO_HIT),
    ];
    let whole = [
        ("AMBIGUOUS", AMBIGUOUS),
        ("MISS", MISS),
        ("SENT", SENT),
        ("STACK_SIZE", MAX_DEPTH as u32),
        ("WORKGROUP_SIZE", WORKGROUP_SIZE as u32),
    ];
    // Debug formatting of f32 is the shortest text that reads back the same.
    let floats = floats.map(|(name, value)| format!("const {name}: f32 = {value:?};\n"));
    let whole = whole.map(|(name, value)| format!("const {name}: u32 = {value}u;\n"));
    floats.concat() + &whole.concat() + &format!("const BEFORE: i32 = {BEFORE};\n")
}

fn source(effect: &RayEffect) -> &'static str {
    let (_, source) = shaders::EFFECTS
        .into_iter()
        .find(|(name, _)| *name == effect.name())
        .expect("invariant: every effect has a shader, as a test composes all of them");
    source
}

/// The function that calls each effect and stores its outputs side by side.
fn finish(effects: &Effects) -> String {
    let mut body = format!(
        "fn finish(i: u32, ray: TraceRay, nearest: Nearest) {{\n    \
         if nearest.index == MISS {{\n        return;\n    }}\n    \
         let first = i * {}u;\n",
        effects.outputs_per_ray()
    );
    let mut offset = 0;
    for effect in effects.per_ray() {
        let (name, width) = (effect.name(), effect.width());
        body += &format!("    let {name}_output = {name}(i, ray, nearest);\n");
        for (k, component) in ["x", "y", "z", "w"].iter().take(width).enumerate() {
            let part = if width == 1 { String::new() } else { format!(".{component}") };
            let at = offset + k;
            body += &format!("    effect_outputs[first + {at}u] = {name}_output{part};\n");
        }
        offset += width;
    }
    body + "}\n"
}
