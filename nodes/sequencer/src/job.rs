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
    /// What of it is measured by a grid encoder or length reference.
    pub trace: Trace,
}

/// Geometry and set-up of a measured trajectory; empty for other programs.
#[derive(Clone, Debug)]
pub(crate) struct Trace {
    pub plane: TestPlane,
    pub centre_mm: Vector3<f64>,
    pub radius_mm: f64,
    pub sense: Sense,
    pub tool_offset_mm: Vector3<f64>,
    pub stations: u32,
    pub zero_id: u32,
    pub setup_id: u32,
}

impl Default for Trace {
    fn default() -> Self {
        Self {
            plane: TestPlane::None,
            centre_mm: Vector3::zeros(),
            radius_mm: 0.0,
            sense: Sense::None,
            tool_offset_mm: Vector3::zeros(),
            stations: 0,
            zero_id: 0,
            setup_id: 0,
        }
    }
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
    /// The program is done, but touches that it made have not arrived: until when they are awaited.
    pub awaits_touches_until: Option<Stamp<Host>>,
    pub repeat: u32,
}

impl Job {
    /// The mark of its begin or end.
    pub fn segment(&self, at: Stamp<Host>, begin: bool, completed: bool) -> TestSegment {
        let trace = &self.task.trace;
        TestSegment {
            at,
            run: self.run,
            begin,
            kind: self.task.kind,
            plane: trace.plane,
            centre_mm: trace.centre_mm,
            radius_mm: trace.radius_mm,
            feed_mm_s: self.task.feed_mm_s,
            sense: trace.sense,
            repeat: self.repeat,
            stylus: self.task.stylus.clone(),
            tool_offset_mm: trace.tool_offset_mm,
            stations: trace.stations,
            zero_id: trace.zero_id,
            setup_id: trace.setup_id,
            cold: self.task.cold,
            features: self.task.features.clone(),
            completed,
        }
    }
}
