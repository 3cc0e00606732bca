//! What is measured is the product as it is built: the laboratory's manifest and lock file agree
//! with the product's.

use std::collections::BTreeSet;
use std::path::Path;
use toml::{Table, Value};

fn read(path: &str) -> Table {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    std::fs::read_to_string(path).unwrap().parse().unwrap()
}

/// The packages of a lock file: name and version.
fn locked(path: &str) -> BTreeSet<(String, String)> {
    let lock = read(path);
    let of = |package: &Value, key: &str| package[key].as_str().unwrap().to_owned();
    let packages = lock["package"].as_array().unwrap().iter();
    packages.map(|package| (of(package, "name"), of(package, "version"))).collect()
}

#[test]
fn dependencies_have_the_versions_of_the_product() {
    let (ours, product) = (locked("Cargo.lock"), locked("../../Cargo.lock"));
    let names: BTreeSet<&String> = product.iter().map(|(name, _)| name).collect();
    let others = ours.difference(&product).filter(|(name, _)| names.contains(name));
    assert_eq!(others.collect::<Vec<_>>(), Vec::<&(String, String)>::new());
    let (ours, product) = (read("Cargo.toml"), read("../../Cargo.toml"));
    for (name, asked) in ours["dependencies"].as_table().unwrap() {
        let workspace = product["workspace"]["dependencies"].get(name);
        if let Some(expected) = workspace.filter(|_| asked.get("path").is_none()) {
            assert_eq!(asked, expected, "{name}");
        }
    }
}

#[test]
fn lints_and_profiles_are_those_of_the_product() {
    let (ours, mut product) = (read("Cargo.toml"), read("../../Cargo.toml"));
    assert_eq!(ours["lints"], product["workspace"]["lints"]);
    let names: BTreeSet<String> = locked("Cargo.lock").into_iter().map(|(name, _)| name).collect();
    for profile in ["release", "dev", "test"] {
        let expected = product["profile"][profile].as_table_mut().unwrap();
        // Cargo warns of a profile for a package that it does not build.
        let packages = expected["package"].as_table_mut().unwrap();
        packages.retain(|name, _| name == "*" || names.contains(name));
        assert_eq!(ours["profile"][profile].as_table(), Some(&*expected), "{profile}");
    }
}
