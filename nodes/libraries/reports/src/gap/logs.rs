//! Logs: which thermometer a displacement goes with, and its drift over time.

use anyhow::Result;
use gap_diagnosis::GoesWith;
use gap_diagnosis::figures::Drift;
use gap_diagnosis::report::{Follows, GapReport};
use maud::{Markup, html};

use super::three;
use crate::page;
use crate::plot::{self, Plot, Trace};
use crate::screen::Tile;
use crate::section::{Drawing, Section};

/// A share above this is not told from all.
const ALL_BUT: f64 = 0.9995;
/// Hours below which a drift is drawn over minutes.
const SHORT_H: f64 = 1.0;

/// A sentence for each channel that goes with thermometers.
pub(super) fn sentences(report: &GapReport) -> Vec<String> {
    report.follows.iter().map(sentence).collect()
}

fn sentence(follows: &Follows) -> String {
    let of = axis(&follows.channel);
    let terms: Vec<String> = follows.thermometers.iter().map(term).collect();
    let (thermometers, explains) = match terms.len() {
        1 => ("thermometer", "explains"),
        _ => ("thermometers", "together they explain"),
    };
    format!(
        "{of} goes with {thermometers} {}; {explains} {} of the drift on held-out time.",
        terms.join(", and "),
        percent(follows.share)
    )
}

/// The channel that goes with thermometers most, as a tile.
pub(super) fn tile(report: &GapReport) -> Option<Tile> {
    let all = report.follows.iter();
    let most = all.max_by(|a, b| a.share.total_cmp(&b.share))?;
    let largest = most.thermometers.iter();
    let largest = largest.max_by(|a, b| a.um_per_k.abs().total_cmp(&b.um_per_k.abs()))?;
    let more = match most.thermometers.len() {
        1 => format!("{}, {}", largest.thermometer, lag(largest)),
        n => format!(
            "{}, {}, and {} more",
            largest.thermometer,
            lag(largest),
            n - 1
        ),
    };
    let more = format!(
        "{more}; explains {} of the drift on held-out time",
        percent(most.share)
    );
    let name = format!("{} goes with a thermometer", axis(&most.channel));
    Some(Tile::new(&name, size(largest), more))
}

/// The axis that a channel reads, or the channel.
fn axis(channel: &str) -> &str {
    channel.strip_prefix("length.").unwrap_or(channel)
}

fn term(one: &GoesWith) -> String {
    format!("{}: {}, {}", one.thermometer, size(one), lag(one))
}

fn size(one: &GoesWith) -> String {
    let sign = if one.um_per_k < 0.0 { "" } else { "+" };
    format!("{sign}{} µm/K", three(one.um_per_k))
}

fn lag(one: &GoesWith) -> String {
    match one.lag_min {
        lag_min if lag_min >= 10.0 => format!("lag {lag_min:.0} min"),
        lag_min if lag_min > 0.0 => format!("lag {lag_min:.1} min"),
        _ => "no lag".to_owned(),
    }
}

fn percent(share: f64) -> String {
    match share {
        share if share > ALL_BUT => "more than 99.9 %".to_owned(),
        share if share > 0.99 => format!("{:.1} %", 100.0 * share),
        share => format!("{:.0} %", 100.0 * share.max(0.0)),
    }
}

/// A part for each drift: the displacement with its model, and the temperatures below.
///
/// # Errors
/// When a plot cannot be drawn.
pub(super) fn sections(report: &GapReport, drifts: &[Drift]) -> Result<Vec<Section>> {
    let of = |drift: &Drift| -> Result<Section> {
        let mut section = Section::new(format!("Drift of {} over time", axis(&drift.channel)));
        let own = report
            .follows
            .iter()
            .find(|own| own.channel == drift.channel);
        section.lines.extend(own.map(sentence));
        section.drawings.push(displacement(drift)?);
        section.drawings.extend(temperatures(drift)?);
        Ok(section)
    };
    drifts.iter().map(of).collect()
}

/// The drawings of a part, unfolded.
pub(super) fn unfolded(section: &Section) -> Markup {
    let drawings = section.drawings.iter();
    let drawings = drawings.map(|drawing| page::figure(&drawing.svg, &drawing.caption));
    let content = html! { div.traces { @for drawing in drawings { (drawing) } } };
    page::fold(&section.title, None, true, &content)
}

/// Label of the axis of time, and its units in an hour.
fn time_axis(drift: &Drift) -> (String, f64) {
    let last_h = drift.time_h.last().copied().unwrap_or(0.0);
    let (unit, per_h) = if last_h < SHORT_H {
        ("min", 60.0)
    } else {
        ("h", 1.0)
    };
    (format!("time of the session / {unit}"), per_h)
}

fn trace(drift: &Drift, name: &str, values: &[f64]) -> Trace {
    let (_, per_h) = time_axis(drift);
    let at = drift.time_h.iter().map(|h| h * per_h);
    Trace {
        name: name.to_owned(),
        points: at.zip(values.iter().copied()).collect(),
        marks: false,
    }
}

fn displacement(drift: &Drift) -> Result<Drawing> {
    let model = if drift.is_by_thermometers {
        "by thermometers"
    } else {
        "by the named effects"
    };
    let mut traces = vec![trace(drift, "read", &drift.deviation_um)];
    if !drift.model_um.is_empty() {
        traces.push(trace(drift, model, &drift.model_um));
    }
    Ok(Drawing {
        svg: plot::svg(&Plot {
            x: time_axis(drift).0,
            y: format!("displacement along {} / µm", axis(&drift.channel)),
            traces,
        })?,
        caption: "Machine minus simulator; readings under each zero lie about the model."
            .to_owned(),
    })
}

fn temperatures(drift: &Drift) -> Result<Option<Drawing>> {
    let all = drift.temperatures.iter();
    let traces: Vec<Trace> = all
        .map(|own| trace(drift, &own.thermometer, &own.degc))
        .collect();
    if traces.is_empty() {
        return Ok(None);
    }
    Ok(Some(Drawing {
        svg: plot::svg(&Plot {
            x: time_axis(drift).0,
            y: "temperature / °C".to_owned(),
            traces,
        })?,
        caption: "Temperatures meanwhile.".to_owned(),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn goes_with(thermometer: &str, um_per_k: f64, lag_min: f64) -> GoesWith {
        GoesWith {
            thermometer: thermometer.to_owned(),
            um_per_k,
            standard_error_um_per_k: 0.01,
            lag_min,
        }
    }

    #[test]
    fn a_thermometer_has_its_size_its_lag_and_its_share() {
        let one = Follows {
            channel: "length.Z".to_owned(),
            share: 0.972,
            thermometers: vec![goes_with("spindle", 3.0, 12.2)],
        };
        assert_eq!(
            sentence(&one),
            "Z goes with thermometer spindle: +3.00 µm/K, lag 12 min; explains 97 % of the drift on held-out time."
        );
        let two = Follows {
            share: 0.9999,
            thermometers: vec![goes_with("rear", 0.93, 0.0), goes_with("table", -3.2, 3.12)],
            ..one
        };
        assert_eq!(
            sentence(&two),
            "Z goes with thermometers rear: +0.930 µm/K, no lag, and table: -3.20 µm/K, lag 3.1 min; \
             together they explain more than 99.9 % of the drift on held-out time."
        );
    }

    #[test]
    fn a_drift_is_drawn_with_its_model_and_its_temperatures() {
        let drift = Drift {
            channel: "length.Z".to_owned(),
            time_h: vec![0.0, 0.25, 0.5],
            deviation_um: vec![0.0, 2.0, 3.0],
            model_um: vec![0.0, 2.1, 2.9],
            is_by_thermometers: true,
            temperatures: vec![gap_diagnosis::figures::Temperature {
                thermometer: "spindle".to_owned(),
                degc: vec![20.0, 20.7, 21.0],
            }],
        };
        let sections = sections(&GapReport::default(), &[drift]).unwrap();
        let drawings = &sections[0].drawings;
        assert_eq!(drawings.len(), 2);
        assert!(drawings[0].svg.contains("by thermometers"));
        assert!(drawings[0].svg.contains("time of the session / min"));
        assert!(drawings[1].svg.contains("temperature / °C"));
    }
}
