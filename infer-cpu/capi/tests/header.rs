//! The committed header is what cbindgen makes of the sources.

use std::path::Path;

#[test]
fn the_header_is_that_of_the_sources() {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(package.join("cbindgen.toml")).unwrap();
    let source = package.join("src/lib.rs");
    let bindings = cbindgen::Builder::new().with_config(config).with_src(source).generate();
    let mut found = Vec::new();
    bindings.unwrap().write(&mut found);

    let committed = package.join("include/edgepuck.h");
    if std::env::var_os("UPDATE_GOLDEN").is_some_and(|value| value == "1") {
        std::fs::write(&committed, &found).unwrap();
        return;
    }
    if std::fs::read(&committed).is_ok_and(|committed| committed == found) {
        return;
    }
    let current = Path::new(env!("CARGO_TARGET_TMPDIR")).join("edgepuck.h");
    std::fs::write(&current, &found).unwrap();
    panic!(
        "{} is not what cbindgen makes of src; compare it with {}, or take that by \
         UPDATE_GOLDEN=1 cargo test -p edgepuck-capi",
        committed.display(),
        current.display()
    );
}
