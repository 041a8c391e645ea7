//! Steps of a plan and cycle goals, one program at a time.

use std::collections::{BTreeMap, VecDeque};
use std::convert::Infallible;

use machine::{MachineFile, program_machine};
use metrology::Stage;
use metrology::number::number;
use metrology::sample::{
    CycleOrder, NewTouches, PlanState, PlanStatus, ProbeTrigger, TestSegment, UpdateRequest,
};
use metrology::stamp::{Host, Span, Stamp};

use crate::config::Config;
use crate::error::SequencerError;
use crate::job::{Job, Owner, Task};
use crate::measuring::{self, Measurement, Setups};
use crate::plan::{Plan, Step};
use crate::rotary;
use crate::task;
use crate::touch_along::{self, PointedTouch};

/// What the sequencer is told.
#[derive(Clone, Debug)]
#[expect(missing_docs, reason = "fields are named in the variant's sentence")]
pub enum Input {
    /// Somebody orders a cycle.
    Cycle(CycleGoal),
    /// The order is called off.
    CancelCycle(u64),
    /// An order that cannot be understood.
    BadCycle { id: u64, reason: String },
    /// Whether a controller took our program.
    ProgramAnswer { id: u64, accepted: bool },
    /// How far the program is.
    ProgramProgress { id: u64, progress: f64 },
    /// The program ended; `None`: the controller vanished.
    ProgramEnd { id: u64, end: Option<ProgramEnd> },
    /// A touch was made.
    Touch(ProbeTrigger),
    /// The thermal model asks for a block cycle.
    UpdateRequest(UpdateRequest),
    /// The compensation was switched, or refused to be; `None`: nobody answered.
    CompensationAnswer {
        id: u64,
        answer: Option<(bool, String)>,
    },
    /// Time passes.
    Tick,
}

/// An order with the number of its goal.
#[derive(Clone, Debug)]
pub struct CycleGoal {
    /// Number of the goal.
    pub id: u64,
    /// The order.
    pub order: CycleOrder,
}

/// How a program ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProgramEnd {
    /// Whether it ran to its end.
    pub done: bool,
    /// What happened, where it did not.
    pub message: String,
}

/// How a cycle ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CycleOutcome {
    /// Number of the goal.
    pub id: u64,
    /// Whether every touch was made.
    pub success: bool,
    /// Whether its client called it off.
    pub canceled: bool,
    /// What happened.
    pub message: String,
    /// Run number of its segment; 0: it never began.
    pub run: u32,
}

/// What the sequencer says.
#[derive(Clone, Debug, PartialEq)]
#[expect(missing_docs, reason = "fields are named in the variant's sentence")]
pub enum Output {
    /// Propose a program to the controller.
    SendProgram { id: u64, name: String, text: String },
    /// Call a program off.
    CancelProgram(u64),
    /// Begin or end of a test.
    Segment(TestSegment),
    /// Switch the compensation.
    SwitchCompensation { id: u64, enable: bool },
    /// A cycle's goal is taken.
    CycleAccepted(u64),
    /// A cycle's goal is refused.
    CycleRejected { id: u64, reason: String },
    /// Touches made and planned of a cycle's goal.
    CycleProgress { id: u64, touches: u32, planned: u32 },
    /// A cycle's goal ended.
    CycleEnded(CycleOutcome),
    /// What is being done.
    Status(PlanStatus),
    /// How a run takes a direction of the probe's axis.
    Pointed { run: u32, touch: PointedTouch },
    /// A touch was told again, or after a later one: it does not count.
    ToldBefore { sequence: u32 },
    /// A program did not run to its end.
    ProgramFailed {
        name: String,
        run: u32,
        message: String,
    },
}

struct Production {
    step: usize,
    program: String,
    from: Stamp<Host>,
    until: Stamp<Host>,
    serve_updates: bool,
    parts: u32,
}

/// Passes of production after which their mean time counts: a few short ones do no harm.
const PASSES_BEFORE: u32 = 100;
/// A pass takes so long at least, s: each is a program with two marks in the bag, and two years of production are allowed.
const SHORTEST_PASS_S: f64 = 1.0;

impl Production {
    /// Why it ends: its program does nothing that takes time.
    fn too_short(&self, now: Stamp<Host>) -> Option<String> {
        let (step, parts, program) = (self.step, self.parts, &self.program);
        let mean_s = (now - self.from).as_secs_f64() / f64::from(parts.max(1));
        (parts >= PASSES_BEFORE && mean_s < SHORTEST_PASS_S).then(|| {
            format!(
                "steps[{step}].program = {program}: {parts} passes took {} s each: a pass of production takes at least {} s: give a program that moves or dwells, or `do: run`",
                number(mean_s),
                number(SHORTEST_PASS_S)
            )
        })
    }
}

/// The sequencer's stage.
pub struct Sequencer {
    config: Config,
    machine: MachineFile,
    /// The mark of the machine file, for controllers.
    mark: Option<u64>,
    programs: BTreeMap<String, String>,
    plan: Option<Plan>,
    state: PlanState,
    message: String,
    step: usize,
    started_at: Option<Stamp<Host>>,
    now: Stamp<Host>,
    job: Option<Job>,
    switching: Option<u64>,
    waiting_until: Option<Stamp<Host>>,
    production: Option<Production>,
    measurements: VecDeque<Measurement>,
    /// The recording whose set-up is under way, and its repetition.
    prepared: Option<(Task, u32)>,
    setups: Setups,
    update_wanted: bool,
    next_run: u32,
    next_id: u64,
    block_cycles: u32,
    touches: NewTouches,
}

impl Sequencer {
    /// A sequencer for `machine`; `programs` are RS-274 texts by the names that the plan uses.
    ///
    /// # Errors
    /// When the plan names an unknown program or a cycle that this machine cannot run: the whole plan is
    /// checked before anything moves.
    pub fn new(
        config: Config,
        machine: MachineFile,
        plan: Option<Plan>,
        programs: BTreeMap<String, String>,
    ) -> Result<Self, SequencerError> {
        if let Some(plan) = &plan {
            task::check(plan, &machine, &programs)?;
        }
        Ok(Self {
            config,
            mark: program_machine::mark_of(&machine),
            machine,
            programs,
            state: PlanState::Waiting,
            message: String::new(),
            plan,
            step: 0,
            started_at: None,
            now: Stamp::default(),
            job: None,
            switching: None,
            waiting_until: None,
            production: None,
            measurements: VecDeque::new(),
            prepared: None,
            setups: Setups::default(),
            update_wanted: false,
            next_run: 1,
            next_id: 1,
            block_cycles: 0,
            touches: NewTouches::default(),
        })
    }

    fn steps(&self) -> &[Step] {
        self.plan.as_ref().map_or(&[], |plan| &plan.steps)
    }

    fn is_idle(&self) -> bool {
        self.job.is_none() && self.switching.is_none() && self.waiting_until.is_none()
    }

    fn say(&self, out: &mut Vec<Output>) {
        let step = self.step.min(self.steps().len());
        let activity = match (step, self.steps().get(step.wrapping_sub(1))) {
            (_, Some(step)) if self.state == PlanState::Running => step.activity(),
            _ => String::new(),
        };
        let progress = self.production.as_ref().map_or(0.0, |production| {
            let whole_s = (production.until - production.from).as_secs_f64();
            ((self.now - production.from).as_secs_f64() / whole_s).min(1.0)
        });
        out.push(Output::Status(PlanStatus {
            at: self.now,
            state: self.state,
            step: count(step),
            steps: count(self.steps().len()),
            activity,
            run: self.job.as_ref().map_or(0, |job| job.run),
            progress,
            message: self.message.clone(),
        }));
    }

    fn fail(&mut self, message: String, out: &mut Vec<Output>) {
        self.state = PlanState::Failed;
        self.production = None;
        self.measurements.clear();
        self.prepared = None;
        self.message = message;
        self.say(out);
    }

    /// Begins whatever is next, if nothing is under way.
    fn go_on(&mut self, out: &mut Vec<Output>) {
        while self.is_idle() && self.state == PlanState::Running {
            if self.production.is_some() {
                if self.produce(out) {
                    continue;
                }
                return;
            }
            if let Some((task, repeat)) = self.prepared.take() {
                self.begin(task, repeat, out);
                return;
            }
            if let Some(run) = self.measurements.pop_front() {
                self.measure(&run, out);
                return;
            }
            let Some(step) = self.steps().get(self.step).cloned() else {
                self.state = PlanState::Done;
                self.say(out);
                return;
            };
            self.step += 1;
            self.begin_step(&step, out);
        }
    }

    /// Runs the next part or a block cycle; true when the production step is over.
    fn produce(&mut self, out: &mut Vec<Output>) -> bool {
        let Some(production) = &mut self.production else {
            return true;
        };
        if self.update_wanted && production.serve_updates {
            self.update_wanted = false;
            match task::update(&self.machine) {
                Ok(task) => self.begin(task, 0, out),
                Err(error) => self.fail(error.to_string(), out),
            }
            return false;
        }
        if self.now >= production.until {
            self.production = None;
            return true;
        }
        if let Some(reason) = production.too_short(self.now) {
            self.fail(reason, out);
            return false;
        }
        let repeat = production.parts;
        production.parts += 1;
        let task = task::part(&production.program, &self.programs);
        let step = production.step;
        match task {
            Some(task) => self.begin(task, repeat, out),
            None => self.fail(format!("steps[{step}]: its program is gone"), out),
        }
        false
    }

    fn begin_step(&mut self, step: &Step, out: &mut Vec<Output>) {
        match step {
            Step::Compensation { enable } => {
                let id = self.take_id();
                self.switching = Some(id);
                out.push(Output::SwitchCompensation {
                    id,
                    enable: *enable,
                });
                self.say(out);
            }
            Step::Produce {
                program,
                minutes,
                serve_updates,
            } => {
                self.production = Some(Production {
                    step: self.step - 1,
                    program: program.clone(),
                    from: self.now,
                    until: self.now + Span::from_secs_f64(minutes * 60.0),
                    serve_updates: *serve_updates,
                    parts: 0,
                });
                self.say(out);
            }
            Step::Rotary(rotary) => {
                let at = self.step - 1;
                match rotary::task(at, rotary, self.steps(), &self.machine) {
                    Ok(task) => self.begin(task, 0, out),
                    Err(error) => self.fail(error.to_string(), out),
                }
            }
            Step::TouchAlong(along) => {
                match touch_along::task(self.step - 1, along, &self.machine) {
                    Ok((task, touches)) => {
                        let run = self.next_run;
                        self.begin(task, 0, out);
                        let pointed = touches.into_iter();
                        out.extend(pointed.map(|touch| Output::Pointed { run, touch }));
                    }
                    Err(error) => self.fail(error.to_string(), out),
                }
            }
            Step::Wait { seconds } => {
                self.waiting_until = Some(self.now + Span::from_secs_f64(*seconds));
                self.say(out);
            }
            Step::Grid(_) | Step::Positioning(_) | Step::Scan(_) | Step::Diagonals(_) => {
                self.measurements = measuring::runs(self.step - 1, step).into();
            }
            step => match task::of_step(self.step - 1, step, &self.machine, &self.programs) {
                Ok(task) => self.begin(task, 0, out),
                Err(error) => self.fail(error.to_string(), out),
            },
        }
    }

    fn measure(&mut self, run: &Measurement, out: &mut Vec<Output>) {
        match self.setups.tasks(run, &self.machine) {
            Ok((Some(setup), task)) => {
                self.prepared = Some((task, run.repeat));
                self.begin(setup, run.repeat, out);
            }
            Ok((None, task)) => self.begin(task, run.repeat, out),
            Err(error) => self.fail(error.to_string(), out),
        }
    }

    fn take_id(&mut self) -> u64 {
        let id = self.next_id;
        self.next_id += 1;
        id
    }

    fn begin(&mut self, task: Task, repeat: u32, out: &mut Vec<Output>) {
        if task.trace.zero_id == 0 {
            self.setups.lose_count();
        }
        let repeat = if task.owner == Owner::Update {
            self.block_cycles += 1;
            self.block_cycles
        } else {
            repeat
        };
        let job = Job {
            run: self.next_run,
            program: 0,
            attempts: 0,
            retry_at: None,
            touches: 0,
            awaits_touches_until: None,
            repeat,
            task,
        };
        self.next_run += 1;
        out.push(Output::Segment(job.segment(self.now, true, false)));
        self.job = Some(job);
        self.propose(out);
        self.say(out);
    }

    fn propose(&mut self, out: &mut Vec<Output>) {
        let id = self.take_id();
        if let Some(job) = &mut self.job {
            job.program = id;
            job.attempts += 1;
            job.retry_at = None;
            let (name, text) = (job.task.name.clone(), &job.task.text);
            let text = match self.mark {
                Some(mark) => program_machine::marked(text, mark),
                None => text.clone(),
            };
            out.push(Output::SendProgram { id, name, text });
        }
    }

    fn answered(&mut self, id: u64, accepted: bool, out: &mut Vec<Output>) {
        let Some(job) = self.job.as_mut().filter(|job| job.program == id) else {
            return;
        };
        if accepted {
            return;
        }
        if job.attempts < self.config.attempts {
            let wait = Span::from_secs_f64(self.config.retry_delay_s);
            job.retry_at = Some(self.now + wait);
            return;
        }
        let message = format!(
            "no controller took the program in {} attempts, {} s apart",
            job.attempts, self.config.retry_delay_s
        );
        self.end(
            &ProgramEnd {
                done: false,
                message,
            },
            false,
            out,
        );
    }

    fn tick(&mut self, out: &mut Vec<Output>) {
        let from = *self.started_at.get_or_insert(self.now);
        let waited_s = (self.now - from).as_secs_f64();
        if self.state == PlanState::Waiting
            && self.plan.is_some()
            && waited_s >= self.config.start_delay_s
        {
            self.state = PlanState::Running;
        }
        if self.waiting_until.is_some_and(|until| until <= self.now) {
            self.waiting_until = None;
        }
        if self
            .job
            .as_ref()
            .and_then(|job| job.retry_at)
            .is_some_and(|at| at <= self.now)
        {
            self.propose(out);
        }
        self.give_up_touches(out);
        self.go_on(out);
    }

    fn order(&mut self, goal: &CycleGoal, out: &mut Vec<Output>) {
        let id = goal.id;
        if !self.is_idle() || self.state == PlanState::Running {
            let reason = "the sequencer is busy: one program at a time".to_owned();
            out.push(Output::CycleRejected { id, reason });
            return;
        }
        match task::of_order(&goal.order, &self.machine, Owner::Goal(id)) {
            Ok(task) => {
                out.push(Output::CycleAccepted(id));
                self.begin(task, 0, out);
            }
            Err(error) => {
                out.push(Output::CycleRejected {
                    id,
                    reason: error.to_string(),
                });
            }
        }
    }

    fn cancel(&mut self, id: u64, out: &mut Vec<Output>) {
        if let Some(job) = self
            .job
            .as_ref()
            .filter(|job| job.task.owner == Owner::Goal(id))
        {
            out.push(Output::CancelProgram(job.program));
        }
    }

    fn switched(&mut self, id: u64, answer: Option<(bool, String)>, out: &mut Vec<Output>) {
        if self.switching != Some(id) {
            return;
        }
        self.switching = None;
        match answer {
            Some((true, _)) => self.go_on(out),
            Some((false, reason)) => self.fail(format!("compensation: {reason}"), out),
            None => self.fail("compensation: no node answered the switch".to_owned(), out),
        }
    }
}

impl Sequencer {
    /// The host's clock was set back: what is waited for comes as much later as it would have.
    fn set_back(&mut self, by: Span) {
        let job = self.job.as_mut();
        let of_job = job.map(|job| [job.retry_at.as_mut(), job.awaits_touches_until.as_mut()]);
        let production = self.production.as_mut();
        let of_production = production.map(|part| [Some(&mut part.from), Some(&mut part.until)]);
        let own = [self.started_at.as_mut(), self.waiting_until.as_mut()];
        for all in [Some(own), of_job, of_production].into_iter().flatten() {
            for stamp in all.into_iter().flatten() {
                *stamp = *stamp - by;
            }
        }
    }
}

impl Stage for Sequencer {
    type Input = Input;
    type Output = Output;
    type Error = Infallible;

    fn step(
        &mut self,
        at: Stamp<Host>,
        input: Input,
        out: &mut Vec<Output>,
    ) -> Result<(), Infallible> {
        if at < self.now {
            self.set_back(self.now - at);
        }
        self.now = at;
        match input {
            Input::Cycle(goal) => self.order(&goal, out),
            Input::CancelCycle(id) => self.cancel(id, out),
            Input::BadCycle { id, reason } => out.push(Output::CycleRejected { id, reason }),
            Input::ProgramAnswer { id, accepted } => self.answered(id, accepted, out),
            Input::ProgramProgress { .. } => {}
            Input::ProgramEnd { id, end } => {
                if self.job.as_ref().is_some_and(|job| job.program == id) {
                    let lost = || ProgramEnd {
                        done: false,
                        message: "the controller vanished while it ran".to_owned(),
                    };
                    self.ended(end.unwrap_or_else(lost), out);
                }
            }
            Input::Touch(trigger) => self.touched(&trigger, out),
            Input::UpdateRequest(_) => self.update_wanted = true,
            Input::CompensationAnswer { id, answer } => self.switched(id, answer, out),
            Input::Tick => self.tick(out),
        }
        Ok(())
    }
}

fn count(n: usize) -> u32 {
    u32::try_from(n).unwrap_or(u32::MAX)
}

/// Message of a program that was stopped because its client called it off.
pub const CANCELED: &str = "called off";

mod ending;
#[cfg(test)]
mod tests;
