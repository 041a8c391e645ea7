//! One program on the controller and the segment around it.

use metrology::sample::{Sense, TestKind, TestPlane, TestSegment};
use metrology::stamp::{Host, Stamp};
use nalgebra::Vector3;

/// What is to be run.
#[derive(Clone, Debug)]
pub(crate) struct Task {
    /// Name for displays.
    pub name: String,
    /// RS-274 text.
    pub text: String,
    /// Kind of the segment.
    pub kind: TestKind,
    /// What is touched.
    pub features: Vec<String>,
    /// Touches planned.
    pub planned: u32,
    /// Whether it becomes the cold reference.
    pub cold: bool,
    /// Programmed feed, mm/s; zero where there is none.
    pub feed_mm_s: f64,
    /// Name of the stylus; empty for programs that do not touch.
    pub stylus: String,
    /// Who ordered it.
    pub owner: Owner,
}

/// Who ordered a task, and so what its failure means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Owner {
    /// A step of the plan: its failure ends the plan.
    Step,
    /// A block cycle between two parts: its failure is reported, production goes on.
    Update,
    /// A goal of `sequencer/run_cycle`.
    Goal(u64),
}

/// A task that is under way.
#[derive(Clone, Debug)]
pub(crate) struct Job {
    pub task: Task,
    pub run: u32,
    /// Number of the goal at the controller.
    pub program: u64,
    /// Proposals so far.
    pub attempts: u32,
    /// When to propose it again; none while a controller has it.
    pub retry_at: Option<Stamp<Host>>,
    /// Touches so far.
    pub touches: u32,
    pub repeat: u32,
}

impl Job {
    /// The mark of its begin or end.
    pub fn segment(&self, at: Stamp<Host>, begin: bool, completed: bool) -> TestSegment {
        TestSegment {
            at,
            run: self.run,
            begin,
            kind: self.task.kind,
            plane: TestPlane::None,
            centre_mm: Vector3::zeros(),
            radius_mm: 0.0,
            feed_mm_s: self.task.feed_mm_s,
            sense: Sense::None,
            repeat: self.repeat,
            stylus: self.task.stylus.clone(),
            tool_offset_mm: Vector3::zeros(),
            stations: 0,
            zero_id: 0,
            setup_id: 0,
            cold: self.task.cold,
            features: self.task.features.clone(),
            completed,
        }
    }
}
