//! One arm of the table: rates, figures, classes, who was taken for whom, other methods.

use std::collections::BTreeSet;

use anyhow::Result;
use trials::Tally;
use trials::comparison::MethodLine;
use trials::confusion::ALIKE;
use trials::tally::{D_BINS, Figure, bin_name};

use crate::report::plot::{self, Plot, Trace};
use crate::report::section::{Drawing, Rows, Section};

/// Most names in one cell.
const MOST_NAMES: usize = 5;

/// Everything of an arm.
///
/// # Errors
/// When the diagram cannot be drawn.
pub fn section(tally: &Tally) -> Result<Section> {
    let mut section = Section::new(format!("Arm {}: {}", tally.arm, tally.arm.title()));
    section.lines.push(format!("{} trials.", tally.trials));
    section.tables.push(Rows {
        head: ["what", "k/n", "95 % interval"].map(str::to_owned).to_vec(),
        rows: tally
            .rates
            .iter()
            .filter(|rate| rate.count.n > 0)
            .map(|rate| {
                let [low, high] = rate.interval.map(|share| 100.0 * share);
                let share = 100.0 * rate.count.share().unwrap_or(0.0);
                let count = format!("{}/{} = {share:.0} %", rate.count.k, rate.count.n);
                vec![rate.what.clone(), count, format!("{low:.0} to {high:.0} %")]
            })
            .collect(),
        note: String::new(),
    });
    section.tables.push(figures(&tally.figures));
    if !tally.classes.is_empty() {
        section.tables.push(classes(tally));
    }
    if !tally.confusion.is_empty() {
        section.tables.push(confusion(tally));
    }
    if !tally.predicted.is_empty() {
        section.tables.push(predicted(tally));
    }
    if !tally.methods.is_empty() {
        section
            .tables
            .push(methods("other methods, same trials", &tally.methods));
    }
    if !tally.false_names.is_empty() {
        let names = tally
            .false_names
            .iter()
            .map(|(name, n)| vec![name.clone(), n.to_string()]);
        section.tables.push(Rows {
            head: ["named though not hidden", "times"]
                .map(str::to_owned)
                .to_vec(),
            rows: names.collect(),
            note: String::new(),
        });
    }
    if !tally.reliability.is_empty() {
        let rows = tally
            .reliability
            .iter()
            .map(|bin| vec![format!("{:.2}", bin.confidence), bin.right.to_string()]);
        section.tables.push(Rows {
            head: ["mean confidence", "right"].map(str::to_owned).to_vec(),
            rows: rows.collect(),
            note: "Confidence beside precision of what is named.".to_owned(),
        });
        section.drawings.push(reliability(tally)?);
    }
    Ok(section)
}

/// Precision over confidence, beside what it should be.
fn reliability(tally: &Tally) -> Result<Drawing> {
    let bins = || tally.reliability.iter();
    let right = bins().filter_map(|bin| Some((bin.confidence, bin.right.share()?)));
    let end = |place: usize| bins().map(move |bin| (bin.confidence, bin.right.wilson()[place]));
    let trace = |name: &str, points: Vec<(f64, f64)>, marks: bool| Trace {
        name: name.to_owned(),
        points,
        marks,
    };
    let svg = plot::svg(&Plot {
        x: "confidence".to_owned(),
        y: "share right".to_owned(),
        traces: vec![
            trace("as said", vec![(0.0, 0.0), (1.0, 1.0)], false),
            trace("named causes", right.collect(), true),
            trace("95 %, lower end", end(0).collect(), true),
            trace("95 %, upper end", end(1).collect(), true),
        ],
    })?;
    Ok(Drawing {
        svg,
        caption: format!(
            "Reliability, arm {}: how often names were right, by the confidence they were given.",
            tally.arm
        ),
    })
}

/// Who was predicted to look like whom.
fn predicted(tally: &Tally) -> Rows {
    let rows = tally.predicted.iter().map(|line| {
        let near: Vec<String> = line
            .cos
            .iter()
            .take(MOST_NAMES)
            .map(|(name, cos)| format!("{name} {cos:.2}"))
            .collect();
        vec![
            line.class.id().to_owned(),
            format!("{:.2}", line.sin_alone),
            near.join(", "),
            line.n.to_string(),
        ]
    });
    let [with, without] = tally.agreement;
    Rows {
        head: [
            "hidden",
            "sin alone",
            "predicted to look like, cosine",
            "of",
        ]
        .map(str::to_owned)
        .to_vec(),
        rows: rows.collect(),
        note: format!(
            "Medians over trials, from signatures alone. One effect hidden, another class named: {with} where some \
             class was predicted to look like it (cosine {ALIKE} and more), {without} where none was."
        ),
    }
}

/// Methods side by side.
pub fn methods(what: &str, lines: &[MethodLine]) -> Rows {
    let rows = lines.iter().map(|line| {
        vec![
            line.method.clone(),
            line.exact.to_string(),
            line.named.to_string(),
            line.wrong.to_string(),
            line.unflagged.to_string(),
            line.calibration_error
                .map_or("-".to_owned(), |error| format!("{error:.3}")),
        ]
    });
    let columns = [
        what,
        "exact",
        "effects named",
        "a wrong name",
        "unflagged",
        "calibration error",
    ];
    Rows {
        head: columns.map(str::to_owned).to_vec(),
        rows: rows.collect(),
        note: "Exact and effects named: of D > 20; unflagged: a wrong name, and no unknown flagged; calibration error: \
               of what is named, where a method without probabilities is sure of every name."
            .to_owned(),
    }
}

/// Figures as a table.
pub fn figures(all: &[Figure]) -> Rows {
    let with = all.iter().filter(|figure| figure.n > 0);
    let rows = with.map(|figure| {
        let value = figure
            .value
            .map_or("-".to_owned(), |value| format!("{value:.3}"));
        vec![figure.what.clone(), value, figure.n.to_string()]
    });
    Rows {
        head: ["figure", "value", "of"].map(str::to_owned).to_vec(),
        rows: rows.collect(),
        note: String::new(),
    }
}

fn classes(tally: &Tally) -> Rows {
    let mut head = vec!["class".to_owned()];
    head.extend((0..D_BINS).map(bin_name));
    head.extend(["D reached", "surrogate", "taken for"].map(str::to_owned));
    let rows = tally.classes.iter().map(|line| {
        let mut row = vec![line.class.id().to_owned()];
        row.extend(line.named.iter().map(|bin| match bin.n {
            0 => String::new(),
            n => format!("{}/{n}", bin.k),
        }));
        let [low, high] = line.d_range;
        row.push(format!("{low:.0} to {high:.0}"));
        row.push(format!("{}/{}", line.surrogate.k, line.surrogate.n));
        row.push(names(&line.taken_for));
        row
    });
    Rows {
        head,
        rows: rows.collect(),
        note: "Named with class and axis, by D; taken for: what was named besides or instead where nothing else was hidden.".to_owned(),
    }
}

fn names(all: &[(String, usize)]) -> String {
    let mut told: Vec<String> = all
        .iter()
        .take(MOST_NAMES)
        .map(|(name, n)| format!("{name} {n}"))
        .collect();
    if all.len() > MOST_NAMES {
        told.push("...".to_owned());
    }
    told.join(", ")
}

fn confusion(tally: &Tally) -> Rows {
    let hidden: BTreeSet<&str> = tally.confusion.iter().map(|(h, ..)| h.as_str()).collect();
    let rows = hidden.into_iter().map(|class| {
        let own = tally
            .confusion
            .iter()
            .filter(|(hidden, ..)| hidden == class);
        let mut said: Vec<(String, usize)> = own.map(|(_, said, n)| (said.clone(), *n)).collect();
        said.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
        let told: Vec<String> = said.iter().map(|(name, n)| format!("{name} {n}")).collect();
        vec![class.to_owned(), told.join(", ")]
    });
    Rows {
        head: ["one effect hidden", "said"].map(str::to_owned).to_vec(),
        rows: rows.collect(),
        note: "Classes whatever the axis; in brackets: shown as a surrogate, nothing named."
            .to_owned(),
    }
}
