//! ISO 230-6: the four space diagonals of a bag.

use anyhow::Result;
use iso230::diagonal;
use iso230::diagonal::{DiagonalResult, DiagonalRuns, DiagonalsResult, SpaceDiagonal};
use iso230::positioning::PositioningRuns;
use metrology::sample::TestKind;

use super::{LEAST_SHARE, LENGTHS, capital, figure, periods_mm, runs, side_of};
use crate::evaluate::Tests;
use crate::evaluate::budget::{Budget, unstate_named};
use crate::evaluate::correction::{About, Measured};
use crate::evaluate::linear::LinearTest;
use crate::plot::{self, Plot, Trace};
use crate::section::{Drawing, NOT_EVALUATED, Rows, Section, head, um};
use crate::terminal::Rank;

/// Begin of the title of a test along a diagonal.
pub(super) const DIAGONAL: &str = "Diagonal ";
/// What the letters of a space diagonal mean.
const LETTERS: &str = "PPP, NPP, PNP and PPN: whether X, Y and Z run in the positive (P) or negative (N) direction from the lower end to the upper.";

/// The space diagonal along which a test ran, and whether it ran it upwards.
fn space_diagonal(test: &LinearTest) -> Option<(SpaceDiagonal, bool)> {
    let along = test.direction;
    if test.kind != TestKind::Diagonal || along.iter().any(|share| share.abs() < LEAST_SHARE) {
        return None;
    }
    let positive = along.map(|share| share > 0.0);
    // A diagonal and its reverse are one: the one with at most one negative axis names it.
    let upwards = positive.iter().filter(|p| **p).count() >= 2;
    let [x, y, z] = [positive.x, positive.y, positive.z].map(|p| p == upwards);
    let diagonal = match (x, y, z) {
        (false, _, _) => SpaceDiagonal::Npp,
        (_, false, _) => SpaceDiagonal::Pnp,
        (_, _, false) => SpaceDiagonal::Ppn,
        _ => SpaceDiagonal::Ppp,
    };
    Some((diagonal, upwards))
}

/// A title of a test whose beam along a space diagonal has the diagonal's letters, in capitals: `Diagonal NPP, run 8 on` of
/// `Diagonal npp, run 8 on`. Histories know the test by the beam's own letters.
#[must_use]
pub fn shown_title(title: &str) -> String {
    let letters = title.strip_prefix(DIAGONAL).and_then(|rest| rest.get(..3));
    let named = |letters: &str| {
        let mut all = SpaceDiagonal::ALL.into_iter().map(SpaceDiagonal::name);
        all.find(|name| name.eq_ignore_ascii_case(letters))
    };
    let is_whole = |rest: &str| !rest.starts_with(char::is_alphanumeric);
    let behind = title
        .get(DIAGONAL.len() + 3..)
        .filter(|rest| is_whole(rest));
    match (letters.and_then(named), behind) {
        (Some(name), Some(behind)) => format!("{DIAGONAL}{name}{behind}"),
        _ => title.to_owned(),
    }
}

/// The name of a test, by the letters of its space diagonal where its beam has another name.
pub(super) fn shown_name(test: &LinearTest) -> String {
    let Some((diagonal, _)) = space_diagonal(test) else {
        return test.name.clone();
    };
    let letters = diagonal.name();
    if test.name.is_empty() || letters.eq_ignore_ascii_case(&test.name) {
        return letters.to_owned();
    }
    format!("{letters} (beam {})", test.name)
}

/// The runs as they are upwards along the diagonal, positions counted from its lower end.
fn upwards(mut runs: PositioningRuns, is_upwards: bool) -> PositioningRuns {
    if is_upwards {
        return runs;
    }
    let last_mm = runs.targets_mm.last().copied().unwrap_or(0.0);
    let reversed = runs.targets_mm.iter().rev();
    runs.targets_mm = reversed.map(|at| last_mm - at).collect();
    // Seen from the other end a deviation along the line is of the other sign, and up is down.
    let turned = |all: &[Vec<f64>]| -> Vec<Vec<f64>> {
        let turn = |run: &Vec<f64>| run.iter().rev().map(|deviation| -deviation).collect();
        all.iter().map(turn).collect()
    };
    (runs.up_mm, runs.down_mm) = (turned(&runs.down_mm), turned(&runs.up_mm));
    runs.zero_mm = runs.targets_mm.first().copied().unwrap_or(0.0);
    runs
}

/// Deviations from the mean at the lower end, so that diagonals of one corner can be compared.
fn from_lower_end(runs: &mut PositioningRuns) {
    let all = || runs.up_mm.iter().chain(&runs.down_mm);
    let first: Vec<f64> = all().filter_map(|run| run.first().copied()).collect();
    let mean_mm = first.iter().sum::<f64>() / first.len().max(1) as f64;
    for deviation in runs.up_mm.iter_mut().chain(&mut runs.down_mm).flatten() {
        *deviation -= mean_mm;
    }
}

/// Names the diagonals whose targets were approached from one side only.
fn one_way(tests: &[LinearTest]) -> Option<Section> {
    let is_one_way = |test: &&LinearTest| space_diagonal(test).is_some() && side_of(test).is_some();
    let one_way = tests.iter().filter(is_one_way);
    let names: Vec<String> = one_way.map(shown_name).collect();
    if names.is_empty() {
        return None;
    }
    let mut section = Section::new("Space diagonals, ISO 230-6");
    let line = format!(
        "Not evaluated with {}: their targets were approached from one side alone (one-way); the figures of ISO 230-6 need both.",
        names.join(", ")
    );
    section.warn(NOT_EVALUATED, line);
    Some(section)
}

/// ISO 230-6, for each state in which the four space diagonals are there.
pub fn sections(tests: &Tests, budget: Option<&Budget>) -> Vec<Section> {
    let mut sections = Vec::new();
    sections.extend(one_way(&tests.linear));
    for compensated in [false, true] {
        let mut first: Vec<(SpaceDiagonal, bool, &LinearTest)> = Vec::new();
        let evaluable = |test: &&LinearTest| {
            let has_targets = !test.targets_mm.is_empty() && side_of(test).is_none();
            test.compensated == compensated && has_targets
        };
        for test in tests.linear.iter().filter(evaluable) {
            if let Some((diagonal, is_upwards)) = space_diagonal(test)
                && first.iter().all(|(known, ..)| *known != diagonal)
            {
                first.push((diagonal, is_upwards, test));
            }
        }
        if first.len() == SpaceDiagonal::ALL.len() {
            sections.push(diagonals_section(tests, &first, budget));
        }
    }
    sections
}

fn diagonals_section(
    tests: &Tests,
    first: &[(SpaceDiagonal, bool, &LinearTest)],
    budget: Option<&Budget>,
) -> Section {
    let state = if first.iter().any(|(.., test)| test.compensated) {
        "compensated"
    } else {
        "not compensated"
    };
    let title = format!("Space diagonals, ISO 230-6: {state}");
    let mut section = Section::new(title).ranked(Rank::Answer);
    let all = first.iter().flat_map(|(.., test)| &test.runs);
    let all: Vec<u32> = all.copied().collect();
    let measured = Measured::of(tests, budget, About::lengths(&all));
    let of = |(diagonal, is_upwards, test): &(SpaceDiagonal, bool, &LinearTest)| {
        let periods_mm = periods_mm(test, tests.machine.as_ref());
        let mut runs = upwards(runs(test, periods_mm, &measured), *is_upwards);
        from_lower_end(&mut runs);
        DiagonalRuns {
            diagonal: *diagonal,
            runs,
        }
    };
    let all: Vec<DiagonalRuns> = first.iter().map(of).collect();
    let span_mm = all.iter().map(|one| one.runs.span_mm()).fold(0.0, f64::max);
    match diagonal::evaluate(&all, &measured.budget) {
        Ok(result) => {
            let lengths_stated = measured.are_lengths_stated;
            section.answer(capital(&format!(
                "{}systematic deviation E_d {} µm, reversal B_d {} µm; the lengths of the diagonals differ by {} µm, and all mean deviations lie within {} µm{}.",
                measured.reservation(),
                figure(&result.systematic_error, lengths_stated),
                figure(&result.reversal, measured.is_stated),
                figure(&result.lengths, lengths_stated),
                figure(&result.spread, lengths_stated),
                coverage(&result, &measured)
            )));
            measured.state_correction(&mut section, span_mm);
            section.tables.push(of_diagonals(&result, &measured));
            match drawing(&result) {
                Ok(drawing) => section.drawings.push(drawing),
                Err(error) => section.lines.push(format!("Not drawn: {error:#}.")),
            }
            section.figures = serde_json::json!({
                "test": section.title,
                "iso230_6": result,
                "correction_to_20_degc": measured.correction.as_json(),
                "no_verdict": measured.correction.lacks(),
            });
            if measured.is_stated && !lengths_stated {
                unstate_named(&mut section.figures, &LENGTHS);
                unstate_named(&mut section.figures, &["spread", "lengths"]);
            }
        }
        Err(error) => section.not_evaluated(error),
    }
    section
}

/// The coverage factors of a sentence; empty where no uncertainty is stated.
fn coverage(result: &DiagonalsResult, measured: &Measured) -> String {
    if !measured.is_stated {
        return String::new();
    }
    let [of_error, of_reversal] = [
        result.systematic_error_coverage_factor,
        result.reversal_coverage_factor,
    ];
    let of_error = if measured.are_lengths_stated {
        format!("of E_d k = {of_error:.2}, ")
    } else {
        String::new()
    };
    format!(" (± U, k = 2; {of_error}of B_d k = {of_reversal:.2}, by their distributions)")
}

/// Mean deviation of both directions over the distance along each diagonal.
fn drawing(result: &DiagonalsResult) -> Result<Drawing> {
    let trace = |one: &DiagonalResult| {
        let points = one.positioning.points.iter();
        Trace {
            name: one.diagonal.name().to_owned(),
            points: points.map(|p| (p.target_mm, p.mean_mm * 1e3)).collect(),
            marks: false,
        }
    };
    let plot = Plot {
        x: "distance along the diagonal / mm".to_owned(),
        y: "mean deviation of both directions / µm".to_owned(),
        traces: result.diagonals.iter().map(trace).collect(),
    };
    Ok(Drawing {
        svg: plot::svg(&plot)?,
        caption: format!(
            "The four diagonals from the mean at their lower end: lines of one slope show a scale error, of several squareness. {LETTERS}"
        ),
    })
}

fn of_diagonals(result: &DiagonalsResult, measured: &Measured) -> Rows {
    let (stated, lengths_stated) = (measured.is_stated, measured.are_lengths_stated);
    let row = |one: &DiagonalResult| {
        let found = &one.positioning;
        vec![
            one.diagonal.name().to_owned(),
            um(one.too_long_mm()),
            figure(&found.systematic_error, lengths_stated),
            figure(&found.reversal, stated),
            figure(&found.repeatability, stated),
            figure(&found.accuracy, lengths_stated),
        ]
    };
    Rows {
        head: head(&["diagonal / µm", "too long by", "E", "B", "R", "A"]),
        rows: result.diagonals.iter().map(row).collect(),
        note: format!(
            "{} All too long alike: a scale error; unlike: squareness. U of E_d and B_d above has the k of its distribution.",
            measured.uncertainty_note()
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::test;
    use super::*;

    #[test]
    fn a_diagonal_is_known_by_its_direction_and_not_by_its_place_in_the_plan() {
        for (direction, wanted) in [
            ([2.0, 1.0, 1.5], (SpaceDiagonal::Ppp, true)),
            ([-2.0, 1.0, 1.5], (SpaceDiagonal::Npp, true)),
            ([2.0, -1.0, 1.5], (SpaceDiagonal::Pnp, true)),
            ([2.0, 1.0, -1.5], (SpaceDiagonal::Ppn, true)),
            ([-2.0, -1.0, 1.5], (SpaceDiagonal::Ppn, false)),
            ([-2.0, -1.0, -1.5], (SpaceDiagonal::Ppp, false)),
        ] {
            assert_eq!(
                space_diagonal(&test(direction)),
                Some(wanted),
                "{direction:?}"
            );
        }
        assert_eq!(space_diagonal(&test([1.0, 1.0, 0.0])), None);
    }

    #[test]
    fn letters_of_a_diagonal_are_capitals_and_another_name_of_its_beam_stays() {
        for (title, shown) in [
            (
                "Diagonal npp, run 8 on: by the laser",
                "Diagonal NPP, run 8 on: by the laser",
            ),
            ("Diagonal PPN: by the laser", "Diagonal PPN: by the laser"),
            ("Diagonal pppx, run 8 on", "Diagonal pppx, run 8 on"),
            ("Diagonal d1, run 8 on", "Diagonal d1, run 8 on"),
            ("Diagonal µµ", "Diagonal µµ"),
            ("Positioning ppp", "Positioning ppp"),
        ] {
            assert_eq!(shown_title(title), shown);
        }
        let named = |name: &str| LinearTest {
            name: name.to_owned(),
            ..test([-1.0, 1.0, 1.0])
        };
        assert_eq!(shown_name(&named("npp")), "NPP");
        assert_eq!(shown_name(&named("")), "NPP");
        assert_eq!(shown_name(&named("beam_2")), "NPP (beam beam_2)");
    }

    #[test]
    fn a_diagonal_that_is_run_from_its_upper_end_is_as_long_and_has_the_same_reversal() {
        let read = test([-1.0, -1.0, 1.0]);
        let as_read = PositioningRuns {
            zero_mm: 0.0,
            targets_mm: read.targets_mm,
            up_mm: read.up_mm,
            down_mm: read.down_mm,
            periods_mm: vec![],
        };
        let turned = upwards(as_read, false);
        assert_eq!(turned.targets_mm, [0.0, 200.0, 300.0]);
        assert_eq!(turned.up_mm, [vec![-0.005, -0.003, -0.002]]);
        assert_eq!(turned.down_mm, [vec![-0.003, -0.001, -0.0]]);
        let mut levelled = turned;
        from_lower_end(&mut levelled);
        assert!((levelled.up_mm[0][0] + 0.001).abs() < 1e-12);
        assert!((levelled.down_mm[0][0] - 0.001).abs() < 1e-12);
    }

    fn five_runs(direction: [f64; 3]) -> LinearTest {
        let one = test(direction);
        LinearTest {
            up_mm: vec![one.up_mm[0].clone(); 5],
            down_mm: vec![one.down_mm[0].clone(); 5],
            ..one
        }
    }

    #[test]
    fn lengths_of_diagonals_are_compared_apart_from_the_range_of_all_means() {
        // The four are alike: 3 µm too long, of 2 µm reversal and more.
        let four = [
            [1.0, 1.0, 1.0],
            [-1.0, 1.0, 1.0],
            [1.0, -1.0, 1.0],
            [1.0, 1.0, -1.0],
        ];
        let tests = Tests {
            linear: four.map(five_runs).to_vec(),
            ..Tests::default()
        };
        let section = sections(&tests, None).remove(0);
        let caption = &section.drawings[0].caption;
        assert!(caption.ends_with(LETTERS), "{caption}");
        let answer = section.answers[0].clone();
        assert!(
            answer.starts_with("As measured, not at 20 °C: systematic"),
            "{answer}"
        );
        // Means are 0 to 3 µm up and 2 to 5 µm down.
        let words = "the lengths of the diagonals differ by 0.00 µm, and all mean deviations lie within 5.00 µm";
        assert!(answer.contains(words), "{answer}");
        let mut longer = tests;
        let one = &mut longer.linear[1];
        for run in one.up_mm.iter_mut().chain(&mut one.down_mm) {
            run[2] += 0.01;
        }
        let answer = sections(&longer, None).remove(0).answers.remove(0);
        assert!(answer.contains("differ by 10.00 µm"), "{answer}");
        let text = include_str!("../../../../../launch_configs/diagonals/budget.yaml");
        let budget = Budget::read(text, std::path::Path::new("budget.yaml")).unwrap();
        let section = sections(&longer, Some(&budget)).remove(0);
        assert!(
            section.answers[0].contains("differ by 10.00 ± "),
            "{:?}",
            section.answers
        );
    }
}
