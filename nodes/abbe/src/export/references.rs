//! Tables of what an external reference read: a laser's runs along an axis, an autocollimator's round one.
//!
//! The deviation of such a run is measured minus commanded position, as that of a table is scale minus motor: the signs are
//! the same. The mean over the runs is taken at every target for each direction, as ISO 230-2 does (x-bar up and down).

use abbe_msgs::topics;
use control_tables::selection::Measured;
use metrology::epoch::utc_of_nanos;
use metrology::sample::{PositioningTable, TestKind};
use metrology::stamp::{Host, Stamp};
use metrology::{Axis, PerAxis};
use recorder::Bag;
use reports::evaluate::Tests;
use reports::evaluate::angular::RotaryTest;
use reports::evaluate::budget::Budget;
use reports::evaluate::correction::{About, Measured as Conditions};
use reports::evaluate::linear::{LinearTest, Reference};

use super::found::is;
use super::temperature;

/// Whether a bag has readings of an external reference.
pub(super) fn are_in(bag: &Bag) -> bool {
    let topics = bag.topics();
    let names = [topics::LENGTH_POSITION.name, topics::ANGLE_POSITION.name];
    topics
        .iter()
        .any(|info| info.message_count > 0 && names.iter().any(|name| is(&info.topic, name)))
}

/// A table for each axis that has none and was measured with nothing added to its commands; the last such test counts. Says
/// of each what it was made of.
pub(super) fn tables(
    tests: &Tests,
    budget: Option<&Budget>,
    measured: &mut Measured,
) -> PerAxis<Option<String>> {
    let linear = tests.linear.iter();
    let linear = linear.filter_map(|test| of_linear(tests, budget, test));
    let rotary = tests.rotary_positioning.iter().filter_map(of_rotary);
    let mut last = PerAxis::<Option<Made>>::default();
    let mut all = PerAxis::<Vec<String>>::default();
    for made in linear.chain(rotary) {
        let axis = made.table.axis;
        all[axis].push(utc_of_nanos(made.table.at.nanos(), 0));
        last[axis] = Some(made);
    }
    let mut told = PerAxis::<Option<String>>::default();
    for axis in Axis::ALL {
        let known = &mut measured.tables[axis];
        if known.is_none()
            && let Some(made) = last[axis].take()
        {
            // A table is of no instant of the control.
            *known = Some(PositioningTable {
                at: Stamp::from_nanos(0),
                ..made.table
            });
            measured.remarks[axis].extend(made.remark);
            told[axis] = Some(made.said + &others(&all[axis]));
        }
    }
    told
}

/// Which measurement of several was taken, by the times at which they began; empty: there is one.
fn others(began: &[String]) -> String {
    match began {
        [] | [_] => String::new(),
        [before @ .., last] => format!(
            ": the last of {} measurements in the bag, begun at {last}; not in it: {}",
            began.len(),
            before.join(", ")
        ),
    }
}

/// A table of a reference's runs.
#[derive(Debug)]
struct Made {
    table: PositioningTable,
    /// What it was made of.
    said: String,
    /// What a reader of the table must know.
    remark: Option<String>,
}

/// The table of runs along one axis, at 20 °C where a budget has what corrects them.
fn of_linear(tests: &Tests, budget: Option<&Budget>, test: &LinearTest) -> Option<Made> {
    let is_wanted = test.kind == TestKind::Positioning
        && test.reference == Reference::Length
        && !test.compensated;
    let axis = test.axis.filter(|_| is_wanted)?;
    let correction = Conditions::of(tests, budget, About::line(test)).correction;
    let runs = correction.runs_at_20_degc(test, vec![]);
    let means = Means {
        axis,
        targets: &runs.targets_mm,
        sides: [&runs.up_mm, &runs.down_mm],
        mean: test.mean_mm,
        first_run: test.first_run,
        began: test.began,
    };
    let (table, said) = means.table()?;
    let state = temperature::state(&correction);
    Some(Made {
        said: format!("{said}, {state}"),
        remark: Some(temperature::remark(&correction, &table)),
        table,
    })
}

fn of_rotary(test: &RotaryTest) -> Option<Made> {
    let axis = Some(test.axis).filter(|_| test.has_readings)?;
    let means = Means {
        axis,
        targets: &test.targets_rad,
        sides: [&test.up_rad, &test.down_rad],
        mean: test.mean_rad,
        first_run: test.first_run,
        began: test.began,
    };
    let (table, said) = means.table()?;
    let remark = None;
    Some(Made {
        table,
        said,
        remark,
    })
}

/// Most that an axis is off at its zero, mm and rad: zeros of reference and axis that differ by more are different ones.
const SAME_ZERO: [f64; 2] = [1.0, 0.01];

/// What a table is made of, in mm or rad.
struct Means<'a> {
    axis: Axis,
    targets: &'a [f64],
    /// Deviations per run and target, up and down, the mean of all taken out.
    sides: [&'a Vec<Vec<f64>>; 2],
    /// That mean.
    mean: f64,
    first_run: u32,
    began: Stamp<Host>,
}

impl Means<'_> {
    /// The table of the means of runs up and down; of one direction alone both sides are that one.
    fn table(&self) -> Option<(PositioningTable, String)> {
        let [up, down] = self.sides;
        let (zero, of_zero) = self.zero();
        let means = self.sides.map(|side| means(side, self.targets.len(), zero));
        let (deviation_up, deviation_down, sides) = match means {
            [Some(up), Some(down)] => (up, down, "up and down"),
            [Some(up), None] => (
                up.clone(),
                up,
                "up alone, so that its lost motion is not in it,",
            ),
            [None, Some(down)] => (
                down.clone(),
                down,
                "down alone, so that its lost motion is not in it,",
            ),
            [None, None] => return None,
        };
        let (axis, first_run, n) = (self.axis, self.first_run, self.targets.len());
        let n_runs = up.len().max(down.len());
        let said = format!(
            "positioning of {axis}: means {sides} of {n_runs} runs (run {first_run} on) of an external reference at {n} targets, {of_zero}"
        );
        let table = PositioningTable {
            at: Stamp::from_nanos(self.began.nanos()),
            axis,
            position: self.targets.to_vec(),
            deviation_up,
            deviation_down,
            n_runs: u32::try_from(n_runs).unwrap_or(u32::MAX),
            weight: 0.0,
            sequence: 0,
        };
        Some((table, said))
    }

    /// From what the deviations are counted: what is added to them, and its words.
    fn zero(&self) -> (f64, String) {
        let is_linear = self.axis.is_linear();
        if self.mean.abs() <= SAME_ZERO[usize::from(!is_linear)] {
            let said = format!(
                "as read (their mean, {}, is in them: pages of abbe report take it out)",
                self.in_words()
            );
            return (self.mean, said);
        }
        let said = format!(
            "counted from the mean of all, {}, which is taken out: the reference was zeroed at another place than the axis",
            self.in_words()
        );
        (0.0, said)
    }

    /// The mean of all deviations with its unit.
    fn in_words(&self) -> String {
        if self.axis.is_linear() {
            format!("{:+.3} um", self.mean * 1e3)
        } else {
            format!("{:+.2} arcsec", self.mean.to_degrees() * 3600.0)
        }
    }
}

/// Means over the runs at each of `n` targets from `zero`; none without a run or a target.
fn means(runs: &[Vec<f64>], n: usize, zero: f64) -> Option<Vec<f64>> {
    let all_have = runs.iter().all(|run| run.len() == n);
    if runs.is_empty() || n == 0 || !all_have {
        return None;
    }
    let mean = |k: usize| zero + runs.iter().map(|run| run[k]).sum::<f64>() / runs.len() as f64;
    Some((0..n).map(mean).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn laser(axis: Axis, reference: Reference, compensated: bool) -> LinearTest {
        LinearTest {
            kind: TestKind::Positioning,
            axis: Some(axis),
            name: axis.letter().to_owned(),
            first_run: 1,
            began: Stamp::from_nanos(0),
            runs: vec![1, 2],
            feed_mm_s: 100.0,
            reference,
            direction: Vector3::ith(axis.index(), 1.0),
            place_mm: None,
            targets_mm: vec![0.0, 42.0, 83.0],
            up_mm: vec![vec![0.001, 0.002, 0.003], vec![0.003, 0.004, 0.005]],
            down_mm: vec![vec![-0.001, -0.002, -0.003], vec![-0.003, -0.002, -0.001]],
            mean_mm: 0.0,
            outlying: Default::default(),
            left_out: vec![],
            compensated,
            longest_rest: None,
        }
    }

    /// Without a budget.
    fn made(test: &LinearTest) -> (PositioningTable, String) {
        let made = of_linear(&Tests::default(), None, test).unwrap();
        (made.table, made.said)
    }

    #[test]
    fn of_two_measurements_of_an_axis_the_last_is_taken_and_both_are_named() {
        let begun = |s: i64| LinearTest {
            began: Stamp::from_nanos(s * 1_000_000_000),
            ..laser(Axis::X, Reference::Length, false)
        };
        let tests = Tests {
            linear: vec![begun(1_767_600_000), begun(1_767_700_000)],
            ..Tests::default()
        };
        let mut measured = Measured::default();
        let told = tables(&tests, None, &mut measured);
        let said = told[Axis::X].as_ref().unwrap();
        let words = "the last of 2 measurements in the bag, begun at 2026-01-06 11:46:40 UTC; not in it: 2026-01-05 08:00:00 UTC";
        assert!(said.contains(words), "{said}");
        assert_eq!(measured.tables[Axis::X].as_ref().unwrap().at.nanos(), 0);
    }

    #[test]
    fn a_laser_gives_the_means_of_both_sides_where_there_is_no_table() {
        let tests = Tests {
            linear: vec![
                laser(Axis::X, Reference::Length, false),
                laser(Axis::Y, Reference::Scale, false),
                laser(Axis::Z, Reference::Length, true),
            ],
            ..Tests::default()
        };
        let mut measured = Measured::default();
        let told = tables(&tests, None, &mut measured);
        let x = measured.tables[Axis::X].clone().unwrap();
        assert_eq!(x.position, [0.0, 42.0, 83.0]);
        for (found, wanted) in [
            (&x.deviation_up, [0.002, 0.003, 0.004]),
            (&x.deviation_down, [-0.002, -0.002, -0.002]),
        ] {
            let mut pairs = found.iter().zip(wanted);
            assert!(pairs.all(|(a, b)| (a - b).abs() < 1e-15), "{found:?}");
        }
        let said = told[Axis::X].as_ref().unwrap();
        assert!(said.contains("means up and down of 2 runs"), "{said}");
        for axis in [Axis::Y, Axis::Z] {
            assert!(measured.tables[axis].is_none() && told[axis].is_none());
        }
        // A table that a node learned stays.
        let learned = measured.tables[Axis::X].clone();
        let other = Tests {
            linear: vec![laser(Axis::X, Reference::Length, false)],
            ..Tests::default()
        };
        assert!(tables(&other, None, &mut measured)[Axis::X].is_none());
        assert_eq!(measured.tables[Axis::X], learned);
    }

    #[test]
    fn deviations_are_as_read_where_both_zeros_are_one_and_from_their_mean_where_not() {
        let mut one = laser(Axis::X, Reference::Length, false);
        one.mean_mm = -0.0016;
        let (table, said) = made(&one);
        assert!((table.deviation_up[0] - 0.0004).abs() < 1e-12, "{table:?}");
        assert!(
            (table.deviation_down[2] + 0.0036).abs() < 1e-12,
            "{table:?}"
        );
        assert!(
            said.ends_with("as read (their mean, -1.600 um, is in them: pages of abbe report take it out), not corrected to 20 °C"),
            "{said}"
        );
        // The laser counts from the begin of the travel.
        one.mean_mm = 280.0;
        let (table, said) = made(&one);
        assert!((table.deviation_up[0] - 0.002).abs() < 1e-12, "{table:?}");
        assert!(
            said.contains("counted from the mean of all, +280000.000 um, which is taken out")
                && !said.contains("as read"),
            "{said}"
        );
    }

    #[test]
    fn of_one_side_both_are_that_side_and_it_is_said() {
        let mut one = laser(Axis::X, Reference::Length, false);
        one.down_mm = vec![];
        let (table, said) = made(&one);
        assert_eq!(table.deviation_up, table.deviation_down);
        assert!(said.contains("up alone"), "{said}");
    }
}
