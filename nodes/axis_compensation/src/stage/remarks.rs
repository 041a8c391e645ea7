//! What the stage has to say of an axis that changed and of a model that came.

use metrology::drift::drift_standard_uncertainty_mm;
use metrology::sample::{CompensationState, ThermalModel};
use metrology::{Axis, Host, Stamp};
use nalgebra::Vector3;

use super::{AxisCompensationStage, Output};
use crate::axis_state::{AxisState as Compensated, Wanted};
use crate::diagnostic::Diagnostic;
use crate::model_gate::{COVERAGE_FACTOR, Passage};
use crate::positioning::dual_loop::DualLoop;
use crate::span_watch::SpanChange;

impl AxisCompensationStage {
    /// Says what changed, once.
    pub(super) fn remark(
        &mut self,
        axis: Axis,
        before: &Compensated,
        after: &Compensated,
        wanted: Wanted,
        out: &mut Vec<Output>,
    ) {
        let cause = match wanted {
            Wanted::Refused(cause) => Some(cause),
            _ => None,
        };
        let is_new = match (cause, self.refused[axis]) {
            (Some(now), Some(before)) => !now.is_like(&before),
            (now, before) => now.is_some() != before.is_some(),
        };
        if is_new {
            out.extend(
                cause.map(|cause| Output::Diagnostic(Diagnostic::ModelRefused { axis, cause })),
            );
        }
        self.refused[axis] = cause;
        match (before.oversize(), after.oversize()) {
            (None, Some(wanted_mm)) => out.push(Output::Diagnostic(Diagnostic::SizeExceeded {
                axis,
                wanted_mm,
                limit_mm: after.size_limit(),
            })),
            (Some(_), None) => out.push(Output::Diagnostic(Diagnostic::SizeKept { axis })),
            _ => {}
        }
        let (from, to): (CompensationState, CompensationState) = (before.state(), after.state());
        if from != to {
            out.push(Output::Diagnostic(Diagnostic::StateChanged {
                axis,
                from,
                to,
                offset_mm: after.offset(),
                cause,
            }));
        }
    }

    /// Says where a drift is used beyond the blocks.
    pub(super) fn watch_span(
        &mut self,
        axis: Axis,
        point_mm: &Vector3<f64>,
        out: &mut Vec<Output>,
    ) {
        let dual_loop = self.positioning[axis].as_ref();
        let adds_thermal = dual_loop.is_none_or(DualLoop::adds_thermal);
        let Some(model) = self.gate.current().filter(|_| adds_thermal) else {
            return;
        };
        let Some(drift) = &model.axes[axis] else {
            return;
        };
        let position_mm = point_mm[axis.index()];
        let policy = self.gate.policy();
        let expanded_mm = |point_mm: &Vector3<f64>| {
            let u_mm = drift_standard_uncertainty_mm(model, axis, point_mm, policy);
            COVERAGE_FACTOR * u_mm.unwrap_or(f64::NAN)
        };
        let matters = || {
            let mut end_mm = *point_mm;
            end_mm[axis.index()] = position_mm.clamp(drift.span_mm.0, drift.span_mm.1);
            let (there_mm, at_end_mm) = (expanded_mm(point_mm), expanded_mm(&end_mm));
            // (2) of span_watch; a NaN matters.
            let is_outweighed = there_mm * there_mm <= 2.0 * at_end_mm * at_end_mm;
            !is_outweighed
        };
        let change = self.spans[axis].look(drift, position_mm, matters);
        out.extend(change.map(|change| {
            Output::Diagnostic(match change {
                SpanChange::KeptWithin => Diagnostic::WithinSpan { axis },
                SpanChange::Left => Diagnostic::BeyondSpan {
                    axis,
                    position_mm,
                    lower_mm: drift.span_mm.0,
                    upper_mm: drift.span_mm.1,
                    expanded_uncertainty_mm: expanded_mm(point_mm),
                    greatest_mm: self.gate.expanded_uncertainty_mm(axis),
                },
            })
        }));
    }

    pub(super) fn model(&mut self, at: Stamp<Host>, model: ThermalModel, out: &mut Vec<Output>) {
        let sequence = model.sequence;
        let was_in_doubt = self.model_in_doubt;
        let is_doubtful = model.quarantined;
        let passage = self.gate.offer(at, model);
        // History of a latched topic changes nothing.
        if let Passage::Expired { late_s } = passage {
            let expired = Diagnostic::ModelExpired { sequence, late_s };
            out.push(Output::Diagnostic(expired));
            return;
        }
        if let Passage::Older { by_s } = passage {
            out.push(Output::Diagnostic(Diagnostic::ModelOlder {
                sequence,
                by_s,
            }));
            return;
        }
        if is_doubtful {
            out.push(Output::Diagnostic(Diagnostic::ModelDoubtful { sequence }));
        }
        self.model_in_doubt = is_doubtful;
        self.model_in_doubt |= !matches!(passage, Passage::Accepted | Passage::Confirmed);
        let doubt_ends = was_in_doubt && !self.model_in_doubt;
        out.extend(match passage {
            Passage::Expired { .. } | Passage::Older { .. } => None,
            Passage::Accepted => {
                doubt_ends.then_some(Output::Diagnostic(Diagnostic::ModelAccepted { sequence }))
            }
            Passage::Confirmed => Some(Output::Diagnostic(Diagnostic::ModelConfirmed { sequence })),
            Passage::NotFinite { axis } => Some(Output::Diagnostic(Diagnostic::ModelNotFinite {
                sequence,
                axis,
            })),
            Passage::Quarantined {
                axis,
                change_mm,
                limit_mm,
            } => Some(Output::Diagnostic(Diagnostic::ModelQuarantined {
                sequence,
                axis,
                change_mm,
                limit_mm,
            })),
        });
    }
}
