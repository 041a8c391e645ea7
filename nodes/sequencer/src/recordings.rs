//! The recordings of a grid encoder that a plan makes, before it is run.
//!
//! What each recording is told by its segment (plate, zero, set-up), and places along it: a trajectory that
//! is run through is told by as many places as one with stops would have.

use machine::MachineFile;
use machine::trajectory::{Arrival, Pace};
use metrology::sample::TestSegment;
use metrology::stamp::Stamp;
use nalgebra::Vector3;

use crate::bounds;
use crate::error::SequencerError;
use crate::job::Job;
use crate::measuring::{Setups, runs};
use crate::plan::{Plan, Step};

/// Places that tell the way of a trajectory without stops.
const PLACES: u32 = 60;

/// A recording to come.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedRecording {
    /// Its segment; the stamp is zero.
    pub segment: TestSegment,
    /// Axis positions along it in order, mm.
    pub places_mm: Vec<Vector3<f64>>,
}

/// The recordings that `plan` makes over a grid encoder's plate, in order; runs count from 1.
///
/// # Errors
/// As the plan itself would be refused, with step and key.
pub fn recordings(
    plan: &Plan,
    machine: &MachineFile,
) -> Result<Vec<PlannedRecording>, SequencerError> {
    bounds::of_plan(plan)?;
    let mut setups = Setups::default();
    let mut found = Vec::new();
    for (at, step) in plan.steps.iter().enumerate() {
        let runs = runs(at, step);
        if runs.is_empty() && !matches!(step, Step::Compensation { .. } | Step::Wait { .. }) {
            setups.lose_count();
        }
        for run in runs {
            let (_, task) = setups.tasks(&run, machine)?;
            let Some((grid, sense)) = run.grid() else {
                continue;
            };
            let pace = match task.trace.stations {
                0 => Pace::Stationwise {
                    stations: PLACES,
                    dwell_s: 1.0,
                },
                stations => Pace::Stationwise {
                    stations,
                    dwell_s: 1.0,
                },
            };
            let places = grid.paced(at, machine, sense, Arrival::Straight, pace)?;
            let number = u32::try_from(found.len() + 1).unwrap_or(u32::MAX);
            let job = Job {
                task,
                run: number,
                program: 0,
                attempts: 0,
                retry_at: None,
                touches: 0,
                awaits_touches_until: None,
                repeat: run.repeat,
            };
            found.push(PlannedRecording {
                segment: TestSegment {
                    completed: true,
                    ..job.segment(Stamp::from_nanos(0), true, true)
                },
                places_mm: places.stops_mm,
            });
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MACHINE: &str = include_str!("../../../launch_configs/grid_xy/machine.yaml");
    const PLAN: &str = "
title: circles and lines
steps:
  - {do: grid, placement: middle, trajectory: circle, radius_mm: 50.0, feed_mm_min: 1500.0, sense: both, stations: 36, dwell_s: 1.0}
  - {do: grid, placement: middle, trajectory: line, angle_deg: 45.0, length_mm: 100.0, feed_mm_min: 1500.0, on_the_fly: true}
  - {do: grid, placement: middle, trajectory: circle, radius_mm: 25.0, feed_mm_min: 1500.0, stations: 12, dwell_s: 1.0, rezero: true}
  - {do: grid, placement: left, trajectory: circle, radius_mm: 50.0, feed_mm_min: 1500.0, stations: 12, dwell_s: 1.0}
";

    #[test]
    fn a_plan_tells_zeros_set_ups_and_places_before_it_runs() {
        let machine = MachineFile::parse(MACHINE, "machine.yaml").unwrap();
        let plan = Plan::from_yaml(PLAN).unwrap();
        let found = recordings(&plan, &machine).unwrap();
        let told = |r: &PlannedRecording| {
            let s = &r.segment;
            (s.run, s.zero_id, s.setup_id, s.stations, r.places_mm.len())
        };
        let told: Vec<_> = found.iter().map(told).collect();
        let expected = [
            (1, 1, 1, 36, 36),
            (2, 1, 1, 36, 36),
            (3, 1, 1, 0, 60),
            (4, 2, 1, 12, 12),
            (5, 3, 2, 12, 12),
        ];
        assert_eq!(told, expected);
        for place in &found[4].places_mm {
            let from_centre = place - found[4].segment.centre_mm;
            assert!((from_centre.xy().norm() - 50.0).abs() < 1e-9);
        }
        let line = &found[2].places_mm;
        let way = line[59] - line[0];
        assert!((way.norm() - 100.0).abs() < 1e-9 && (way.x - way.y).abs() < 1e-9);
    }
}
