//! The pages of `docs` about the keys of TOML files, made from the code that reads them: its types,
//! its field docs and the bounds that it checks.

use anyhow::Context;
use std::collections::{HashMap, HashSet, VecDeque};
use std::fs;
use std::path::{Path, PathBuf};
use syn::visit::Visit;
use syn::{Attribute, Expr, Item, Lit, Meta, Type};
use xtask::workspace::root;

/// A table: its heading, and the file and the name of the type that reads it.
type Table = (&'static str, &'static str, &'static str);

/// Each page: its beginning, and its tables.
const PAGES: [(&str, &str, &[Table]); 2] = [
    (
        "scene-reference.md",
        "# Keys of scenes\n\nA scene is a TOML file: [First scan](first-scan.md) has an example, and \
         `sim-gpu/EFFECTS.md` in the repository the models of the effects.",
        &[("", "scene/table.rs", "SceneTable"), ("trajectory", "scene/table.rs", "TimedPose")],
    ),
    (
        "sensor-reference.md",
        "# Keys of sensors\n\nA sensor is a TOML file: [Your sensor](sensor.md) has an example, and \
         `sim-gpu/SENSORS.md` in the repository the models.",
        &[("", "sensor/profile.rs", "Profile")],
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
    let code = Code::read(&root().join("sim-gpu/src")).unwrap();
    let mut faults = Vec::new();
    for (name, heading, tables) in PAGES {
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

#[derive(Default)]
struct Code {
    /// Types by file and name.
    types: Vec<(PathBuf, Kind)>,
    /// What values must be, by file and key.
    bounds: HashMap<(PathBuf, String), Vec<String>>,
    constants: HashMap<String, String>,
    /// The bodies of functions, which give defaults.
    functions: HashMap<String, String>,
}

enum Kind {
    Struct(syn::ItemStruct),
    Enum(syn::ItemEnum),
}

impl Kind {
    fn name(&self) -> String {
        match self {
            Self::Struct(it) => it.ident.to_string(),
            Self::Enum(it) => it.ident.to_string(),
        }
    }

    fn field(&self, name: &str) -> Option<&syn::Field> {
        let Self::Struct(it) = self else { return None };
        it.fields.iter().find(|field| field.ident.as_ref().is_some_and(|ident| ident == name))
    }

    fn attributes(&self) -> &[Attribute] {
        match self {
            Self::Struct(it) => &it.attrs,
            Self::Enum(it) => &it.attrs,
        }
    }
}

/// Finds the checks of numbers.
struct Checks<'a>(&'a Path, &'a mut Code);

impl Visit<'_> for Checks<'_> {
    fn visit_expr_call(&mut self, call: &syn::ExprCall) {
        let name = words(&call.func);
        let arguments: Vec<String> = call.args.iter().map(words).collect();
        let bound = match (name.as_str(), &arguments[..]) {
            ("within", [_, _, range]) => Some(self.1.within(range)),
            ("at_least", [_, _, least]) => Some(format!("at least {}", self.1.number(least))),
            ("positive", _) => Some("above 0".to_owned()),
            _ => None,
        };
        // Keys are texts such as `rotating.rpm` and `{key}.min_m[{axis}]`.
        let key = arguments.first().and_then(|key| key.split('"').rev().nth(1));
        if let (Some(bound), Some(key)) = (bound, key) {
            let key = key.rsplit('.').next().unwrap_or(key).split('[').next().unwrap_or(key);
            let of = self.1.bounds.entry((self.0.to_owned(), key.to_owned())).or_default();
            if !bound.is_empty() && !of.contains(&bound) {
                of.push(bound);
            }
        }
        syn::visit::visit_expr_call(self, call);
    }
}

impl Code {
    fn read(folder: &Path) -> anyhow::Result<Self> {
        let mut code = Self::default();
        let mut files = Vec::new();
        let mut folders = vec![folder.to_owned()];
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(&folder)? {
                let path = entry?.path();
                let of = if path.is_dir() { &mut folders } else { &mut files };
                of.push(path);
            }
        }
        files.sort();
        let mut parsed = Vec::new();
        for file in files.iter().filter(|file| file.extension().is_some_and(|it| it == "rs")) {
            let text = fs::read_to_string(file)?;
            let syntax = syn::parse_file(&text).with_context(|| file.display().to_string())?;
            let file = file.strip_prefix(folder).unwrap_or(file).to_owned();
            for item in &syntax.items {
                code.note(&file, item.clone());
            }
            parsed.push((file, syntax));
        }
        for (file, syntax) in &parsed {
            Checks(file, &mut code).visit_file(syntax);
        }
        Ok(code)
    }

    fn note(&mut self, file: &Path, item: Item) {
        match item {
            Item::Struct(it) => self.types.push((file.to_owned(), Kind::Struct(it))),
            Item::Enum(it) => self.types.push((file.to_owned(), Kind::Enum(it))),
            Item::Const(it) => {
                self.constants.insert(it.ident.to_string(), words(&it.expr));
            }
            Item::Fn(it) => {
                self.functions.insert(it.sig.ident.to_string(), words(&it.block));
            }
            Item::Impl(it) => {
                for item in &it.items {
                    if let syn::ImplItem::Const(it) = item {
                        self.constants.insert(it.ident.to_string(), words(&it.expr));
                    }
                }
            }
            // `named!`: an enum with texts as values, after the name of its kind.
            Item::Macro(it) => {
                let text = it.mac.tokens.to_string();
                let body = text.find('{').zip(text.find(" : \""));
                if let Some((body, kind)) = body.filter(|(body, kind)| kind < body)
                    && let Ok(it) = syn::parse_str(&format!("{}{}", &text[..kind], &text[body..]))
                {
                    self.types.push((file.to_owned(), Kind::Enum(it)));
                }
            }
            _ => {}
        }
    }

    /// The type that `name` means in `file`.
    fn find(&self, file: &Path, name: &str) -> Option<&(PathBuf, Kind)> {
        let (module, name) = name.rsplit_once("::").unwrap_or(("", name));
        let folder = file.parent().unwrap_or(Path::new(""));
        let rank = |path: &Path| match module {
            "" if path == file => 0,
            "" if path.parent() == Some(folder) => 1,
            "" => 2,
            _ => u8::from(path != file.with_extension("").join(module).with_extension("rs")),
        };
        let all = self.types.iter().filter(|(_, kind)| kind.name() == name);
        all.min_by_key(|(path, _)| rank(path))
    }

    fn number(&self, text: &str) -> String {
        let (sign, text) = text.strip_prefix('-').map_or(("", text), |text| ("-", text));
        let text = text.trim_end_matches("asf64").trim_start_matches("self.");
        let text = self.constants.get(text).map_or(text, String::as_str).trim_end_matches("asf64");
        let text = text.replace("u16::MAX", "65535").replace("1<<", "2^");
        format!("{sign}{}", text.strip_suffix(".0").unwrap_or(&text))
    }

    fn within(&self, range: &str) -> String {
        let range = self.constants.get(range).map_or(range, String::as_str);
        let (from, to) = range.split_once("..=").unwrap_or((range, range));
        match (self.number(from), self.number(to)) {
            (from, to) if to == "f64::MAX" => format!("at least {from}"),
            (from, to) => format!("{from} to {to}"),
        }
    }

    /// The bounds of a value, without those that name variables.
    fn bounds(&self, file: &Path, key: &str) -> String {
        let of = |file: &Path| self.bounds.get(&(file.to_owned(), key.to_owned()));
        let all = of(file).or_else(|| of(&file.with_file_name("profile.rs")));
        let is_known = |bound: &&String| {
            let mut words = bound.split([' ', '-']).filter(|word| word.contains('_'));
            words.all(|word| self.types.iter().any(|(_, kind)| kind.field(word).is_some()))
        };
        let all: Vec<&str> =
            all.into_iter().flatten().filter(is_known).map(String::as_str).collect();
        let all = all.iter().map(|bound| format!(", {bound}")).collect::<String>();
        all.replace("above 0, 0 to", "above 0, up to")
    }

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
                if !seen.insert((file.clone(), kind.name())) {
                    continue;
                }
                // A type that serde makes of another one is written as the other one.
                if let Some(other) = serde(kind.attributes(), "try_from").flatten() {
                    queue.push_front((path, file.clone(), other));
                    continue;
                }
                match kind {
                    Kind::Struct(table) => {
                        let below = self.table(&path, file, table, &mut page, faults);
                        queue.extend(below);
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
            let value = kind.clone() + &self.bounds(file, &key);
            let default = self.absent(file, field);
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
            "f64" => "number",
            "bool" => "true or false",
            "String" | "PathBuf" => "text",
            "u16" | "u32" | "u64" => "whole number",
            "NonZeroU32" => "whole number, at least 1",
            "Motion" => "text or list: `trajectory`",
            _ => "",
        };
        match self.find(file, &name) {
            _ if !known.is_empty() => known.to_owned(),
            Some((_, Kind::Struct(it))) if serde(&it.attrs, "try_from").is_none() => "table".into(),
            Some((file, kind)) => match (serde(kind.attributes(), "try_from").flatten(), kind) {
                (Some(other), _) => {
                    syn::parse_str(&other).map(|of| self.value(file, &of)).unwrap_or_default()
                }
                (None, Kind::Enum(it)) => choices(it),
                _ => String::new(),
            },
            None => name,
        }
    }

    fn absent(&self, file: &Path, field: &syn::Field) -> String {
        let name = words(&field.ty);
        match serde(&field.attrs, "default") {
            _ if name.starts_with("Option<") => "optional".to_owned(),
            // Its check wants one: an empty list has a better message than serde's.
            _ if docs(&field.attrs).contains("at least one") => "required".to_owned(),
            None => "required".to_owned(),
            Some(Some(function)) => {
                let body = self.functions.get(&function).map_or("", String::as_str);
                let value = self.number(body.trim_matches(['{', '}']));
                let value = value.replace("NonZeroU32::MIN", "1");
                value.rsplit_once("::").map_or(value.clone(), |(_, name)| self.number(name))
            }
            Some(None) => match self.find(file, &inner(&field.ty)) {
                _ if name.starts_with('[') || name == "f64" || name.starts_with('u') => "0".into(),
                _ if name == "bool" => "false".to_owned(),
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

/// The innermost type: `Beam` of `Option<Vec<Beam>>`.
fn inner(of: &Type) -> String {
    let name = words(of);
    let name = name.rsplit(['<', ',']).next().unwrap_or_default();
    name.trim_end_matches('>').to_owned()
}

/// The code without spaces.
fn words(of: &impl quote::ToTokens) -> String {
    of.to_token_stream().to_string().replace(' ', "")
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
