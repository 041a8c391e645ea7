//! The stage's part in the geometric compensation: models that come, and what is said of them.

use metrology::sample::GeometryModel;

use super::{AxisCompensationStage, Output};
use crate::diagnostic::Diagnostic;
use crate::geometric::{GeometryPassage, GeometrySource};

impl AxisCompensationStage {
    pub(super) fn geometry(
        &mut self,
        source: GeometrySource,
        model: GeometryModel,
        out: &mut Vec<Output>,
    ) {
        let sequence = model.sequence;
        let passage = match &mut self.geometric {
            Some(geometric) => geometric.offer(source, model),
            None => {
                let unused = Diagnostic::GeometryUnused {
                    model: source,
                    sequence,
                };
                out.push(Output::Diagnostic(unused));
                return;
            }
        };
        out.push(Output::Diagnostic(match passage {
            GeometryPassage::Accepted => Diagnostic::GeometryAccepted {
                model: source,
                sequence,
            },
            GeometryPassage::Confirmed => Diagnostic::GeometryConfirmed {
                model: source,
                sequence,
            },
            GeometryPassage::Quarantined {
                change_mm,
                limit_mm,
            } => Diagnostic::GeometryQuarantined {
                model: source,
                sequence,
                change_mm,
                limit_mm,
            },
            GeometryPassage::Incomplete { axis } => Diagnostic::GeometryIncomplete {
                model: source,
                sequence,
                axis,
            },
            GeometryPassage::Refused { cause } => Diagnostic::GeometryRefused {
                model: source,
                sequence,
                cause,
            },
        }));
    }
}
