//! The Raspberry Pi side of Edgepuck. So far it knows its version and says
//! what it cannot do yet.

use std::process::ExitCode;

fn main() -> ExitCode {
    match std::env::args().nth(1).as_deref() {
        Some("--version" | "-V") => {
            println!("infer-cpu {}", env!("CARGO_PKG_VERSION"));
            ExitCode::SUCCESS
        }
        _ => {
            eprintln!("infer-cpu: classification is not built yet; only --version works");
            ExitCode::from(2)
        }
    }
}
