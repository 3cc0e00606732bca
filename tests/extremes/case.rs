//! Finds, reads and checks the files of cases.

use std::ffi::OsStr;
use std::path::Path;

use libtest_mimic::Trial;
use serde::Deserialize;

use crate::classify::Classify;
use crate::effect::InCube;
use crate::scan::Scan;
use crate::scene::ManyObjects;
use crate::sweep::Sweep;

const HEAVY: &str = "EDGEPUCK_HEAVY";

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    derivation: String,
    #[serde(default)]
    heavy: bool,
    scan: Option<Scan>,
    classify: Option<Classify>,
    effect: Option<InCube>,
    scene: Option<ManyObjects>,
    sweep: Option<Sweep>,
}

type Check = Box<dyn FnOnce() + Send>;

pub fn trials() -> Vec<Trial> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("extremes/cases");
    let mut trials = vec![Trial::test("misspelt_keys_are_named", misspelt_keys_are_named)];
    for (path, content) in tests::tree::files(&root) {
        let name = path.with_extension("").to_string_lossy().replace('\\', "/");
        let test = parse(&String::from_utf8_lossy(&content), &path)
            .map_err(|cause| format!("{}: {cause}", path.display()));
        let heavy = test.as_ref().is_ok_and(|(heavy, _)| *heavy);
        let skipped = heavy && !std::env::var(HEAVY).is_ok_and(|value| value == "1");
        if skipped {
            eprintln!("SKIPPED: {name} takes gigabytes or minutes; {HEAVY}=1 runs it");
        }
        let trial = Trial::test(name, move || Ok(test.map(|(_, check)| check())?));
        trials.push(trial.with_ignored_flag(skipped));
    }
    trials
}

fn parse(text: &str, path: &Path) -> Result<(bool, Check), String> {
    if path.extension() != Some(OsStr::new("toml")) {
        return Err("a case's name ends in .toml".to_owned());
    }
    let file: File = toml::from_str(text).map_err(|e| e.to_string())?;
    if file.derivation.trim().is_empty() {
        return Err("`derivation` is empty".to_owned());
    }
    let kinds: [(&str, Option<Check>); 5] = [
        ("scan", file.scan.map(|case| Box::new(move || case.check()) as Check)),
        ("classify", file.classify.map(|case| Box::new(move || case.check()) as Check)),
        ("effect", file.effect.map(|case| Box::new(move || case.check()) as Check)),
        ("scene", file.scene.map(|case| Box::new(move || case.check()) as Check)),
        ("sweep", file.sweep.map(|case| Box::new(move || case.check()) as Check)),
    ];
    let mut named = kinds.into_iter().filter_map(|(kind, check)| Some((kind, check?)));
    let (Some((kind, check)), None) = (named.next(), named.next()) else {
        return Err("a case is one table: scan, classify, effect, scene or sweep".to_owned());
    };
    match path.parent().and_then(Path::file_name) {
        Some(folder) if folder == kind => Ok((file.heavy, check)),
        _ => Err(format!("a case of `{kind}` belongs into the folder {kind}")),
    }
}

fn misspelt_keys_are_named() -> Result<(), libtest_mimic::Failed> {
    let sweep = "[sweep]\nground = 0\nclusters = []\nsmall = 0\n";
    let whole = format!("derivation = \"one\"\n{sweep}invalid = 0\n");
    let message = |text: &str, name: &str| parse(text, Path::new(name)).err().unwrap_or_default();
    assert_eq!(message(&whole, "sweep/a.toml"), "");
    for (text, name, expected) in [
        (whole.replace("small", "tiny"), "sweep/a.toml", "unknown field `tiny`"),
        (whole.replace("derivation", "derived"), "sweep/a.toml", "unknown field `derived`"),
        (whole.replace("[sweep]", "[sweeps]"), "sweep/a.toml", "unknown field `sweeps`"),
        (whole.replace("\"one\"", "\" \""), "sweep/a.toml", "`derivation` is empty"),
        ("derivation = \"one\"".to_owned(), "sweep/a.toml", "a case is one table"),
        (sweep.to_owned() + "invalid = 0", "sweep/a.toml", "missing field `derivation`"),
        (whole.clone(), "scan/a.toml", "belongs into the folder sweep"),
        (whole.clone(), "sweep/a.tml", "ends in .toml"),
    ] {
        let found = message(&text, name);
        assert!(found.contains(expected), "{expected}: {found}");
    }
    Ok(())
}
