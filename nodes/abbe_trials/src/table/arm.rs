//! One arm of the table: rates, figures, classes, other methods, what was named falsely and how surely.

use anyhow::Result;
use reports::section::{Rows, Section, head};
use trials::Tally;
use trials::comparison::MethodLine;
use trials::proportion::Proportion;
use trials::tally::{ClassLine, D_BINS, Figure, bin_name};

use super::reliability;

/// Everything of an arm but who was taken for whom.
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
        section.tables.push(by_size(tally));
        section.tables.push(classes(tally));
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
        section.tables.push(reliability::rows(tally));
        section.drawings.push(reliability::drawing(tally)?);
    }
    Ok(section)
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
        let value = match figure.value {
            None => "-".to_owned(),
            Some(count) if figure.is_count => format!("{count:.0}"),
            Some(value) => format!("{value:.3}"),
        };
        vec![figure.what.clone(), value, figure.n.to_string()]
    });
    Rows {
        head: ["figure", "value", "of"].map(str::to_owned).to_vec(),
        rows: rows.collect(),
        note: String::new(),
    }
}

/// Classes by D.
fn by_size(tally: &Tally) -> Rows {
    let mut columns = vec!["class".to_owned()];
    columns.extend((0..D_BINS).map(bin_name));
    let has_limits = tally.classes.iter().any(|line| line.limit.is_some());
    let limit_of = |line: &ClassLine| {
        let told = line.limit.map_or_else(String::new, |d| d.to_string());
        has_limits.then_some(told)
    };
    columns.extend(has_limits.then(|| "95 % from D".to_owned()));
    let rows = tally.classes.iter().map(|line| {
        let mut row = vec![line.class.id().to_owned()];
        row.extend(line.named.iter().map(share));
        row.extend(limit_of(line));
        row
    });
    Rows {
        head: columns,
        rows: rows.collect(),
        note: "Named with class and axis, by D, with Wilson's 95 % interval; 95 % from D: where it is named nineteen times \
               of twenty."
            .to_owned(),
    }
}

/// What else is known of the classes.
fn classes(tally: &Tally) -> Rows {
    let rows = tally.classes.iter().map(|line| {
        let [low, high] = line.d_range;
        let own = tally.predicted.iter().find(|own| own.class == line.class);
        vec![
            line.class.id().to_owned(),
            format!("{low:.0} to {high:.0}"),
            share(&line.surrogate),
            own.map_or_else(String::new, |own| {
                format!("{:.2} of {}", own.sin_alone, own.n)
            }),
            names(&line.taken_for),
        ]
    });
    Rows {
        head: head(&["class", "D reached", "surrogate", "sin alone", "taken for"]),
        rows: rows.collect(),
        note: "Surrogate: shown as one, with class and axis; sin alone: part of its signature that no other class can \
               imitate, median of so many; taken for: what was named besides or instead where nothing else was hidden."
            .to_owned(),
    }
}

/// How many of how many, with the 95 % interval of their share; nothing of none.
fn share(count: &Proportion) -> String {
    if count.n == 0 {
        return String::new();
    }
    let [low, high] = count.wilson().map(|share| 100.0 * share);
    format!("{}/{} ({low:.0} to {high:.0} %)", count.k, count.n)
}

fn names(all: &[(String, usize)]) -> String {
    let told: Vec<String> = all.iter().map(|(name, n)| format!("{name} {n}")).collect();
    told.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_is_told_with_its_interval_and_nothing_of_none() {
        assert_eq!(share(&Proportion { k: 17, n: 24 }), "17/24 (51 to 85 %)");
        assert_eq!(share(&Proportion { k: 5, n: 5 }), "5/5 (57 to 100 %)");
        assert_eq!(share(&Proportion::default()), "");
    }

    #[test]
    fn how_many_are_told_without_decimals() {
        let count = Figure {
            is_count: true,
            ..Figure::new("longer", Some(3.0), 40)
        };
        let all = [count, Figure::new("median", Some(2.5), 40)];
        let rows = figures(&all).rows;
        assert_eq!(rows[0], ["longer", "3", "40"]);
        assert_eq!(rows[1], ["median", "2.500", "40"]);
    }
}
