//! What a shift measures: blocks every 15 to 30 minutes, circles at its beginning, in its middle and at its end.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use machine::MachineFile;
use metrology::Axis;
use metrology::sample::{TestKind, TestPlane};
use metrology::stamp::{Host, Stamp};
use rand::Rng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Mcg;
use sequencer::Plan;

use super::work::{self, Spell};
use crate::error::TrialError;
use crate::measurement::Sample;
use crate::programme::{Conditions, circle};

/// Length of a shift, s.
const SHIFT_S: f64 = 4.0 * 3600.0;
/// Time between two block cycles, min.
const BLOCKS_EVERY_MIN: [f64; 2] = [15.0, 30.0];
/// What of it the touches take, s.
const TOUCHES_S: f64 = 60.0;
/// Text of a program that passes in coarse steps: nobody runs it.
const OUT_OF_SIGHT: &str = "(frame: machine)\nG4 P1\nM2\n";

/// Placements of the plate, and the axes of their planes.
const PLACEMENTS: [(&str, [Axis; 2]); 3] = [
    ("middle", [Axis::X, Axis::Y]),
    ("side", [Axis::Z, Axis::X]),
    ("front", [Axis::Y, Axis::Z]),
];

/// What one shift measures.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Programme {
    conditions: Conditions,
    /// Placements besides the first one.
    others: Vec<usize>,
    /// Whether the large circle is run at a second feed.
    pub has_two_feeds: bool,
    /// Production spells between block cycles.
    pub intervals: usize,
}

impl Programme {
    pub(super) fn draw(random: &mut Pcg64Mcg) -> Self {
        let mut others = vec![1, 2];
        others.shuffle(random);
        others.truncate(random.random_range(0..=2));
        let every_min = random.random_range(BLOCKS_EVERY_MIN[0]..BLOCKS_EVERY_MIN[1]);
        Self {
            conditions: Conditions::draw(random),
            others,
            has_two_feeds: random.random::<f64>() < 0.7,
            intervals: (SHIFT_S / 60.0 / every_min).round() as usize,
        }
    }

    /// Planes that are measured.
    pub(super) fn planes(&self) -> impl Iterator<Item = [Axis; 2]> {
        std::iter::once(0)
            .chain(self.others.iter().copied())
            .map(|place| PLACEMENTS[place].1)
    }

    /// Time between two block cycles, s.
    pub(super) fn every_s(&self) -> f64 {
        SHIFT_S / self.intervals as f64
    }

    /// Circles of one of the three times: those in XY under one zero, the first once more at their end.
    fn circles(&self, is_first: bool) -> Vec<String> {
        let [large_mm, small_mm] = self.conditions.radius_mm;
        let [slow, fast] = self.conditions.feed_mm_min;
        let mut all = vec![circle("middle", large_mm, slow)];
        if self.has_two_feeds {
            all.push(circle("middle", large_mm, fast));
        }
        if is_first {
            all.push(circle("middle", small_mm, slow));
        }
        all.push(circle("middle", large_mm, slow));
        let others = self.others.iter().map(|place| PLACEMENTS[*place].0);
        all.extend(others.map(|placement| circle(placement, large_mm, slow)));
        all
    }

    /// The plan.
    pub(super) fn plan(&self) -> Result<Plan, TrialError> {
        let blocks = |cold: bool| vec![format!("{{do: blocks, cold: {cold}}}")];
        let mut parts = vec![self.circles(true), blocks(true)];
        for k in 0..self.intervals {
            parts.push(vec![format!("{{do: run, program: {}}}", program(k))]);
            if k == self.intervals / 2 || k + 1 == self.intervals {
                parts.push(self.circles(false));
            }
            parts.push(blocks(false));
        }
        let mut text = "title: a shift\nsteps:\n".to_owned();
        for step in parts.iter().flatten() {
            let _ = writeln!(text, "  - {step}");
        }
        Plan::from_yaml(&text).map_err(|source| TrialError::ProgrammeText { source })
    }

    /// What is produced between the tests, and the texts of those programs.
    pub(super) fn production(
        &self,
        random: &mut Pcg64Mcg,
        part: &Spell,
    ) -> BTreeMap<String, Vec<Spell>> {
        let length_s = self.every_s() - TOUCHES_S;
        let of = |k: usize| (program(k), work::production(random, part, length_s));
        (0..self.intervals).map(of).collect()
    }
}

fn program(interval: usize) -> String {
    format!("production_{interval}")
}

/// Texts of programs that pass in coarse steps.
pub(super) fn texts<'p>(names: impl Iterator<Item = &'p String>) -> BTreeMap<String, String> {
    names
        .map(|name| (name.clone(), OUT_OF_SIGHT.to_owned()))
        .collect()
}

/// Travels of X, Y and Z, mm.
pub(super) fn travels_mm(machine: &MachineFile) -> [[f64; 2]; 3] {
    Axis::LINEAR.map(|axis| {
        machine
            .linear(axis)
            .map_or([0.0; 2], |entry| entry.travel_mm)
    })
}

/// A run of a shift.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RunOfShift {
    pub number: u32,
    pub kind: TestKind,
    pub plane: TestPlane,
    /// Begin and end since the session began, s.
    pub from_s: f64,
    pub until_s: f64,
}

/// When the runs of a shift were.
#[derive(Clone, Debug, Default)]
pub(super) struct Timeline {
    began: Option<Stamp<Host>>,
    pub runs: Vec<RunOfShift>,
}

impl Timeline {
    /// Takes a sample of the session.
    pub(super) fn take(&mut self, at: Stamp<Host>, sample: &Sample) {
        let began = *self.began.get_or_insert(at);
        let Sample::Segment(segment) = sample else {
            return;
        };
        let since_s = (at - began).as_secs_f64();
        if segment.begin {
            self.runs.push(RunOfShift {
                number: segment.run,
                kind: segment.kind,
                plane: segment.plane,
                from_s: since_s,
                until_s: since_s,
            });
        } else if let Some(run) = self.runs.iter_mut().find(|run| run.number == segment.run) {
            run.until_s = since_s;
        }
    }

    fn of_kind(&self, kind: TestKind) -> impl Iterator<Item = &RunOfShift> {
        self.runs.iter().filter(move |run| run.kind == kind)
    }

    /// Block cycles.
    pub(super) fn blocks(&self) -> Vec<&RunOfShift> {
        self.of_kind(TestKind::Block).collect()
    }

    /// Circles in XY at each of the three times.
    pub(super) fn circle_groups(&self) -> Vec<Vec<&RunOfShift>> {
        let mut groups: Vec<Vec<&RunOfShift>> = vec![];
        let circles = self.of_kind(TestKind::Circle);
        for run in circles.filter(|run| run.plane == TestPlane::Xy) {
            let last = groups.last_mut().filter(|group| {
                let before_s = group.last().map_or(f64::NEG_INFINITY, |last| last.until_s);
                run.from_s - before_s < TOUCHES_S
            });
            match last {
                Some(group) => group.push(run),
                None => groups.push(vec![run]),
            }
        }
        groups
    }

    /// Length of the session, s.
    pub(super) fn length_s(&self) -> f64 {
        self.runs.last().map_or(SHIFT_S, |run| run.until_s)
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use sequencer::Step;

    use super::*;

    #[test]
    fn blocks_come_every_15_to_30_minutes_and_circles_three_times() {
        for seed in 0..40 {
            let programme = Programme::draw(&mut Pcg64Mcg::seed_from_u64(seed));
            assert!((880.0..=1850.0).contains(&programme.every_s()));
            let plan = programme.plan().unwrap();
            let blocks = { plan.steps.iter() }.filter(|step| matches!(step, Step::Blocks { .. }));
            assert_eq!(blocks.count(), programme.intervals + 1);
            let circles = |step: &&Step| matches!(step, Step::Grid(_));
            let first = plan.steps.iter().take_while(circles).count();
            assert!(first >= 3, "{:?}", plan.steps);
            let all = plan.steps.iter().filter(circles).count();
            assert_eq!(all, 3 * first - 2, "the small circle is run once");
        }
    }
}
