//! Which effects look alike in a recording: a graph of them, and a table of all with the smallest sizes that would be found.
//!
//! Two effects are alike by the cosine between their whitened signatures: at 1 no evaluation of this recording separates them.
//! The graph has a name a line, those that are alike near each other, and an arc between two of [`ALIKE`] and more.

use std::fmt::Write as _;

use gap_diagnosis::figures::Isolability;

use super::three;
use super::words::{in_units, name_of};
use crate::plot::legend;
use crate::section::{Drawing, Rows, Section, head};
use crate::svg::escaped;
use crate::terminal::Rank;

/// Cosine from which two effects are alike.
const ALIKE: f64 = 0.7;
/// Cosine from which this recording hardly separates them.
const SAME: f64 = 0.95;
/// Most names of the graph; the others are in the table.
const MOST_ARCS: usize = 40;
/// Most names in one cell, and most pairs in the sentence.
const MOST_NAMES: usize = 3;
const ARCS_WIDTH: f64 = 720.0;
/// Height of a line, px.
const LINE_PX: f64 = 30.0;
/// Where the names end and the arcs begin, px.
const ARCS_PX: f64 = 400.0;
/// Room for the farthest arc, px.
const ARC_REACH_PX: f64 = 300.0;
/// Most letters of a name in the graph.
const MOST_LETTERS_OF_A_NAME: usize = 40;

/// Size of the cosine between two effects.
fn cosine(isolability: &Isolability, a: usize, b: usize) -> f64 {
    let row = isolability.cos.get(a);
    row.and_then(|row| row.get(b)).map_or(0.0, |cos| cos.abs())
}

/// Those that are alike to `a`, the most alike first.
fn alike(isolability: &Isolability, a: usize) -> Vec<usize> {
    let mut found: Vec<usize> = (0..isolability.names.len())
        .filter(|b| *b != a && cosine(isolability, a, *b) >= ALIKE)
        .collect();
    found.sort_by(|x, y| cosine(isolability, a, *y).total_cmp(&cosine(isolability, a, *x)));
    found
}

/// Effects with a look-alike, each followed by the one that is most alike to it.
fn chained(isolability: &Isolability) -> Vec<usize> {
    let mut left: Vec<usize> = (0..isolability.names.len())
        .filter(|a| !alike(isolability, *a).is_empty())
        .collect();
    let mut chain: Vec<usize> = Vec::new();
    while !left.is_empty() {
        // The nearest of those that are alike to any before it; else a new group begins.
        let near = |k: &usize| {
            let all = chain.iter().rev().take(MOST_NAMES);
            all.map(|before| cosine(isolability, *before, *k))
                .fold(0.0, f64::max)
        };
        let next = (0..left.len()).max_by(|a, b| {
            let (x, y) = (left[*a], left[*b]);
            near(&x).total_cmp(&near(&y)).then(y.cmp(&x))
        });
        chain.push(left.remove(next.unwrap_or(0)));
    }
    chain
}

fn shortened(name: &str) -> String {
    if name.chars().count() <= MOST_LETTERS_OF_A_NAME {
        return name.to_owned();
    }
    let begin: String = name.chars().take(MOST_LETTERS_OF_A_NAME).collect();
    format!("{begin}…")
}

/// The graph; `None` where no two effects are alike.
fn drawing(isolability: &Isolability) -> Option<Drawing> {
    let chain = chained(isolability);
    if chain.is_empty() {
        return None;
    }
    let shown: Vec<usize> = chain.iter().copied().take(MOST_ARCS).collect();
    let named = [
        (
            1,
            "line",
            "cosine from 0.95: this recording hardly separates them",
        ),
        (0, "line", "from 0.70: alike"),
    ];
    let mut text = legend("effects that look alike", &named);
    // A text has no error of writing.
    let _ = draw(&mut text, isolability, &shown);
    let more = match chain.len() - shown.len() {
        0 => String::new(),
        n => format!(" {n} more are in the table alone."),
    };
    Some(Drawing {
        svg: text,
        caption: format!(
            "An arc joins two effects that look alike in this recording; its value shows under the pointer.{more}"
        ),
    })
}

fn draw(text: &mut String, isolability: &Isolability, shown: &[usize]) -> std::fmt::Result {
    let height = LINE_PX * shown.len() as f64 + 8.0;
    write!(
        text,
        "<svg class=\"plot look_alikes\" role=\"img\" aria-label=\"effects that look alike\" viewBox=\"0 0 {ARCS_WIDTH} {height}\">"
    )?;
    let y = |line: usize| LINE_PX * (line as f64 + 0.6);
    let name = |line: usize| name_of(&isolability.names[shown[line]]);
    let most = shown.len().saturating_sub(1).max(1) as f64;
    for below in 0..shown.len() {
        for above in 0..below {
            let cos = cosine(isolability, shown[above], shown[below]);
            if cos < ALIKE {
                continue;
            }
            let (colour, width) = if cos >= SAME { (1, 2.5) } else { (0, 1.2) };
            // Neighbours have a small arc, those far apart a wide one.
            let reach = ARC_REACH_PX * ((below - above) as f64 / most).sqrt();
            let (top, bottom) = (y(above), y(below));
            write!(
                text,
                "<g class=\"c{colour}\"><path fill=\"none\" stroke=\"currentColor\" stroke-width=\"{width}\" d=\"M{ARCS_PX} {top:.1}C{:.1} {top:.1} {:.1} {bottom:.1} {ARCS_PX} {bottom:.1}\"><title>{} and {}: cosine {cos:.2}</title></path></g>",
                ARCS_PX + reach,
                ARCS_PX + reach,
                escaped(&name(above)),
                escaped(&name(below))
            )?;
        }
    }
    for line in 0..shown.len() {
        write!(
            text,
            "<circle cx=\"{ARCS_PX}\" cy=\"{:.1}\" r=\"3.5\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            y(line),
            ARCS_PX - 10.0,
            y(line) + 5.0,
            escaped(&shortened(&name(line)))
        )?;
    }
    text.push_str("</svg>");
    Ok(())
}

/// The smallest size that would be found, in words.
fn detectable(isolability: &Isolability, k: usize) -> String {
    let key = isolability.unit.get(k).map_or("", String::as_str);
    let least = isolability.detectable.get(k).copied().unwrap_or(f64::NAN);
    let (label, factor, unit) = in_units(key, least);
    format!("{label} {} {unit}", three(least * factor))
        .trim()
        .to_owned()
}

/// The pairs that a recording hardly separates.
fn answer(isolability: &Isolability) -> String {
    let n = isolability.names.len();
    let pairs = (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b)));
    let mut same: Vec<(usize, usize)> = pairs
        .filter(|(a, b)| cosine(isolability, *a, *b) >= SAME)
        .collect();
    same.sort_by(|x, y| cosine(isolability, y.0, y.1).total_cmp(&cosine(isolability, x.0, x.1)));
    let Some(more) = same.len().checked_sub(1) else {
        return "This recording separates every two effects that it shows.".to_owned();
    };
    let named: Vec<String> = { same.iter().take(MOST_NAMES) }
        .map(|(a, b)| {
            let (a, b) = (&isolability.names[*a], &isolability.names[*b]);
            format!("{} and {}", name_of(a), name_of(b))
        })
        .collect();
    let more = match more + 1 - named.len() {
        0 => String::new(),
        1 => ", and 1 more pair".to_owned(),
        n => format!(", and {n} more pairs"),
    };
    format!(
        "This recording hardly separates {}{more}.",
        named.join("; ")
    )
}

/// The part; `None` where a recording shows no effect.
pub(super) fn section(isolability: &Isolability) -> Option<Section> {
    let sin = |k: &usize| isolability.sin_alone.get(*k).copied().unwrap_or(1.0);
    let mut order: Vec<usize> = (0..isolability.names.len()).collect();
    order.sort_by(|a, b| sin(a).total_cmp(&sin(b)));
    let row = |a: &usize| {
        let names = alike(isolability, *a).into_iter().take(MOST_NAMES);
        let names: Vec<String> = names
            .map(|b| {
                format!(
                    "{} {:.2}",
                    name_of(&isolability.names[b]),
                    cosine(isolability, *a, b)
                )
            })
            .collect();
        vec![
            name_of(&isolability.names[*a]),
            detectable(isolability, *a),
            format!("{:.3}", sin(a)),
            names.join(", "),
        ]
    };
    let rows: Vec<Vec<String>> = order.iter().map(row).collect();
    if rows.is_empty() {
        return None;
    }
    let mut section =
        Section::new("Effects that look alike in this recording").ranked(Rank::Detail);
    section.answer(answer(isolability));
    section.tables.push(Rows {
        head: head(&["effect", "found from", "sine alone", "looks like (cosine)"]),
        rows,
        note: "Found from: the smallest size that 95 of 100 such recordings would show. Sine alone: share of the signature that no combination of other effects imitates. Cosine between two signatures: at 1 no evaluation of this recording separates them.".to_owned(),
    });
    section.drawings.extend(drawing(isolability));
    Some(section)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn three_effects() -> Isolability {
        Isolability {
            names: ["backlash X", "scale_error X", "backlash Y"]
                .map(str::to_owned)
                .to_vec(),
            cos: vec![
                vec![1.0, 0.1, -0.97],
                vec![0.1, 1.0, 0.2],
                vec![-0.97, 0.2, 1.0],
            ],
            sin_alone: vec![0.2, 0.99, 0.21],
            detectable: vec![0.8, 2.63, 0.9],
            unit: ["width_um", "scale_um_per_m", "width_um"]
                .map(str::to_owned)
                .to_vec(),
        }
    }

    #[test]
    fn an_arc_joins_those_that_look_alike_and_no_others() {
        let section = section(&three_effects()).unwrap();
        let drawn = &section.drawings[0].svg;
        assert_eq!(drawn.matches("<path").count(), 1, "{drawn}");
        assert!(drawn.contains("backlash X and backlash Y: cosine 0.97"));
        assert!(!drawn.contains("scale error"), "{drawn}");
        assert_eq!(
            section.answers,
            ["This recording hardly separates backlash X and backlash Y."]
        );
        let row = &section.tables[0].rows[0];
        assert_eq!(
            row[..2],
            ["backlash X", "width 0.800 µm"].map(str::to_owned)
        );
    }

    #[test]
    fn a_recording_in_which_nothing_is_alike_has_no_graph() {
        let mut apart = three_effects();
        apart.cos[0][2] = 0.3;
        apart.cos[2][0] = 0.3;
        let section = section(&apart).unwrap();
        assert!(section.drawings.is_empty());
        assert!(section.answers[0].contains("separates every two effects"));
        assert!(super::section(&Isolability::default()).is_none());
    }

    #[test]
    fn look_alikes_stand_next_to_each_other() {
        assert_eq!(chained(&three_effects()), [0, 2]);
    }
}
