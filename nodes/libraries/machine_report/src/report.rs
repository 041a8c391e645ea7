//! What a bridge makes of the values that a machine reports.

use metrology::sample::{AxisState, MachineValue, TemperatureSample};

use crate::condition::ValueCondition;

/// What is published of a machine's values.
#[derive(Clone, Debug, PartialEq)]
pub enum Report {
    /// Positions of all axes that are known.
    State(AxisState),
    /// A temperature that can be.
    Temperature(TemperatureSample),
    /// A value as it was reported, with a verdict.
    Value(MachineValue),
    /// A condition worth reporting.
    Condition(ValueCondition),
}

/// Takes reports, as whatever a bridge makes of them.
pub trait Sink {
    /// Takes one.
    fn push(&mut self, report: Report);

    /// Takes all.
    fn extend(&mut self, reports: impl IntoIterator<Item = Report>) {
        for report in reports {
            self.push(report);
        }
    }
}

impl<O: From<Report>> Sink for Vec<O> {
    fn push(&mut self, report: Report) {
        Self::push(self, report.into());
    }
}
