//! How often names were right, by the confidence they were given: as a table and as a diagram.

use anyhow::Result;
use reports::plot::{self, Plot, Trace};
use reports::section::{Drawing, Rows, head};
use trials::Tally;

/// Bin by bin of confidence.
pub fn rows(tally: &Tally) -> Rows {
    let rows = tally.reliability.iter().map(|line| {
        let [from, to] = line.bin;
        let percent = |share: f64| format!("{:.0} %", 100.0 * share);
        let [low, high] = line.interval.map(percent);
        let share = percent(line.right.share().unwrap_or(0.0));
        vec![
            format!("{from:.1} to {to:.1}"),
            line.right.n.to_string(),
            format!("{:.2}", line.confidence),
            format!("{}/{} = {share}", line.right.k, line.right.n),
            format!("{low} to {high}"),
        ]
    });
    Rows {
        head: head(&[
            "confidence of a name",
            "names",
            "mean confidence",
            "right",
            "95 % interval",
        ]),
        rows: rows.collect(),
        note: "Reliability: confidence beside precision of what is named, with Wilson's interval."
            .to_owned(),
    }
}

/// Precision over confidence, beside what it should be.
///
/// # Errors
/// When the diagram cannot be drawn.
pub fn drawing(tally: &Tally) -> Result<Drawing> {
    let bins = || tally.reliability.iter();
    let right = bins().filter_map(|bin| Some((bin.confidence, bin.right.share()?)));
    let end = |place: usize| bins().map(move |bin| (bin.confidence, bin.interval[place]));
    let trace = |name: &str, points: Vec<(f64, f64)>, marks: bool| Trace {
        name: name.to_owned(),
        points,
        marks,
    };
    let svg = plot::svg(&Plot {
        x: "confidence".to_owned(),
        y: "share right".to_owned(),
        traces: vec![
            trace("as said", vec![(0.0, 0.0), (1.0, 1.0)], false),
            trace("named causes", right.collect(), true),
            trace("95 %, lower end", end(0).collect(), true),
            trace("95 %, upper end", end(1).collect(), true),
        ],
    })?;
    Ok(Drawing {
        svg,
        caption: format!(
            "Reliability, arm {}: how often names were right, by the confidence they were given.",
            tally.arm
        ),
    })
}
