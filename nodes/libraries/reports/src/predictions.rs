//! Prediction of the drift between block cycles: what was left at each update by each way of predicting it.

use anyhow::Result;
use maud::{Markup, html};

use super::over_time;
use super::page::{all_figures, figure, fold, table};
use super::plot::{Plot, Trace, svg};
use super::svg::short;
use crate::evidence::{Evidence, Prediction};

/// Ways of predicting by their keys, with their names.
const PREDICTORS: [(&str, &str); 3] = [
    ("hold_um", "held"),
    ("relaxation_um", "time constant"),
    ("temperature_um", "temperatures"),
];
/// Seconds of an hour.
const HOUR_S: f64 = 3600.0;
const COLUMNS: [&str; 4] = ["time / h", "held", "time constant", "temperatures"];

/// The residual of one way, µm.
fn residual_um(prediction: &Prediction, key: &str) -> Option<f64> {
    let mut all = prediction.residuals_um.iter();
    let (_, text) = all.find(|(name, _)| *name == key)?;
    text.parse().ok()
}

/// Root mean squares of temperatures and of a held model at the updates where both are known, µm.
fn compared_um(predictions: &[Prediction]) -> Option<(f64, f64, usize)> {
    let both = |one| {
        Some((
            residual_um(one, "temperature_um")?,
            residual_um(one, "hold_um")?,
        ))
    };
    let all: Vec<(f64, f64)> = predictions.iter().filter_map(both).collect();
    let n = all.len() as f64;
    let rms = |of: fn(&(f64, f64)) -> f64| {
        (all.iter().map(|one| of(one).powi(2)).sum::<f64>() / n).sqrt()
    };
    (!all.is_empty()).then(|| (rms(|one| one.0), rms(|one| one.1), all.len()))
}

fn hours(evidence: &Evidence, one: &Prediction) -> f64 {
    (one.at - over_time::start(evidence)).as_secs_f64() / HOUR_S
}

/// What each way left over time; `None` where none is known.
fn picture(evidence: &Evidence) -> Result<Option<Markup>> {
    let trace = |(key, name): (&str, &str)| {
        let all = evidence.predictions.iter();
        let points = all.filter_map(|one| Some((hours(evidence, one), residual_um(one, key)?)));
        Trace {
            name: name.to_owned(),
            points: points.collect(),
            marks: false,
        }
    };
    let traces = PREDICTORS.map(trace).into_iter();
    let plot = Plot {
        x: "time since start / h".to_owned(),
        y: "left at the blocks, rms / µm".to_owned(),
        traces: traces.filter(|trace| !trace.points.is_empty()).collect(),
    };
    let caption = "Residual at the blocks at each update, had the last model been held, extrapolated with its time constant, or moved with the temperatures.";
    if plot.traces.is_empty() {
        return Ok(None);
    }
    Ok(Some(figure(&svg(&plot)?, caption)))
}

/// The part; empty without an update.
///
/// # Errors
/// When the plot cannot be drawn.
pub fn section(evidence: &Evidence) -> Result<Markup> {
    if evidence.predictions.is_empty() {
        return Ok(html! {});
    }
    let cells = |one: &Prediction| {
        let values = PREDICTORS.map(|(key, _)| {
            let value = residual_um(one, key);
            value.map_or_else(|| "—".to_owned(), |um| format!("{um:.2}"))
        });
        std::iter::once(format!("{:.2}", hours(evidence, one)))
            .chain(values)
            .collect()
    };
    let rows: Vec<Vec<String>> = evidence.predictions.iter().map(cells).collect();
    let drawn = picture(evidence)?;
    let answer = compared_um(&evidence.predictions).map(|(temperature, held, n)| {
        format!(
            "Temperatures leave {} µm rms between block cycles, a held model {} µm, over {n} updates.",
            short(temperature),
            short(held)
        )
    });
    let note = html! { p.note { "Residual at the blocks, root mean square in µm; a dash: that way was not identifiable or not proven yet." } };
    Ok(fold(
        "Prediction between block cycles",
        answer.as_deref(),
        false,
        &html! {
            @if let Some(drawn) = &drawn { (drawn) }
            (all_figures(&html! { (table(&COLUMNS, &rows)) (note) }))
        },
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use metrology::stamp::Stamp;

    fn update(hold: &str, temperature: &str) -> Prediction {
        Prediction {
            at: Stamp::from_nanos(0),
            residuals_um: vec![
                ("hold_um", hold.to_owned()),
                ("relaxation_um", String::new()),
                ("temperature_um", temperature.to_owned()),
            ],
        }
    }

    #[test]
    fn only_updates_that_know_both_are_compared() {
        let all = [
            update("6.0", ""),
            update("3.0", "1.0"),
            update("4.0", "1.0"),
        ];
        let (temperature, held, n) = compared_um(&all).unwrap();
        assert!((temperature - 1.0).abs() < 1e-12 && n == 2);
        assert!((held - 12.5_f64.sqrt()).abs() < 1e-12, "{held}");
        assert!(compared_um(&all[..1]).is_none());
        let evidence = Evidence {
            predictions: all.to_vec(),
            ..Evidence::default()
        };
        let text = section(&evidence).unwrap().into_string();
        assert!(
            text.contains("a held model 3.54 µm, over 2 updates"),
            "{text}"
        );
        assert!(text.contains("<svg") && !text.contains("time constant</span>"));
        assert_eq!(section(&Evidence::default()).unwrap().into_string(), "");
    }
}
