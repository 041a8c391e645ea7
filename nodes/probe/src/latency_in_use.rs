//! Which latency corrects a touch: a calibrated one before a given one.

use metrology::sample::ProbeLatency;

use crate::config::GivenLatency;
use crate::diagnostic::Diagnostic;

/// A negative latency is refused from this many standard uncertainties on.
const SIGNIFICANT: f64 = 3.0;

/// A latency and its standard uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LatencyInUse {
    /// Latency, s.
    pub latency_s: f64,
    /// Standard uncertainty, s.
    pub standard_uncertainty_s: f64,
}

impl From<GivenLatency> for LatencyInUse {
    fn from(given: GivenLatency) -> Self {
        Self {
            latency_s: given.latency_s,
            standard_uncertainty_s: given.standard_uncertainty_s,
        }
    }
}

impl LatencyInUse {
    /// Takes over a calibrated latency.
    ///
    /// # Errors
    /// The diagnostic to report when it cannot be one: not finite, or negative beyond doubt.
    pub fn from_calibration(latency: &ProbeLatency) -> Result<Self, Diagnostic> {
        let (latency_s, u_s) = (latency.latency_s, latency.standard_uncertainty_s);
        let usable = latency_s.is_finite() && u_s.is_finite() && u_s >= 0.0;
        if usable && latency_s + SIGNIFICANT * u_s >= 0.0 {
            return Ok(Self {
                latency_s,
                standard_uncertainty_s: u_s,
            });
        }
        Err(Diagnostic::LatencyRefused {
            latency_s,
            standard_uncertainty_s: u_s,
        })
    }
}
