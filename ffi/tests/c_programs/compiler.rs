//! A C compiler, and the header that cbindgen makes.

use std::path::{Path, PathBuf};
use std::process::Command;

/// The folder of the package.
const PACKAGE: &str = env!("CARGO_MANIFEST_DIR");
/// Where tests write.
const SCRATCH: &str = env!("CARGO_TARGET_TMPDIR");

/// A compiler that makes programs for the machine this test was built for.
pub struct Compiler {
    command: String,
    standard: &'static str,
    folder: tempfile::TempDir,
}

impl Compiler {
    /// A compiler of C; an error if it is missing or makes programs for another machine.
    pub fn c() -> Result<Self, String> {
        Self::find("CC", "cc", "-std=c99")
    }

    /// A compiler of C++, with the same errors.
    pub fn c_plus_plus() -> Result<Self, String> {
        Self::find("CXX", "c++", "-std=c++11")
    }

    /// The compiler that environment variable `variable` names, else `default`.
    fn find(variable: &str, default: &str, standard: &'static str) -> Result<Self, String> {
        let command = std::env::var(variable).unwrap_or_else(|_| default.to_owned());
        let machine = match Command::new(&command).arg("-dumpmachine").output() {
            Ok(output) if output.status.success() => String::from_utf8(output.stdout).unwrap(),
            _ => return Err(format!("there is no compiler `{command}`")),
        };
        let arch = machine.split('-').next().map(|arch| arch.replace("arm64", "aarch64"));
        let same_arch = arch.as_deref() == Some(std::env::consts::ARCH);
        if !same_arch || machine.contains("musl") != cfg!(target_env = "musl") {
            return Err(format!("`{command}` compiles for {}", machine.trim()));
        }
        let folder = tempfile::tempdir_in(SCRATCH).unwrap();
        Ok(Self { command, standard, folder })
    }

    /// The folder of its programs, for their inputs as well.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Compiles `source`, a path in the package, with all warnings as errors, and links it as `link`
    /// says.
    pub fn compile(&self, source: &str, link: &[String]) -> PathBuf {
        let program = self.folder().join("program");
        let mut command = Command::new(&self.command);
        command.args(["-Wall", "-Wextra", "-Wpedantic", "-Werror", "-g", "-O1", self.standard]);
        command.arg("-I").arg(Path::new(PACKAGE).join("include"));
        command.arg(Path::new(PACKAGE).join(source)).args(link).arg("-o").arg(&program);
        let output = command.output().unwrap();
        let messages = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{command:?}\n{messages}");
        program
    }
}

/// What links a program with the archive, which Cargo makes in one go with the Rust library that the
/// test is linked with.
pub fn static_link() -> Vec<String> {
    let archive = library_folder().join("libedgepuck.a");
    [archive.to_str().unwrap(), "-lpthread", "-ldl", "-lm"].map(str::to_owned).to_vec()
}

/// What links a program with the shared library.
pub fn dynamic_link() -> Vec<String> {
    let folder = library_folder().display().to_string();
    let run_path = format!("-Wl,-rpath,{folder}");
    let words = ["-ledgepuck", "-lpthread", "-lm"].map(str::to_owned);
    [format!("-L{folder}"), run_path].into_iter().chain(words).collect()
}

/// Cargo puts the libraries for C beside the test itself.
fn library_folder() -> PathBuf {
    std::env::current_exe().unwrap().with_file_name("")
}

#[test]
fn the_header_is_that_of_the_sources() {
    let package = Path::new(PACKAGE);
    let config = cbindgen::Config::from_file(package.join("cbindgen.toml")).unwrap();
    let source = package.join("src/lib.rs");
    let bindings = cbindgen::Builder::new().with_config(config).with_src(source).generate();
    let mut found = Vec::new();
    bindings.unwrap().write(&mut found);

    let committed = package.join("include/edgepuck.h");
    if std::env::var_os("UPDATE_GOLDEN").is_some_and(|value| value == "1") {
        std::fs::write(&committed, &found).unwrap();
    } else if std::fs::read(&committed).unwrap() != found {
        let current = Path::new(SCRATCH).join("edgepuck.h");
        std::fs::write(&current, &found).unwrap();
        panic!(
            "{} is not what cbindgen makes of src; compare it with {}, or take that by \
             UPDATE_GOLDEN=1 cargo test",
            committed.display(),
            current.display()
        );
    }
}
