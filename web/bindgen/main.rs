//! Writes the JavaScript that loads a file of WebAssembly, and the file as it loads it:
//! `edgepuck-bindgen FILE FOLDER`.

use wasm_bindgen_cli_support::Bindgen;

fn main() {
    let words: Vec<String> = std::env::args().collect();
    let [_, file, folder] = &words[..] else { panic!("expected FILE FOLDER") };
    let mut bindgen = Bindgen::new();
    bindgen
        .input_path(file)
        .typescript(false)
        .remove_name_section(true)
        .omit_default_module_path(false);
    let bindgen = bindgen.web(true).expect("a page is one of the ways to load it");
    bindgen.generate(folder).unwrap_or_else(|error| panic!("{file}: {error:#}"));
}
