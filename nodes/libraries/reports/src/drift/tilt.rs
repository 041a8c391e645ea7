//! How a machine tilts while it warms: the angle between two sensors at two heights, ISO 230-3.
//!
//! Two sensors along X give a turn about Y, two along Y one about X: equation (4) of [`iso230::thermal`]. Readings count where
//! both sensors were read at once.

use anyhow::Result;
use iso230::thermal::{self, AngularDrift, DriftChannel, DriftTest};
use iso230::{ExpandedAngle, ExpandedAngularRate, Iso230Error};
use metrology::Axis;
use metrology::number::number;
use metrology::stamp::{Host, Stamp};
use serde::Serialize;
use serde_json::json;

use super::figures::{AFTER_H, FIGURE_NAMES, LONGEST_PAUSE_S, rate_window_s, scatter_mm};
use super::logs::{note_of, reader, time_axis};
use super::{HOUR_S, in_words};
use crate::evaluate::budget::{Budget, unstate};
use crate::evaluate::drift::{Drift, DriftLog};
use crate::plot::{self, Plot, Trace};
use crate::section::{Drawing, Rows, Section, head};

/// Least distance of two heights, mm: a tilt by nearer sensors is their noise, or the heights are in metres.
const LEAST_APART_MM: f64 = 5.0;

/// One angle, evaluated.
#[derive(Debug, Serialize)]
struct Figures {
    /// Drift after one hour; `None`: not recorded so long.
    after_1_h: Option<ExpandedAngle>,
    /// Drift after three hours; `None`: not recorded so long.
    after_3_h: Option<ExpandedAngle>,
    /// Greatest minus least angle of the whole test.
    range: ExpandedAngle,
    /// Slope of the line through the end of the test.
    final_rate: ExpandedAngularRate,
    /// Length of that end, s.
    rate_window_s: f64,
}

/// Two sensors of one run along one axis, the lower one first.
struct Pair<'a> {
    lower: &'a DriftLog,
    upper: &'a DriftLog,
    /// Times at which both were read.
    at: Vec<Stamp<Host>>,
    /// What both read then, mm.
    values_mm: [Vec<f64>; 2],
}

/// One part for every axis with two heights.
///
/// # Errors
/// When a plot cannot be drawn.
pub(super) fn sections(drift: &Drift, budget: Option<&Budget>) -> Result<Vec<Section>> {
    pairs(&drift.logs)
        .iter()
        .map(|pair| section(pair, budget))
        .collect()
}

/// Every two logs of one run along X or Y with heights.
fn pairs(logs: &[DriftLog]) -> Vec<Pair<'_>> {
    let mut found = Vec::new();
    for (k, one) in logs.iter().enumerate() {
        let Some(height_mm) = one
            .height_mm
            .filter(|_| matches!(one.axis, Axis::X | Axis::Y))
        else {
            continue;
        };
        let is_other = |log: &&DriftLog| log.run == one.run && log.axis == one.axis;
        let other = logs[k + 1..]
            .iter()
            .filter(is_other)
            .find_map(|log| Some((log, log.height_mm?)));
        if let Some((other, other_mm)) = other {
            let (lower, upper) = if height_mm < other_mm {
                (one, other)
            } else {
                (other, one)
            };
            found.push(Pair::new(lower, upper));
        }
    }
    found
}

impl<'a> Pair<'a> {
    fn new(lower: &'a DriftLog, upper: &'a DriftLog) -> Self {
        let (mut at, mut values_mm) = (Vec::new(), [Vec::new(), Vec::new()]);
        let mut others = upper.displacements.points.iter().peekable();
        for (instant, low_mm) in &lower.displacements.points {
            while others.next_if(|(other, _)| other < instant).is_some() {}
            if let Some((_, high_mm)) = others.next_if(|(other, _)| other == instant) {
                at.push(*instant);
                values_mm[0].push(*low_mm);
                values_mm[1].push(*high_mm);
            }
        }
        Self {
            lower,
            upper,
            at,
            values_mm,
        }
    }

    /// Readings of one sensor alone.
    fn left_out(&self) -> usize {
        let n = |log: &DriftLog| log.displacements.points.len();
        n(self.lower) + n(self.upper) - 2 * self.at.len()
    }

    fn heights_mm(&self) -> [f64; 2] {
        [self.lower, self.upper].map(|log| log.height_mm.unwrap_or(f64::NAN))
    }

    /// Since the first reading, s.
    fn times_s(&self) -> Vec<f64> {
        let first = self.at.first().copied();
        let since = |at: &Stamp<Host>| first.map_or(0.0, |first| (*at - first).as_secs_f64());
        self.at.iter().map(since).collect()
    }

    fn check_heights(&self) -> Result<(), String> {
        let [low_mm, high_mm] = self.heights_mm();
        if high_mm - low_mm < LEAST_APART_MM {
            return Err(format!(
                "heights_mm = [{}, {}]: at least {LEAST_APART_MM} mm apart; state heights in mm",
                number(low_mm),
                number(high_mm)
            ));
        }
        Ok(())
    }

    fn figures(&self, budget: Option<&Budget>) -> Result<Figures, String> {
        self.check_heights()?;
        if self.lower.zeroed_anew || self.upper.zeroed_anew {
            return Err("one of the two instruments was zeroed anew while it went on".to_owned());
        }
        let times_s = self.times_s();
        let recorded_s = times_s.last().copied().unwrap_or(0.0);
        let squares = self.values_mm.iter().map(|values| {
            let points: Vec<_> = times_s
                .iter()
                .copied()
                .zip(values.iter().copied())
                .collect();
            scatter_mm(&points).powi(2)
        });
        let reader = reader(budget, (squares.sum::<f64>() / 2.0).sqrt());
        let rate_window_s = rate_window_s(&times_s);
        let channels = self.heights_mm().into_iter().zip(&self.values_mm);
        let channels: Vec<DriftChannel> = channels
            .map(|(height_mm, values_mm)| DriftChannel {
                axis: self.lower.axis,
                height_mm,
                displacements_mm: values_mm.clone(),
            })
            .collect();
        let evaluated = |drift_after_s: f64| -> Result<AngularDrift, Iso230Error> {
            let test = DriftTest {
                cause: self.lower.cause,
                times_s: times_s.clone(),
                channels: channels.clone(),
                drift_after_s,
                rate_window_s,
                longest_gap_s: LONGEST_PAUSE_S,
            };
            let result = thermal::evaluate(&test, &reader.budget(0))?;
            result
                .angles
                .first()
                .copied()
                .ok_or(Iso230Error::TooFewPoints {
                    place: "angles",
                    n: 0,
                    least: 1,
                })
        };
        let in_words = |error: Iso230Error| error.to_string();
        let whole = evaluated(recorded_s.max(f64::MIN_POSITIVE)).map_err(in_words)?;
        let after = |hours: f64| {
            let found = (recorded_s >= hours * HOUR_S).then(|| evaluated(hours * HOUR_S));
            found.transpose().map(|one| one.map(|one| one.drift_after))
        };
        let [one, three] = AFTER_H;
        Ok(Figures {
            after_1_h: after(one).map_err(in_words)?,
            after_3_h: after(three).map_err(in_words)?,
            range: whole.range,
            final_rate: whole.final_rate,
            rate_window_s,
        })
    }
}

/// About which axis a displacement along one turns, by the right-hand rule of the module's head.
const fn about(axis: Axis) -> Axis {
    match axis {
        Axis::X => Axis::B,
        _ => Axis::A,
    }
}

fn section(pair: &Pair, budget: Option<&Budget>) -> Result<Section> {
    let [low_mm, high_mm] = pair.heights_mm();
    let turn = about(pair.lower.axis);
    let mut section = Section::new(format!(
        "Tilt about {turn}, run {}, ISO 230-3: {}",
        pair.lower.run,
        in_words(pair.lower.cause)
    ));
    section.lines.push(format!(
        "By displacements along {} at heights {low_mm:.1} and {high_mm:.1} mm, {} readings of both at once.",
        pair.lower.axis,
        pair.at.len()
    ));
    let left_out = pair.left_out();
    if left_out > 0 {
        section.warn(
            "Readings of one height alone",
            format!("{left_out} readings left out: the other sensor was not read then."),
        );
    }
    let found = pair.figures(budget);
    if let Ok(figures) = &found {
        let cells = figures.cells(budget.is_some());
        section
            .answers
            .push(format!("range {} µrad about {turn}.", cells[2]));
        section.tables.push(table(turn, &cells, budget));
        section.drawings = vec![drawing(pair, turn)?];
    }
    section.figures = json!({
        "test": section.title,
        "iso230_3_tilt": {
            "run": pair.lower.run,
            "about": turn.letter(),
            "heights_mm": [low_mm, high_mm],
            "cause": pair.lower.cause,
            "readings": pair.at.len(),
            "left_out": left_out,
            "figures": found.as_ref().ok(),
        },
    });
    if budget.is_none() {
        unstate(&mut section.figures);
    }
    if let Err(why) = found {
        section.not_evaluated(why);
    }
    Ok(section)
}

impl Figures {
    fn cells(&self, stated: bool) -> [String; 4] {
        let both = |value: f64, expanded: f64| {
            if stated {
                format!("{value:.2} ± {expanded:.2}")
            } else {
                format!("{value:.2}")
            }
        };
        let urad = |angle: &ExpandedAngle| {
            both(angle.value_rad * 1e6, angle.expanded_uncertainty_rad * 1e6)
        };
        let or_dash =
            |angle: &Option<ExpandedAngle>| angle.as_ref().map_or_else(|| "—".to_owned(), urad);
        let per_h = HOUR_S * 1e6;
        let rate = self.final_rate;
        [
            or_dash(&self.after_1_h),
            or_dash(&self.after_3_h),
            urad(&self.range),
            both(
                rate.value_rad_s * per_h,
                rate.expanded_uncertainty_rad_s * per_h,
            ),
        ]
    }
}

fn table(turn: Axis, cells: &[String; 4], budget: Option<&Budget>) -> Rows {
    let names = FIGURE_NAMES.map(|name| name.replace("µm", "µrad"));
    let names: Vec<&str> = std::iter::once("tilt about")
        .chain(names.iter().map(String::as_str))
        .collect();
    let first = std::iter::once(turn.letter().to_owned());
    Rows {
        head: head(&names),
        rows: vec![first.chain(cells.iter().cloned()).collect()],
        note: format!(
            "Difference of both displacements over the distance of the heights, by the right-hand rule; what both sensors' holder shifts leaves it. {}",
            note_of(budget)
        ),
    }
}

fn drawing(pair: &Pair, turn: Axis) -> Result<Drawing> {
    let [low_mm, high_mm] = pair.heights_mm();
    let sign = if turn == Axis::B { 1.0 } else { -1.0 };
    let [low, high] = &pair.values_mm;
    let angles = low
        .iter()
        .zip(high)
        .map(|(l, h)| sign * (h - l) / (high_mm - low_mm) * 1e6);
    let angles: Vec<f64> = angles.collect();
    let first = angles.first().copied().unwrap_or(0.0);
    let times_s = pair.times_s();
    let (time, unit_s) = time_axis(times_s.last().copied().unwrap_or(0.0));
    let times = times_s.into_iter().map(|s| s / unit_s);
    let points = times.zip(angles.iter().map(|angle| angle - first));
    Ok(Drawing {
        svg: plot::svg(&Plot {
            x: time,
            y: format!("tilt about {turn} / µrad"),
            traces: vec![Trace {
                name: turn.letter().to_owned(),
                points: points.collect(),
                marks: false,
            }],
        })?,
        caption: "Tilt since the first reading.".to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::evaluate::drift::Series;
    use iso230::thermal::DriftCause;

    const BUDGET: &str = include_str!("../../../../../launch_configs/full_closed/budget.yaml");

    /// Readings every 10 minutes for three hours; `mm` by the time in hours.
    fn log(axis: Axis, height_mm: f64, mm: impl Fn(f64) -> f64) -> DriftLog {
        let mut displacements = Series::default();
        for k in 0..=18 {
            let at = Stamp::from_nanos(600_000_000_000 * k);
            displacements.push(at, mm(k as f64 / 6.0));
        }
        DriftLog {
            run: 4,
            axis,
            cause: DriftCause::Spindle,
            height_mm: Some(height_mm),
            displacements,
            zeroed_anew: false,
        }
    }

    fn drift(logs: Vec<DriftLog>) -> Drift {
        Drift {
            logs,
            ..Drift::default()
        }
    }

    fn budget() -> Budget {
        Budget::read(BUDGET, Path::new("budget.yaml")).unwrap()
    }

    #[test]
    fn heights_in_metres_give_no_tilt() {
        for (low_mm, high_mm) in [(0.110, 0.260), (110.0, 110.001), (110.0, 114.9)] {
            let logs = vec![
                log(Axis::X, low_mm, |h| 1.5e-3 * h),
                log(Axis::X, high_mm, |h| 3e-3 * h),
            ];
            let section = sections(&drift(logs), None).unwrap().remove(0);
            let said = section.terminal();
            assert!(said.contains("at least 5 mm apart"), "{said}");
        }
    }

    #[test]
    fn two_heights_make_a_tilt_by_the_right_hand_rule_by_hand() {
        // 3 µm/h at the upper of two heights 150 mm apart, 1.5 µm/h at the lower: 10 µrad/h; after 1 h 10, in all 30 µrad.
        for (axis, turn, sign) in [(Axis::X, "B", 1.0), (Axis::Y, "A", -1.0)] {
            let [low, high] = [(110.0, 1.5e-3), (260.0, 3e-3)]
                .map(|(mm, per_h)| log(axis, mm, move |h| per_h * h));
            for logs in [vec![low.clone(), high.clone()], vec![high, low]] {
                let found = sections(&drift(logs), Some(&budget())).unwrap();
                assert_eq!(found.len(), 1);
                let figures = &found[0].figures["iso230_3_tilt"];
                assert_eq!(figures["about"], turn);
                assert_eq!(figures["heights_mm"], json!([110.0, 260.0]));
                let near = |value: &serde_json::Value, by_hand: f64, name: &str| {
                    let value = value.as_f64().unwrap();
                    assert!(
                        (value - by_hand).abs() < 1e-9 * by_hand.abs(),
                        "{name}: {value} {by_hand}"
                    );
                };
                let of = &figures["figures"];
                near(&of["after_1_h"]["value_rad"], sign * 10e-6, "after 1 h");
                near(&of["after_3_h"]["value_rad"], sign * 30e-6, "after 3 h");
                near(&of["range"]["value_rad"], 30e-6, "range");
                near(
                    &of["final_rate"]["value_rad_s"],
                    sign * 10e-6 / 3600.0,
                    "rate",
                );
                // Four readings with 0.05 µm each over 150 mm, k = 2.
                near(
                    &of["range"]["expanded_uncertainty_rad"],
                    2.0 * 2.0 * 0.05e-3 / 150.0,
                    "U",
                );
                let row = &found[0].tables[0].rows[0];
                assert_eq!(row[3], "30.00 ± 1.33");
                assert_eq!(found[0].drawings.len(), 1);
            }
        }
    }

    #[test]
    fn one_height_several_axes_or_z_make_no_tilt_and_a_missing_reading_is_counted() {
        let still = |axis, mm| log(axis, mm, |_| 0.0);
        let mut without = still(Axis::X, 260.0);
        without.height_mm = None;
        for logs in [
            vec![still(Axis::X, 110.0)],
            vec![still(Axis::X, 110.0), still(Axis::Y, 260.0)],
            vec![still(Axis::Z, 110.0), still(Axis::Z, 260.0)],
            vec![still(Axis::X, 110.0), without],
        ] {
            assert!(sections(&drift(logs), None).unwrap().is_empty());
        }
        let mut high = still(Axis::X, 260.0);
        high.displacements.points.remove(5);
        let found = sections(&drift(vec![still(Axis::X, 110.0), high]), None).unwrap();
        assert_eq!(found[0].figures["iso230_3_tilt"]["left_out"], 1);
        let range = &found[0].figures["iso230_3_tilt"]["figures"]["range"];
        assert!(range["expanded_uncertainty_rad"].is_null(), "{range}");
        let mut anew = still(Axis::X, 260.0);
        anew.zeroed_anew = true;
        let found = sections(&drift(vec![still(Axis::X, 110.0), anew]), None).unwrap();
        assert!(found[0].figures["iso230_3_tilt"]["figures"].is_null());
    }
}
