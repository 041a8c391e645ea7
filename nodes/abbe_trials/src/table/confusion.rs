//! Who was taken for whom, beside who was predicted to look like whom: as a list of pairs where there are only
//! characters, as a matrix on a page.

use std::collections::BTreeSet;

use maud::{Markup, html};
use reports::section::{Rows, head};
use trials::confusion::{ALIKE, NOTHING, NOTICED, Pair, UNKNOWN};
use trials::{Class, Tally};

/// Some thirty columns have to go beside each other; what was hidden stays in sight where they do not.
const TABLE: &str = "font-size: .7rem; line-height: 1.3";
const HIDDEN: &str = "text-align: left; white-space: nowrap; position: sticky; left: 0; background: var(--paper); padding-right: .4rem";
const SAID: &str = "writing-mode: vertical-rl; text-align: right; padding: .2rem";
const CELL: &str = "padding: .1rem .2rem;";

/// Every pair.
pub fn pairs(tally: &Tally) -> Rows {
    let rows = tally.confusion.iter().map(|pair| {
        let count = pair.observed;
        vec![
            pair.hidden.id().to_owned(),
            pair.said.clone(),
            match count.n {
                0 => "-".to_owned(),
                n => format!("{}/{n}", count.k),
            },
            pair.cosine.map_or_else(String::new, cosine),
        ]
    });
    Rows {
        head: head(&["hidden", "said", "observed k/n", "predicted cosine"]),
        rows: rows.collect(),
        note: note(tally),
    }
}

fn cosine(value: f64) -> String {
    format!("{value:.2}")
}

fn note(tally: &Tally) -> String {
    let mut note = format!(
        "Classes whatever the axis. Observed: of the trials that hide this class alone, with everything that was said; \
         in brackets: shown as a surrogate, nothing named. Predicted: from signatures alone, median over all trials that hide \
         it; what was never said is there from a cosine of {NOTICED} on, and a class has none with itself."
    );
    let [with, without] = tally.agreement;
    if with.n + without.n > 0 {
        note.push_str(&format!(
            " One effect hidden, another class named: {with} where some class was predicted to look like it (cosine \
             {ALIKE} and more), {without} where none was."
        ));
    }
    note
}

/// Hidden classes by what was said of them.
pub fn matrix(tally: &Tally) -> Markup {
    let all = &tally.confusion;
    let hidden: BTreeSet<Class> = all.iter().map(|pair| pair.hidden).collect();
    let columns = columns(all);
    let trials = |class: Class| {
        let own = all.iter().find(|pair| pair.hidden == class);
        own.map_or(0, |pair| pair.observed.n)
    };
    html! {
        figure {
            table.confusion style=(TABLE) {
                thead { tr {
                    th style=(HIDDEN) { "hidden, trials" }
                    @for name in &columns { th style=(SAID) { (name) } }
                } }
                tbody { @for class in hidden { tr {
                    th style=(HIDDEN) { (class.id()) ", " (trials(class)) }
                    @for name in &columns {
                        (cell(all.iter().filter(|pair| pair.hidden == class && pair.class() == *name), class.id() == *name))
                    }
                } } }
            }
            figcaption.note {
                "Arm " (tally.arm) ": who was taken for whom, beside who was predicted to look like whom. Upper number: how \
                 often that was said; lower number and shade: predicted cosine; bold: the class itself. " (note(tally))
            }
        }
    }
}

/// What was said or could have been: classes that are hidden in their order, others by name, then what is no class.
fn columns(all: &[Pair]) -> Vec<&str> {
    let mut said: BTreeSet<&str> = all.iter().map(Pair::class).collect();
    let mut take = |names: &[&'static str]| -> Vec<&str> {
        let there = names.iter().copied().filter(|name| said.remove(name));
        there.collect()
    };
    let mut columns = take(&Class::every().map(Class::id).collect::<Vec<_>>());
    let last = take(&[UNKNOWN, NOTHING]);
    columns.extend(said);
    columns.extend(last);
    columns
}

/// What of a hidden class was taken for another: named, shown in brackets, and the predicted cosine below.
fn cell<'p>(own: impl Iterator<Item = &'p Pair>, is_itself: bool) -> Markup {
    let own: Vec<&Pair> = own.collect();
    let times = |is_surrogate: bool| {
        let pair = own.iter().find(|pair| pair.is_surrogate() == is_surrogate);
        pair.map_or(0, |pair| pair.observed.k)
    };
    let counts = match (times(false), times(true)) {
        (0, 0) => String::new(),
        (named, 0) => named.to_string(),
        (0, shown) => format!("({shown})"),
        (named, shown) => format!("{named} ({shown})"),
    };
    let predicted = own.iter().find_map(|pair| pair.cosine);
    let percent = 60.0 * predicted.unwrap_or(0.0);
    html! {
        td style=(format!("{CELL} background: color-mix(in srgb, #0072B2 {percent:.0}%, transparent)")) {
            @if is_itself { b { (counts) } } @else { (counts) }
            @if let Some(value) = predicted { br; small { (cosine(value)) } }
        }
    }
}

#[cfg(test)]
mod tests {
    use trials::Arm;
    use trials::proportion::Proportion;

    use super::*;

    fn tally() -> Tally {
        let pair = |said: &str, k: usize, cosine: Option<f64>| Pair {
            hidden: Class::Backlash,
            said: said.to_owned(),
            observed: Proportion { k, n: 9 },
            cosine,
        };
        Tally {
            confusion: vec![
                pair("backlash", 5, None),
                pair("drive_windup", 2, Some(0.42)),
                pair("(drive_windup)", 1, Some(0.42)),
                pair("nothing", 1, None),
                pair("coolant", 0, Some(0.31)),
            ],
            ..Tally::of(Arm::Catalogue, &[])
        }
    }

    #[test]
    fn what_was_said_and_what_was_predicted_stand_in_one_row() {
        let rows = pairs(&tally()).rows;
        assert_eq!(rows[1], ["backlash", "drive_windup", "2/9", "0.42"]);
        assert_eq!(rows[2], ["backlash", "(drive_windup)", "1/9", "0.42"]);
        assert_eq!(rows[4], ["backlash", "coolant", "0/9", "0.31"]);
        assert_eq!(rows.len(), 5);
    }

    #[test]
    fn a_cell_holds_what_was_named_what_was_shown_and_what_was_predicted() {
        let page = matrix(&tally()).into_string();
        assert!(page.contains(">backlash, 9</th>"), "{page}");
        assert!(page.contains("<b>5</b>"), "{page}");
        assert!(
            page.contains(">2 (1)<br><small>0.42</small></td>"),
            "{page}"
        );
        assert_eq!(page.matches("<td").count(), 4, "{page}");
        let order = ["backlash", "drive_windup", "coolant", "nothing"];
        assert_eq!(columns(&tally().confusion), order);
    }
}
