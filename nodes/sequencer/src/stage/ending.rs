//! How a program's end is judged: also one that ran to its end has failed when touches were lost.

use metrology::sample::ProbeTrigger;
use metrology::stamp::Span;

use super::{CANCELED, CycleOutcome, Output, ProgramEnd, Sequencer};
use crate::job::Owner;

/// How long touches are awaited after their program's end, s: on a live graph they come by another way than the end does,
/// and on a computer that stood still for seconds they are sent again first.
const STRAGGLERS_S: f64 = 10.0;

impl Sequencer {
    /// The controller says that the program ended.
    pub(super) fn ended(&mut self, end: ProgramEnd, out: &mut Vec<Output>) {
        if let Some(job) = &mut self.job
            && end.done
            && job.touches < job.task.planned
        {
            job.awaits_touches_until = Some(self.now + Span::from_secs_f64(STRAGGLERS_S));
            return;
        }
        let canceled = end.message == CANCELED;
        self.end(&end, canceled, out);
    }

    /// A touch has come.
    pub(super) fn touched(&mut self, trigger: &ProbeTrigger, out: &mut Vec<Output>) {
        if !self.touches.is_new(self.now, trigger) {
            let sequence = trigger.sequence;
            out.push(Output::ToldBefore { sequence });
            return;
        }
        let Some(job) = &mut self.job else { return };
        job.touches += 1;
        let (touches, planned) = (job.touches, job.task.planned);
        let is_last = job.awaits_touches_until.is_some() && touches >= planned;
        if let Owner::Goal(id) = job.task.owner {
            out.push(Output::CycleProgress {
                id,
                touches,
                planned,
            });
        }
        if is_last {
            let done = ProgramEnd {
                done: true,
                message: String::new(),
            };
            self.end(&done, false, out);
        }
    }

    /// Fails the program whose touches have been awaited long enough.
    pub(super) fn give_up_touches(&mut self, out: &mut Vec<Output>) {
        let Some(job) = &self.job else { return };
        if job
            .awaits_touches_until
            .is_none_or(|until| self.now < until)
        {
            return;
        }
        let message = format!(
            "{} of {} touches arrived within {STRAGGLERS_S} s of the program's end, the others were lost; see whether \
             the computer or the network was overloaded, then measure again",
            job.touches, job.task.planned
        );
        let lost = ProgramEnd {
            done: false,
            message,
        };
        self.end(&lost, false, out);
    }

    pub(super) fn end(&mut self, end: &ProgramEnd, canceled: bool, out: &mut Vec<Output>) {
        let Some(job) = self.job.take() else { return };
        out.push(Output::Segment(job.segment(self.now, false, end.done)));
        if !end.done {
            self.setups.lose_count();
            let (name, message) = (job.task.name.clone(), end.message.clone());
            out.push(Output::ProgramFailed {
                name,
                run: job.run,
                message,
            });
        }
        match job.task.owner {
            Owner::Goal(id) => out.push(Output::CycleEnded(CycleOutcome {
                id,
                success: end.done,
                canceled,
                message: end.message.clone(),
                run: job.run,
            })),
            Owner::Step if !end.done => {
                self.fail(format!("{}: {}", job.task.name, end.message), out);
            }
            Owner::Step | Owner::Update => {}
        }
        self.go_on(out);
    }
}
