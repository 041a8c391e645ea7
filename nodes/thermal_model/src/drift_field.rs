//! From drifts at faces to a model per axis, by the configured method.

use metrology::drift::relaxed_s;
use metrology::least_squares::FitError;
use metrology::sample::AxisDrift;
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

/// Gives `axes` the rates that `rates` (faces whose drift is a rate, mm/s) have, axis by axis with
/// its time constant. The fit is linear in the drifts, so rates go through it as drifts do.
pub fn with_rates(
    axes: &mut PerAxis<Option<AxisDrift>>,
    rates: &Field,
    time_constants_s: &PerAxis<Option<f64>>,
) {
    for axis in Axis::LINEAR {
        if let (Some(drift), Some(rate), Some(tau_s)) =
            (&mut axes[axis], &rates.axes[axis], time_constants_s[axis])
        {
            drift.rate_mm_s = rate.k0_mm;
            drift.slope_rate_per_s = rate.slope_mm_per_mm;
            drift.time_constant_s = tau_s;
        }
    }
}

/// The same drift seen from `elapsed_s` later; its rates have decayed meanwhile.
#[must_use]
pub fn advanced(drift: &AxisDrift, elapsed_s: f64) -> AxisDrift {
    let acted_s = relaxed_s(elapsed_s, drift.time_constant_s);
    let left = (-elapsed_s / drift.time_constant_s).exp();
    AxisDrift {
        k0_mm: drift.k0_mm + drift.rate_mm_s * acted_s,
        slope_mm_per_mm: drift.slope_mm_per_mm + drift.slope_rate_per_s * acted_s,
        rate_mm_s: drift.rate_mm_s * left,
        slope_rate_per_s: drift.slope_rate_per_s * left,
        ..*drift
    }
}

/// The same drift, standing still.
#[must_use]
pub fn halted(drift: &AxisDrift) -> AxisDrift {
    AxisDrift {
        rate_mm_s: 0.0,
        slope_rate_per_s: 0.0,
        time_constant_s: f64::INFINITY,
        ..*drift
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn advancing_in_two_steps_is_advancing_once() {
        let drift = AxisDrift {
            k0_mm: 0.01,
            rate_mm_s: 1e-5,
            slope_rate_per_s: 2e-8,
            time_constant_s: 1800.0,
            ..AxisDrift::default()
        };
        let once = advanced(&drift, 900.0);
        let twice = advanced(&advanced(&drift, 400.0), 500.0);
        assert!((once.k0_mm - twice.k0_mm).abs() < 1e-15);
        assert!((once.slope_rate_per_s - twice.slope_rate_per_s).abs() < 1e-20);
        assert!(halted(&once).rate_mm_s == 0.0);
    }
}
