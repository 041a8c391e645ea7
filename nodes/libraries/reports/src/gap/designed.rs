//! The page of a designed programme: what it will name, what stays together, and what more minutes would bring.

use anyhow::Result;
use gap_diagnosis::design::{Aimed, Design, Remedy, Rung};
use maud::html;

use super::{name, section, three};
use crate::Report;
use crate::plot::{self, Plot, Trace};
use crate::screen::Screen;
use crate::section::{Drawing, Section};
use crate::terminal::{self, Part, Rank};

/// The page; `order`: the steps of a person, a row each.
///
/// # Errors
/// When the plot cannot be drawn.
pub fn page(
    title: &str,
    design: &Design,
    order: Vec<Vec<String>>,
    notes: &[String],
) -> Result<Report> {
    let mut lines = sentences(design);
    lines.extend(notes.iter().cloned());
    let mut minutes = minutes(design);
    minutes.drawings.push(drawing(design)?);
    let sections: Vec<Section> = [
        programme(order).ranked(Rank::Answer),
        minutes,
        sizes(design),
        together(design),
        hidden(design).ranked(Rank::Detail),
    ]
    .into_iter()
    .filter(|section| section.tables.iter().any(|table| !table.rows.is_empty()))
    .collect();
    Ok(Report {
        title: title.to_owned(),
        parts: terminal::apart(sections.iter().map(Part::of)),
        screen: Screen::default(),
        body: html! {
            @for line in &lines { p { (line) } }
            @for section in &sections { (section.html()) }
        },
        figures: serde_json::json!({ "design": design, "notes": notes }),
        lines,
    })
}

fn wanted(design: &Design) -> Option<&Rung> {
    design.rungs.get(design.wanted)
}

fn sentences(design: &Design) -> Vec<String> {
    let Some(rung) = wanted(design) else {
        return vec![];
    };
    let tests: usize = rung.tests.iter().map(|(_, repeats)| repeats).sum();
    vec![
        format!(
            "{} tests in {} of {} min, set-ups included.",
            tests,
            three(rung.used_min),
            three(rung.minutes)
        ),
        format!(
            "{} of {} effects will be named at their stated size; {} will not show; {} will show without a sure name{}: too near the noise, or too like another effect. {} pairs of those that show stay together.",
            rung.named,
            design.effects.len(),
            design.hidden.len(),
            design.unsure.len(),
            in_brackets(&design.unsure),
            design.together.len()
        ),
    ]
}

/// The first names, and how many more there are.
fn in_brackets(names: &[String]) -> String {
    const LISTED: usize = 5;
    match names.len().checked_sub(LISTED) {
        _ if names.is_empty() => String::new(),
        None | Some(0) => format!(" ({})", names.join(", ")),
        Some(more) => format!(" ({} and {more} more)", names[..LISTED].join(", ")),
    }
}

fn programme(order: Vec<Vec<String>>) -> Section {
    section(
        "Programme",
        &["set-up", "test", "repeats"],
        order,
        "In the order of INSTRUCTIONS.md.",
    )
}

fn minutes(design: &Design) -> Section {
    let rows = design.rungs.iter().map(|rung| {
        vec![
            three(rung.minutes),
            three(rung.used_min),
            rung.tests.len().to_string(),
            rung.named.to_string(),
            three(rung.worst),
        ]
    });
    section(
        "What more minutes bring",
        &[
            "minutes",
            "used",
            "different tests",
            "effects named",
            "worst separability",
        ],
        rows.collect(),
        "Worst separability: of the effects that all tests together would name; 1 is the limit of naming.",
    )
}

fn drawing(design: &Design) -> Result<Drawing> {
    let points = |of: fn(&Rung) -> f64| -> Vec<(f64, f64)> {
        let rungs = design.rungs.iter();
        rungs.map(|rung| (rung.minutes, of(rung))).collect()
    };
    let svg = plot::svg(&Plot {
        x: "time / min".to_owned(),
        y: "effects".to_owned(),
        traces: vec![Trace {
            name: "named at their stated size".to_owned(),
            points: points(|rung| rung.named as f64),
            marks: false,
        }],
    })?;
    Ok(Drawing {
        svg,
        caption: "Effects that will be named, by the minutes of the programme.".to_owned(),
    })
}

fn sizes(design: &Design) -> Section {
    let mut names: Vec<String> = vec!["effect".to_owned()];
    names.extend(
        design
            .rungs
            .iter()
            .map(|rung| format!("{} min", three(rung.minutes))),
    );
    names.extend(["stated", "key of the machine file"].map(str::to_owned));
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let row = |one: &Aimed| {
        let mut row = vec![name(&one.effect, &one.axis)];
        let sizes = one.named_from.iter();
        row.extend(sizes.map(|from| from.map_or_else(|| "never".to_owned(), three)));
        row.extend([three(one.stated), one.parameter.clone()]);
        row
    };
    let is_shown = |one: &&Aimed| one.named_from.iter().any(Option::is_some);
    section(
        "Smallest size that will be named",
        &names,
        design.effects.iter().filter(is_shown).map(row).collect(),
        "By the minutes of the programme; in 95 of 100 recordings, where no other effect is as large. Never: another effect looks the same, or the size is beyond what is physical.",
    )
}

fn together(design: &Design) -> Section {
    let rows = design.together.iter().map(|pair| {
        let [a, b] = &pair.effects;
        vec![
            format!("{a} and {b}"),
            format!("{:.2}", pair.cos),
            words(&pair.parted_by),
        ]
    });
    section(
        "Pairs that stay together",
        &["pair", "cosine", "parted by"],
        rows.collect(),
        "Both show, and the programme does not tell which of the two it is.",
    )
}

fn hidden(design: &Design) -> Section {
    let rows = design
        .hidden
        .iter()
        .map(|one| vec![one.effect.clone(), words(&one.shown_by), one.needs.clone()]);
    section(
        "What will not show",
        &["effect", "shown by", "needs"],
        rows.collect(),
        "At the stated size.",
    )
}

fn words(remedy: &Remedy) -> String {
    match remedy {
        Remedy::Test { title, minutes } => format!("{title} (+{} min)", three(*minutes)),
        Remedy::OtherInstrument { title, minutes } => {
            format!(
                "{title}, an instrument that is not at hand (+{} min)",
                three(*minutes)
            )
        }
        Remedy::Beyond(words) if words.is_empty() => "—".to_owned(),
        Remedy::Beyond(words) => format!("no test here; {words}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_in_brackets_are_five_at_most_and_the_others_are_counted() {
        let names: Vec<String> = (1..=7).map(|k| format!("backlash {k}")).collect();
        assert_eq!(in_brackets(&[]), "");
        assert_eq!(in_brackets(&names[..1]), " (backlash 1)");
        assert!(in_brackets(&names[..5]).ends_with("backlash 5)"));
        assert!(in_brackets(&names).ends_with("backlash 5 and 2 more)"));
    }
}
