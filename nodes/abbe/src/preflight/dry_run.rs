//! A plan run on a machine without errors: its sequencer, its control, what its nodes ask for, and what would be recorded.

use std::collections::{BTreeMap, VecDeque};

use anyhow::{Context, Result, bail};
use fake_cnc::{Cnc, Outcome};
use gap_diagnosis::session::{Input, SessionBuilder, SessionConfig};
use machine::MachineFile;
use metrology::Stage;
use metrology::sample::{PlanState, TestKind};
use metrology::stamp::{Host, Span, Stamp};
use sequencer::{Plan, ProgramEnd, Sequencer, Step};
use thermal_model::ThermalModelConfig;
use twin::Session;

use super::ideal::IdealMachine;
use super::requests::Requests;

/// Time between two looks of the sequencer at its plan.
const PLAN_PERIOD: Span = Span::from_nanos(100_000_000);
/// Longest programme, s.
pub const LIMIT_S: f64 = 24.0 * 3600.0;

/// What a plan would record.
pub struct DryRun {
    /// The session of an ideal machine.
    pub session: Session,
    /// How long the plan takes.
    pub minutes: f64,
    /// Touches of its cycles.
    pub touches: u64,
    /// Block cycles that its nodes ask for besides.
    pub requested: u32,
    /// How far each thermometer changes, K; empty where temperatures stand still.
    pub changes_k: Vec<(String, f64)>,
}

/// What is foreseen beside the plan.
#[derive(Clone, Copy, Default)]
pub struct Beside<'b> {
    /// Whether what moves warms the machine, as [`super::warming`] has it; else temperatures stand still.
    pub warms: bool,
    /// Parameters of the thermal model that asks for block cycles.
    pub thermal_model: Option<&'b ThermalModelConfig>,
}

/// Control, sequencer and what is recorded of them.
struct Rehearsal {
    now: Stamp<Host>,
    cnc: Cnc<IdealMachine>,
    sequencer: Sequencer,
    orders: VecDeque<fake_cnc::Input>,
    news: VecDeque<sequencer::Input>,
    recorded: SessionBuilder,
    requests: Option<Requests>,
    touches: u64,
    /// Block cycles that began.
    cycles: u32,
    state: PlanState,
    message: String,
}

/// Runs a plan; `programs` are those that it names.
///
/// # Errors
/// When the plan cannot be run on this machine, or no session comes of it.
pub fn dry_run(
    plan: &Plan,
    programs: BTreeMap<String, String>,
    machine: &MachineFile,
    control: &fake_cnc::Config,
    beside: Beside<'_>,
) -> Result<DryRun> {
    let mut rehearsal = Rehearsal::new(plan, programs, machine, control, beside)?;
    let period = Span::from_secs_f64(machine.control.servo_period_ms / 1e3);
    let mut look_at = rehearsal.now;
    while rehearsal.state != PlanState::Done {
        if rehearsal.now >= look_at {
            look_at += PLAN_PERIOD;
            rehearsal.news.push_back(sequencer::Input::Tick);
        }
        rehearsal.orders.push_back(fake_cnc::Input::Tick);
        rehearsal.ask();
        rehearsal.settle()?;
        if rehearsal.state == PlanState::Failed {
            bail!("plan: it would fail: {}", rehearsal.message);
        }
        let passed_s = rehearsal.now.as_secs_f64();
        if passed_s > LIMIT_S {
            bail!(
                "plan: it would take more than {} h: ask it of a part of the plan",
                LIMIT_S / 3600.0
            );
        }
        rehearsal.now += period;
    }
    let minutes = rehearsal.now.as_secs_f64() / 60.0;
    let changes = rehearsal.cnc.hardware().changes_k();
    let changes_k = changes.map(|(id, k)| (id.to_owned(), k)).collect();
    let (session, _) = rehearsal.recorded.finish()?;
    Ok(DryRun {
        session,
        minutes,
        touches: rehearsal.touches,
        requested: rehearsal.cycles.saturating_sub(planned_cycles(plan)),
        changes_k,
    })
}

/// Block cycles that are steps of a plan.
fn planned_cycles(plan: &Plan) -> u32 {
    let steps = plan.steps.iter();
    let blocks = steps.filter(|step| matches!(step, Step::Blocks { .. }));
    blocks.fold(0, |n, _| n + 1)
}

impl Rehearsal {
    fn new(
        plan: &Plan,
        programs: BTreeMap<String, String>,
        machine: &MachineFile,
        control: &fake_cnc::Config,
        beside: Beside<'_>,
    ) -> Result<Self> {
        let settings = sequencer::Config::default();
        let ideal = IdealMachine::new(machine)?;
        let ideal = if beside.warms {
            ideal.warming(machine)
        } else {
            ideal
        };
        let requests = beside.thermal_model.map(|it| Requests::new(it, machine));
        Ok(Self {
            now: Stamp::from_nanos(0),
            cnc: Cnc::new(control, machine, ideal)?,
            sequencer: Sequencer::new(settings, machine.clone(), Some(plan.clone()), programs)
                .context("plan")?,
            orders: VecDeque::new(),
            news: VecDeque::new(),
            recorded: SessionBuilder::new(machine, SessionConfig::default())?,
            requests: requests.transpose()?,
            touches: 0,
            cycles: 0,
            state: PlanState::Waiting,
            message: String::new(),
        })
    }

    /// Hands on what the thermal model asks for.
    fn ask(&mut self) {
        let now = self.now;
        let request = self.requests.as_mut().and_then(|it| it.tick(now));
        self.news
            .extend(request.map(sequencer::Input::UpdateRequest));
    }

    /// Hands on what control and sequencer tell each other until both are silent.
    fn settle(&mut self) -> Result<()> {
        let (mut said, mut told) = (vec![], vec![]);
        loop {
            if let Some(order) = self.orders.pop_front() {
                self.cnc.step(self.now, order, &mut said)?;
                for output in said.drain(..) {
                    self.of_control(output);
                }
            } else if let Some(news) = self.news.pop_front() {
                let Ok(()) = self.sequencer.step(self.now, news, &mut told);
                for output in told.drain(..) {
                    self.of_sequencer(output);
                }
            } else {
                return Ok(());
            }
        }
    }

    fn of_control(&mut self, output: fake_cnc::Output) {
        use fake_cnc::Output as Said;
        let news = match output {
            Said::State(state) => return self.recorded.take(Input::State(state)),
            Said::Grid(sample) => return self.recorded.take(Input::Grid(sample)),
            Said::Length(sample) => return self.recorded.take(Input::Length(sample)),
            Said::Temperature(sample) => {
                if let Some(requests) = &mut self.requests {
                    requests.temperature(self.now, sample.clone());
                }
                return self.recorded.take(Input::Temperature(sample));
            }
            Said::Trigger(trigger) => {
                self.touches += 1;
                if let Some(requests) = &mut self.requests {
                    requests.touched(self.now);
                }
                self.recorded.take(Input::Trigger(trigger.clone()));
                sequencer::Input::Touch(trigger)
            }
            Said::Accepted { goal } => sequencer::Input::ProgramAnswer {
                id: goal,
                accepted: true,
            },
            Said::Refused { goal, .. } => sequencer::Input::ProgramAnswer {
                id: goal,
                accepted: false,
            },
            Said::Finished {
                goal,
                outcome,
                message,
                ..
            } => sequencer::Input::ProgramEnd {
                id: goal,
                end: Some(ProgramEnd {
                    done: outcome == Outcome::Done,
                    message,
                }),
            },
            Said::Feedback { .. } | Said::Diagnostic(_) | Said::Answer(_) | Said::AtRest => return,
        };
        self.news.push_back(news);
    }

    fn of_sequencer(&mut self, output: sequencer::Output) {
        use sequencer::Output as Told;
        match output {
            Told::SendProgram { id, name, text } => {
                self.orders.push_back(fake_cnc::Input::RunProgram {
                    goal: id,
                    text,
                    name,
                });
            }
            Told::CancelProgram(goal) => {
                self.orders
                    .push_back(fake_cnc::Input::CancelProgram { goal });
            }
            Told::Segment(segment) => {
                self.cycles += u32::from(segment.begin && segment.kind == TestKind::Block);
                if let Some(requests) = &mut self.requests {
                    requests.segment(self.now, &segment);
                }
                self.recorded.take(Input::Segment(segment));
            }
            // An ideal machine has nothing to compensate.
            Told::SwitchCompensation { id, .. } => {
                self.news.push_back(sequencer::Input::CompensationAnswer {
                    id,
                    answer: Some((true, String::new())),
                });
            }
            Told::Status(status) => {
                self.state = status.state;
                self.message = status.message;
            }
            Told::CycleAccepted(_)
            | Told::CycleRejected { .. }
            | Told::CycleProgress { .. }
            | Told::CycleEnded(_)
            | Told::Pointed { .. }
            | Told::ToldBefore { .. }
            | Told::ProgramFailed { .. } => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::programme::Planned;
    use super::*;

    /// The cold blocks and half an hour of production of `first_run`.
    fn half_an_hour() -> Planned {
        let folder = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../launch_configs/first_run"
        );
        let mut planned = Planned::read(Path::new(folder), None).unwrap();
        planned.plan.steps = vec![
            Step::Blocks {
                blocks: Vec::new(),
                cold: true,
            },
            Step::Produce {
                program: "production.ngc".to_owned(),
                minutes: 30.0,
                serve_updates: true,
            },
        ];
        planned
    }

    fn run(planned: &Planned, beside: Beside<'_>) -> DryRun {
        let programs = planned.programs.clone();
        dry_run(
            &planned.plan,
            programs,
            &planned.machine,
            &planned.control,
            beside,
        )
        .unwrap()
    }

    /// It asks once the load has changed for the least period of 5 min, and 15 min after each cycle: 5 and 20 min.
    #[test]
    fn the_thermal_model_of_a_scenario_adds_its_cycles_and_production_warms_the_machine() {
        let planned = half_an_hour();
        let with = run(&planned, planned.beside());
        assert!((1..=3).contains(&with.requested), "{}", with.requested);
        let cycles = 1 + with.requested;
        assert_eq!(with.session.runs.len(), cycles as usize);
        assert_eq!(with.touches, 6 * u64::from(cycles));
        let change_k = |run: &DryRun, id: &str| {
            let found = run.changes_k.iter().find(|(sensor, _)| sensor == id);
            found.map(|(_, change_k)| *change_k)
        };
        assert!(change_k(&with, "spindle_front").unwrap() > 5.0);
        let still = run(&planned, Beside::default());
        assert_eq!((still.requested, still.session.runs.len()), (0, 1));
        assert_eq!(change_k(&still, "spindle_front"), None);
    }
}
