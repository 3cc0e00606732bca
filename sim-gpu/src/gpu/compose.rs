//! Composes the WGSL of one variant from the files under `shaders/`.
//!
//! A variant holds the files of the effects it models and no others. Adding
//! an effect is adding one file there, one twin in `cpu/effects` and one
//! [`Module`] here.

use crate::bvh::MAX_DEPTH;
use crate::cpu::intersect::{DISPLACEMENT, STEEPEST};
use crate::cpu::traverse::{ACCURACY, FAR_SCALE, LEAST_COMPONENT, NO_HIT};
use crate::effects::{Effects, NoiseModel};
use crate::ray::{AMBIGUOUS, MISS};

/// Rays of one workgroup. Lavapipe and GPUs trace alike from 32 to 256.
pub(super) const WORKGROUP_SIZE: usize = 64;

/// The constants that shaders share with their twins, which document them.
fn constants() -> String {
    let floats = [
        ("ACCURACY", ACCURACY),
        ("DISPLACEMENT", DISPLACEMENT),
        ("FAR_SCALE", FAR_SCALE),
        ("LEAST_COMPONENT", LEAST_COMPONENT),
        ("NO_HIT", NO_HIT),
        ("STEEPEST", STEEPEST),
    ];
    let whole = [
        ("AMBIGUOUS", AMBIGUOUS),
        ("MISS", MISS),
        ("STACK_SIZE", MAX_DEPTH as u32),
        ("WORKGROUP_SIZE", WORKGROUP_SIZE as u32),
    ];
    // Debug formatting of f32 is the shortest text that reads back the same.
    let floats = floats.map(|(name, value)| format!("const {name}: f32 = {value:?};\n"));
    let whole = whole.map(|(name, value)| format!("const {name}: u32 = {value}u;\n"));
    floats.concat() + &whole.concat()
}

/// What every variant holds.
const TRACE: [&str; 5] = [
    edgepuck_shaders::BVH,
    edgepuck_shaders::RAY,
    edgepuck_shaders::INTERSECT,
    edgepuck_shaders::TRAVERSE,
    edgepuck_shaders::TRACE,
];

/// A per-ray input that some effects read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// Key and beam: `streams`, binding 1.
    Stream,
    /// The object's reflectivity: `reflectivities`, binding 2.
    Reflectivity,
}

/// One effect as a shader module: its function is called `name` and answers
/// `words` floats per ray.
#[derive(Clone, Debug, PartialEq)]
pub struct Module {
    /// The function's name, and the file's.
    pub name: &'static str,
    /// The file's text.
    pub source: &'static str,
    /// Floats per ray.
    pub words: usize,
    /// What it reads.
    pub input: Input,
    /// Values of its `override` constants.
    pub constants: Vec<(&'static str, f64)>,
}

/// The modules that `effects` need, in the order of their words.
#[must_use]
pub fn modules(effects: &Effects) -> Vec<Module> {
    let noise = effects.noise.map(|noise| {
        let constants = vec![("noise_mean_m", noise.mean_m), ("noise_sigma_m", noise.sigma_m)];
        let (name, source, words) = match noise.model {
            NoiseModel::Range => ("noise_range", edgepuck_shaders::NOISE_RANGE, 1),
            NoiseModel::Xyz => ("noise_xyz", edgepuck_shaders::NOISE_XYZ, 3),
        };
        Module { name, source, words, input: Input::Stream, constants }
    });
    let dropout = effects.dropout.map(|dropout| Module {
        name: "dropout",
        source: edgepuck_shaders::DROPOUT,
        words: 1,
        input: Input::Stream,
        constants: vec![("dropout_probability", dropout.probability)],
    });
    let intensity = effects.intensity.map(|_| Module {
        name: "intensity",
        source: edgepuck_shaders::INTENSITY,
        words: 1,
        input: Input::Reflectivity,
        constants: vec![],
    });
    [noise, dropout, intensity].into_iter().flatten().collect()
}

/// The WGSL of the variant that traces and models `modules`.
#[must_use]
pub fn compose(modules: &[Module]) -> String {
    let mut wgsl = constants() + &TRACE.join("\n");
    if modules.is_empty() {
        wgsl.push_str("\nfn finish(i: u32, ray: TraceRay, nearest: Nearest) {}\n");
        return wgsl;
    }
    let mut push = |source: &str| {
        wgsl.push('\n');
        wgsl.push_str(source);
    };
    push(edgepuck_shaders::WORDS);
    if reads(modules, Input::Stream) {
        push(edgepuck_shaders::STREAM);
    }
    if modules.iter().any(|m| m.name.starts_with("noise")) {
        push(edgepuck_shaders::NORMAL_DEVIATE);
    }
    modules.iter().for_each(|module| push(module.source));
    push(&finish(modules));
    wgsl
}

/// Floats per ray that `modules` answer together.
#[must_use]
pub fn words_per_ray(modules: &[Module]) -> usize {
    modules.iter().map(|module| module.words).sum()
}

/// Whether any of `modules` reads `input`.
#[must_use]
pub fn reads(modules: &[Module], input: Input) -> bool {
    modules.iter().any(|module| module.input == input)
}

/// The function that calls each module and stores its words side by side.
fn finish(modules: &[Module]) -> String {
    let mut body = format!(
        "fn finish(i: u32, ray: TraceRay, nearest: Nearest) {{\n    \
         if nearest.index == MISS {{\n        return;\n    }}\n    \
         let first = i * {}u;\n",
        words_per_ray(modules)
    );
    let mut offset = 0;
    for Module { name, words, .. } in modules {
        body += &format!("    let {name}_word = {name}(i, ray, nearest);\n");
        for (k, component) in ["x", "y", "z"].iter().take(*words).enumerate() {
            let part = if *words == 1 { String::new() } else { format!(".{component}") };
            body += &format!("    words[first + {}u] = {name}_word{part};\n", offset + k);
        }
        offset += words;
    }
    body + "}\n"
}
