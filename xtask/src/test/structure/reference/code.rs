//! What the code says of the keys of TOML files: its types, the bounds that it checks, and defaults.

use anyhow::Context;
use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use syn::punctuated::Punctuated;
use syn::visit::Visit;
use syn::{Attribute, Expr, Item, Lit};
use xtask::workspace::root;

/// The items of some files.
#[derive(Default)]
pub struct Code {
    /// Types by file and name.
    types: Vec<(PathBuf, Kind)>,
    /// What values must be, by file and key.
    bounds: HashMap<(PathBuf, String), Vec<String>>,
    constants: HashMap<String, String>,
    /// The bodies of functions, which give defaults.
    pub functions: HashMap<String, String>,
    /// What functions say is expected of a value.
    expectations: HashMap<String, String>,
    /// The values of fields in `Default::default`, by type and field.
    pub defaults: HashMap<(String, String), String>,
}

/// A type.
pub enum Kind {
    Struct(syn::ItemStruct),
    Enum(syn::ItemEnum),
}

impl Kind {
    pub fn name(&self) -> String {
        match self {
            Self::Struct(it) => it.ident.to_string(),
            Self::Enum(it) => it.ident.to_string(),
        }
    }

    pub fn field(&self, name: &str) -> Option<&syn::Field> {
        let Self::Struct(it) = self else { return None };
        it.fields.iter().find(|field| field.ident.as_ref().is_some_and(|ident| ident == name))
    }

    pub fn attributes(&self) -> &[Attribute] {
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
            ("several", _) => Some("at least one".to_owned()),
            ("layers", [_, _, n]) => Some(format!("{n} or more layers")),
            (name, _) if self.1.expectations.contains_key(name) => {
                self.1.expectations.get(name).cloned()
            }
            ("positive", _) => Some("above 0".to_owned()),
            _ => None,
        };
        self.note(&arguments, bound);
        syn::visit::visit_expr_call(self, call);
    }

    /// `span.check("key", least, most)`.
    fn visit_expr_method_call(&mut self, call: &syn::ExprMethodCall) {
        let arguments: Vec<String> = call.args.iter().map(words).collect();
        if let ("check", [_, least, most]) = (call.method.to_string().as_str(), &arguments[..]) {
            let bound = self.1.within(&format!("{least}..={most}"));
            self.note(&arguments, Some(bound));
        }
        syn::visit::visit_expr_method_call(self, call);
    }

    /// `(condition, "key", "expected ...")`.
    fn visit_expr_tuple(&mut self, tuple: &syn::ExprTuple) {
        if let [_, key, Expr::Lit(expected)] = &tuple.elems.iter().collect::<Vec<_>>()[..] {
            self.note(&[words(key)], expectation(&expected.lit));
        }
        syn::visit::visit_expr_tuple(self, tuple);
    }

    /// The checks in lists, too.
    fn visit_macro(&mut self, of: &syn::Macro) {
        let list = Punctuated::<Expr, syn::Token![,]>::parse_terminated;
        let items = of.parse_body_with(list).unwrap_or_default();
        items.iter().for_each(|item| self.visit_expr(item));
    }
}

impl Checks<'_> {
    /// Notes the bound of the key that is the first of the arguments of a check: a text such as
    /// `rotating.rpm` or `{key}.min_m[{axis}]`, as a whole or as it ends.
    fn note(&mut self, arguments: &[String], bound: Option<String>) {
        let key = arguments.first().and_then(|key| key.split('"').rev().nth(1));
        let (Some(bound), Some(key)) = (bound, key) else { return };
        let ending = key.rsplit('.').next().unwrap_or(key).split('[').next().unwrap_or(key);
        let key = if key.contains(['{', '[']) { ending } else { key };
        let of = self.1.bounds.entry((self.0.to_owned(), key.to_owned())).or_default();
        if !bound.is_empty() && !of.contains(&bound) {
            of.push(bound);
        }
    }
}

/// What a text says is expected of a number.
fn expectation(of: &Lit) -> Option<String> {
    let Lit::Str(text) = of else { return None };
    let mut text = text.value();
    for words in [
        "expected ",
        "a finite number of ",
        "a finite number ",
        "two finite factors ",
        "two numbers, ",
    ] {
        text = text.strip_prefix(words).map(str::to_owned).unwrap_or(text);
    }
    let reason = text.find(", because").or(text.find(", for "));
    let text = &text[..reason.unwrap_or(text.len())];
    let is_number = text.starts_with(|letter: char| letter.is_ascii_digit());
    let is_bound = ["above", "more", "widths"].iter().any(|word| text.starts_with(word));
    (is_number || is_bound).then(|| text.to_owned())
}

/// The last text of a function that says what is expected.
#[derive(Default)]
struct Expectation(Option<String>);

impl Visit<'_> for Expectation {
    fn visit_lit(&mut self, lit: &Lit) {
        self.0 = expectation(lit).or(self.0.take());
    }
}

impl Code {
    pub fn read(sources: &[&str]) -> anyhow::Result<Self> {
        let mut code = Self::default();
        let mut files = Vec::new();
        let mut paths: Vec<PathBuf> = sources.iter().map(|source| root().join(source)).collect();
        while let Some(path) = paths.pop() {
            match path.is_dir() {
                true => {
                    for entry in fs::read_dir(&path)? {
                        paths.push(entry?.path());
                    }
                }
                false => files.push(path),
            }
        }
        files.sort();
        let mut parsed = Vec::new();
        for file in files.iter().filter(|file| file.extension().is_some_and(|it| it == "rs")) {
            let text = fs::read_to_string(file)?;
            let syntax = syn::parse_file(&text).with_context(|| file.display().to_string())?;
            let file = file.strip_prefix(root()).unwrap_or(file).to_owned();
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
                let mut expectation = Expectation::default();
                expectation.visit_block(&it.block);
                let name = it.sig.ident.to_string();
                self.expectations.extend(expectation.0.map(|text| (name.clone(), text)));
                self.functions.insert(name, words(&it.block));
            }
            Item::Impl(it) => {
                let of = words(&it.self_ty);
                for item in &it.items {
                    match item {
                        syn::ImplItem::Const(it) => {
                            self.constants.insert(it.ident.to_string(), words(&it.expr));
                        }
                        syn::ImplItem::Fn(it) if it.sig.ident == "default" => {
                            self.note_defaults(&of, &it.block);
                        }
                        _ => {}
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

    /// Notes the values of fields in the body of `Default::default`, which may be variables.
    fn note_defaults(&mut self, of: &str, body: &syn::Block) {
        let mut variables = HashMap::new();
        for statement in &body.stmts {
            match statement {
                syn::Stmt::Local(syn::Local { pat, init: Some(init), .. }) => {
                    variables.insert(words(pat), words(&init.expr));
                }
                syn::Stmt::Expr(Expr::Struct(made), _) => {
                    for field in &made.fields {
                        let value = words(&field.expr);
                        let value = variables.get(&value).cloned().unwrap_or(value);
                        self.defaults.insert((of.to_owned(), words(&field.member)), value);
                    }
                }
                _ => {}
            }
        }
    }

    /// The type that `name` means in `file`.
    pub fn find(&self, file: &Path, name: &str) -> Option<&(PathBuf, Kind)> {
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

    pub fn number(&self, text: &str) -> String {
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

    /// The bounds of the value of `key` in the table at `path`, without those that name variables.
    pub fn bounds(&self, file: &Path, path: &str, key: &str) -> String {
        let whole = format!("{path}.{key}");
        let of = |key: &str| {
            let files = ["profile.rs", "recipe.rs"].map(|name| file.with_file_name(name));
            let mut files = std::iter::once(file.to_owned()).chain(files);
            files.find_map(|file| self.bounds.get(&(file, key.to_owned())))
        };
        let all = of(&whole).or_else(|| of(key));
        let is_known = |bound: &&String| {
            let mut words = bound.split([' ', '-']).filter(|word| word.contains('_'));
            words.all(|word| self.types.iter().any(|(_, kind)| kind.field(word).is_some()))
        };
        let all: Vec<&str> =
            all.into_iter().flatten().filter(is_known).map(String::as_str).collect();
        let all = all.iter().map(|bound| format!(", {bound}")).collect::<String>();
        all.replace("above 0, 0 to", "above 0, up to")
    }
}

/// The code without spaces.
pub fn words(of: &impl quote::ToTokens) -> String {
    of.to_token_stream().to_string().replace(' ', "")
}
