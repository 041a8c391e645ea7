//! Fewer rows for the search: samples that stand close together count as their mean.
//!
//! # Model
//!
//! M neighbours of a trace, none of them left out as a spike of the reader and no reversal between them, are
//! one row. With mean and standard deviation (of the M) of angle and time:
//!
//! ```text
//!   row = √M · mean of the deviations                                                 (1)
//!   column in it = √M · ½ [ f(mean − deviation) + f(mean + deviation) ]               (2)
//! ```
//!
//! (2) is the mean of f over the samples up to its third derivative; √M keeps the noise of every row that of
//! one sample, so sums of squares stay as they were. The fit that is reported has all samples.

use super::config::BreakdownConfig;
use super::robust::Fit;
use super::scene::{Block, Point, Scene, Trace, spacing_rad};

/// Rows that the shortest period of a cyclic error keeps.
const ROWS_PER_PERIOD: f64 = 8.0;

/// Neighbours of each trace that count as one; none where all would stay as they are.
fn together(scene: &Scene, config: &BreakdownConfig) -> Option<Vec<usize>> {
    let pitches = scene.axes.map(|axis| config.candidates_mm(axis));
    let shortest_mm = pitches
        .iter()
        .flat_map(|candidates| candidates.iter().copied())
        .fold(f64::INFINITY, f64::min);
    let of = |trace: &Trace| {
        let wanted_rad = (std::f64::consts::TAU / config.search_samples as f64)
            .min(shortest_mm / (ROWS_PER_PERIOD * trace.radius_mm));
        ((wanted_rad / trace.spacing_rad) as usize).max(1)
    };
    let counts: Vec<usize> = scene.traces.iter().map(of).collect();
    counts.iter().any(|m| *m > 1).then_some(counts)
}

/// Whether fewer rows would do for the search.
pub(super) fn would_do(scene: &Scene, config: &BreakdownConfig) -> bool {
    together(scene, config).is_some()
}

/// The scene with fewer rows, without the samples that `fit` left out.
pub(super) fn thinned(scene: &Scene, fit: &Fit, config: &BreakdownConfig) -> Option<Scene> {
    let counts = together(scene, config)?;
    let mut thin = scene.clone();
    thin.n_rows = 0;
    for ((trace, before), m) in thin.traces.iter_mut().zip(&scene.traces).zip(counts) {
        let used: Vec<&Point> = before
            .rows()
            .filter(|row| fit.weights[*row] > 0.0)
            .map(|row| &before.points[row - before.first_row])
            .collect();
        let together = |a: &&Point, b: &&Point| (0..2).all(|k| b.arc_rad[k] >= a.arc_rad[k]);
        let between_reversals = used.chunk_by(together);
        let blocks = between_reversals.flat_map(|part| part.chunks(m));
        let made: Vec<(Point, Block)> = blocks.map(|block| mean(before, block)).collect();
        (trace.points, trace.blocks) = made.into_iter().unzip();
        trace.spacing_rad = spacing_rad(&trace.points);
        trace.first_row = thin.n_rows;
        thin.n_rows += trace.points.len();
    }
    Some(thin)
}

fn mean(trace: &Trace, block: &[&Point]) -> (Point, Block) {
    let n = block.len() as f64;
    let mean = |of: fn(&Point) -> f64| block.iter().map(|p| of(p)).sum::<f64>() / n;
    let spread = |of: fn(&Point) -> f64, mean: f64| {
        let squares = block.iter().map(|p| (of(p) - mean).powi(2));
        (squares.sum::<f64>() / n).sqrt()
    };
    let (angle, time) = (|p: &Point| p.angle_rad, |p: &Point| p.time_s);
    let (angle_rad, time_s) = (mean(angle), mean(time));
    let observed_mm = mean(|p| p.observed_mm);
    let at = |side: f64| {
        Point::new(
            &trace.circle,
            angle_rad + side * trace.sense * spread(angle, angle_rad),
            time_s + side * spread(time, time_s),
            observed_mm,
        )
    };
    let block = Block {
        nodes: [at(-1.0), at(1.0)],
        root: n.sqrt(),
    };
    (at(0.0), block)
}
