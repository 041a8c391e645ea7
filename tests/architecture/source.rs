//! A Rust file as the compiler sees it outside tests: paths, words and string literals with their lines.

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use syn::UseTree;
use syn::spanned::Spanned;
use syn::visit::{self, Visit};

use crate::tree::{self, File};

/// A piece of code and the line where it stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// What stands there.
    pub text: String,
    /// Line, from 1.
    pub line: usize,
}

/// A constant of a module or function.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Constant {
    /// Its name and line.
    pub name: Found,
    /// Its value as written, without blanks.
    pub value: String,
}

/// What a file holds outside tests and documentation.
#[derive(Debug, Default)]
pub struct Source {
    /// Paths such as `std::fs::read`: those in code as written, then those of `use` items spelled out.
    pub paths: Vec<Found>,
    /// Values of string literals.
    pub strings: Vec<Found>,
    /// Names of fields, parameters and constants.
    pub quantities: Vec<Found>,
    /// Constants that belong to no type.
    pub constants: Vec<Constant>,
    /// Names of modules declared here.
    pub modules: Vec<Found>,
    /// Traits that are implemented here.
    pub implemented: Vec<String>,
    /// Modules in files of their own that exist in tests only.
    pub test_modules: Vec<String>,
}

impl Source {
    /// Reads the text of a Rust file.
    pub fn parse(text: &str) -> Self {
        let mut source = Self::default();
        let tokens: TokenStream = text.parse().unwrap();
        let tokens = outside_tests(tokens, &mut source.test_modules);
        let flat = flat(tokens.clone());
        source.paths = paths_in(&flat);
        source.strings = flat.iter().filter_map(string).collect();
        source.visit_file(&syn::parse2(tokens).unwrap());
        source
    }
}

/// Every Rust file below `folder` that is not of tests alone, by path.
pub fn sources(folder: &str) -> Vec<(String, Source)> {
    let files = tree::files(folder, ".rs");
    let of_tests = |path: &str| path.contains("/tests/") || path.contains("/benches/");
    let mut parsed: Vec<(String, Source)> = files
        .into_iter()
        .filter(|file| !of_tests(&file.path))
        .map(|File { path, text }| (path, Source::parse(&text)))
        .collect();
    let only_in_tests: Vec<String> = parsed
        .iter()
        .flat_map(|(path, source)| {
            let folder = folder_of_modules(path);
            let file = move |name: &String| format!("{folder}/{name}.rs");
            source.test_modules.iter().map(file)
        })
        .collect();
    parsed.retain(|(path, _)| !only_in_tests.contains(path));
    parsed
}

/// Where the modules that a file declares lie: beside `lib.rs` and `main.rs`, else in a folder of its name.
fn folder_of_modules(path: &str) -> String {
    let (folder, name) = path.rsplit_once('/').unwrap_or(("", path));
    match name {
        "lib.rs" | "main.rs" => folder.to_owned(),
        name => format!("{folder}/{}", name.trim_end_matches(".rs")),
    }
}

/// Leaves out documentation, and every item under `#[test]` or `#[cfg(test)]`.
fn outside_tests(tokens: TokenStream, test_modules: &mut Vec<String>) -> TokenStream {
    let mut kept = Vec::new();
    let mut rest = tokens.into_iter().peekable();
    let mut skips = false;
    while let Some(token) = rest.next() {
        if is_mark(&token, '#') {
            let bang = rest.next_if(|next| is_mark(next, '!'));
            if let Some(TokenTree::Group(group)) = rest.peek() {
                let words = flat(group.stream());
                skips |= bang.is_none() && is_test(&words);
                let attribute = rest.next();
                if !skips && words.first().is_some_and(|word| word.text != "doc") {
                    kept.push(token);
                    kept.extend(bang.into_iter().chain(attribute));
                }
                continue;
            }
        }
        if skips {
            skips = false;
            let mut item = vec![token];
            while !item.last().is_some_and(|last| ends_item(&item, last)) {
                let Some(token) = rest.next() else { break };
                item.push(token);
            }
            test_modules.extend(module_in_file(&item));
            continue;
        }
        kept.push(match token {
            TokenTree::Group(group) => {
                let inner = outside_tests(group.stream(), test_modules);
                let mut new = proc_macro2::Group::new(group.delimiter(), inner);
                new.set_span(group.span());
                TokenTree::Group(new)
            }
            token => token,
        });
    }
    kept.into_iter().collect()
}

fn is_mark(token: &TokenTree, mark: char) -> bool {
    matches!(token, TokenTree::Punct(found) if found.as_char() == mark)
}

/// Whether an attribute is `test`, or `cfg(test)` alone or with more.
fn is_test(words: &[Found]) -> bool {
    let texts: Vec<&str> = words.iter().map(|word| word.text.as_str()).collect();
    match texts.as_slice() {
        ["test"] => true,
        ["cfg", inner @ ..] => inner.contains(&"test") && !inner.contains(&"not"),
        _ => false,
    }
}

fn ends_item(item: &[TokenTree], last: &TokenTree) -> bool {
    let is_use = item.iter().any(|token| token.to_string() == "use");
    match last {
        TokenTree::Punct(mark) => mark.as_char() == ';',
        TokenTree::Group(group) => !is_use && group.delimiter() == Delimiter::Brace,
        _ => false,
    }
}

fn module_in_file(item: &[TokenTree]) -> Option<String> {
    let texts: Vec<String> = item.iter().map(ToString::to_string).collect();
    match texts.as_slice() {
        [.., keyword, name, end] if keyword == "mod" && end == ";" => Some(name.clone()),
        _ => None,
    }
}

/// Every token in order; a bracket counts as an empty one.
fn flat(tokens: TokenStream) -> Vec<Found> {
    let mut found = Vec::new();
    for token in tokens {
        let line = token.span().start().line;
        match token {
            TokenTree::Group(group) => {
                let bracket = Found {
                    text: String::new(),
                    line,
                };
                found.push(bracket.clone());
                found.extend(flat(group.stream()));
                found.push(bracket);
            }
            token => found.push(Found {
                text: token.to_string(),
                line,
            }),
        }
    }
    found
}

fn is_word(text: &str) -> bool {
    text.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

/// Joins `a :: b :: c` to paths; a word alone is a path too. What `use` names is left out.
fn paths_in(tokens: &[Found]) -> Vec<Found> {
    let mut found: Vec<Found> = Vec::new();
    let mut before = ["", "", ""];
    let mut in_use = false;
    for token in tokens {
        let text = token.text.as_str();
        in_use = (in_use || text == "use") && text != ";";
        if in_use {
            continue;
        }
        match found.last_mut() {
            Some(path) if is_word(text) && is_word(before[0]) && before[1..] == [":", ":"] => {
                path.text.push_str("::");
                path.text.push_str(text);
            }
            _ if is_word(text) => found.push(token.clone()),
            _ => {}
        }
        before = [before[1], before[2], text];
    }
    found
}

/// The value of a string literal.
fn string(token: &Found) -> Option<Found> {
    let literal: syn::LitStr = syn::parse_str(&token.text).ok()?;
    Some(Found {
        text: literal.value(),
        line: token.line,
    })
}

fn spell_out(tree: &UseTree, before: &str, line: usize, found: &mut Vec<Found>) {
    let join = |name: String| {
        if before.is_empty() {
            name
        } else {
            format!("{before}::{name}")
        }
    };
    let text = match tree {
        UseTree::Path(path) => {
            spell_out(&path.tree, &join(path.ident.to_string()), line, found);
            return;
        }
        UseTree::Group(group) => {
            for tree in &group.items {
                spell_out(tree, before, line, found);
            }
            return;
        }
        UseTree::Name(name) => join(name.ident.to_string()),
        UseTree::Rename(name) => join(name.ident.to_string()),
        _ => join("*".to_owned()),
    };
    found.push(Found { text, line });
}

fn named(name: &syn::Ident) -> Found {
    Found {
        text: name.to_string(),
        line: name.span().start().line,
    }
}

/// The text of an expression without blanks and digit separators.
fn written(expr: &syn::Expr) -> String {
    let text = expr.span().source_text().unwrap();
    let kept = text.chars().filter(|c| !c.is_whitespace() && *c != '_');
    kept.collect::<String>()
        .replace(",]", "]")
        .replace(",)", ")")
}

impl<'ast> Visit<'ast> for Source {
    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        let line = item.use_token.span.start().line;
        spell_out(&item.tree, "", line, &mut self.paths);
    }

    fn visit_item_mod(&mut self, item: &'ast syn::ItemMod) {
        self.modules.push(named(&item.ident));
        visit::visit_item_mod(self, item);
    }

    fn visit_item_impl(&mut self, item: &'ast syn::ItemImpl) {
        if let Some((path, _)) = &item.trait_ {
            let last = path.segments.last().map(|last| last.ident.to_string());
            self.implemented.extend(last);
        }
        visit::visit_item_impl(self, item);
    }

    fn visit_field(&mut self, field: &'ast syn::Field) {
        self.quantities.extend(field.ident.as_ref().map(named));
        visit::visit_field(self, field);
    }

    fn visit_item_const(&mut self, item: &'ast syn::ItemConst) {
        self.quantities.push(named(&item.ident));
        self.constants.push(Constant {
            name: named(&item.ident),
            value: written(&item.expr),
        });
        visit::visit_item_const(self, item);
    }

    fn visit_pat_type(&mut self, typed: &'ast syn::PatType) {
        if let syn::Pat::Ident(name) = typed.pat.as_ref() {
            self.quantities.push(named(&name.ident));
        }
        visit::visit_pat_type(self, typed);
    }
}

#[test]
fn code_is_read_without_tests_and_documentation() {
    let source = Source::parse(
        "//! std::doc\nuse std::{fs, time::Instant as Now};\n/// \"said\"\nfn f(a_m: f64) { x::y(\"told\") }\n\
         #[cfg(test)]\nmod far;\n#[cfg(test)] mod near { fn g() { std::env::var(\"secret\") } }\n\
         #[cfg(test)] use a::{b};\n#[test]\nfn h() { bad() }\nimpl metrology::Stage for S {}\nmod last { const C: u8 = 1; }",
    );
    let texts =
        |found: &[Found]| -> Vec<String> { found.iter().map(|found| found.text.clone()).collect() };
    let paths = texts(&source.paths);
    for path in ["std::fs", "std::time::Instant", "x::y", "metrology::Stage"] {
        assert!(paths.contains(&path.to_owned()), "{path} in {paths:?}");
    }
    for path in ["std::doc", "std::env::var", "bad", "a::b"] {
        assert!(!paths.contains(&path.to_owned()), "{path} in {paths:?}");
    }
    assert_eq!(texts(&source.strings), ["told"]);
    assert_eq!(texts(&source.quantities), ["a_m", "C"]);
    assert_eq!(texts(&source.modules), ["last"]);
    assert_eq!(source.implemented, ["Stage"]);
    assert_eq!(source.test_modules, ["far"]);
    assert_eq!(source.strings[0].line, 4);
    assert_eq!(folder_of_modules("a/src/stage.rs"), "a/src/stage");
}
