use std::ffi::c_char;
use std::fmt::Display;
use std::ptr::null;
use std::str::FromStr;

use infer_cpu::Options;
use infer_cpu::sampler::SamplerSpec;

use crate::pointers;
use crate::status::{EdgepuckStatus, Failure};

/// The options of a classifier. Begin with edgepuck_options_default, then change fields. Choices
/// are words, as on infer-cpu's command line; an unknown word gives an error that lists the valid
/// ones.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct EdgepuckOptions {
    /// The precision: "f32" or "i8". Null: "f32".
    pub precision: *const c_char,
    /// The kernels, such as "scalar" or "neon". Null: the fastest ones of this machine.
    pub kernel: *const c_char,
    /// The number of threads, including the caller's; 0 counts as 1.
    pub threads: usize,
    /// The sampler that chooses points for the network: "all", "first", "random", "fps" or
    /// "cpl". Null: as in training; the next four fields must then have their defaults.
    pub sampler: *const c_char,
    /// The number of points that the sampler keeps. 0: 1024.
    pub points: usize,
    /// The seed of random draws.
    pub seed: u64,
    /// The first point of "fps": "farthest" (from the centroid) or "first". Null: "farthest".
    pub fps_start: *const c_char,
    /// The layers whose features "cpl" pools: "auto", "own", "stn" or "trunk". Null: "auto".
    pub front: *const c_char,
    /// The normalisation of clouds: "unit-sphere", "metric", "metric-sight" or "none". Null: as in
    /// training.
    pub normalization: *const c_char,
    /// Whether points that are not finite are dropped; otherwise they are an error.
    pub drop_invalid: bool,
    /// The number of points for which memory is allocated at loading; larger clouds allocate later.
    pub capacity: usize,
}

/// The default options.
#[unsafe(no_mangle)]
pub extern "C" fn edgepuck_options_default() -> EdgepuckOptions {
    let options = Options::default();
    EdgepuckOptions {
        precision: null(),
        kernel: null(),
        threads: options.threads,
        sampler: null(),
        points: 0,
        seed: 0,
        fps_start: null(),
        front: null(),
        normalization: null(),
        drop_invalid: options.drop_invalid,
        capacity: options.capacity,
    }
}

impl EdgepuckOptions {
    /// The options for the Rust library; the defaults if there are none.
    ///
    /// # Safety
    /// Every word is null or a NUL-terminated string.
    pub(crate) unsafe fn or_default(options: Option<&Self>) -> Result<Options, Failure> {
        // SAFETY: every word is null or NUL-terminated, as required above.
        options.map_or_else(|| Ok(Options::default()), |options| unsafe { options.read() })
    }

    /// # Safety
    /// As [`Self::or_default`].
    unsafe fn read(&self) -> Result<Options, Failure> {
        // SAFETY: every word is null or NUL-terminated, as required above.
        unsafe {
            Ok(Options {
                precision: word("precision", self.precision)?.unwrap_or_default(),
                kernel: word("kernel", self.kernel)?,
                threads: self.threads.max(1),
                sampler: self.sampler()?,
                activation_ranges: None,
                normalization: word("normalization", self.normalization)?,
                drop_invalid: self.drop_invalid,
                capacity: self.capacity,
            })
        }
    }

    /// # Safety
    /// As [`Self::or_default`].
    unsafe fn sampler(&self) -> Result<Option<SamplerSpec>, Failure> {
        let default = SamplerSpec::default();
        // SAFETY: every word is null or NUL-terminated, as required above.
        let (kind, spec) = unsafe {
            let spec = SamplerSpec {
                kind: default.kind,
                points: if self.points == 0 { default.points } else { self.points },
                seed: self.seed,
                fps_start: word("fps_start", self.fps_start)?.unwrap_or_default(),
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

/// Parses the word in field `option`, if it is not null.
///
/// # Safety
/// `pointer` is null or a NUL-terminated string.
unsafe fn word<T: FromStr<Err: Display>>(
    option: &'static str,
    pointer: *const c_char,
) -> Result<Option<T>, Failure> {
    if pointer.is_null() {
        return Ok(None);
    }
    // SAFETY: not null, and NUL-terminated, as required above.
    let word = unsafe { pointers::text(pointer, option) }?;
    word.parse().map(Some).map_err(|cause: T::Err| bad(option, cause.to_string()))
}

fn bad(option: &'static str, cause: String) -> Failure {
    Failure::new(EdgepuckStatus::BadValue, format!("option `{option}`: {cause}"))
}
