//! The Raspberry Pi as a compilation target: its programs are linked without a C compiler, and run
//! here in an emulator.

use crate::workspace;
use std::process::Command;

/// Static binaries that run on any 64-bit Raspberry Pi, whatever its system.
pub const TRIPLE: &str = "aarch64-unknown-linux-musl";

/// The message about a missing emulator.
pub const NO_EMULATOR: &str =
    "no qemu-aarch64 here knows the Cortex-A76: install qemu-user, QEMU 7.1 or newer";

/// QEMU for one program.
const EMULATOR: &str = "qemu-aarch64";
/// The core of a Raspberry Pi 5. It has fp16 and dot products and no newer
/// extension, so that a kernel that uses one traps.
const CORE: &str = "cortex-a76";

/// The emulator of the Pi, if this machine has it.
pub fn emulator() -> Option<Command> {
    let mut emulator = Command::new(EMULATOR);
    emulator.args(["-cpu", CORE]);
    let cores = Command::new(EMULATOR).args(["-cpu", "help"]).output().ok()?;
    String::from_utf8_lossy(&cores.stdout).contains(CORE).then_some(emulator)
}

/// Cargo, which links for the Pi with the linker that comes with Rust and
/// tests under the emulator, unless the environment says otherwise.
pub fn cargo(args: &[&str]) -> Command {
    let mut command = workspace::cargo(args);
    command.args(["--target", TRIPLE]);
    let prefix = format!("CARGO_TARGET_{}", TRIPLE.replace('-', "_").to_uppercase());
    let defaults =
        [("LINKER", "rust-lld".to_owned()), ("RUNNER", format!("{EMULATOR} -cpu {CORE}"))];
    for (what, value) in defaults {
        let key = format!("{prefix}_{what}");
        if std::env::var_os(&key).is_none() {
            command.env(key, value);
        }
    }
    command
}
