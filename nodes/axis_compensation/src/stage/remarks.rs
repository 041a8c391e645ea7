//! What the stage has to say of an axis that changed and of a model that came.

use metrology::Axis;
use metrology::sample::{CompensationState, ThermalModel};

use super::{AxisCompensationStage, Output};
use crate::axis_state::{AxisState as Compensated, Wanted};
use crate::diagnostic::Diagnostic;
use crate::model_gate::Passage;

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

    pub(super) fn model(&mut self, model: ThermalModel, out: &mut Vec<Output>) {
        let sequence = model.sequence;
        let was_in_doubt = self.model_in_doubt;
        self.model_in_doubt = model.quarantined;
        if model.quarantined {
            out.push(Output::Diagnostic(Diagnostic::ModelDoubtful { sequence }));
        }
        let passage = self.gate.offer(model);
        self.model_in_doubt |= !matches!(passage, Passage::Accepted | Passage::Confirmed);
        let doubt_ends = was_in_doubt && !self.model_in_doubt;
        out.extend(match passage {
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
