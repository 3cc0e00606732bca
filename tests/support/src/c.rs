//! Tests of a C interface: its header, and programs that a C compiler links with it.

#![expect(clippy::unwrap_used, reason = "tests")]

use std::path::{Path, PathBuf};
use std::process::Command;

/// The package of a C interface.
pub struct Package {
    /// Its folder, `CARGO_MANIFEST_DIR`.
    pub folder: &'static str,
    /// Where its tests write, `CARGO_TARGET_TMPDIR`.
    pub scratch: &'static str,
    /// The name of its library and header.
    pub library: &'static str,
}

impl Package {
    /// A compiler of C; an error if it is missing or makes programs for another machine.
    pub fn c(&self) -> Result<Compiler<'_>, String> {
        self.compiler("CC", "cc", "-std=c99")
    }

    /// A compiler of C++, with the same errors.
    pub fn c_plus_plus(&self) -> Result<Compiler<'_>, String> {
        self.compiler("CXX", "c++", "-std=c++11")
    }

    /// The compiler that environment variable `variable` names, else `default`.
    fn compiler(
        &self,
        variable: &str,
        default: &str,
        standard: &'static str,
    ) -> Result<Compiler<'_>, String> {
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
        let folder = tempfile::tempdir_in(self.scratch).unwrap();
        Ok(Compiler { package: self, command, standard, folder })
    }

    /// What links a program with the archive, which Cargo makes in one go with the Rust library that the
    /// test is linked with.
    #[must_use]
    pub fn static_link(&self) -> Vec<String> {
        let archive = library_folder().join(format!("lib{}.a", self.library));
        let mut link =
            [archive.to_str().unwrap(), "-lpthread", "-ldl", "-lm"].map(str::to_owned).to_vec();
        // What features of the workspace bring: the simplification of meshes is in C++.
        let library = "libstdc++.so";
        let found = Command::new("cc").arg(format!("-print-file-name={library}")).output();
        if found.is_ok_and(|found| found.stdout.trim_ascii() != library.as_bytes()) {
            link.push("-lstdc++".to_owned());
        }
        link
    }

    /// What links a program with the shared library.
    #[must_use]
    pub fn dynamic_link(&self) -> Vec<String> {
        let folder = library_folder().display().to_string();
        let library = format!("-l{}", self.library);
        let run_path = format!("-Wl,-rpath,{folder}");
        vec![format!("-L{folder}"), library, run_path, "-lpthread".to_owned(), "-lm".to_owned()]
    }

    /// Checks that the committed header is what cbindgen makes of the sources.
    ///
    /// # Panics
    /// If it is not: the message names the file to compare it with.
    pub fn check_header(&self) {
        let package = Path::new(self.folder);
        let config = cbindgen::Config::from_file(package.join("cbindgen.toml")).unwrap();
        let source = package.join("src/lib.rs");
        let bindings = cbindgen::Builder::new().with_config(config).with_src(source).generate();
        let mut found = Vec::new();
        bindings.unwrap().write(&mut found);

        let name = format!("{}.h", self.library);
        let committed = package.join("include").join(&name);
        if std::env::var_os("UPDATE_GOLDEN").is_some_and(|value| value == "1") {
            std::fs::write(&committed, &found).unwrap();
            return;
        }
        if std::fs::read(&committed).is_ok_and(|committed| committed == found) {
            return;
        }
        let current = Path::new(self.scratch).join(&name);
        std::fs::write(&current, &found).unwrap();
        panic!(
            "{} is not what cbindgen makes of src; compare it with {}, or take that by \
             UPDATE_GOLDEN=1 cargo test",
            committed.display(),
            current.display()
        );
    }
}

/// A compiler that makes programs for the machine this test was built for.
pub struct Compiler<'a> {
    package: &'a Package,
    command: String,
    standard: &'static str,
    folder: tempfile::TempDir,
}

impl Compiler<'_> {
    /// Where what it makes belongs.
    #[must_use]
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Compiles `source`, a path in the package, with all warnings as errors, and links it as `link`
    /// says.
    ///
    /// # Panics
    /// If that fails: with what the compiler says.
    #[must_use]
    pub fn compile(&self, source: &str, link: &[String]) -> PathBuf {
        let package = Path::new(self.package.folder);
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

/// Cargo puts the libraries for C beside the test itself.
fn library_folder() -> PathBuf {
    std::env::current_exe().unwrap().with_file_name("")
}
