//! From drifts at faces to a model per axis, by the configured method.

use metrology::drift::relaxed_s;
use metrology::least_squares::FitError;
use metrology::sample::{AxisDrift, DriftGrowth};
use metrology::{Axis, PerAxis};

use crate::config::Method;
use crate::diagnostic::Diagnostic;
use crate::error::ThermalModelError;
use crate::reference::{FaceDrift, Reference};
use crate::two_block::SlopeLimit;
use crate::{n_block, two_block};

/// Level below which the lack-of-fit test is reported.
const LACK_OF_FIT_LEVEL: f64 = 0.01;

/// A fitted field.
#[derive(Clone, Debug)]
pub struct Field {
    /// Model per axis.
    pub axes: PerAxis<Option<AxisDrift>>,
    /// p value of the lack-of-fit test; NaN where there is none.
    pub lack_of_fit_p: f64,
    /// What is to be said about it.
    pub remarks: Vec<Diagnostic>,
}

/// Fits the faces.
///
/// # Errors
/// When a number is unusable.
pub fn fit(
    method: Method,
    reference: &Reference,
    faces: &[FaceDrift],
    limits: &PerAxis<SlopeLimit>,
) -> Result<Field, FitError> {
    match method {
        Method::TwoBlock => Ok(lines(faces, limits)),
        Method::NBlock => affine(reference, faces, limits),
    }
}

fn lines(faces: &[FaceDrift], limits: &PerAxis<SlopeLimit>) -> Field {
    let mut field = Field {
        axes: PerAxis::default(),
        lack_of_fit_p: f64::NAN,
        remarks: Vec::new(),
    };
    for axis in Axis::LINEAR {
        let mut own = faces.iter().filter(|f| f.axis == axis);
        field.axes[axis] = match (own.next(), own.next()) {
            (Some(first), Some(second)) => {
                let line = two_block::line(axis, first, second, limits[axis]);
                if let Some(inconsistency_mm) = line.inconsistency_mm {
                    field.remarks.push(Diagnostic::SlopeUnidentifiable {
                        axis,
                        span_mm: line.span_mm,
                        least_span_mm: line.least_span_mm,
                        inconsistency_mm,
                    });
                }
                Some(line.drift)
            }
            (Some(only), None) => Some(two_block::shift(axis, only)),
            _ => None,
        };
    }
    field
}

fn affine(
    reference: &Reference,
    faces: &[FaceDrift],
    limits: &PerAxis<SlopeLimit>,
) -> Result<Field, FitError> {
    let fit = n_block::fit(faces, reference.origin_mm(), limits).map_err(|error| match error {
        ThermalModelError::Fit(reason) => reason,
        _ => FitError::NoDecomposition,
    })?;
    let mut remarks = vec![Diagnostic::Fitted {
        n_faces: fit.n_faces,
        terms: fit.terms,
        left_out: fit.left_out,
        degrees_of_freedom: fit.degrees_of_freedom,
        lack_of_fit_p: fit.lack_of_fit_p,
        residual_rms_mm: fit.residual_rms_mm,
    }];
    if fit.lack_of_fit_p < LACK_OF_FIT_LEVEL {
        remarks.push(Diagnostic::LackOfFit {
            lack_of_fit_p: fit.lack_of_fit_p,
        });
    }
    Ok(Field {
        axes: fit.axes,
        lack_of_fit_p: fit.lack_of_fit_p,
        remarks,
    })
}

/// Lets `axes` grow by `rates`, the fit of faces whose drift is a rate (mm/s) for the faces of
/// `source` and zero for the others, with the time constant of `source`. The fit is linear in the
/// drifts, so rates go through it as drifts do; done for every axis in turn, the sum is the field
/// fitted to all faces as they will be.
pub fn add_growth(
    axes: &mut PerAxis<Option<AxisDrift>>,
    source: Axis,
    rates: &PerAxis<Option<AxisDrift>>,
    time_constant_s: f64,
) {
    for axis in Axis::LINEAR {
        let (Some(drift), Some(rate)) = (&mut axes[axis], &rates[axis]) else {
            continue;
        };
        let mut gradient_rate_per_s = rate.cross_slope_mm_per_mm;
        gradient_rate_per_s[axis.index()] = rate.slope_mm_per_mm;
        if rate.k0_mm != 0.0 || gradient_rate_per_s.iter().any(|g| *g != 0.0) {
            drift.growth[source.index()] = Some(DriftGrowth {
                rate_mm_s: rate.k0_mm,
                gradient_rate_per_s,
                time_constant_s,
            });
        }
    }
}

/// The same drift of `axis` seen from `elapsed_s` later; its rates have decayed meanwhile.
#[must_use]
pub fn advanced(axis: Axis, drift: &AxisDrift, elapsed_s: f64) -> AxisDrift {
    let mut later = *drift;
    for growth in later.growth.iter_mut().flatten() {
        let acted_s = relaxed_s(elapsed_s, growth.time_constant_s);
        let left = (-elapsed_s / growth.time_constant_s).exp();
        let mut change = growth.gradient_rate_per_s * acted_s;
        later.k0_mm += growth.rate_mm_s * acted_s;
        later.slope_mm_per_mm += change[axis.index()];
        change[axis.index()] = 0.0;
        later.cross_slope_mm_per_mm += change;
        growth.rate_mm_s *= left;
        growth.gradient_rate_per_s *= left;
    }
    later
}

/// The same drift, standing still.
#[must_use]
pub fn halted(drift: &AxisDrift) -> AxisDrift {
    AxisDrift {
        growth: [None; 3],
        ..*drift
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn advancing_in_two_steps_is_advancing_once() {
        let drift = AxisDrift {
            k0_mm: 0.01,
            growth: [
                Some(DriftGrowth {
                    rate_mm_s: 1e-5,
                    gradient_rate_per_s: Vector3::new(2e-8, 1e-8, 0.0),
                    time_constant_s: 1800.0,
                }),
                None,
                Some(DriftGrowth {
                    rate_mm_s: -2e-6,
                    gradient_rate_per_s: Vector3::zeros(),
                    time_constant_s: 600.0,
                }),
            ],
            ..AxisDrift::default()
        };
        let later = |drift: &AxisDrift, s| advanced(Axis::X, drift, s);
        let once = later(&drift, 900.0);
        let twice = later(&later(&drift, 400.0), 500.0);
        assert!((once.k0_mm - twice.k0_mm).abs() < 1e-15);
        assert!((once.slope_mm_per_mm - twice.slope_mm_per_mm).abs() < 1e-18);
        assert!((once.cross_slope_mm_per_mm - twice.cross_slope_mm_per_mm).norm() < 1e-18);
        let rates = |drift: &AxisDrift| drift.growth[0].unwrap().gradient_rate_per_s;
        assert!((rates(&once) - rates(&twice)).norm() < 1e-20);
        assert!(halted(&once).growth == [None; 3]);
    }
}
