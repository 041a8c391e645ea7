//! Programmes that a designed one is compared with, in the same minutes: by hand, a shop's, a random one.
//!
//! | programme | what it is |
//! |---|---|
//! | designed | `abbe preflight --design` for the drawn machine file; whoever has that program writes it |
//! | by hand | that of the scenario `gap_first`: circles of two radii and feeds, touches of three faces, scans along X |
//! | a shop's | a ballbar in three planes, one laser run of five cycles along each axis |
//! | random | set-ups, tests, radii, feeds and repeats as they are drawn |
//!
//! ```text
//!   minutes = sum over set-ups of their time + time of the programs       (1)
//! ```
//!
//! A set-up is made anew whenever the next test has another plate, beam or bar, or the probe. A programme that leaves room in
//! the minutes is made again as often as it fits: by hand as a whole, a shop's test by test within each set-up.

use std::f64::consts::TAU;
use std::fmt;

use machine::MachineFile;
use metrology::Axis;
use rand::Rng;
use rand::seq::IndexedRandom;
use rand_pcg::Pcg64Mcg;
use sequencer::{Plan, Step};
use serde::{Deserialize, Serialize};

use crate::error::TrialError;
use crate::programme::BEAM_MARGIN_MM;

/// Time of one set-up, min: as `abbe preflight --design` has them.
const PLATE_MIN: f64 = 6.0;
const BAR_MIN: f64 = 4.0;
const BEAM_MIN: f64 = 8.0;
const PROBE_MIN: f64 = 1.0;

/// Planes of the drawn machine's plates.
const PLATES: [&str; 3] = ["middle", "side", "front"];
/// Faces that are touched.
const FACES: [&str; 4] = ["block_1.x", "block_1.y", "block_1.z", "block_2.x"];
/// Most set-ups that a random programme tries.
const MOST_SETUPS: usize = 40;
/// Overrun of runs that stop at their targets, and of scans, which reach their feed before the first one, mm.
const STOP_OVERRUN_MM: f64 = 5.0;
const SCAN_OVERRUN_MM: f64 = 15.0;
/// Greatest feed of a scan that this overrun is enough for on every drawn machine, m/min.
const SCAN_FEED_M_MIN: f64 = 3.0;
/// Way from rest to a circle and back, and from touch to touch, min.
const APPROACH_MIN: f64 = 0.25;
const TOUCH_MIN: f64 = 0.1;

/// One programme of the comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Compared {
    /// By `abbe preflight --design`.
    Designed,
    /// As in the scenario `gap_first`.
    ByHand,
    /// Ballbar in three planes, laser along three axes.
    Shop,
    /// Drawn.
    Random,
}

impl Compared {
    /// Every programme, in the order of the table.
    pub const ALL: [Self; 4] = [Self::Designed, Self::ByHand, Self::Shop, Self::Random];

    /// Whether its circles are read by a ballbar: along the radius alone.
    #[must_use]
    pub const fn reads_bar(self) -> bool {
        matches!(self, Self::Shop)
    }

    /// (1) without the programs: the time of a plan's set-ups, min.
    #[must_use]
    pub fn set_up_min(self, plan: &Plan) -> f64 {
        let mut last = String::new();
        let mut sum_min = 0.0;
        for (name, minutes) in plan.steps.iter().filter_map(|step| self.set_up(step)) {
            if name != last {
                sum_min += minutes;
                last = name;
            }
        }
        sum_min
    }

    /// What a step stands on, and the time to put that up, min.
    fn set_up(self, step: &Step) -> Option<(String, f64)> {
        let plate_min = if self.reads_bar() { BAR_MIN } else { PLATE_MIN };
        let beam = |beam: &Option<String>| Some((format!("beam {}", beam.as_ref()?), BEAM_MIN));
        match step {
            Step::Grid(grid) => Some((format!("plate {}", grid.placement), plate_min)),
            Step::Positioning(run) | Step::Scan(run) => beam(&run.beam),
            Step::Diagonals(run) => Some((
                format!("beams {}", run.beams.join(" ")),
                BEAM_MIN * run.beams.len() as f64,
            )),
            Step::Blocks { .. }
            | Step::Latency { .. }
            | Step::Artefact { .. }
            | Step::Rotary(_)
            | Step::TouchAlong(_) => Some(("probe".to_owned(), PROBE_MIN)),
            _ => None,
        }
    }

    /// The programme for a machine that uses as much of `minutes` as it can; `time_min` says how long the programs of a plan
    /// take. A designed programme is not written here: `None`.
    ///
    /// # Errors
    /// When not even one pass fits, with the minutes that it needs, and when a plan cannot be run.
    pub fn plan(
        self,
        machine: &MachineFile,
        minutes: f64,
        random: &mut Pcg64Mcg,
        time_min: &dyn Fn(&Plan) -> Result<f64, TrialError>,
    ) -> Result<Option<Plan>, TrialError> {
        let repeated = |steps: &dyn Fn(usize) -> Vec<String>| {
            let once = plan(&steps(1))?;
            let pass_min = time_min(&once)?;
            let needs_min = |times: usize| -> Result<f64, TrialError> {
                let set_up_min = self.set_up_min(&plan(&steps(times))?);
                Ok(set_up_min + times as f64 * pass_min)
            };
            let mut times = 1;
            let least_min = needs_min(times)?;
            if least_min > minutes {
                return Err(TrialError::TooFewMinutes {
                    programme: self,
                    minutes,
                    needs_min: least_min,
                });
            }
            while needs_min(times + 1)? <= minutes {
                times += 1;
            }
            plan(&steps(times)).map(Some)
        };
        match self {
            Self::Designed => Ok(None),
            Self::ByHand => {
                let pass = by_hand(machine);
                repeated(&|times| vec![pass.as_slice(); times].concat())
            }
            Self::Shop => {
                let tests = of_shop(machine);
                let often = |times: usize| -> Vec<String> {
                    let each = tests.iter();
                    each.flat_map(|test| vec![test.clone(); times]).collect()
                };
                repeated(&often)
            }
            Self::Random => self.drawn(machine, minutes, random, time_min).map(Some),
        }
    }

    /// Draws tests until the minutes are full; the last are taken back where programs take longer than was estimated.
    fn drawn(
        self,
        machine: &MachineFile,
        minutes: f64,
        random: &mut Pcg64Mcg,
        time_min: &dyn Fn(&Plan) -> Result<f64, TrialError>,
    ) -> Result<Plan, TrialError> {
        let mut steps = Vec::<String>::new();
        let mut used_min = 0.0;
        for _ in 0..MOST_SETUPS {
            let (set_up_min, tests) = drawn_tests(machine, random);
            let mut spent_min = set_up_min;
            for (step, test_min) in tests {
                if used_min + spent_min + test_min <= minutes {
                    spent_min += test_min;
                    steps.push(step);
                }
            }
            used_min += if spent_min > set_up_min {
                spent_min
            } else {
                0.0
            };
        }
        loop {
            let drawn = plan(&steps)?;
            let needs_min = self.set_up_min(&drawn) + time_min(&drawn)?;
            if needs_min <= minutes {
                return Ok(drawn);
            }
            if steps.pop().is_none() || steps.is_empty() {
                return Err(TrialError::TooFewMinutes {
                    programme: self,
                    minutes,
                    needs_min,
                });
            }
        }
    }
}

impl fmt::Display for Compared {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Designed => "designed",
            Self::ByHand => "by hand (`gap_first`)",
            Self::Shop => "a shop's (ballbar, laser)",
            Self::Random => "random",
        })
    }
}

fn plan(steps: &[String]) -> Result<Plan, TrialError> {
    let lines: Vec<String> = steps.iter().map(|step| format!("  - {step}\n")).collect();
    let text = format!("title: a compared programme\nsteps:\n{}", lines.concat());
    Plan::from_yaml(&text).map_err(|source| TrialError::ProgrammeText { source })
}

fn circle(plate: &str, radius_mm: f64, feed_mm_min: f64, repeats: u32) -> String {
    format!(
        "{{do: grid, placement: {plate}, trajectory: circle, radius_mm: {radius_mm:.1}, feed_mm_min: {feed_mm_min:.1}, \
         sense: both, on_the_fly: true, repeats: {repeats}}}"
    )
}

fn touches(face: &str, repeats: u32) -> String {
    format!(
        "{{do: latency, feature: {face}, feeds_mm_min: [60.0, 240.0, 480.0], repeats: {repeats}}}"
    )
}

/// A run along a beam: `what` with its targets, or as a scan.
fn along(
    machine: &MachineFile,
    axis: Axis,
    targets: u32,
    runs: u32,
    rest: &str,
    feed_mm_min: f64,
) -> Option<(String, f64)> {
    let length = machine.length_reference.as_ref()?;
    let mut beams = length.beams.iter();
    let beam = beams.find(|beam| beam.axis() == Some(axis))?;
    let ends = [beam.from_mm[axis.index()], beam.to_mm[axis.index()]];
    let (from_mm, to_mm) = (ends[0] + BEAM_MARGIN_MM, ends[1] - BEAM_MARGIN_MM);
    let spacing_mm = (to_mm - from_mm) / f64::from(targets - 1);
    let (what, overrun_mm) = if rest.is_empty() {
        ("scan", SCAN_OVERRUN_MM)
    } else {
        ("positioning", STOP_OVERRUN_MM)
    };
    let step = format!(
        "{{do: {what}, axis: {axis}, from_mm: {from_mm:.1}, to_mm: {to_mm:.1}, spacing_mm: {spacing_mm:.1}, runs: {runs}, \
         {rest}feed_mm_min: {feed_mm_min:.1}, overrun_mm: {overrun_mm:.1}, beam: {}}}",
        beam.id
    );
    Some((step, to_mm - from_mm))
}

/// The steps of `gap_first`, along the beam of the drawn machine.
fn by_hand(machine: &MachineFile) -> Vec<String> {
    let plate = PLATES[0];
    let mut steps = vec![
        circle(plate, 50.0, 1500.0, 3),
        circle(plate, 80.0, 2400.0, 2),
    ];
    steps.extend(["block_1.x", "block_2.x", "block_1.y"].map(|face| touches(face, 3)));
    let scan = along(machine, Axis::X, 19, 3, "", 3000.0);
    steps.extend(scan.map(|(step, _)| step));
    steps.extend([
        circle(plate, 80.0, 1500.0, 2),
        circle(plate, 50.0, 2400.0, 3),
    ]);
    steps.push(touches("block_1.x", 3));
    steps
}

/// A ballbar of 100 mm in three planes at one feed in both senses, then ISO 230-2: five cycles of eleven targets an axis.
fn of_shop(machine: &MachineFile) -> Vec<String> {
    let bars = PLATES.map(|plate| circle(plate, 100.0, 1000.0, 1));
    let lasers = Axis::LINEAR.into_iter().filter_map(|axis| {
        let run = along(machine, axis, 11, 5, "dwell_s: 2.0, ", 6000.0);
        run.map(|(step, _)| step)
    });
    bars.into_iter().chain(lasers).collect()
}

/// The tests of one drawn set-up with their estimated time, and that of the set-up, min.
fn drawn_tests(machine: &MachineFile, random: &mut Pcg64Mcg) -> (f64, Vec<(String, f64)>) {
    let kind = random.random_range(0..7_usize);
    let count = random.random_range(1..=3_u32);
    let mut tests = Vec::new();
    for _ in 0..count {
        let repeats = random.random_range(1..=3_u32);
        tests.extend(drawn_test(machine, random, kind, repeats));
    }
    let set_up_min = match kind {
        0..3 => PLATE_MIN,
        3..6 => BEAM_MIN,
        _ => PROBE_MIN,
    };
    (set_up_min, tests)
}

fn drawn_test(
    machine: &MachineFile,
    random: &mut Pcg64Mcg,
    kind: usize,
    repeats: u32,
) -> Option<(String, f64)> {
    let often = f64::from(repeats);
    match kind {
        0..3 => {
            let radius_mm = random.random_range(20.0_f64..100.0).round();
            let feed_mm_min = 100.0 * random.random_range(10.0_f64..80.0).round();
            let turn_min = 1.25 * TAU * radius_mm / feed_mm_min;
            let step = circle(PLATES[kind], radius_mm, feed_mm_min, repeats);
            Some((step, 2.0 * often * (turn_min + APPROACH_MIN)))
        }
        3..6 => {
            let axis = Axis::LINEAR[kind - 3];
            let targets = random.random_range(5..=21_u32);
            let is_scan: bool = random.random();
            let most_m_min = if is_scan { SCAN_FEED_M_MIN } else { 12.0 };
            let feed_mm_min = 1000.0 * random.random_range(1.0..most_m_min).round();
            let rest = if is_scan { "" } else { "dwell_s: 1.0, " };
            let (step, way_mm) = along(machine, axis, targets, repeats, rest, feed_mm_min)?;
            let stops_min = if is_scan {
                0.0
            } else {
                2.0 * f64::from(targets) * 1.5 / 60.0
            };
            let run_min = 2.0 * way_mm / feed_mm_min + stops_min + APPROACH_MIN;
            Some((step, often * run_min))
        }
        _ => {
            let face = FACES.choose(random)?;
            Some((touches(face, repeats), 3.0 * often * TOUCH_MIN))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    const MACHINE: &str = include_str!("../data/machine.yaml");

    fn machine() -> MachineFile {
        MachineFile::parse(MACHINE, "data/machine.yaml").unwrap()
    }

    /// Programs that take a minute a step.
    fn a_minute_each(plan: &Plan) -> Result<f64, TrialError> {
        Ok(plan.steps.len() as f64)
    }

    fn of(which: Compared, minutes: f64) -> Result<Plan, TrialError> {
        let mut random = Pcg64Mcg::seed_from_u64(5);
        let plan = which.plan(&machine(), minutes, &mut random, &a_minute_each);
        plan.map(Option::unwrap)
    }

    /// By hand: plate, probe, beam, plate, probe are 6 + 1 + 8 + 6 + 1 min; a shop's three bars and beams 3 * (4 + 8) min.
    #[test]
    fn eq1_set_ups_count_whenever_another_begins() {
        for (which, minutes, set_up_min, steps) in [
            (Compared::ByHand, 31.0, 22.0, 9),
            (Compared::ByHand, 62.0, 44.0, 18),
            (Compared::Shop, 42.0, 36.0, 6),
            (Compared::Shop, 47.9, 36.0, 6),
            (Compared::Shop, 48.0, 36.0, 12),
        ] {
            let plan = of(which, minutes).unwrap();
            assert_eq!(plan.steps.len(), steps, "{which} {minutes}");
            assert!(
                (which.set_up_min(&plan) - set_up_min).abs() < 1e-12,
                "{which}"
            );
        }
    }

    #[test]
    fn a_programme_that_does_not_fit_says_what_it_needs() {
        for (which, needs) in [(Compared::ByHand, "31"), (Compared::Shop, "42")] {
            let said = of(which, 10.0).unwrap_err().to_string();
            assert!(said.contains(needs) && said.contains("10 min"), "{said}");
        }
    }

    #[test]
    fn a_random_programme_is_within_its_minutes_and_tests_something() {
        for seed in 0..20 {
            let mut random = Pcg64Mcg::seed_from_u64(seed);
            let which = Compared::Random;
            let half = |plan: &Plan| Ok(0.5 * plan.steps.len() as f64);
            let plan = which
                .plan(&machine(), 60.0, &mut random, &half)
                .unwrap()
                .unwrap();
            let used_min = which.set_up_min(&plan) + 0.5 * plan.steps.len() as f64;
            assert!(
                used_min <= 60.0 && !plan.steps.is_empty(),
                "{seed}: {used_min}"
            );
        }
    }
}
