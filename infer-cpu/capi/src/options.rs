//! How a classifier computes, in C's types.

use std::ffi::{CStr, c_char};
use std::fmt::Display;
use std::ptr::null;
use std::str::FromStr;

use infer_cpu::sampler::SamplerSpec;
use infer_cpu::{Options, UpAxis};

use crate::failure::Failure;
use crate::status::EdgepuckStatus;

/// How a classifier computes. Begin with edgepuck_options_default, then change
/// what you like. Choices are words, the same as on infer-cpu's command line;
/// a word that names nothing gives an error that lists those that do.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct EdgepuckOptions {
    /// What to compute in: "f32", "f32-fc16" (fp32 arithmetic, the weights of
    /// vector layers stored in fp16), "f16" or "i8". Null: "f32".
    pub precision: *const c_char,
    /// The kernels to use, such as "scalar" or "neon". Null: the fastest that
    /// this machine runs.
    pub kernel: *const c_char,
    /// Threads, the caller's among them; 0 counts as 1.
    pub threads: usize,
    /// Which T-Nets are run: "both", "input", "feature" or "none"; one that is
    /// left out counts as the identity. Null: all that the model has.
    pub t_nets: *const c_char,
    /// Which points the network sees: "all", "first", "random", "fps", "voxel"
    /// or "cpl". Null: as in training; the next seven fields are then left at
    /// their defaults.
    pub sampler: *const c_char,
    /// How many points the sampler keeps. 0: 1024.
    pub points: usize,
    /// What random draws depend on.
    pub seed: u64,
    /// Where "fps" begins: "farthest" (from the centroid) or "first". Null:
    /// "farthest".
    pub fps_start: *const c_char,
    /// Edge of a voxel for "voxel", in the units of a normalised cloud. 0: as
    /// fine as points allows.
    pub voxel_size: f64,
    /// How "cpl" comes to its number of points: "truncate", "cyclic", "nearest"
    /// or "weighted". Null: "cyclic".
    pub resize: *const c_char,
    /// How often "cpl" may pool again while it has fewer points than asked for.
    pub passes: usize,
    /// What "cpl" pools: "auto", "own", "stn" or "trunk". Null: "auto".
    pub front: *const c_char,
    /// How clouds are normalised: "unit-sphere" or "none". Null: as in
    /// training.
    pub normalization: *const c_char,
    /// Drop points that are not finite instead of refusing the cloud.
    pub drop_invalid: bool,
    /// Draws of a random subset whose log-probabilities are averaged; more than
    /// 1 needs the sampler "random", or vote_rotations.
    pub votes: u32,
    /// Turn the cloud about its up axis between votes, evenly spread.
    pub vote_rotations: bool,
    /// The axis that points up: 0 for x, 1 for y, 2 for z.
    pub up: usize,
    /// Points to make room for at once; larger clouds allocate when they come.
    pub capacity: usize,
}

/// The options of a classifier that is loaded without any.
#[unsafe(no_mangle)]
pub extern "C" fn edgepuck_options_default() -> EdgepuckOptions {
    let options = Options::default();
    EdgepuckOptions {
        precision: null(),
        kernel: null(),
        threads: options.threads,
        t_nets: null(),
        sampler: null(),
        points: 0,
        seed: 0,
        fps_start: null(),
        voxel_size: 0.0,
        resize: null(),
        passes: 0,
        front: null(),
        normalization: null(),
        drop_invalid: options.drop_invalid,
        votes: options.votes,
        vote_rotations: options.vote_rotations,
        up: 2,
        capacity: options.capacity,
    }
}

impl EdgepuckOptions {
    /// The same for the Rust library.
    ///
    /// # Safety
    /// Every word is null or a NUL-terminated string.
    pub(crate) unsafe fn read(&self) -> Result<Options, Failure> {
        let up = match self.up {
            0 => UpAxis::X,
            1 => UpAxis::Y,
            2 => UpAxis::Z,
            other => return Err(bad("up", format!("expected 0, 1 or 2, found {other}"))),
        };
        // SAFETY: words are this function's contract.
        unsafe {
            Ok(Options {
                precision: word("precision", self.precision)?.unwrap_or_default(),
                kernel: word("kernel", self.kernel)?,
                threads: self.threads.max(1),
                t_nets: word("t_nets", self.t_nets)?.unwrap_or_default(),
                sampler: self.sampler()?,
                activation_ranges: None,
                normalization: word("normalization", self.normalization)?,
                outlier_filter: None,
                drop_invalid: self.drop_invalid,
                votes: self.votes,
                vote_rotations: self.vote_rotations,
                up,
                capacity: self.capacity,
            })
        }
    }

    /// # Safety
    /// As [`Self::read`].
    unsafe fn sampler(&self) -> Result<Option<SamplerSpec>, Failure> {
        let default = SamplerSpec::default();
        // SAFETY: words are this function's contract.
        let (kind, spec) = unsafe {
            let spec = SamplerSpec {
                kind: default.kind,
                points: if self.points == 0 { default.points } else { self.points },
                seed: self.seed,
                fps_start: word("fps_start", self.fps_start)?.unwrap_or_default(),
                voxel_size: (self.voxel_size != 0.0).then_some(self.voxel_size),
                resize: word("resize", self.resize)?.unwrap_or_default(),
                passes: self.passes,
                front: word("front", self.front)?.unwrap_or_default(),
            };
            (word("sampler", self.sampler)?, spec)
        };
        match kind {
            Some(kind) => Ok(Some(SamplerSpec { kind, ..spec })),
            None if spec == default => Ok(None),
            None => Err(bad(
                "sampler",
                "expected a sampler, since other fields say how it samples, found null".to_owned(),
            )),
        }
    }
}

/// What the word in field `option` names, if there is one.
///
/// # Safety
/// It is null or a NUL-terminated string.
unsafe fn word<T: FromStr<Err: Display>>(
    option: &'static str,
    pointer: *const c_char,
) -> Result<Option<T>, Failure> {
    if pointer.is_null() {
        return Ok(None);
    }
    // SAFETY: not null; the rest is this function's contract.
    let word = unsafe { CStr::from_ptr(pointer) }.to_string_lossy();
    word.parse().map(Some).map_err(|cause: T::Err| bad(option, cause.to_string()))
}

fn bad(option: &'static str, cause: String) -> Failure {
    Failure::new(EdgepuckStatus::BadOption, format!("option `{option}`: {cause}"))
}
