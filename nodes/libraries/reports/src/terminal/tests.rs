use super::*;
use crate::Report;
use crate::section::head;

/// Rows of a table, each with a sentence that a terminal wraps.
fn rows(n: usize) -> Rows {
    let row = |k: usize| {
        let words = format!("cause {k} is a worn guide, a loose gib or a bent foundation");
        vec![format!("row {k}"), format!("{k}.00"), words]
    };
    Rows {
        head: head(&["name", "value / µm", "look at"]),
        rows: (0..n).map(row).collect(),
        note: "Values at 20 °C.".to_owned(),
    }
}

/// A report of many tests: every third has no result, and every one left something out.
fn of_many_tests() -> (Report, Vec<Section>) {
    let mut sections: Vec<Section> = (0..60)
        .map(|k| {
            let mut section = Section::new(format!("Positioning {k}"));
            if k % 3 == 0 {
                section.not_evaluated(format!("{k} targets are too few"));
            } else {
                section.lines.push(format!("{k} targets."));
                section.answers.push(format!("accuracy A {k}.00 µm."));
                section.tables.extend([rows(6), rows(50)]);
            }
            section.tell_left_out(&[format!("target {k}")]);
            section
        })
        .collect();
    let mut verdicts = Section::new("Conformance").ranked(Rank::Answer);
    verdicts
        .answers
        .push("does not conform: 1 (A of Y).".to_owned());
    verdicts.tables.push(rows(2));
    sections.push(verdicts);
    (report(&sections), sections)
}

/// A report of one part whose table has more rows than there is room.
fn of_one_table() -> (Report, Vec<Section>) {
    let mut section = Section::new("What would be found");
    section.tables.push(rows(300));
    let sections = vec![section];
    (report(&sections), sections)
}

fn report(sections: &[Section]) -> Report {
    Report {
        title: "made up".to_owned(),
        lines: vec!["Where: everywhere.".to_owned(), "Which: all.".to_owned()],
        parts: apart(sections.iter().map(Part::of)),
        screen: crate::screen::Screen::default(),
        body: maud::html! {},
        figures: serde_json::Value::Null,
    }
}

/// The whole text by the recipe of a terminal: title, sentences, and the sections one below the other.
fn by_recipe(report: &Report, sections: &[Section]) -> String {
    let texts: Vec<String> = sections.iter().map(Section::terminal).collect();
    format!(
        "{}\n\n{}\n\n{}",
        report.title,
        report.lines.join("\n"),
        texts.join("\n")
    )
}

#[test]
fn large_reports_take_forty_lines_begin_with_the_answer_and_name_what_is_left() {
    // Tables of the first: 40 tests with two each and that of the verdicts, of which three are there.
    let cases = [(of_many_tests(), "78 more tables, "), (of_one_table(), "")];
    for ((report, sections), left) in cases {
        let page = Path::new("page/report.html");
        let text = report.short(&Room::with_page(Some(page)));
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines.len() <= MOST_LINES, "{}: {text}", lines.len());
        assert!(lines.len() > MOST_LINES / 2, "{text}");
        assert_eq!(lines[0], "Where: everywhere.");
        let last = lines[lines.len() - 1];
        assert!(last.starts_with(left), "{last}");
        let end = "conditions and remarks: --full, or the page page/report.html";
        assert!(last.ends_with(end), "{last}");
        assert!(last.contains(" more rows, "), "{last}");
        assert_eq!(report.terminal(), by_recipe(&report, &sections));
        for section in &sections {
            assert!(report.terminal().contains(&section.title));
        }
    }
}

#[test]
fn verdicts_come_first_and_what_has_no_result_is_counted_and_named() {
    let (report, _) = of_many_tests();
    let text = report.short(&Room::with_page(None));
    let lines: Vec<&str> = text.lines().collect();
    // Twelve of 41 results; that of the verdicts, which is the last section, comes first.
    assert_eq!(lines[2], "Conformance: does not conform: 1 (A of Y).");
    assert_eq!(lines[3], "Positioning 1: accuracy A 1.00 µm.");
    assert!(lines.contains(&"And 29 more results."), "{text}");
    let first = "Not evaluated, 20 times: Positioning 0: Not evaluated: 0 targets are too few. And 19 more (Positioning 3; ";
    let counted = lines.iter().find(|line| line.starts_with(first)).unwrap();
    assert!(counted.ends_with("Positioning 57)."), "{counted}");
    let left_out = lines.iter().find(|line| line.starts_with("Left out, 60"));
    assert!(left_out.unwrap().contains("; Positioning 59)"), "{text}");
    let title = lines.iter().position(|line| *line == "Conformance");
    let table = lines.iter().position(|line| *line == "Positioning 1");
    assert!(title.unwrap() < table.unwrap(), "{text}");
    assert!(text.ends_with(": --full"), "{text}");
}

#[test]
fn a_table_that_is_cut_says_how_many_rows_it_has_besides() {
    let (report, _) = of_one_table();
    let text = report.short(&Room::with_page(None));
    let shown = text
        .lines()
        .filter(|line| line.starts_with(" row "))
        .count();
    assert!(shown > 5, "{text}");
    let cut = format!(" and {} more", 300 - shown);
    assert!(text.lines().any(|line| line == cut), "{text}");
    let last = format!("{} more rows, conditions and remarks: --full", 300 - shown);
    assert!(text.ends_with(&last), "{text}");
}

#[test]
fn lines_that_others_print_are_taken_from_the_room() {
    let (report, _) = of_many_tests();
    let tail = ["Bag:  runs/a/bag (9 messages, 0 lost)".to_owned()];
    let room = Room {
        lines: 30,
        tail: &tail,
        page: None,
    };
    let text = report.short(&room);
    let lines: Vec<&str> = text.lines().collect();
    assert!(lines.len() <= 30, "{}: {text}", lines.len());
    assert_eq!(lines[lines.len() - 2], tail[0]);
    // Ten lines are left, which one table can use and three cannot.
    assert!(lines.contains(&"Conformance"), "{text}");
    assert!(!lines.contains(&"Positioning 1"), "{text}");
}

#[test]
fn a_small_report_is_there_as_a_whole() {
    let mut section = Section::new("Causes");
    section.tables.push(rows(2));
    let report = report(&[section]);
    let text = report.short(&Room::with_page(None));
    for words in ["Causes", "row 0", "row 1", "Values at 20 °C."] {
        assert!(text.contains(words), "{words}: {text}");
    }
    assert!(
        text.ends_with("\n\nConditions and remarks: --full"),
        "{text}"
    );
}
