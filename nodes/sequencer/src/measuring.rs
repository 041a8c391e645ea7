//! Steps that a grid encoder, a length reference or scales measure, run by run.
//!
//! Which plate or beam is up, and whether its count still stands, decides how each run begins: a new
//! placement is mounted over the top of Z, a count that was lost (another program ran in between, or
//! the last one failed) or is wanted anew is set to zero, and otherwise the head goes straight on, so that
//! recordings share one zero. Mounting and zeroing is a program of its own before the recording's segment
//! begins: readings of the zero before cannot fall into it.

use machine::MachineFile;
use machine::trajectory::{Arrival, Trajectory};
use metrology::sample::{Sense, TestKind};

use crate::error::SequencerError;
use crate::job::{Owner, Task, Trace};
use crate::plan::{DiagonalStep, GridStep, PositioningStep, Step};

/// One run of a measuring step.
#[derive(Clone, Debug)]
pub(crate) struct Measurement {
    /// Place of the step in the plan.
    pub step: usize,
    what: What,
    /// Which repetition, from 0.
    pub repeat: u32,
}

#[derive(Clone, Debug)]
enum What {
    Grid(GridStep, Sense),
    Positioning(PositioningStep),
    Scan(PositioningStep),
    Diagonal(DiagonalStep, String),
}

/// What counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Device {
    Grid,
    Length,
}

/// A plate or beam that is up.
#[derive(Clone, Debug)]
struct Up {
    device: Device,
    id: String,
    setup_id: u32,
    /// Whether its count still stands.
    counts: bool,
}

/// What is up, and how often things were set up and zeroed.
#[derive(Clone, Debug, Default)]
pub(crate) struct Setups {
    up: Option<Up>,
    setups: u32,
    grid_zeros: u32,
    length_zeros: u32,
}

/// The runs of `step`, in order; none for a step of another kind.
pub(crate) fn runs(at: usize, step: &Step) -> Vec<Measurement> {
    let measurement = |what, repeat| Measurement {
        step: at,
        what,
        repeat,
    };
    match step {
        Step::Grid(grid) => (0..grid.repeats)
            .flat_map(|repeat| {
                let senses = grid.sense.list().iter();
                senses.map(move |sense| (What::Grid(grid.clone(), *sense), repeat))
            })
            .map(|(what, repeat)| measurement(what, repeat))
            .collect(),
        Step::Positioning(run) => (0..run.runs)
            .map(|repeat| measurement(What::Positioning(run.clone()), repeat))
            .collect(),
        Step::Scan(run) => (0..run.runs)
            .map(|repeat| measurement(What::Scan(run.clone()), repeat))
            .collect(),
        Step::Diagonals(diagonals) => diagonals
            .beams
            .iter()
            .flat_map(|beam| (0..diagonals.runs).map(move |repeat| (beam, repeat)))
            .map(|(beam, repeat)| {
                measurement(What::Diagonal(diagonals.clone(), beam.clone()), repeat)
            })
            .collect(),
        _ => Vec::new(),
    }
}

/// Checks that every run of `step` can be made, wherever it begins.
pub(crate) fn check(at: usize, step: &Step, machine: &MachineFile) -> Result<(), SequencerError> {
    let runs = runs(at, step);
    if runs.is_empty() {
        return Err(SequencerError::NothingToRun { step: at });
    }
    for run in runs.iter().filter(|run| run.repeat == 0) {
        run.program(machine, Arrival::Mount)?;
    }
    Ok(())
}

impl Setups {
    /// Another program runs or a run failed: what was counted is lost.
    pub(crate) fn lose_count(&mut self) {
        if let Some(up) = &mut self.up {
            up.counts = false;
        }
    }

    /// The task of `run`, and the one that sets up what measures it where something has to be.
    pub(crate) fn tasks(
        &mut self,
        run: &Measurement,
        machine: &MachineFile,
    ) -> Result<(Option<Task>, Task), SequencerError> {
        let Some((device, id, rezero)) = run.device() else {
            self.lose_count();
            let trajectory = run.program(machine, Arrival::Mount)?;
            return Ok((None, run.task(trajectory, 0, 0)));
        };
        let known = self
            .up
            .as_ref()
            .filter(|up| up.device == device && up.id == id);
        let arrival = match known {
            None => Arrival::Mount,
            Some(up) if !up.counts => Arrival::Return,
            Some(_) if rezero => Arrival::Zero,
            Some(_) => Arrival::Straight,
        };
        let trajectory = run.program(machine, arrival)?;
        if arrival == Arrival::Mount {
            self.setups += 1;
            self.up = Some(Up {
                device,
                id: id.to_owned(),
                setup_id: self.setups,
                counts: false,
            });
        }
        let zeros = match device {
            Device::Grid => &mut self.grid_zeros,
            Device::Length => &mut self.length_zeros,
        };
        if arrival != Arrival::Straight {
            *zeros += 1;
        }
        let zero_id = *zeros;
        let setup_id = self.up.as_mut().map_or(0, |up| {
            up.counts = true;
            up.setup_id
        });
        let setup = trajectory.setup.clone();
        let task = run.task(trajectory, zero_id, setup_id);
        let setup = setup.map(|text| Task {
            name: format!("set-up of {}", task.features.join(" ")),
            text,
            kind: TestKind::Production,
            feed_mm_s: 0.0,
            trace: Trace {
                zero_id,
                setup_id,
                ..Trace::default()
            },
            ..task.clone()
        });
        Ok((setup, task))
    }
}

impl Measurement {
    /// The step over a plate and its sense, where it is one.
    pub(crate) const fn grid(&self) -> Option<(&GridStep, Sense)> {
        match &self.what {
            What::Grid(step, sense) => Some((step, *sense)),
            _ => None,
        }
    }

    /// What measures it, where, and whether its count is wanted anew; `None`: scales alone.
    fn device(&self) -> Option<(Device, &str, bool)> {
        match &self.what {
            What::Grid(step, _) => Some((Device::Grid, &step.placement, step.rezero)),
            What::Positioning(step) | What::Scan(step) => {
                let beam = step.beam.as_deref()?;
                Some((Device::Length, beam, false))
            }
            What::Diagonal(_, beam) => Some((Device::Length, beam, false)),
        }
    }

    fn program(
        &self,
        machine: &MachineFile,
        arrival: Arrival,
    ) -> Result<Trajectory, SequencerError> {
        match &self.what {
            What::Grid(step, sense) => step.program(self.step, machine, *sense, arrival),
            What::Positioning(step) => step.program(self.step, machine, true, arrival),
            What::Scan(step) => step.program(self.step, machine, false, arrival),
            What::Diagonal(step, beam) => step.program(self.step, machine, beam, arrival),
        }
    }

    fn task(&self, trajectory: Trajectory, zero_id: u32, setup_id: u32) -> Task {
        let mut features = match &self.what {
            What::Positioning(step) | What::Scan(step) => vec![step.axis.letter().to_owned()],
            What::Grid(..) | What::Diagonal(..) => Vec::new(),
        };
        features.extend(self.device().map(|(_, id, _)| id.to_owned()));
        Task {
            name: format!("{:?}", trajectory.kind).to_lowercase(),
            text: trajectory.program,
            kind: trajectory.kind,
            features,
            planned: 0,
            cold: false,
            feed_mm_s: trajectory.feed_mm_s,
            stylus: String::new(),
            owner: Owner::Step,
            trace: Trace {
                plane: trajectory.plane,
                centre_mm: trajectory.centre_mm,
                radius_mm: trajectory.radius_mm,
                sense: trajectory.sense,
                tool_offset_mm: trajectory.tool_offset_mm,
                stations: trajectory.stations,
                zero_id,
                setup_id,
            },
        }
    }
}
