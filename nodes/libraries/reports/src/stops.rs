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
//! [`trial`] shows such runs beside the one that the table was made of.

use anyhow::Result;
use machine::MachineFile;

use super::plot::{self, Plot, Trace};
use super::section::{Drawing, Rows, Section, head, um};
use super::svg::unsigned_zero;
use crate::evaluate::budget::NOT_STATED;
use crate::evaluate::correction::{BY_MOTOR, BY_OWN_SCALE, scale};
use crate::evaluate::stops::{Stop, Stops};

/// Of the stops of a direction each so-manyth is in the table that is tried.
pub const TABLE_EVERY: usize = 2;
/// Stops of one direction that a prediction needs.
const LEAST_STOPS: usize = 5;
/// Coverage factor of what is printed.
const COVERAGE: f64 = 2.0;
/// Deviations below which there is nothing to take out, µm.
const WORTH_UM: f64 = 0.5;

/// One part for all verifications along one axis; none without any. The machine file states the scale's certificate.
#[must_use]
pub fn section(all: &[Stops], machine: Option<&MachineFile>) -> Option<Section> {
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
            "± U (k = 2)",
            "mean up",
            "mean down",
            "slope / (µm/m)",
            "read by",
        ]),
        rows: all.iter().map(|stops| row(stops, machine)).collect(),
        note: "Sizes of the deviations; the slope is that of a straight line through all. U: of the scale at the stop farthest from zero, by its certificate in the machine file (scale_expanded_uncertainty_um, scale_expanded_uncertainty_um_per_m); its temperature is not in it."
            .to_owned(),
    });
    let predicted: Vec<_> = all
        .iter()
        .filter(|stops| !stops.compensated)
        .filter_map(|stops| Some((stops, predicted_um(stops)?)))
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
    section.figures = figures(&section.title, all, machine);
    Some(section)
}

/// Why the deviations are no figures of the standard.
const fn label(stops: &Stops) -> &'static str {
    if stops.by_scale {
        BY_OWN_SCALE
    } else {
        BY_MOTOR
    }
}

/// U (k = 2) of the scale at the stop that is farthest from zero, mm, where it was read and its certificate is stated.
fn expanded_mm(stops: &Stops, machine: Option<&MachineFile>) -> Option<f64> {
    let scale = scale(machine?, stops.axis).filter(|_| stops.by_scale)?;
    let sizes_mm = stops.stops.iter().map(|stop| stop.commanded_mm.abs());
    Some(COVERAGE * scale.standard_mm(sizes_mm.fold(0.0, f64::max)))
}

fn row(stops: &Stops, machine: Option<&MachineFile>) -> Vec<String> {
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
        expanded_mm(stops, machine).map_or_else(|| NOT_STATED.to_owned(), um),
        um(side(true)),
        um(side(false)),
        um_per_m(slope(&stops.stops)),
        label(stops).to_owned(),
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

/// A slope in µm/m, a zero without a sign.
fn um_per_m(slope: f64) -> String {
    unsigned_zero(format!("{:.1}", slope * 1e6))
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
fn predicted_um(stops: &Stops) -> Option<[f64; 3]> {
    let mut between: Vec<[f64; 3]> = Vec::new();
    for up in [true, false] {
        let side = stops.side(up);
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

/// Stops of one program under different tables of the control: (name, stops), the run without a table first.
///
/// # Errors
/// When the plot cannot be drawn.
pub fn trial(title: &str, runs: &[(&str, &Stops)]) -> Result<Section> {
    let table = runs.first().map(|(_, bare)| bare.table(TABLE_EVERY, 1.0));
    let in_table_mm = table.map_or_else(Vec::new, |table| table.position);
    let left: Vec<Left> = runs
        .iter()
        .map(|(_, stops)| Left::of(stops, &in_table_mm))
        .collect();
    let bare_mm = left.first().map_or(f64::NAN, |bare| bare.rms_mm);
    let rows = runs.iter().zip(&left).map(|((name, stops), left)| {
        vec![
            (*name).to_owned(),
            left.n.to_string(),
            um(left.max_mm),
            um(left.p95_mm),
            um(left.p95_between_mm),
            um(left.rms_mm),
            format!("{:.3}", left.rms_mm / bare_mm),
            um_per_m(slope(&stops.stops)),
        ]
    });
    let mut section = Section::new(title);
    section.tables.push(Rows {
        head: head(&[
            "measured / µm",
            "stops",
            "max",
            "p95",
            "p95 between the table's points",
            "rms",
            "rms, share of the first",
            "slope / (µm/m)",
        ]),
        rows: rows.collect(),
        note: "The control was started anew for each row. The table is made of every second stop of the first run, up and down apart; the stops between were in no table.".to_owned(),
    });
    section.drawings.push(Drawing {
        svg: plot::svg(&Plot {
            x: "commanded position / mm".to_owned(),
            y: "position minus command / µm".to_owned(),
            traces: runs
                .iter()
                .flat_map(|(name, stops)| traces(name, stops))
                .collect(),
        })?,
        caption: "Deviation at every stop.".to_owned(),
    });
    let figures = runs.iter().zip(&left).map(|((name, _), left)| {
        serde_json::json!({
            "run": name,
            "stops": left.n,
            "max_mm": left.max_mm,
            "p95_mm": left.p95_mm,
            "p95_between_mm": left.p95_between_mm,
            "rms_mm": left.rms_mm,
        })
    });
    section.figures = figures.collect::<Vec<_>>().into();
    Ok(section)
}

/// Deviations that are left at the stops of one run, mm.
struct Left {
    n: usize,
    max_mm: f64,
    p95_mm: f64,
    /// At the stops that no table was made of.
    p95_between_mm: f64,
    rms_mm: f64,
}

impl Left {
    fn of(stops: &Stops, in_table_mm: &[f64]) -> Self {
        let sides = [true, false].map(|up| stops.side(up));
        let all = || sides.iter().flatten().map(|stop| stop.deviation_mm);
        let n = all().count();
        let squares: f64 = all().map(|deviation| deviation * deviation).sum();
        Self {
            n,
            max_mm: all().map(f64::abs).fold(0.0, f64::max),
            p95_mm: p95(all()),
            p95_between_mm: p95(between(&sides, in_table_mm)),
            rms_mm: (squares / n as f64).sqrt(),
        }
    }
}

/// Deviations at the stops that are in no table, mm.
fn between(sides: &[Vec<Stop>; 2], in_table_mm: &[f64]) -> impl Iterator<Item = f64> {
    let is_in = move |stop: &&Stop| in_table_mm.iter().any(|at_mm| stop.is_at(*at_mm));
    let left = sides.iter().flatten().filter(move |stop| !is_in(stop));
    left.map(|stop| stop.deviation_mm)
}

fn traces(name: &str, stops: &Stops) -> [Trace; 2] {
    [(true, "up"), (false, "down")].map(|(up, direction)| Trace {
        name: format!("{name}, {direction}"),
        points: stops
            .side(up)
            .iter()
            .map(|stop| (stop.commanded_mm, stop.deviation_mm * 1e3))
            .collect(),
        marks: false,
    })
}

fn figures(title: &str, all: &[Stops], machine: Option<&MachineFile>) -> serde_json::Value {
    let one = |stops: &Stops| {
        let deviations = || stops.stops.iter().map(|stop| stop.deviation_mm);
        serde_json::json!({
            "run": stops.run,
            "axis": stops.axis.to_string(),
            "by_scale": stops.by_scale,
            "label": label(stops),
            "scale_expanded_uncertainty_mm": expanded_mm(stops, machine),
            "compensated": stops.compensated,
            "stops": stops.stops.len(),
            "p95_mm": p95(deviations()),
            "slope": slope(&stops.stops),
            "predicted_p95_um": predicted_um(stops),
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
        let [before, after, wrong] = predicted_um(&long).unwrap();
        assert!(after < 1e-9, "{after}");
        assert!((wrong - 2.0 * before).abs() < 1e-9 && before > 10.0);
        assert!((slope(&long.stops) - 1e-4).abs() < 1e-12);
        assert_eq!([um_per_m(-1e-9), um_per_m(-1e-6)], ["0.0", "-1.0"]);
        let section = section(&[long], None).unwrap();
        assert!(
            section.terminal().contains("100.0"),
            "{}",
            section.terminal()
        );
        assert!(super::section(&[], None).is_none());
    }

    #[test]
    fn what_the_machines_own_scale_read_has_its_label_and_the_scales_uncertainty() {
        // scale_expanded_uncertainty_um: 1.0 and scale_expanded_uncertainty_um_per_m: 3.0: by hand 1.45 µm at 150 mm.
        let machine = include_str!("../../../../launch_configs/dual_loop/machine.yaml");
        let machine = MachineFile::parse(machine, "machine.yaml").unwrap();
        let read = |by_scale| Stops {
            by_scale,
            ..stops(|p, _| 1e-5 * p)
        };
        let section = section(&[read(true), read(false)], Some(&machine)).unwrap();
        let rows = &section.tables[0].rows;
        assert_eq!(
            (rows[0][4].as_str(), rows[1][4].as_str()),
            ("1.45", NOT_STATED)
        );
        assert_eq!(
            (rows[0][8].as_str(), rows[1][8].as_str()),
            (BY_OWN_SCALE, BY_MOTOR)
        );
        let found = &section.figures["stops"];
        assert_eq!(found[0]["label"], BY_OWN_SCALE);
        let u_mm = found[0]["scale_expanded_uncertainty_mm"].as_f64().unwrap();
        assert!((u_mm - 1.45e-3).abs() < 1e-12, "{u_mm}");
        assert!(found[1]["scale_expanded_uncertainty_mm"].is_null());
    }

    #[test]
    fn a_table_of_stops_keeps_directions_apart_and_leaves_out_what_one_of_them_lacks() {
        let mut bare = stops(|p, up| 1e-4 * p + if up { -0.004 } else { 0.004 });
        // The way home ends at a place that was stopped at before.
        bare.stops.push(Stop {
            commanded_mm: 0.0,
            deviation_mm: 9.0,
            up: true,
        });
        bare.stops
            .retain(|stop| stop.up || stop.commanded_mm < 140.0);
        let table = bare.table(2, -1.0);
        assert_eq!(table.position.len(), 10);
        assert_eq!(table.position[1].to_bits(), (-120.0_f64).to_bits());
        assert!((table.deviation_up[5] - 0.004).abs() < 1e-15);
        assert!((table.deviation_down[1] - 0.008).abs() < 1e-15);
    }

    #[test]
    fn a_trial_shows_what_is_left_beside_what_was_there() {
        let bare = stops(|p, up| 1e-4 * p + if up { -0.004 } else { 0.004 });
        let left = stops(|p, _| 1e-6 * p);
        let twice = stops(|p, up| 2e-4 * p + if up { -0.008 } else { 0.008 });
        let runs = [("without", &bare), ("with", &left), ("turned", &twice)];
        let section = trial("Tables", &runs).unwrap();
        let ratio = |row: usize| section.tables[0].rows[row][6].parse::<f64>().unwrap();
        assert!(ratio(1) < 0.02 && (ratio(2) - 2.0).abs() < 1e-9);
        assert_eq!(section.figures[0]["stops"], 42);
        assert_eq!(section.drawings.len(), 1);
    }
}
