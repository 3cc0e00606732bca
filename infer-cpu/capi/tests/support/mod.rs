//! A C compiler, the library to link, and a model small enough to reason about.

#![expect(clippy::unwrap_used, reason = "tests")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use formats::model_card::{ModelCard, Normalization};
use formats::weights::{Tensor, write_weights};

/// Writes a model of three classes: a cloud in the positive octant is of the axis along which it
/// reaches farthest. A trunk that passes coordinates on, the maximum over points, a head that
/// passes them on.
pub fn write_longest_axis_model(path: &Path) {
    let identity = Tensor { shape: vec![3, 3], values: vec![1., 0., 0., 0., 1., 0., 0., 0., 1.] };
    let zeros = Tensor { shape: vec![3], values: vec![0.0; 3] };
    let layers = ["feat.conv1", "feat.conv2", "fc1"].into_iter().flat_map(|layer| {
        let weight = (format!("{layer}.weight"), identity.clone());
        [weight, (format!("{layer}.bias"), zeros.clone())]
    });
    let card = ModelCard {
        classes: ["x", "y", "z"].map(str::to_owned).to_vec(),
        normalization: Normalization::None,
        ..ModelCard::default()
    };
    let tensors: BTreeMap<_, _> = layers.collect();
    write_weights(path, &tensors, &card.to_metadata()).unwrap();
}

/// A compiler that makes programs for the machine this test was built for.
pub struct Compiler {
    command: String,
    standard: &'static str,
    folder: tempfile::TempDir,
}

impl Compiler {
    pub fn c() -> Result<Self, String> {
        Self::find("CC", "cc", "-std=c99")
    }

    pub fn c_plus_plus() -> Result<Self, String> {
        Self::find("CXX", "c++", "-std=c++11")
    }

    /// The compiler that environment variable `variable` names, else `default`; an error if it is
    /// missing or makes programs for another machine.
    fn find(variable: &str, default: &str, standard: &'static str) -> Result<Self, String> {
        let command = std::env::var(variable).unwrap_or_else(|_| default.to_owned());
        let machine = match Command::new(&command).arg("-dumpmachine").output() {
            Ok(output) if output.status.success() => String::from_utf8(output.stdout).unwrap(),
            _ => {
                return Err(format!("there is no compiler `{command}`"));
            }
        };
        let arch = machine.split('-').next().map(|arch| arch.replace("arm64", "aarch64"));
        let same_arch = arch.as_deref() == Some(std::env::consts::ARCH);
        if !same_arch || machine.contains("musl") != cfg!(target_env = "musl") {
            return Err(format!("`{command}` compiles for {}", machine.trim()));
        }
        let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap();
        Ok(Self { command, standard, folder })
    }

    /// Where what it makes belongs.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Compiles `source`, a path in this package, with all warnings as errors, and links it as
    /// `link` says.
    pub fn compile(&self, source: &str, link: &[String]) -> PathBuf {
        let package = Path::new(env!("CARGO_MANIFEST_DIR"));
        let program = self.folder().join("program");
        let mut command = Command::new(&self.command);
        command.args(["-Wall", "-Wextra", "-Wpedantic", "-Werror", "-g", "-O1"]);
        command.arg(self.standard).arg("-I").arg(package.join("include"));
        command.arg(package.join(source));
        command.args(link).arg("-o").arg(&program);
        let output = command.output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{command:?}\n{said}");
        program
    }
}

/// Where cargo put this library for C: beside the test itself. The package's library is built as
/// all its crate types in one go, so that the archive cannot be older than the Rust library that
/// the test is linked with.
pub fn library_folder() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    test.parent().unwrap().to_path_buf()
}

pub fn static_link() -> Vec<String> {
    let archive = library_folder().join("libedgepuck.a");
    let system = ["-lpthread", "-ldl", "-lm"].map(str::to_owned);
    [archive.to_str().unwrap().to_owned()].into_iter().chain(system).collect()
}

pub fn dynamic_link() -> Vec<String> {
    let folder = library_folder();
    let folder = folder.to_str().unwrap();
    vec![
        format!("-L{folder}"),
        "-ledgepuck".to_owned(),
        format!("-Wl,-rpath,{folder}"),
        "-lm".to_owned(),
    ]
}
