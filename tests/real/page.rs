//! The table of recordings as Markdown, and its comparison with the one in the tree.

use std::fmt::Write as _;

use crate::expected::Recording;
use crate::run::Outcome;

/// A verdict on a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Every check holds.
    Right,
    /// Every failed check has its reason.
    KnownWrong(Vec<String>),
    /// A check failed without a reason, or holds although it has one.
    Broken(Vec<String>),
}

/// Whether a name of `known_wrong` is that of a check.
fn covers(mark: &str, check: &str) -> bool {
    mark.strip_suffix('*')
        .map_or(mark == check, |start| check.starts_with(start))
}

/// The verdict of a recording's checks.
pub fn verdict(recording: &Recording, outcome: &Outcome) -> Verdict {
    let marks = &recording.expected.known_wrong;
    let failed: Vec<_> = outcome.checks.iter().filter(|check| !check.holds).collect();
    let is_marked = |name: &str| marks.keys().any(|mark| covers(mark, name));
    let unmarked = failed.iter().filter(|check| !is_marked(&check.name));
    let mut broken: Vec<String> = unmarked
        .map(|check| format!("{}: {}: {}", recording.name, check.name, check.found))
        .collect();
    let idle = marks.keys().filter(|mark| {
        let mut under = failed.iter().filter(|check| covers(mark, &check.name));
        under.next().is_none()
    });
    broken.extend(idle.map(|mark| {
        format!(
            "{}: {mark}: right now, or no such check: remove it from known_wrong",
            recording.name
        )
    }));
    if !broken.is_empty() {
        return Verdict::Broken(broken);
    }
    let mut reasons: Vec<String> = marks.values().cloned().collect();
    reasons.dedup();
    if reasons.is_empty() {
        Verdict::Right
    } else {
        Verdict::KnownWrong(reasons)
    }
}

const HEAD: &str = "# Recordings and verdicts

Written by `tests/real/table`; [README.md](README.md) describes it. The numbers of the third column may differ in their last digits on another computer.

| recording | right answer | the program | verdict |
|---|---|---|---|
";

fn cell(text: &str) -> String {
    text.replace('|', "\\|")
        .replace('\n', " ")
        .trim()
        .to_owned()
}

/// The whole page.
pub fn markdown(rows: &[(Recording, Outcome)]) -> String {
    let mut lines = String::new();
    let (mut right, mut wrong) = (0, 0);
    for (recording, outcome) in rows {
        let verdict = match verdict(recording, outcome) {
            Verdict::Right => {
                right += 1;
                "right".to_owned()
            }
            Verdict::KnownWrong(reasons) => {
                wrong += 1;
                format!("**wrong**: {}", reasons.join("; "))
            }
            Verdict::Broken(reasons) => {
                wrong += 1;
                format!("**broken**: {}", reasons.join("; "))
            }
        };
        let expected = &recording.expected;
        let _ = writeln!(
            lines,
            "| [`{0}`](recordings/{0}/expected.yaml): {1}. {2} | {3} | {4} | {5} |",
            recording.name,
            cell(&expected.title),
            cell(&expected.source),
            cell(&expected.right),
            cell(&outcome.words.join("; ")),
            cell(&verdict)
        );
    }
    let n = rows.len();
    format!("{HEAD}{lines}\nOf {n} recordings {right} are right and {wrong} are wrong.\n")
}

/// A text without the digits of its numbers.
fn without_digits(text: &str) -> String {
    let letters = text.chars().filter(|letter| !letter.is_ascii_digit());
    letters.filter(|letter| *letter != '-').collect()
}

/// Lines that differ by more than numbers in what the program printed.
pub fn differences(written: &str, now: &str) -> Vec<String> {
    let column = |line: &str, k: usize| line.split(" | ").nth(k).unwrap_or_default().to_owned();
    let is_same = |a: &str, b: &str| {
        let exact = [0, 1, 3].into_iter().all(|k| column(a, k) == column(b, k));
        exact && without_digits(a) == without_digits(b)
    };
    let (mut written, mut now) = (written.lines(), now.lines());
    let mut found = vec![];
    loop {
        match (written.next(), now.next()) {
            (None, None) => return found,
            (Some(a), Some(b)) if is_same(a, b) => {}
            (a, b) => found.push(format!(
                "- {}\n+ {}",
                a.unwrap_or_default(),
                b.unwrap_or_default()
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::path::PathBuf;

    use super::*;
    use crate::check::Check;

    fn recording(known_wrong: &[(&str, &str)]) -> Recording {
        let text = "{title: a, source: b, right: c, input: d.csv}";
        let mut expected: crate::expected::Expected = serde_saphyr::from_str(text).unwrap();
        let marks = known_wrong.iter();
        let marks = marks.map(|(mark, why)| ((*mark).to_owned(), (*why).to_owned()));
        expected.known_wrong = marks.collect::<BTreeMap<_, _>>();
        Recording {
            name: "n".to_owned(),
            folder: PathBuf::new(),
            expected,
        }
    }

    fn outcome(checks: &[(&str, bool)]) -> Outcome {
        let checks = checks.iter();
        let checks = checks.map(|(name, holds)| Check::new(*name, *holds, "7"));
        Outcome {
            checks: checks.collect(),
            words: vec!["A 1.25 µm".to_owned()],
        }
    }

    #[test]
    fn a_mark_hides_its_own_checks_alone_and_none_that_holds() {
        let failing = outcome(&[("map A", false), ("map B", true)]);
        let of = |marks: &[(&str, &str)], outcome: &Outcome| verdict(&recording(marks), outcome);
        let broken = |reason: &str| Verdict::Broken(vec![reason.to_owned()]);
        assert_eq!(of(&[], &failing), broken("n: map A: 7"));
        let known = Verdict::KnownWrong(vec!["why".to_owned()]);
        assert_eq!(of(&[("map A", "why")], &failing), known);
        assert_eq!(of(&[("map *", "why")], &failing), known);
        let all = outcome(&[("map A", true), ("map B", true)]);
        assert_eq!(of(&[], &all), Verdict::Right);
        let idle = broken("n: map *: right now, or no such check: remove it from known_wrong");
        assert_eq!(of(&[("map *", "why")], &all), idle);
    }

    #[test]
    fn a_page_differs_by_words_and_not_by_measured_digits() {
        let page = markdown(&[(recording(&[]), outcome(&[]))]);
        assert!(page.contains("| A 1.25 µm | right |"), "{page}");
        assert!(differences(&page, &page.replace("1.25", "-1.26")).is_empty());
        for (from, to) in [
            ("1.25 µm", "1.25 mm"),
            ("µm | right |", "µm | **wrong** |"),
            ("| c |", "| c 1 |"),
        ] {
            assert_eq!(
                differences(&page, &page.replace(from, to)).len(),
                1,
                "{from}"
            );
        }
    }
}
