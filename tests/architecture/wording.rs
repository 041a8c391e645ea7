//! No unfinished work, no skipped test, and nothing of the machine on which it was written.

use crate::check;
use crate::tree::{self, File};

/// Endings of files that people write.
const WRITTEN: [&str; 17] = [
    ".rs", ".md", ".toml", ".yaml", ".yml", ".xml", ".py", ".sh", ".msg", ".srv", ".action",
    ".ngc", ".hal", ".ini", ".svg", "/run", ".txt",
];

/// Lists that a program writes.
const GENERATED: [&str; 1] = ["Cargo.lock"];

fn written() -> Vec<File> {
    let all = WRITTEN.iter().flat_map(|ending| tree::files("", ending));
    all.filter(|file| !GENERATED.contains(&file.path.as_str()))
        .collect()
}

/// Marks of work that is not done. Put together here so that this file does not hold them.
fn unfinished() -> Vec<String> {
    let halves = [
        ("TO", "DO"),
        ("FIX", "ME"),
        ("XX", "X"),
        ("todo", "!("),
        ("unimple", "mented!("),
        ("#[ig", "nore"),
    ];
    halves.iter().map(|(a, b)| format!("{a}{b}")).collect()
}

/// Folders of one person's machine and hosts of package registries.
fn places() -> Vec<String> {
    let halves = [
        ("/wo", "rk/"),
        ("/tm", "p/"),
        ("/ho", "me/"),
        ("/ro", "ot/"),
        ("/Us", "ers/"),
        ("crates", ".io"),
        ("py", "pi.org"),
        ("python", "hosted.org"),
        ("proxy.go", "lang.org"),
        ("npm", "js.org"),
        ("deb.debian", ".org"),
    ];
    halves.iter().map(|(a, b)| format!("{a}{b}")).collect()
}

/// Lines with one of `words`, where no letter stands before or after a word of letters.
fn lines_with(file: &File, words: &[String]) -> Vec<String> {
    let holds = |line: &str, word: &str| {
        line.match_indices(word).any(|(at, _)| {
            let before = line[..at].chars().next_back();
            let after = line[at + word.len()..].chars().next();
            let is_letter = |c: Option<char>| c.is_some_and(char::is_alphanumeric);
            let is_word = word.chars().all(char::is_alphabetic);
            !is_word || !(is_letter(before) || is_letter(after))
        })
    };
    let mut found = Vec::new();
    for (at, line) in file.text.lines().enumerate() {
        for word in words.iter().filter(|word| holds(line, word)) {
            found.push(format!("{}:{}: {word}", file.path, at + 1));
        }
    }
    found
}

#[test]
fn arch_nothing_is_left_unfinished_or_skipped() {
    let words = unfinished();
    check(
        &written()
            .iter()
            .flat_map(|file| lines_with(file, &words))
            .collect::<Vec<_>>(),
    );
    for word in &words {
        let bad = File {
            path: "a.rs".to_owned(),
            text: format!("fn f() {{}} // {word} later"),
        };
        assert_eq!(lines_with(&bad, &words).len(), 1, "{word}");
    }
    let good = File {
        path: "a.rs".to_owned(),
        text: format!("MAN{}S", words[0]),
    };
    assert!(lines_with(&good, &words).is_empty());
}

#[test]
fn arch_nothing_names_a_place_of_one_machine() {
    let places = places();
    check(
        &written()
            .iter()
            .flat_map(|file| lines_with(file, &places))
            .collect::<Vec<_>>(),
    );
    for place in &places {
        let bad = File {
            path: "a.md".to_owned(),
            text: format!("see {place}abc"),
        };
        assert_eq!(lines_with(&bad, &places).len(), 1, "{place}");
    }
}
