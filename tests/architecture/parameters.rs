//! A node's table of parameters, its defaults and its README say the same.
//!
//! The table is read from the source (`const PARAMETERS`), whose rows are `ParameterDoc` literals or
//! calls of small functions that make them.

use std::collections::BTreeMap;

use syn::{Expr, Item, Lit, Pat, Stmt};

use crate::check;
use crate::tree;

/// One parameter.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Row {
    /// Dotted name.
    pub name: String,
    /// Unit; empty: none.
    pub unit: String,
    /// Default as written; empty: not said.
    pub default: String,
}

type Values = BTreeMap<String, String>;

/// The text of a string literal, or of a parameter that stands for one.
fn text_of(expr: &Expr, values: &Values) -> Option<String> {
    match expr {
        Expr::Lit(literal) => match &literal.lit {
            Lit::Str(text) => Some(text.value()),
            _ => None,
        },
        Expr::Path(path) => values.get(&path.path.get_ident()?.to_string()).cloned(),
        _ => None,
    }
}

/// Name and unit of one element of the table.
fn row_of(expr: &Expr, values: &Values, file: &syn::File) -> Option<Row> {
    match expr {
        Expr::Struct(literal) => {
            let field = |wanted: &str| {
                let is = |field: &&syn::FieldValue| matches!(&field.member, syn::Member::Named(name) if name == wanted);
                text_of(&literal.fields.iter().find(is)?.expr, values)
            };
            Some(Row {
                name: field("name")?,
                unit: field("unit")?,
                default: String::new(),
            })
        }
        Expr::Call(call) => {
            let Expr::Path(path) = call.func.as_ref() else {
                return None;
            };
            let name = path.path.get_ident()?;
            let function = file.items.iter().find_map(|item| match item {
                Item::Fn(function) if function.sig.ident == *name => Some(function),
                _ => None,
            })?;
            let parameters = function.sig.inputs.iter().filter_map(|input| match input {
                syn::FnArg::Typed(typed) => match typed.pat.as_ref() {
                    Pat::Ident(name) => Some(name.ident.to_string()),
                    _ => None,
                },
                _ => None,
            });
            let given = parameters.zip(&call.args);
            let values = given
                .filter_map(|(name, value)| Some((name, text_of(value, values)?)))
                .collect();
            match function.block.stmts.last()? {
                Stmt::Expr(tail, None) => row_of(tail, &values, file),
                _ => None,
            }
        }
        _ => None,
    }
}

/// The rows of `const PARAMETERS` in the text of a Rust file; `None`: it has no such table.
fn rows(text: &str) -> Option<Vec<Row>> {
    let file = syn::parse_file(text).unwrap();
    let table = file.items.iter().find_map(|item| match item {
        Item::Const(item) if item.ident == "PARAMETERS" => Some(item.expr.as_ref()),
        _ => None,
    })?;
    let table = match table {
        Expr::Reference(reference) => reference.expr.as_ref(),
        table => table,
    };
    let Expr::Array(array) = table else {
        return Some(Vec::new());
    };
    let read = |(at, element)| {
        let row = row_of(element, &Values::new(), &file);
        row.unwrap_or_else(|| Row {
            name: format!("row {at} cannot be read"),
            ..Row::default()
        })
    };
    Some(array.elems.iter().enumerate().map(read).collect())
}

/// A node's table of parameters; empty: it has none.
pub fn table(node: &str) -> Vec<Row> {
    let files = tree::files(&format!("nodes/{node}/src"), ".rs");
    let mut found = files.iter().filter_map(|file| rows(&file.text));
    found.next().unwrap_or_default()
}

/// Rows of the README's table of parameters: the one with a column `unit` and one `default`.
fn readme_rows(readme: &str) -> Vec<Row> {
    let cells = |line: &str| -> Vec<String> {
        let inner = line.trim().trim_start_matches('|').trim_end_matches('|');
        inner
            .split('|')
            .map(|cell| cell.trim().trim_matches('`').to_owned())
            .collect()
    };
    let mut lines = readme.lines();
    let mut found = Vec::new();
    while let Some(line) = lines.next() {
        let head = cells(line);
        let column = |name: &str| head.iter().position(|cell| cell == name);
        let (Some(unit), Some(default)) = (column("unit"), column("default")) else {
            continue;
        };
        for line in lines
            .by_ref()
            .skip(1)
            .take_while(|line| line.starts_with('|'))
        {
            let row = cells(line);
            let cell = |at: usize| row.get(at).cloned().unwrap_or_default();
            let unit = cell(unit);
            found.push(Row {
                name: cell(0),
                unit: if unit == "-" { String::new() } else { unit },
                default: cell(default),
            });
        }
    }
    found
}

/// The value of a literal as written in Rust, made comparable with a README.
fn literal(expr: &Expr) -> Option<String> {
    match expr {
        Expr::Lit(literal) => match &literal.lit {
            Lit::Float(number) => number
                .base10_parse::<f64>()
                .ok()
                .map(|value| value.to_string()),
            Lit::Int(number) => number
                .base10_parse::<u64>()
                .ok()
                .map(|value| value.to_string()),
            Lit::Bool(truth) => Some(truth.value.to_string()),
            Lit::Str(text) => Some(text.value()),
            _ => None,
        },
        Expr::MethodCall(call) if call.args.is_empty() => literal(&call.receiver),
        _ => None,
    }
}

/// Literal fields of every `impl Default` in the text of a Rust file.
fn defaults(text: &str) -> BTreeMap<String, String> {
    let file = syn::parse_file(text).unwrap();
    let mut found = BTreeMap::new();
    for item in &file.items {
        let Item::Impl(item) = item else { continue };
        let is_default = item
            .trait_
            .as_ref()
            .is_some_and(|(path, _)| path.is_ident("Default"));
        for function in item.items.iter().filter(|_| is_default) {
            let syn::ImplItem::Fn(function) = function else {
                continue;
            };
            let Some(Stmt::Expr(Expr::Struct(values), None)) = function.block.stmts.last() else {
                continue;
            };
            for field in &values.fields {
                if let (syn::Member::Named(name), Some(value)) =
                    (&field.member, literal(&field.expr))
                {
                    found.insert(name.to_string(), value);
                }
            }
        }
    }
    found
}

/// Numbers are compared as numbers, text without its quotes.
fn says_the_same(a: &str, b: &str) -> bool {
    let plain = |text: &str| text.trim_matches('"').to_owned();
    match (a.parse::<f64>(), b.parse::<f64>()) {
        (Ok(a), Ok(b)) => a.total_cmp(&b).is_eq(),
        _ => plain(a) == plain(b),
    }
}

fn differences(
    place: &str,
    table: &[Row],
    readme: &[Row],
    defaults: &BTreeMap<String, String>,
) -> Vec<String> {
    let mut found = Vec::new();
    for row in table {
        let Some(told) = readme.iter().find(|told| told.name == row.name) else {
            found.push(format!(
                "{place}: {}: the README's table lacks it",
                row.name
            ));
            continue;
        };
        if told.unit != row.unit {
            let (told, unit) = (&told.unit, &row.unit);
            found.push(format!(
                "{place}: {}: unit \"{told}\": must be \"{unit}\"",
                row.name
            ));
        }
    }
    for told in readme {
        if !table.iter().any(|row| row.name == told.name) {
            found.push(format!("{place}: {}: PARAMETERS lacks it", told.name));
        }
        let value = defaults.get(&told.name);
        if let Some(value) = value.filter(|value| !says_the_same(value, &told.default)) {
            found.push(format!(
                "{place}: {}: default {}: must be {value}",
                told.name, told.default
            ));
        }
    }
    found
}

#[test]
fn arch_parameters_are_what_the_readme_says() {
    let mut found = Vec::new();
    let mut tables = 0;
    for node in tree::nodes() {
        let files = tree::files(&format!("nodes/{node}/src"), ".rs");
        let defaults: BTreeMap<_, _> = files
            .iter()
            .filter(|file| file.path.ends_with("/config.rs"))
            .flat_map(|file| defaults(&file.text))
            .collect();
        let place = format!("nodes/{node}/README.md");
        let Some(readme) = tree::text(&place) else {
            continue;
        };
        let table = table(&node);
        tables += usize::from(!table.is_empty());
        found.extend(differences(
            &place,
            &table,
            &readme_rows(&readme),
            &defaults,
        ));
    }
    assert!(
        tables > 0,
        "no node has both a table of parameters and a README"
    );
    check(&found);
}

#[test]
fn a_table_is_read_and_every_difference_found() {
    let rust = "const fn t(name: &'static str, u: &'static str) -> D { D { name, unit: u } }\n\
                const PARAMETERS: &[D] = &[t(\"a_s\", \"s\"), D { name: \"b\", unit: \"\" }, D { name: \"c_mm\", unit: \"mm\" }, f()];\n\
                impl Default for C { fn default() -> Self { Self { a_s: 0.5, b: \"x\".to_owned(), on: true } } }";
    let table = rows(rust).unwrap();
    assert_eq!(table[3].name, "row 3 cannot be read");
    let readme = "| name | unit | default | meaning |\n|---|---|---|---|\n| `a_s` | ms | 0.50 | x |\n\
                  | `b` | - | y | x |\n| `d` |  | 1 | x |\n\n| name | unit |\n|---|---|\n| `e` | s |\n";
    let found = differences(
        "README.md",
        &table[..3],
        &readme_rows(readme),
        &defaults(rust),
    );
    assert_eq!(
        found,
        [
            "README.md: a_s: unit \"ms\": must be \"s\"",
            "README.md: c_mm: the README's table lacks it",
            "README.md: b: default y: must be x",
            "README.md: d: PARAMETERS lacks it",
        ]
    );
}
