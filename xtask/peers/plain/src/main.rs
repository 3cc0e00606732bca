//! Takes a turn of the plain scene for each line it reads, and writes how long
//! it took. The first line it writes is the scan's fingerprint.

mod turn;

use std::io::{BufRead, Write};
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args_os().nth(1).ok_or("usage: plain MESH")?;
    let plain = turn::Plain::new(Path::new(&path))?;
    let mut out = std::io::stdout().lock();
    writeln!(out, "{}", turn::fingerprint(&plain.scan()))?;
    for line in std::io::stdin().lock().lines() {
        line?;
        writeln!(out, "{}", plain.turn())?;
        out.flush()?;
    }
    Ok(())
}
