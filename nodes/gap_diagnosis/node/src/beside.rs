//! Runs each diagnosis on a thread of its own, so that the node goes on taking samples meanwhile.

use std::thread::JoinHandle;

use gap_diagnosis::stage::Finding;
use gap_diagnosis::{GapDiagnosisStage, Input, Output};
use metrology::{Host, Stage, Stamp};

/// The stage with the diagnosis that is being made.
pub(crate) struct Beside {
    stage: GapDiagnosisStage,
    under_way: Option<JoinHandle<Finding>>,
}

impl Beside {
    pub(crate) fn new(stage: GapDiagnosisStage) -> Self {
        Self {
            stage,
            under_way: None,
        }
    }

    /// From now on diagnoses are made beside.
    pub(crate) fn begin(&mut self) {
        self.stage.go_beside();
    }

    fn finding(&mut self) -> Option<Finding> {
        let is_made = self.under_way.as_ref().is_some_and(JoinHandle::is_finished);
        let made = self.under_way.take_if(|_| is_made)?.join();
        // A diagnosis that panicked is a fault of this program and ends it as anywhere else.
        Some(made.unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
    }
}

impl Stage for Beside {
    type Input = Input;
    type Output = Output;
    type Error = <GapDiagnosisStage as Stage>::Error;

    fn step(
        &mut self,
        at: Stamp<Host>,
        input: Input,
        out: &mut Vec<Output>,
    ) -> Result<(), Self::Error> {
        if input == Input::Tick
            && let Some(finding) = self.finding()
        {
            self.stage.step(at, Input::Found(Box::new(finding)), out)?;
        }
        self.stage.step(at, input, out)?;
        let due = out
            .iter()
            .position(|output| matches!(output, Output::Due(_)));
        if let Some(Output::Due(task)) = due.map(|place| out.remove(place)) {
            self.under_way = Some(std::thread::spawn(move || task.run()));
        }
        Ok(())
    }
}
