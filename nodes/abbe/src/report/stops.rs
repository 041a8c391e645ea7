//! The stops of verifications along one axis, and what a table made of every second stop would leave of the others.
//!
//! # Model
//!
//! With d_i the deviation at stop i, t the straight lines through every second stop of the same direction:
//!
//! ```text
//!   left_i = d_i − t(p_i),   with the wrong sign: d_i + t(p_i),   i a stop between          (1)
//! ```
//!
//! (1) is a prediction: what an exported table does on the control is seen when the scenario is run with it.

use super::section::{Rows, Section, head, um};
use crate::evaluate::stops::{Stop, Stops};

/// Stops of one direction that a prediction needs.
const LEAST_STOPS: usize = 5;
/// Deviations below which there is nothing to take out, µm.
const WORTH_UM: f64 = 0.5;

/// One part for all verifications along one axis; none without any.
#[must_use]
pub fn section(all: &[Stops]) -> Option<Section> {
    if all.is_empty() {
        return None;
    }
    let mut section = Section::new("Stops of verifications along one axis: position minus command");
    section.tables.push(Rows {
        head: head(&[
            "run / µm",
            "stops",
            "p95",
            "max",
            "mean up",
            "mean down",
            "slope / (µm/m)",
            "read by",
        ]),
        rows: all.iter().map(row).collect(),
        note: "Sizes of the deviations; the slope is that of a straight line through all."
            .to_owned(),
    });
    let predicted: Vec<_> = all
        .iter()
        .filter(|stops| !stops.compensated)
        .filter_map(|stops| Some((stops, predicted_um(&stops.stops)?)))
        .filter(|(_, [before_um, ..])| *before_um > WORTH_UM)
        .collect();
    if !predicted.is_empty() {
        section.tables.push(Rows {
            head: head(&["p95 at every other stop / µm", "as it is", "with a table", "with its sign turned"]),
            rows: predicted
                .iter()
                .map(|(stops, values)| {
                    let values = values.map(|value| format!("{value:.2}"));
                    std::iter::once(format!("run {}", stops.run)).chain(values).collect()
                })
                .collect(),
            note: "Predicted: a table of every second stop, straight lines between. It adds minus the deviation to the command; with the wrong sign errors double.".to_owned(),
        });
    }
    section.figures = figures(&section.title, all);
    Some(section)
}

fn row(stops: &Stops) -> Vec<String> {
    let deviations = || stops.stops.iter().map(|stop| stop.deviation_mm);
    let side = |up: bool| {
        let of = stops.stops.iter().filter(|stop| stop.up == up);
        mean(of.map(|stop| stop.deviation_mm))
    };
    let state = if stops.compensated {
        ", compensated"
    } else {
        ""
    };
    vec![
        format!("{} {}{state}", stops.run, stops.axis),
        stops.stops.len().to_string(),
        um(p95(deviations())),
        um(deviations().map(f64::abs).fold(0.0, f64::max)),
        um(side(true)),
        um(side(false)),
        format!("{:.1}", slope(&stops.stops) * 1e6),
        if stops.by_scale {
            "linear scale"
        } else {
            "control"
        }
        .to_owned(),
    ]
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let all: Vec<f64> = values.collect();
    all.iter().sum::<f64>() / all.len() as f64
}

fn p95(values: impl Iterator<Item = f64>) -> f64 {
    let mut sizes: Vec<f64> = values.map(f64::abs).collect();
    sizes.sort_by(f64::total_cmp);
    let place = (0.95 * sizes.len() as f64).ceil() as usize;
    sizes
        .get(place.saturating_sub(1))
        .copied()
        .unwrap_or(f64::NAN)
}

/// Of a straight line through all stops, mm/mm.
fn slope(stops: &[Stop]) -> f64 {
    let at = mean(stops.iter().map(|stop| stop.commanded_mm));
    let with = |value: fn(&Stop) -> f64| -> f64 {
        stops.iter().map(|s| (s.commanded_mm - at) * value(s)).sum()
    };
    with(|s| s.deviation_mm) / with(|s| s.commanded_mm)
}

/// (1): p95 at the stops between as they are, with the table, and with its sign turned, µm.
fn predicted_um(stops: &[Stop]) -> Option<[f64; 3]> {
    let mut between: Vec<[f64; 3]> = Vec::new();
    for up in [true, false] {
        let mut side: Vec<&Stop> = stops.iter().filter(|stop| stop.up == up).collect();
        side.sort_by(|a, b| a.commanded_mm.total_cmp(&b.commanded_mm));
        if side.len() < LEAST_STOPS {
            return None;
        }
        between.extend(side.windows(3).step_by(2).filter_map(|three| match three {
            [a, b, c] => {
                let share = (b.commanded_mm - a.commanded_mm) / (c.commanded_mm - a.commanded_mm);
                let table = a.deviation_mm + share * (c.deviation_mm - a.deviation_mm);
                let d = b.deviation_mm;
                Some([d, d - table, d + table])
            }
            _ => None,
        }));
    }
    Some([0, 1, 2].map(|k| p95(between.iter().map(|values| values[k])) * 1e3))
}

fn figures(title: &str, all: &[Stops]) -> serde_json::Value {
    let one = |stops: &Stops| {
        let deviations = || stops.stops.iter().map(|stop| stop.deviation_mm);
        serde_json::json!({
            "run": stops.run,
            "axis": stops.axis.to_string(),
            "by_scale": stops.by_scale,
            "compensated": stops.compensated,
            "stops": stops.stops.len(),
            "p95_mm": p95(deviations()),
            "slope": slope(&stops.stops),
            "predicted_p95_um": predicted_um(&stops.stops),
        })
    };
    serde_json::json!({ "test": title, "stops": all.iter().map(one).collect::<Vec<_>>() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use metrology::Axis;

    fn stops(error: impl Fn(f64, bool) -> f64) -> Stops {
        let all = [true, false]
            .into_iter()
            .flat_map(|up| (0..=20).map(move |k| (f64::from(k) * 15.0 - 150.0, up)));
        Stops {
            run: 1,
            axis: Axis::X,
            by_scale: false,
            compensated: false,
            stops: all
                .map(|(commanded_mm, up)| Stop {
                    commanded_mm,
                    deviation_mm: error(commanded_mm, up),
                    up,
                })
                .collect(),
        }
    }

    #[test]
    fn eq1_a_table_takes_out_lead_and_lost_motion_and_doubles_them_with_the_wrong_sign() {
        let long = stops(|p, up| 1e-4 * p + if up { -0.004 } else { 0.004 });
        let [before, after, wrong] = predicted_um(&long.stops).unwrap();
        assert!(after < 1e-9, "{after}");
        assert!((wrong - 2.0 * before).abs() < 1e-9 && before > 10.0);
        assert!((slope(&long.stops) - 1e-4).abs() < 1e-12);
        let section = section(&[long]).unwrap();
        assert!(
            section.terminal().contains("100.0"),
            "{}",
            section.terminal()
        );
        assert!(super::section(&[]).is_none());
    }
}
