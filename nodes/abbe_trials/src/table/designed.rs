//! Arms of designed programmes: by minutes and physics, by class, by second rounds; and the lines that their page begins with.

use metrology::number::decimals_of;
use reports::section::{Rows, Section, head};
use trials::Arm;
use trials::designed::{Overview, PROGRAMME_MIN, ProgrammeLine, RoundsLine, SizeLine};
use trials::proportion::Proportion;
use trials::target::{Ratio, Target};

use super::{NOT_TRIED, Table, percent};
use crate::programmes::ratio_words;

/// Classes whose sizes the first lines give, in a user's words.
const IN_WORDS: [(&str, &str); 4] = [
    ("backlash", "lost motion"),
    ("scale_error", "scale"),
    ("squareness", "squareness"),
    ("servo_lag", "servo lag"),
];

/// Everything of an arm that is by its programmes.
pub fn section(overview: &Overview) -> Section {
    let arm = overview.arm;
    let mut section = Section::new(format!("Programmes of arm {arm}"));
    section.tables.push(Rows {
        head: head(&[
            "machines",
            "trials",
            "named, D < 10",
            "10 to 20",
            "> 20",
            "of D > 10 on the common programme",
            "1 effect, D > 10: exact",
            "2-3 effects, D > 7: exact",
            "a wrong name",
            "unflagged",
            "minutes, median",
        ]),
        rows: overview
            .programmes
            .iter()
            .map(|line| programme(arm, line))
            .collect(),
        note: "D is that on the designed programme. The common programme has three plates, three beams and four faces: 43 min of \
               set-ups alone. Unflagged: a wrong name, and no unknown flagged."
            .to_owned(),
    });
    section.tables.push(Rows {
        head: head(&[
            "class",
            "not shown, 20 min",
            "40 min",
            "size of D 20, 20 min",
            "40 min",
            "unit",
        ]),
        rows: overview.sizes.iter().map(size).collect(),
        note: "Not shown: D below 2. Size of D 20: in the middle machine, of those that show it."
            .to_owned(),
    });
    if !overview.rounds.is_empty() {
        section.tables.push(Rows {
            head: head(&[
                "drawn as",
                "open after round one",
                "second round designed",
                "exact after it",
                "the same, D > 10",
                "exact before, not after",
            ]),
            rows: overview.rounds.iter().map(rounds).collect(),
            note: "Open: not all that is hidden is named, or something else. Second round designed: of the open ones; exact: of \
                   these."
                .to_owned(),
        });
    }
    section
}

fn count(count: Proportion) -> String {
    match count.n {
        0 => "-".to_owned(),
        n => format!("{}/{n}", count.k),
    }
}

fn programme(arm: Arm, line: &ProgrammeLine) -> Vec<String> {
    let [low, middle, high] = line.named;
    let of_names = [low, middle, high, line.of_common, line.single, line.several];
    let mut cells = vec![line.what.clone(), line.trials.to_string()];
    cells.extend(of_names.map(|own| {
        if arm.leaves_out() {
            "-".to_owned()
        } else {
            count(own)
        }
    }));
    cells.extend([line.wrong, line.unflagged].map(count));
    let used = line.used_min;
    cells.push(used.map_or_else(|| "-".to_owned(), |min| format!("{min:.1}")));
    cells
}

fn size(line: &SizeLine) -> Vec<String> {
    let mut cells = vec![line.class.id().to_owned()];
    cells.extend(line.not_shown.map(count));
    cells.extend(
        line.size
            .map(|size| size.map_or_else(|| "-".to_owned(), two_digits)),
    );
    cells.push(line.unit.clone());
    cells
}

fn rounds(line: &RoundsLine) -> Vec<String> {
    let counts = [
        line.open,
        line.designed,
        line.exact,
        line.exact_of_large,
        line.spoilt,
    ];
    let mut cells = vec![line.what.clone()];
    cells.extend(counts.map(count));
    cells
}

/// Ten sentences for a user: what can be trusted, what cannot, from what size, with which programme.
pub fn ten_lines(table: &Table, ratio: Option<Ratio>) -> Vec<String> {
    let of = |arm: Arm| table.programmes.iter().find(|overview| overview.arm == arm);
    let [known, left_out, rounds] =
        [Arm::Designed, Arm::DesignedLeftOut, Arm::DesignedTwoRounds].map(of);
    let mut lines = of_names(known, &table.targets).to_vec();
    lines.extend(of_sizes(known));
    lines.extend(of_what_is_open(left_out, rounds));
    lines.push(format!(
        "Intervals hold the size in {}. {}",
        figure(
            &table.targets,
            "s5: 95 % intervals that hold the parameter, D > 20"
        ),
        ratio.map_or_else(
            || {
                "What a shop's programme of the same minutes names is in the table of `abbe-trials programmes`."
                    .to_owned()
            },
            ratio_words
        )
    ));
    lines
}

/// What can be trusted of names.
fn of_names(known: Option<&Overview>, targets: &[Target]) -> [String; 4] {
    let both = |of: fn(&ProgrammeLine) -> Proportion| by_minutes(known, of);
    [
        format!(
            "One cause that the programme shows (D above 10) is named alone in {}.",
            both(|line| line.single)
        ),
        format!(
            "Two or three such causes (D above 7) are all named, and nothing else, in {}.",
            both(|line| line.several)
        ),
        format!(
            "A wrong cause is named in {}; no unknown is flagged beside it in {}.",
            both(|line| line.wrong),
            both(|line| line.unflagged)
        ),
        format!(
            "A good machine is given a cause in {}, and any alarm in {}.",
            figure(targets, "s5: nothing hidden, any cause named"),
            figure(targets, "s5: nothing hidden, any alarm, unknown included")
        ),
    ]
}

/// From what size, and what few minutes leave out.
fn of_sizes(known: Option<&Overview>) -> [String; 3] {
    [
        format!(
            "Few minutes leave instruments out: of faults that all of them together show (D above 10), {} are named.",
            by_minutes(known, |line| line.of_common)
        ),
        format!("Sizes that 20 min show well (D 20): {}.", sizes(known, 0)),
        format!("Sizes that 40 min show well (D 20): {}.", sizes(known, 1)),
    ]
}

/// Causes that are not known, and second rounds.
fn of_what_is_open(left_out: Option<&Overview>, rounds: Option<&Overview>) -> [String; 2] {
    let line = rounds.and_then(|overview| overview.rounds.first());
    let round = |of: fn(&RoundsLine) -> Proportion| {
        line.map_or_else(|| NOT_TRIED.to_owned(), |line| percent(of(line)))
    };
    [
        format!(
            "A cause that Abbe does not know gets another's name in {}, unflagged in {}.",
            by_minutes(left_out, |line| line.wrong),
            by_minutes(left_out, |line| line.unflagged)
        ),
        format!(
            "After a first round is open, a second of 15 min is designed in {}; then {} is exact. Of what was exact, {} is so no longer.",
            round(|line| line.designed),
            round(|line| line.exact),
            round(|line| line.spoilt)
        ),
    ]
}

/// A share at 20 and at 40 min.
fn by_minutes(overview: Option<&Overview>, of: fn(&ProgrammeLine) -> Proportion) -> String {
    let shares = PROGRAMME_MIN.map(|minutes| {
        let line = overview.and_then(|overview| overview.line(minutes));
        let share = line.map_or_else(|| NOT_TRIED.to_owned(), |line| percent(of(line)));
        format!("{share} ({minutes} min)")
    });
    shares.join(" and ")
}

/// A target's figure.
fn figure(targets: &[Target], metric: &str) -> String {
    let found = targets.iter().find(|target| target.metric == metric);
    let count = found.and_then(|target| target.count);
    percent(count.unwrap_or_default())
}

/// A size with two significant digits: those of a lag are thousandths.
fn two_digits(size: f64) -> String {
    format!("{size:.*}", decimals_of(size))
}

/// Sizes of some classes with a D of 20, at one of the minutes.
fn sizes(overview: Option<&Overview>, minutes: usize) -> String {
    let told = IN_WORDS.iter().filter_map(|(id, words)| {
        let mut lines = overview?.sizes.iter();
        let line = lines.find(|line| line.class.id() == *id)?;
        let size = line.size.get(minutes).copied().flatten()?;
        Some(format!("{words} {} {}", two_digits(size), line.unit))
    });
    let told: Vec<String> = told.collect();
    if told.is_empty() {
        NOT_TRIED.to_owned()
    } else {
        told.join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_of_any_magnitude_have_two_digits() {
        let told = [0.003_17, 0.584, 8.37, 61.2].map(two_digits);
        assert_eq!(told, ["0.0032", "0.58", "8.4", "61"]);
    }
}
