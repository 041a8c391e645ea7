//! Measurements and models: touches, latency, drift, geometry, positioning, the gap.

use metrology::Axis;
use metrology::sample::{
    GapCause, GapParameter, GapStatus, GapSummary, GeometryModel, PositioningTable, ProbedPoint,
    Rejection,
};
use serde_json::{Value, json};

use super::motion::unit;
use super::{Page, list, ms, short};

/// Causes of a gap, and parameters of each, that are shown; the report has all.
const MOST_CAUSES: usize = 10;
const MOST_PARAMETERS: usize = 20;

fn reason(rejection: Rejection) -> Option<&'static str> {
    Some(match rejection {
        Rejection::None => return None,
        Rejection::BeforeQueue => "older than the kept positions",
        Rejection::AfterQueue => "newer than the received positions",
        Rejection::Gap => "positions are missing at the contact",
        Rejection::NotFinite => "a number is not finite",
        Rejection::ClockWentBack => "the controller's clock went back",
        Rejection::StandoffTooShort => "the stand-off is too short for the feed",
        Rejection::NoLatency => "the probe latency is unknown",
    })
}

const fn status(status: GapStatus) -> &'static str {
    match status {
        GapStatus::Named => "named",
        GapStatus::Surrogate => "surrogate",
        GapStatus::Set => "set",
    }
}

/// How many components, coefficients and readings a model has, and its residuals.
pub(super) fn geometry(model: &GeometryModel) -> Value {
    json!({
        "at_ms": ms(model.at),
        "chain": short(&model.chain),
        "components": model.curves.iter().map(|curve| curve.component.to_string()).collect::<Vec<_>>(),
        "unknowns": model.n_unknowns,
        "rank": model.rank,
        "readings": model.n_samples,
        "residual_mm": model.residual_standard_deviation_mm,
        "sequence": model.sequence,
    })
}

/// The last report of the diagnosis, without its whole text.
pub(super) fn gap(report: &GapSummary) -> Value {
    let parameter = |one: &GapParameter| json!({"name": short(&one.name), "value": one.value, "low": one.low, "high": one.high});
    let cause = |one: &GapCause| {
        json!({
            "effect": short(&one.effect),
            "axis": short(&one.axis),
            "status": status(one.status),
            "confidence": one.confidence,
            "parameters": one.parameters.iter().take(MOST_PARAMETERS).map(parameter).collect::<Vec<_>>(),
        })
    };
    let causes = report.causes.iter().take(MOST_CAUSES).map(cause);
    json!({
        "at_ms": ms(report.at),
        "rms_mm": report.rms_mm,
        "p95_mm": report.p95_mm,
        "floor_mm": report.floor_mm,
        "above_floor": report.above_floor,
        "causes": causes.collect::<Vec<_>>(),
        "more_causes": report.causes.len().saturating_sub(MOST_CAUSES),
        "has_unknown": report.has_unknown,
        "gap_closed": report.gap_closed,
        "next_experiment": short(&report.next_experiment),
    })
}

/// Points, runs and the greatest deviation of a table.
pub(super) fn positioning(table: &PositioningTable) -> Value {
    let both = table.deviation_up.iter().chain(&table.deviation_down);
    json!({
        "axis": table.axis.letter(),
        "unit": unit(table.axis),
        "at_ms": ms(table.at),
        "points": table.position.len(),
        "runs": table.n_runs,
        "greatest": both.fold(0.0, |most: f64, one| most.max(one.abs())),
    })
}

impl Page {
    pub(super) fn touches_part(&self) -> Option<Value> {
        let one = |touch: &ProbedPoint| {
            let place = touch.point_in_machine_mm;
            json!({
                "at_ms": ms(touch.received_at),
                "feature": touch.feature_id,
                "x_mm": place.x,
                "y_mm": place.y,
                "z_mm": place.z,
                "latency_s": touch.applied_latency_s,
                "standard_uncertainty_mm": touch.standard_uncertainty_mm,
                "rejected": reason(touch.rejection),
                "sequence": touch.sequence,
            })
        };
        list(self.touches.iter().map(one).collect())
    }

    pub(super) fn latency_part(&self) -> Option<Value> {
        let latency = &self.latency.as_ref()?.value;
        Some(json!({
            "at_ms": ms(latency.at),
            "latency_s": latency.latency_s,
            "standard_uncertainty_s": latency.standard_uncertainty_s,
            "touches": latency.n,
            "negative": latency.negative,
        }))
    }

    pub(super) fn drift_part(&self) -> Option<Value> {
        let model = &self.drift.as_ref()?.value;
        let one = |axis: Axis| {
            let drift = model.axes[axis].as_ref()?;
            Some(json!({
                "axis": axis.letter(),
                "p0_mm": drift.p0_mm,
                "k0_mm": drift.offset_identifiable.then_some(drift.k0_mm),
                "standard_uncertainty_mm": drift.covariance[(0, 0)].sqrt(),
                "slope_mm_per_mm": drift.slope_identifiable.then_some(drift.slope_mm_per_mm),
                "measured_ms": ms(drift.measured_at),
            }))
        };
        let is_over = |now| now > model.valid_until;
        Some(json!({
            "at_ms": ms(model.at),
            "valid_until_ms": ms(model.valid_until),
            "is_over": self.time_of_the_cell().is_some_and(is_over),
            "quarantined": model.quarantined,
            "blocks": model.n_blocks,
            "sequence": model.sequence,
            "axes": Axis::LINEAR.into_iter().filter_map(one).collect::<Vec<_>>(),
        }))
    }
}
