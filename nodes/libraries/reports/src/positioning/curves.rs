//! Deviations of a positioning test as they are always drawn: each reading, means up and down, and ±2s about them.

use anyhow::Result;
use iso230::positioning::PositioningRuns;

use crate::plot::{self, Band, Plot, Trace};
use crate::section::Drawing;

/// Half width of the band in standard deviations.
const BAND: f64 = 2.0;

/// Mean and standard deviation of the readings at a target, µm; of a single reading the latter is NaN.
fn mean_and_s(values_um: &[f64]) -> (f64, f64) {
    let n = values_um.len() as f64;
    let mean = values_um.iter().sum::<f64>() / n;
    let squares: f64 = values_um.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, (squares / (n - 1.0)).sqrt())
}

/// Deviations over the targets, from each side that was approached.
///
/// # Errors
/// When the plot cannot be drawn.
pub(super) fn drawing(runs: &PositioningRuns) -> Result<Drawing> {
    let (mut traces, mut bands, mut readings) = (vec![], vec![], vec![]);
    // A side has one colour: its readings, their mean and the band.
    let mut colours = vec![];
    for (name, all) in [("up", &runs.up_mm), ("down", &runs.down_mm)] {
        if all.is_empty() {
            continue;
        }
        let at = |place: usize| -> Vec<f64> {
            let own = all.iter().filter_map(|run| run.get(place));
            own.map(|mm| mm * 1e3).collect()
        };
        let of = runs.targets_mm.iter().enumerate();
        let found: Vec<(f64, (f64, f64))> = of
            .map(|(place, target_mm)| (*target_mm, mean_and_s(&at(place))))
            .collect();
        bands.push(Band {
            name: format!("{name} ±2s"),
            of: traces.len(),
            points: found
                .iter()
                .map(|(t, (m, s))| (*t, m - BAND * s, m + BAND * s))
                .collect(),
        });
        colours.push(traces.len());
        traces.push(Trace {
            name: format!("mean {name}"),
            points: found.iter().map(|(t, (m, _))| (*t, *m)).collect(),
            marks: false,
        });
        let single = all.iter().flat_map(|run| runs.targets_mm.iter().zip(run));
        readings.push(Trace {
            name: format!("readings {name}"),
            points: single.map(|(t, mm)| (*t, mm * 1e3)).collect(),
            marks: true,
        });
    }
    bands.retain(|band| band.points.iter().any(|point| point.1.is_finite()));
    traces.extend(readings);
    colours.extend(colours.clone());
    let plot = Plot {
        x: "target / mm".to_owned(),
        y: "deviation / µm".to_owned(),
        traces,
    };
    Ok(Drawing {
        svg: plot::paired_svg(&plot, &bands, &colours)?,
        caption: "Deviation at each target, from each side: every reading, their mean, and two standard deviations s about it. The mean of all is taken out."
            .to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn runs(up_mm: Vec<Vec<f64>>, down_mm: Vec<Vec<f64>>) -> PositioningRuns {
        PositioningRuns {
            targets_mm: vec![0.0, 100.0, 200.0],
            up_mm,
            down_mm,
            zero_mm: 0.0,
            periods_mm: vec![],
        }
    }

    #[test]
    fn the_band_is_two_standard_deviations_wide_on_either_side() {
        let (mean, s) = mean_and_s(&[1.0, 2.0, 3.0]);
        assert!((mean - 2.0).abs() < 1e-12 && (s - 1.0).abs() < 1e-12);
        let run = |off: f64| vec![off, off + 0.001, off + 0.002];
        let up = vec![run(0.0), run(0.001), run(0.002)];
        let text = drawing(&runs(up.clone(), up)).unwrap().svg;
        for words in ["up ±2s", "down ±2s", "mean up", "readings down"] {
            assert!(text.contains(words), "{words}");
        }
        assert_eq!(text.matches("<polygon").count(), 2);
    }

    #[test]
    fn a_single_run_has_no_band_and_one_side_no_other() {
        let text = drawing(&runs(vec![vec![0.0, 0.001, 0.002]], vec![]))
            .unwrap()
            .svg;
        assert!(
            !text.contains("<polygon") && !text.contains("±2s"),
            "{text}"
        );
        assert!(!text.contains("down") && !text.contains("NaN"), "{text}");
    }
}
