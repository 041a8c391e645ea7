//! The page of a designed programme: what it will name, what stays together, and what more minutes would bring.

use anyhow::Result;
use gap_diagnosis::design::{Aimed, Design, Remedy, Rung};
use maud::{Markup, html};

use super::words::{name_of, with_unit};
use super::{name, section, three};
use crate::plot::{self, Plot, Trace};
use crate::screen::{Screen, Tile, Tone};
use crate::section::{Drawing, Section};
use crate::terminal::{self, Part, Rank};
use crate::{Report, page};

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
    let drawing = drawing(design)?;
    let screen = screen(design, page::figure(&drawing.svg, &drawing.caption));
    let mut minutes = minutes(design);
    minutes.drawings.push(drawing);
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
        screen,
        body: html! {
            @for line in notes { p { (line) } }
            @for section in &sections { (section.html()) }
        },
        figures: serde_json::json!({ "design": design, "notes": notes }),
        lines,
    })
}

/// The first screen: what will be named, and what more minutes would bring.
fn screen(design: &Design, picture: Markup) -> Screen {
    let Some(rung) = wanted(design) else {
        return Screen::default();
    };
    let n_tests: usize = rung.tests.iter().map(|(_, repeats)| repeats).sum();
    let (all, used) = (design.effects.len(), three(rung.used_min));
    let sentence = format!(
        "In {used} min {} of {all} effects will be named at their stated size.",
        rung.named
    );
    let time = format!("{n_tests} tests with repeats; set-ups included");
    let unsure: Vec<String> = design.unsure.iter().map(|id| name_of(id)).collect();
    let hidden: Vec<String> = design
        .hidden
        .iter()
        .map(|one| name_of(&one.effect))
        .collect();
    let tile = |name: &str, names: &[String]| {
        let listed = in_brackets(names);
        let listed = listed.trim_start_matches(" (").trim_end_matches(')');
        Tile::new(name, names.len().to_string(), listed)
    };
    Screen {
        verdict: Some((sentence, Tone::Plain)),
        tiles: vec![
            Tile::new("time of the programme", format!("{used} min"), time),
            Tile::new("will be named", format!("{} of {all}", rung.named), ""),
            tile("show without a sure name", &unsure),
            tile("will not show", &hidden),
        ],
        next: more_minutes(design, rung),
        picture: Some(picture),
        ..Screen::default()
    }
}

/// The next longer programme and how many more effects it names.
fn more_minutes(design: &Design, rung: &Rung) -> Option<Tile> {
    let longer = design.rungs.get(design.wanted + 1)?;
    let more = longer.named.checked_sub(rung.named).filter(|n| *n > 0)?;
    Some(Tile::new(
        "with more time",
        format!("{} min", three(longer.minutes)),
        format!("{more} more effects are named"),
    ))
}

fn wanted(design: &Design) -> Option<&Rung> {
    design.rungs.get(design.wanted)
}

fn sentences(design: &Design) -> Vec<String> {
    let Some(rung) = wanted(design) else {
        return vec![];
    };
    let tests: usize = rung.tests.iter().map(|(_, repeats)| repeats).sum();
    let unsure: Vec<String> = design.unsure.iter().map(|id| name_of(id)).collect();
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
            in_brackets(&unsure),
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
    let mut names: Vec<String> = ["effect", "size"].map(str::to_owned).to_vec();
    names.extend(
        design
            .rungs
            .iter()
            .map(|rung| format!("{} min", three(rung.minutes))),
    );
    names.push("stated".to_owned());
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let row = |one: &Aimed| {
        let (size, factor) = with_unit(&one.parameter, one.stated);
        let mut row = vec![name(&one.effect, &one.axis), size];
        let shown = |from: f64| three(from * factor);
        let sizes = one.named_from.iter();
        row.extend(sizes.map(|from| from.map_or_else(|| "never".to_owned(), shown)));
        row.push(shown(one.stated));
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
            format!("{} and {}", name_of(a), name_of(b)),
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
    let rows = design.hidden.iter().map(|one| {
        vec![
            name_of(&one.effect),
            words(&one.shown_by),
            one.needs.clone(),
        ]
    });
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
    use gap_diagnosis::design::Hidden;

    use super::*;

    fn rung(minutes: f64, named: usize) -> Rung {
        Rung {
            minutes,
            used_min: minutes,
            tests: vec![("circle".to_owned(), 3)],
            worst: 0.5,
            named,
        }
    }

    #[test]
    fn the_page_begins_with_what_is_named_and_has_no_keys() {
        let design = Design {
            rungs: vec![rung(20.0, 3), rung(40.0, 5)],
            wanted: 0,
            effects: vec![Aimed {
                effect: "angular_error".to_owned(),
                axis: "CX".to_owned(),
                parameter: "p1_urad".to_owned(),
                stated: 10.0,
                weight: 1.0,
                named_from: vec![Some(55.4), None],
            }],
            together: vec![],
            hidden: vec![Hidden {
                effect: "guide_bow YX".to_owned(),
                needs: "lines".to_owned(),
                shown_by: Remedy::Beyond(String::new()),
            }],
            unsure: vec!["guide_bow ZX".to_owned()],
        };
        let page = page("Designed", &design, vec![], &[]).unwrap();
        let verdict = page.screen.verdict.clone().unwrap().0;
        assert_eq!(
            verdict,
            "In 20.0 min 3 of 1 effects will be named at their stated size."
        );
        assert_eq!(page.screen.shown().len(), 5);
        assert_eq!(page.screen.shown()[4].more, "2 more effects are named");
        let html = page.html();
        for words in [
            "bow of a guide EYX",
            "linear part / µrad",
            "angular error ECX",
        ] {
            assert!(html.contains(words), "{words}: {html}");
        }
        for key in ["guide_bow", "p1_urad"] {
            assert!(
                !html.contains(key) && !page.terminal().contains(key),
                "{key}"
            );
        }
    }

    #[test]
    fn names_in_brackets_are_five_at_most_and_the_others_are_counted() {
        let names: Vec<String> = (1..=7).map(|k| format!("backlash {k}")).collect();
        assert_eq!(in_brackets(&[]), "");
        assert_eq!(in_brackets(&names[..1]), " (backlash 1)");
        assert!(in_brackets(&names[..5]).ends_with("backlash 5)"));
        assert!(in_brackets(&names).ends_with("backlash 5 and 2 more)"));
    }
}
