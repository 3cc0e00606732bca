//! Every shader variant is valid WGSL, and lays its records out as Rust does. No GPU is needed.

use std::collections::BTreeSet;
use std::mem::offset_of;
use std::path::{Path, PathBuf};

use glam::DVec3;
use naga::TypeInner;
use naga::valid::{Capabilities, ValidationFlags, Validator};
use sim_gpu::effects::{Dropout, Effects, Intensity, Noise, NoiseModel};
use sim_gpu::internals::bvh::{LeafTriangle, Node};
use sim_gpu::internals::cpu::effects::append_outputs;
use sim_gpu::internals::gpu::{View, compose};
use sim_gpu::internals::ray::TraceRay;

/// All combinations of effects.
fn variants() -> Vec<Effects> {
    let mut variants = Vec::new();
    for noise in [None, Some(NoiseModel::Range), Some(NoiseModel::Xyz)] {
        for dropout in [false, true] {
            for intensity in [false, true] {
                variants.push(Effects {
                    noise: noise.map(|model| Noise { mean_m: 0.5, sigma_m: 0.25, model }),
                    dropout: dropout.then_some(Dropout { probability: 0.125 }),
                    intensity: intensity.then_some(Intensity),
                    ..Effects::default()
                });
            }
        }
    }
    variants
}

fn parsed(effects: &Effects) -> naga::Module {
    let wgsl = compose(effects);
    let module = naga::front::wgsl::parse_str(&wgsl)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string(&wgsl)));
    Validator::new(ValidationFlags::all(), Capabilities::default())
        .validate(&module)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string(&wgsl)));
    module
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn read(file: &str) -> String {
    std::fs::read_to_string(root().join("shaders").join(file)).expect("a shader is text")
}

fn all_files() -> BTreeSet<String> {
    let mut files = BTreeSet::new();
    for folder in ["", "shared/", "effects/"] {
        for entry in std::fs::read_dir(root().join("shaders").join(folder)).expect("a folder") {
            let entry = entry.expect("a file");
            if entry.path().extension().is_some_and(|extension| extension == "wgsl") {
                files.insert(format!("{folder}{}", entry.file_name().display()));
            }
        }
    }
    files
}

/// What else a variant holds than its effects need, `only_what_is_asked` finds.
#[test]
fn all_variants_validate_and_declare_each_binding_once() {
    for effects in variants() {
        let module = parsed(&effects);
        let bindings = module.global_variables.iter().filter_map(|(_, g)| g.binding.as_ref());
        let bindings: Vec<_> = bindings.map(|b| (b.group, b.binding)).collect();
        let distinct: BTreeSet<_> = bindings.iter().collect();
        assert_eq!(distinct.len(), bindings.len(), "{effects:?}: a binding is declared twice");
    }
}

#[test]
fn every_shader_file_is_part_of_some_variant() {
    for file in all_files() {
        let is_part = |effects: &Effects| compose(effects).contains(&read(&file));
        assert!(variants().iter().any(is_part), "{file} is part of no variant");
    }
}

#[test]
fn every_pass_and_effect_has_a_counterpart_of_its_name() {
    let cpu = root().join("sim-gpu/src/cpu");
    let effects = std::fs::read_to_string(cpu.join("effects.rs")).expect("a source file");
    for file in all_files().iter().filter(|file| !file.starts_with("shared/")) {
        let name = file.trim_end_matches(".wgsl");
        let found = match name.strip_prefix("effects/") {
            Some(effect) => effects.contains(&format!("pub fn {effect}(")),
            None => cpu.join(format!("{name}.rs")).is_file(),
        };
        assert!(found, "{file} has no counterpart");
    }
    // Shared files name theirs, as do some of the others.
    for file in all_files() {
        let wgsl = read(&file);
        let named = wgsl.split('`').skip(1).step_by(2).filter(|name| name.ends_with(".rs"));
        for name in named.filter(|name| name.starts_with("sim-gpu") || name.starts_with("formats"))
        {
            assert!(root().join(name).is_file(), "{file} names {name}");
        }
    }
}

/// Scalars of a value of a type.
fn width(module: &naga::Module, ty: naga::Handle<naga::Type>) -> usize {
    match module.types[ty].inner {
        TypeInner::Scalar(naga::Scalar::F32) => 1,
        TypeInner::Vector { size, scalar: naga::Scalar::F32 } => size as usize,
        ref other => panic!("expected f32 or a vector of it, found {other:?}"),
    }
}

/// `Effects::per_ray` is the one definition of which outputs there are, in which
/// order and how many: shaders and the CPU must both follow it.
#[test]
fn shaders_and_the_cpu_give_the_outputs_that_effects_define() {
    let target = tests::casting::target(&tests::meshes::cube());
    let pattern = tests::casting::beams([DVec3::X]);
    let job = tests::casting::job(&target, &tests::casting::at(DVec3::X * 3.0), &pattern);
    let ray = job.frame.beam(&pattern, 0);
    for effects in variants() {
        let module = parsed(&effects);
        let mut stored = Vec::new();
        for effect in effects.per_ray() {
            let (_, function) = module
                .functions
                .iter()
                .find(|(_, function)| function.name.as_deref() == Some(effect.name()))
                .unwrap_or_else(|| panic!("the shader has no function {}", effect.name()));
            let result = function.result.as_ref().expect("an effect gives numbers");
            assert_eq!(width(&module, result.ty), effect.width(), "{}", effect.name());
            stored.extend(std::iter::repeat_n(effect.name(), effect.width()));
        }
        let wgsl = compose(&effects);
        let in_order: Vec<&str> = wgsl
            .lines()
            .filter_map(|line| line.trim().strip_prefix("effect_outputs[first + "))
            .enumerate()
            .map(|(at, line)| {
                let (place, value) = line.split_once("u] = ").expect("an assignment");
                assert_eq!(place, at.to_string(), "outputs stand side by side");
                value.split_once("_output").expect("an effect's output").0
            })
            .collect();
        assert_eq!(in_order, stored, "{effects:?}");
        let mut together = Vec::new();
        append_outputs(&mut together, &effects, &job, 0, &ray, 0);
        assert_eq!(together.len(), effects.outputs_per_ray());
    }
}

/// Size and member offsets of a struct of the shader.
fn layout(module: &naga::Module, name: &str) -> (u32, Vec<(String, u32)>) {
    let (_, found) = module
        .types
        .iter()
        .find(|(_, t)| t.name.as_deref() == Some(name))
        .unwrap_or_else(|| panic!("no struct {name}"));
    let TypeInner::Struct { members, span } = &found.inner else { panic!("{name} is no struct") };
    (*span, members.iter().map(|m| (m.name.clone().unwrap_or_default(), m.offset)).collect())
}

macro_rules! assert_same_layout {
    ($module:expr, $type:ident { $($member:ident),* $(,)? }) => {{
        let (size, members) = layout($module, stringify!($type));
        assert_eq!(size as usize, size_of::<$type>(), "size of {}", stringify!($type));
        let rust = [$((stringify!($member).to_owned(), offset_of!($type, $member) as u32)),*];
        assert_eq!(members, rust, "{}", stringify!($type));
    }};
}

#[test]
fn records_are_laid_out_alike_in_wgsl_and_rust() {
    for effects in variants() {
        let module = &parsed(&effects);
        assert_same_layout!(
            module,
            Node { left_min, left, left_max, left_count, right_min, right, right_max, right_count }
        );
        assert_same_layout!(module, LeafTriangle { a, index, b, longest, c, _padding_c });
        assert_same_layout!(module, TraceRay { origin, root, direction, _padding });
        assert_same_layout!(
            module,
            View {
                turn_x,
                root,
                turn_y,
                first_ray,
                turn_z,
                first_word,
                origin_low,
                first_direction,
                origin_high,
                reach_low,
                reach_high,
                reflectivity,
            }
        );
    }
}
