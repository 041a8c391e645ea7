//! Numbers in the messages of error enums go through `metrology::number`, so that none has the noise of a binary fraction.

use crate::tree;

/// Fields of type `f64` that an `#[error("…")]` of `text` shows bare, as `{field}`.
fn bare(text: &str) -> Vec<String> {
    let Ok(file) = syn::parse_file(text) else {
        return vec![];
    };
    let mut found = vec![];
    for item in &file.items {
        match item {
            syn::Item::Enum(item) => {
                for variant in &item.variants {
                    found.extend(of(&variant.attrs, &variant.fields, &variant.ident));
                }
            }
            syn::Item::Struct(item) => found.extend(of(&item.attrs, &item.fields, &item.ident)),
            _ => {}
        }
    }
    found
}

fn of(attributes: &[syn::Attribute], fields: &syn::Fields, name: &syn::Ident) -> Vec<String> {
    let error = attributes.iter().find(|a| a.path().is_ident("error"));
    let Some(syn::Meta::List(list)) = error.map(|a| &a.meta) else {
        return vec![];
    };
    let message = list.tokens.to_string();
    let numbers = fields.iter().filter(|field| match &field.ty {
        syn::Type::Path(named) => named.path.is_ident("f64"),
        _ => false,
    });
    let shown = numbers.filter_map(|field| {
        let field = field.ident.as_ref()?.to_string();
        let is_bare = ["}", ":?}"]
            .iter()
            .any(|end| message.contains(&format!("{{{field}{end}")));
        let is_rounded = message.contains(&format!("{field} = "));
        (is_bare && !is_rounded).then(|| format!("{name}: {{{field}}} is shown bare"))
    });
    shown.collect()
}

#[test]
fn arch_numbers_in_messages_are_rounded_and_have_their_unit() {
    let mut violations = vec![];
    for folder in ["nodes", "msgs/src"] {
        for file in tree::files(folder, ".rs") {
            let lines = bare(&file.text).into_iter();
            violations.extend(lines.map(|line| format!("{}: {line}", file.path)));
        }
    }
    crate::check(&violations);
    let example = "enum E { #[error(\"{x_mm} mm\")] A { x_mm: f64 }, #[error(\"{n} runs, {y:.3}\")] B { n: u32, y: f64 } }";
    assert_eq!(bare(example), ["A: {x_mm} is shown bare"]);
    let rounded = "enum E { #[error(\"{x_mm} mm\", x_mm = number(*x_mm))] A { x_mm: f64 } }";
    assert_eq!(bare(rounded), [""; 0]);
}
