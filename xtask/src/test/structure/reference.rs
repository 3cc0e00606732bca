//! The pages of `docs` about the keys of TOML files, made from the code that reads them: its types,
//! its field docs and the bounds that it checks.

mod code;

use code::{Code, Kind, words};
use std::collections::{HashSet, VecDeque};
use std::fs;
use std::path::{Path, PathBuf};
use syn::{Attribute, Expr, Lit, Meta, Type};
use xtask::workspace::root;

/// A table: its heading, and the file and the name of the type that reads it.
type Table = (&'static str, &'static str, &'static str);

/// A page: its name, its beginning, the folders and files of its types, and its tables.
type Page = (&'static str, &'static str, &'static [&'static str], &'static [Table]);

const SIM: &[&str] = &["sim-gpu/src"];
const SCENES: &[&str] = &["sim-gpu/scenes/src", "sim-gpu/shapes/src/objects/mod.rs"];
const TRAIN: &[&str] = &["train/src", "formats/src/model_card.rs"];

const PAGES: [Page; 4] = [
    (
        "scene-reference.md",
        "# Keys of scenes\n\nA scene is a TOML file: [First scan](first-scan.md) has an example, and \
         `sim-gpu/EFFECTS.md` in the repository the models of the effects.",
        SIM,
        &[
            ("", "sim-gpu/src/scene/table.rs", "SceneTable"),
            ("trajectory", "sim-gpu/src/scene/table.rs", "TimedPose"),
        ],
    ),
    (
        "sensor-reference.md",
        "# Keys of sensors\n\nA sensor is a TOML file: [Your sensor](sensor.md) has an example, and \
         `sim-gpu/SENSORS.md` in the repository the models.",
        SIM,
        &[("", "sim-gpu/src/sensor/profile.rs", "Profile")],
    ),
    (
        "scene-recipe-reference.md",
        "# Keys of scene recipes\n\nA recipe of `gen-scenes` and `gen-drive` is a TOML file: \
         `street`, `room` and `yard` are built in, and `assets/scenes` in the repository has them. \
         A list of 2 numbers is the least and the greatest.",
        SCENES,
        &[
            ("", "sim-gpu/scenes/src/recipe.rs", "Recipe"),
            ("kind", "sim-gpu/shapes/src/objects/mod.rs", "ObjectKind"),
            ("place", "sim-gpu/scenes/src/recipe.rs", "Place"),
        ],
    ),
    (
        "train-recipe-reference.md",
        "# Keys of training recipes\n\nA recipe of `train` is a TOML file: [Train](train.md) has an \
         example, and the folder of a run has its recipe with all keys. The built-in recipes are \
         `edge-64`, `set-64`, `lidar-64` and `street-128`. The training part must have clouds of \
         every class, also of those that `unknown` lists. A set of only a few sweeps usually lacks \
         some. Lengths of clouds in the unit sphere are in radii, those of clusters in metres.",
        TRAIN,
        &[("", "train/src/recipe.rs", "Recipe")],
    ),
];

/// What each page says.
const UNITS: &str = "The end of a key names its unit: `_m` is metres, `_deg` degrees, `_s` seconds, `_us` \
                     microseconds, `_hz` 1/s.";

/// The types whose docs the keys of others have, too.
const TWINS: [(&str, &str); 6] = [
    ("SceneTable", "SceneFile"),
    ("ObjectTable", "SceneObject"),
    ("SensorTable", "SceneSensor"),
    ("Profile", "SensorProfile"),
    ("EffectsTable", "Effects"),
    ("OwnMaterial", "Material"),
];

#[test]
fn the_pages_about_keys_say_what_the_code_does() {
    let mut faults = Vec::new();
    for (name, heading, sources, tables) in PAGES {
        let code = Code::read(sources).unwrap();
        let made = code.page(heading, tables, &mut faults);
        let page = root().join("docs/src").join(name);
        if std::env::var_os("UPDATE_GOLDEN").is_some() {
            fs::write(&page, &made).unwrap();
        }
        let found = fs::read_to_string(&page).unwrap_or_default();
        assert!(found == made, "docs/src/{name}: UPDATE_GOLDEN=1 cargo test -p xtask rewrites it");
    }
    assert_eq!(faults, [""; 0]);
}

impl Code {
    fn page(&self, heading: &str, tables: &[Table], faults: &mut Vec<String>) -> String {
        let mut page = format!(
            "{heading} {UNITS}\n\n<!-- Made from the code: UPDATE_GOLDEN=1 cargo test -p xtask -->\n"
        );
        let mut seen = HashSet::new();
        for &(path, file, name) in tables {
            let root = (path.to_owned(), PathBuf::from(file), name.to_owned());
            let mut queue = VecDeque::from([root]);
            while let Some((path, file, name)) = queue.pop_front() {
                let Some((file, kind)) = self.find(&file, &name) else { continue };
                // A choice of words has a section only where its own path is asked for.
                let is_written = match kind {
                    Kind::Enum(of) => !path.starts_with('[') || serde(&of.attrs, "tag").is_some(),
                    Kind::Struct(_) => true,
                };
                if is_written && !seen.insert((file.clone(), kind.name())) {
                    continue;
                }
                // A type that serde makes of another one is written as the other one.
                if let Some(other) = made_of(kind.attributes()) {
                    queue.push_front((path, file.clone(), other));
                    continue;
                }
                match kind {
                    Kind::Struct(table) => {
                        let below = self.table(&path, file, table, &mut page, faults);
                        queue.extend(below);
                    }
                    Kind::Enum(choice) if !path.starts_with('[') => {
                        page += &format!("\n## `{path}`\n\n| value | meaning |\n|---|---|\n");
                        for variant in &choice.variants {
                            page += &format!("| {} | {} |\n", named(variant), docs(&variant.attrs));
                        }
                    }
                    Kind::Enum(choice) if serde(&choice.attrs, "tag").is_some() => {
                        for variant in &choice.variants {
                            let table = syn::ItemStruct {
                                attrs: variant.attrs.clone(),
                                fields: variant.fields.clone(),
                                ..syn::parse_quote!(
                                    struct Variant;
                                )
                            };
                            let path = format!(
                                "{path}` with `kind = {}",
                                named(variant).trim_matches('`')
                            );
                            self.table(&path, file, &table, &mut page, faults);
                        }
                    }
                    Kind::Enum(choice) => {
                        let fields = choice.variants.iter().flat_map(|variant| &variant.fields);
                        let inner =
                            fields.map(|field| (path.clone(), file.clone(), inner(&field.ty)));
                        inner.for_each(|table| queue.push_front(table));
                    }
                }
            }
        }
        page
    }

    /// Adds a table of keys to the `page`. Returns the tables below it.
    fn table(
        &self,
        path: &str,
        file: &Path,
        table: &syn::ItemStruct,
        page: &mut String,
        faults: &mut Vec<String>,
    ) -> Vec<(String, PathBuf, String)> {
        if !path.is_empty() {
            *page += &format!("\n## `{path}`\n");
        }
        let about = docs(&table.attrs);
        if !path.is_empty() && !about.is_empty() {
            *page += &format!("\n{about}\n");
        }
        *page += "\n| key | value | default | meaning |\n|---|---|---|---|\n";
        let path = path.trim_matches(['[', ']']);
        let mut below = Vec::new();
        for field in &table.fields {
            let key = field.ident.as_ref().map(ToString::to_string).unwrap_or_default();
            let meaning = self.meaning(file, table, &field.attrs, &key);
            if meaning.is_empty() {
                faults.push(format!("{}: {}.{key} has no doc", file.display(), table.ident));
            }
            let kind = self.value(file, &field.ty);
            let value = kind.clone() + &self.bounds(file, path, &key);
            let default = self.absent(file, table, field);
            *page += &format!("| `{key}` | {value} | {default} | {meaning} |\n");
            let key = if path.is_empty() { key } else { format!("{path}.{key}") };
            let key = match kind.split_once(": ") {
                // A section of its own has the poses, which two tables share.
                _ if kind.ends_with("`trajectory`") => continue,
                Some(("list", "table")) => format!("[[{key}]]"),
                Some(("table", _)) => format!("[{key}.NAME]"),
                _ => format!("[{key}]"),
            };
            below.push((key, file.to_owned(), inner(&field.ty)));
        }
        below
    }

    /// The docs of a field, or those of the field of this name of its table's twin or of poses.
    fn meaning(
        &self,
        file: &Path,
        table: &syn::ItemStruct,
        attributes: &[Attribute],
        key: &str,
    ) -> String {
        let twin = TWINS.iter().find(|(name, _)| table.ident == name).map(|(_, twin)| *twin);
        let twins = [twin.unwrap_or("PoseKeys"), "PoseKeys"].into_iter();
        let twins = twins.filter_map(|twin| self.find(file, twin)?.1.field(key));
        let all = std::iter::once(docs(attributes)).chain(twins.map(|field| docs(&field.attrs)));
        all.filter(|docs| !docs.is_empty()).take(1).collect()
    }

    /// What is written as a value of this type.
    fn value(&self, file: &Path, of: &Type) -> String {
        let name = words(of);
        let within = |outer: &str| name.strip_prefix(outer)?.strip_suffix('>').map(str::to_owned);
        let of = |inner: &str| syn::parse_str(inner).map(|of| self.value(file, &of));
        if let Some(inner) = within("Option<").or_else(|| within("Box<")) {
            return of(&inner).unwrap_or_default();
        }
        if let Some(inner) = within("Vec<") {
            return format!("list: {}", of(&inner).unwrap_or_default());
        }
        if let Some(inner) = within("BTreeMap<String,") {
            return format!("table: {}", of(&inner).unwrap_or_default());
        }
        if let Some((inner, n)) = name.strip_prefix('[').and_then(|it| it.split_once(';')) {
            let n = n.trim_end_matches(']');
            return format!("list of {n}: {}", of(inner).unwrap_or_default());
        }
        let known = match name.as_str() {
            "f32" | "f64" => "number",
            "bool" => "true or false",
            "String" | "PathBuf" => "text",
            "u16" | "u32" | "u64" | "usize" => "whole number",
            "NonZeroU32" => "whole number, at least 1",
            "Motion" => "text or list: `trajectory`",
            _ => "",
        };
        match self.find(file, &name) {
            _ if !known.is_empty() => known.to_owned(),
            Some((_, kind)) if serde(kind.attributes(), "tag").is_some() => "table".into(),
            Some((_, Kind::Struct(it))) if made_of(&it.attrs).is_none() => "table".into(),
            Some((file, kind)) => match (made_of(kind.attributes()), kind) {
                (Some(other), _) => {
                    syn::parse_str(&other).map(|of| self.value(file, &of)).unwrap_or_default()
                }
                (None, Kind::Enum(it)) => choices(it),
                _ => String::new(),
            },
            None if name == "Effects" => {
                "table, as [`effects`](scene-reference.md#effects) of scenes".to_owned()
            }
            None => name,
        }
    }

    /// The value of an expression in code, as TOML; `optional` if it is that of a table.
    fn shown(&self, file: &Path, code: &str) -> String {
        let code = code.trim_end_matches(".into()").trim_end_matches(".to_owned()");
        if let Some(body) = code.strip_suffix("()").and_then(|name| self.functions.get(name)) {
            return self.shown(file, body.trim_matches(['{', '}']));
        }
        let list = code.trim_start_matches("vec!").strip_prefix('[');
        if let Some(items) = list.and_then(|items| items.strip_suffix(']')) {
            let items: Vec<String> = items.split(',').map(|item| self.number(item)).collect();
            return format!("[{}]", items.join(", "));
        }
        match code.split_once("::") {
            Some(("Vec", "new()")) => "empty".to_owned(),
            Some(("NonZeroU32", "MIN")) => "1".to_owned(),
            Some((name, "default()")) => match self.find(file, name) {
                Some((_, kind)) if made_of(kind.attributes()).is_some() => "[0, 0]".to_owned(),
                _ => "optional".to_owned(),
            },
            Some((name, variant)) => match self.find(file, name) {
                Some((_, Kind::Enum(it))) => {
                    let found = it.variants.iter().find(|of| of.ident == variant);
                    found.map(named).unwrap_or_default()
                }
                _ => self.number(variant),
            },
            None if code.starts_with('"') => format!("`{code}`"),
            None => self.number(code),
        }
    }

    fn absent(&self, file: &Path, table: &syn::ItemStruct, field: &syn::Field) -> String {
        let name = words(&field.ty);
        let key = field.ident.as_ref().map(ToString::to_string).unwrap_or_default();
        let of_table = serde(&table.attrs, "default");
        let wants_one = |text: String| text.contains("at least one");
        let is_wanted = wants_one(docs(&field.attrs)) || wants_one(self.bounds(file, "", &key));
        let made = self.defaults.get(&(table.ident.to_string(), key));
        match of_table.clone().or_else(|| serde(&field.attrs, "default")) {
            _ if name.starts_with("Option<") => "optional".to_owned(),
            // Its check wants one: an empty list has a better message than serde's.
            _ if is_wanted => "required".to_owned(),
            None => "required".to_owned(),
            Some(Some(function)) => self.shown(file, &format!("{function}()")),
            Some(None) => match self.find(file, &inner(&field.ty)) {
                _ if of_table.is_some() && made.is_some() => {
                    made.map(|made| self.shown(file, made)).unwrap_or_default()
                }
                _ if name.starts_with('[') || name == "f64" || name.starts_with('u') => "0".into(),
                _ if name == "bool" => "false".to_owned(),
                Some((_, kind)) if made_of(kind.attributes()).as_deref() == Some("[f64; 2]") => {
                    "[0, 0]".to_owned()
                }
                Some((_, Kind::Enum(it))) if it.ident == name => {
                    let is_default = |it: &&syn::Variant| {
                        it.attrs.iter().any(|attribute| attribute.path().is_ident("default"))
                    };
                    it.variants.iter().find(is_default).map(named).unwrap_or_default()
                }
                _ => "optional".to_owned(),
            },
        }
    }
}

/// The words of a choice: what serde expects, or the names of the variants.
fn choices(of: &syn::ItemEnum) -> String {
    if let Some(expected) = serde(&of.attrs, "expecting").flatten() {
        let expected = expected.trim_start_matches("expected ");
        return expected.rsplit_once(" as ").map_or(expected, |(words, _)| words).to_owned();
    }
    of.variants.iter().map(named).collect::<Vec<_>>().join(", ")
}

fn named(variant: &syn::Variant) -> String {
    match &variant.discriminant {
        Some((_, Expr::Lit(it))) => format!("`{}`", words(&it.lit)),
        _ => format!("`\"{}\"`", variant.ident.to_string().to_lowercase()),
    }
}

/// The type of which serde makes the one with these attributes.
fn made_of(attributes: &[Attribute]) -> Option<String> {
    serde(attributes, "try_from").or(serde(attributes, "from")).flatten()
}

/// The innermost type: `Beam` of `Option<Vec<Beam>>`.
fn inner(of: &Type) -> String {
    let name = words(of);
    let name = name.rsplit(['<', ',']).next().unwrap_or_default();
    name.trim_end_matches('>').to_owned()
}

fn docs(attributes: &[Attribute]) -> String {
    let lines = attributes.iter().filter_map(|attribute| match &attribute.meta {
        Meta::NameValue(it) if it.path.is_ident("doc") => match &it.value {
            Expr::Lit(syn::ExprLit { lit: Lit::Str(text), .. }) => Some(text.value()),
            _ => None,
        },
        _ => None,
    });
    let text = lines.collect::<Vec<_>>().join("");
    // Links to code lead nowhere here.
    let parts = text.trim().split("[`").enumerate().map(|(i, part)| match part.split_once("`]") {
        Some((name, rest)) if i > 0 => {
            let rest =
                rest.strip_prefix('(').and_then(|it| it.split_once(')')).map_or(rest, |it| it.1);
            format!("`{}`{rest}", name.rsplit("::").next().unwrap_or(name))
        }
        _ => part.to_owned(),
    });
    let text = parts.collect::<String>().replace('|', "\\|");
    let text =
        text.replace(". `None` is", ". If it is absent:").replace("; `None` is", "; if absent,");
    text.replace("; `None` are", "; if absent,")
}

/// The value of serde's attribute `name`, if the attribute is there.
fn serde(attributes: &[Attribute], name: &str) -> Option<Option<String>> {
    let mut found = None;
    for attribute in attributes.iter().filter(|attribute| attribute.path().is_ident("serde")) {
        let visited = attribute.parse_nested_meta(|meta| {
            let value = match meta.value() {
                Ok(value) => Some(value.parse::<syn::LitStr>()?.value()),
                Err(_) => None,
            };
            if meta.path.is_ident(name) {
                found = Some(value);
            }
            Ok(())
        });
        visited.ok()?;
    }
    found
}
