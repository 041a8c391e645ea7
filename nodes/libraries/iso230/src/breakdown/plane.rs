//! The breakdown of one plane: make ready, fit and search, divide up, cross-check.

use nalgebra::{DMatrix, DVector};

use super::config::BreakdownConfig;
use super::contribution::{self, Rows, circularity_mm};
use super::cross_check::{cross_check, squareness_rad};
use super::distinguish::TiedRows;
use super::error::BreakdownError;
use super::instrument::{self, Instrument};
use super::noise;
use super::recording::{CircularPlane, CircularRecording, CircularSense};
use super::report::{Noise, PlaneBreakdown, RecordingSummary};
use super::robust::Fit;
use super::scene::{Scene, Trace};
use super::search::search;
use super::term::RowKey;

/// What is evaluated.
pub(super) struct Input<'a> {
    pub plane: CircularPlane,
    /// Recordings of the plane with their places in the caller's list.
    pub recordings: &'a [(usize, &'a CircularRecording)],
    pub config: &'a BreakdownConfig,
    pub tied: TiedRows,
}

/// `instruments` by the caller's list of recordings, or none.
pub(super) fn evaluate(
    plane: CircularPlane,
    recordings: &[(usize, &CircularRecording)],
    instruments: &[Instrument],
    config: &BreakdownConfig,
) -> Result<PlaneBreakdown, BreakdownError> {
    let input = Input {
        plane,
        recordings,
        config,
        tied: TiedRows::default(),
    };
    let scene = Scene::new(plane, recordings);
    let found = search(&input, &scene)?;
    let fit = &found.fit;
    let covariance = &fit.covariance + instrument::covariance(&scene, fit, instruments);
    let Rows {
        setting_up,
        machine,
        unseen,
        deviations_mm,
    } = contribution::rows(&input, &scene, &found, &covariance);
    let checks: Vec<_> = scene
        .traces
        .iter()
        .map(|trace| cross_check(trace, &deviations_mm, &fit.weights, scene.axes))
        .collect();
    let residuals = DVector::from_column_slice(&fit.residuals_mm);
    let summary = |trace: &Trace| RecordingSummary {
        residual_circularity_mm: circularity_mm(trace, &residuals, &fit.weights),
        ..summary(trace, &deviations_mm, fit)
    };
    let summaries: Vec<RecordingSummary> = scene.traces.iter().map(summary).collect();
    let worst = summaries
        .iter()
        .map(|r| r.circularity_mm)
        .fold(0.0, f64::max);
    let mut breakdown = PlaneBreakdown {
        plane,
        axes: scene.axes,
        rows: machine,
        setting_up,
        unseen,
        not_found: found.not_found,
        recordings: summaries,
        noise: noise_of(&scene, fit),
        scales: None,
        four_point_squareness_rad: squareness_rad(&scene, &checks),
        cross_checks: checks,
        worst_circularity_mm: worst,
    };
    breakdown.scales = scales(&scene, fit, &covariance, &breakdown);
    Ok(breakdown)
}

fn summary(trace: &Trace, deviations_mm: &DVector<f64>, fit: &Fit) -> RecordingSummary {
    let weights = trace.rows().map(|row| fit.weights[row]);
    let (first, last) = (trace.points.first(), trace.points.last());
    let swept = first.zip(last).map_or((0.0, 0.0), |(a, b)| {
        ((b.angle_rad - a.angle_rad).abs(), b.time_s - a.time_s)
    });
    RecordingSummary {
        recording: trace.recording,
        sense: if trace.sense > 0.0 {
            CircularSense::CounterClockwise
        } else {
            CircularSense::Clockwise
        },
        feed_mm_s: trace.feed_mm_s,
        measured_feed_mm_s: swept.0 * trace.radius_mm / swept.1,
        radius_mm: trace.radius_mm,
        n_samples: trace.points.len(),
        n_outliers: weights.clone().filter(|w| *w <= 0.0).count(),
        n_downweighted: weights.filter(|w| *w > 0.0 && *w < 1.0).count(),
        circularity_mm: circularity_mm(trace, deviations_mm, &fit.weights),
        residual_circularity_mm: 0.0,
    }
}

fn noise_of(scene: &Scene, fit: &Fit) -> Noise {
    let residuals = fit.residuals_by_trace(scene);
    let (whiteness, whiteness_score) = noise::whiteness(&residuals);
    Noise {
        high_pass_mm: noise::high_pass(&residuals),
        residual_mm: fit.variance_mm2.sqrt(),
        whiteness,
        whiteness_score,
        inflation: fit.inflation,
    }
}

/// s₁ = m + q/2 and s₂ = m − q/2, where both m and q stand alone.
fn scales(
    scene: &Scene,
    fit: &Fit,
    covariance: &DMatrix<f64>,
    breakdown: &PlaneBreakdown,
) -> Option<[(f64, f64); 2]> {
    let alone = |key: RowKey| {
        breakdown
            .row(&key)
            .is_some_and(|row| row.aliases.is_empty())
    };
    if !(alone(RowKey::RadialExpansion) && alone(RowKey::ScalingMismatch)) {
        return None;
    }
    let place = |key: RowKey| {
        let mut kept = fit.reduction.kept.iter();
        kept.position(|column| fit.terms[*column].row(scene) == key)
    };
    let (m, q) = (
        place(RowKey::RadialExpansion)?,
        place(RowKey::ScalingMismatch)?,
    );
    Some([0.5, -0.5].map(|half| {
        let variance =
            covariance[(m, m)] + 2.0 * half * covariance[(m, q)] + half * half * covariance[(q, q)];
        (
            fit.parameters[m] + half * fit.parameters[q],
            variance.max(0.0).sqrt(),
        )
    }))
}
