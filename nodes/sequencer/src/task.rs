//! What each step, order and update runs on the controller.

use std::collections::BTreeMap;

use machine::MachineFile;
use machine::cycle::Cycle;
use machine::file::ArtefactEntry;
use metrology::sample::{CycleKind, CycleOrder, TestKind};

use crate::bounds;
use crate::cycle;
use crate::error::{OrderError, SequencerError};
use crate::job::{Owner, Task, Trace};
use crate::measuring;
use crate::plan::{Plan, Step};
use crate::rotary;
use crate::touch_along;
use crate::zeroed;

/// Checks that every step of a plan can be run on this machine.
pub(crate) fn check(
    plan: &Plan,
    machine: &MachineFile,
    programs: &BTreeMap<String, String>,
) -> Result<(), SequencerError> {
    if plan.steps.is_empty() {
        return Err(SequencerError::NoSteps);
    }
    bounds::of_plan(plan)?;
    zeroed::check(plan, programs)?;
    for (at, step) in plan.steps.iter().enumerate() {
        match step {
            Step::Compensation { .. } => {}
            Step::Rotary(step) => {
                rotary::task(at, step, &plan.steps, machine)?;
            }
            Step::TouchAlong(step) => {
                touch_along::task(at, step, machine)?;
            }
            Step::Wait { seconds } => {
                if !(seconds.is_finite() && *seconds > 0.0) {
                    return Err(SequencerError::Seconds {
                        step: at,
                        seconds: *seconds,
                    });
                }
            }
            Step::Produce {
                program, minutes, ..
            } => {
                if !(minutes.is_finite() && *minutes > 0.0) {
                    return Err(SequencerError::Minutes {
                        step: at,
                        minutes: *minutes,
                    });
                }
                text(at, program, programs)?;
            }
            Step::Grid(_) | Step::Positioning(_) | Step::Scan(_) | Step::Diagonals(_) => {
                measuring::check(at, step, machine)?;
            }
            step => {
                of_step(at, step, machine, programs)?;
            }
        }
    }
    Ok(())
}

fn text<'a>(
    step: usize,
    program: &str,
    programs: &'a BTreeMap<String, String>,
) -> Result<&'a str, SequencerError> {
    programs
        .get(program)
        .map(String::as_str)
        .ok_or_else(|| SequencerError::UnknownProgram {
            step,
            program: program.to_owned(),
            known: programs
                .keys()
                .map(String::as_str)
                .collect::<Vec<_>>()
                .join(", "),
        })
}

/// The task of a step that is one program.
pub(crate) fn of_step(
    at: usize,
    step: &Step,
    machine: &MachineFile,
    programs: &BTreeMap<String, String>,
) -> Result<Task, SequencerError> {
    let order = match step {
        // Of an action's goal 0 is what it is by default; a plan says what it means.
        Step::Latency { repeats: 0, .. } => return Err(SequencerError::NoRepeats { step: at }),
        Step::Artefact { points: 0, .. } => return Err(SequencerError::NoPoints { step: at }),
        Step::Blocks { blocks, cold } => order(CycleKind::Blocks, blocks.clone(), *cold),
        Step::Latency {
            feature,
            feeds_mm_min,
            repeats,
        } => CycleOrder {
            feeds_mm_min: feeds_mm_min.clone(),
            repeats: *repeats,
            ..order(CycleKind::Latency, vec![feature.clone()], false)
        },
        Step::Artefact { id, points } => CycleOrder {
            points: *points,
            ..order(kind_of(at, machine, id)?, vec![id.clone()], false)
        },
        Step::Verify { program, label } => {
            let text = text(at, program, programs)?;
            return Ok(plain(
                program,
                text,
                TestKind::Verification,
                vec![label.clone()],
            ));
        }
        Step::Run { program } | Step::Produce { program, .. } => {
            let text = text(at, program, programs)?;
            return Ok(plain(program, text, TestKind::Production, Vec::new()));
        }
        Step::Compensation { .. }
        | Step::Wait { .. }
        | Step::Grid(_)
        | Step::Positioning(_)
        | Step::Scan(_)
        | Step::Diagonals(_)
        | Step::Rotary(_)
        | Step::TouchAlong(_) => {
            return Ok(plain("", "", TestKind::Dwell, Vec::new()));
        }
    };
    of_order(&order, machine, Owner::Step)
        .map_err(|source| SequencerError::Order { step: at, source })
}

/// The task of an ordered cycle.
pub(crate) fn of_order(
    order: &CycleOrder,
    machine: &MachineFile,
    owner: Owner,
) -> Result<Task, OrderError> {
    let cycle = cycle::plan(machine, order)?;
    Ok(of_cycle(cycle, order.cold, machine, owner))
}

/// The task of a cycle's program.
pub(crate) fn of_cycle(cycle: Cycle, cold: bool, machine: &MachineFile, owner: Owner) -> Task {
    Task {
        name: format!("{:?} cycle", cycle.kind).to_lowercase(),
        planned: u32::try_from(cycle.touches.len()).unwrap_or(u32::MAX),
        feed_mm_s: cycle
            .touches
            .first()
            .map_or(0.0, |touch| touch.feed_mm_min / 60.0),
        stylus: machine.probe.mounted.clone(),
        text: cycle.program,
        kind: cycle.kind,
        features: cycle.features,
        cold,
        owner,
        trace: Trace::default(),
    }
}

/// The block cycle that the thermal model asked for.
pub(crate) fn update(machine: &MachineFile) -> Result<Task, OrderError> {
    of_order(
        &order(CycleKind::Blocks, Vec::new(), false),
        machine,
        Owner::Update,
    )
}

/// One part of the production.
pub(crate) fn part(program: &str, programs: &BTreeMap<String, String>) -> Option<Task> {
    let text = programs.get(program)?;
    Some(plain(program, text, TestKind::Production, Vec::new()))
}

fn order(kind: CycleKind, features: Vec<String>, cold: bool) -> CycleOrder {
    CycleOrder {
        kind,
        features,
        feeds_mm_min: Vec::new(),
        points: 0,
        repeats: 1,
        cold,
    }
}

fn plain(name: &str, text: &str, kind: TestKind, features: Vec<String>) -> Task {
    Task {
        name: name.to_owned(),
        text: text.to_owned(),
        kind,
        features,
        planned: 0,
        cold: false,
        feed_mm_s: 0.0,
        stylus: String::new(),
        owner: Owner::Step,
        trace: Trace::default(),
    }
}

/// The cycle that measures an artefact.
fn kind_of(step: usize, machine: &MachineFile, id: &str) -> Result<CycleKind, SequencerError> {
    let named = machine
        .artefacts
        .iter()
        .find(|entry| machine::cycle::artefact_id(entry) == id);
    match named {
        Some(ArtefactEntry::Sphere { .. }) => Ok(CycleKind::Sphere),
        Some(ArtefactEntry::Plane { .. }) => Ok(CycleKind::Plane),
        Some(ArtefactEntry::Bore { .. } | ArtefactEntry::Boss { .. }) => Ok(CycleKind::Bore),
        None => Err(SequencerError::UnknownArtefact {
            step,
            id: id.to_owned(),
        }),
    }
}
