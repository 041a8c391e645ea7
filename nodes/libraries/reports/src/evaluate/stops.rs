//! Where an axis stood at the stops of a verification program that moves this axis alone.
//!
//! The position is that of the linear scale where the axis has one, otherwise the one that the control reports.
//! A stop counts when the command rests long enough; the mean of its last part is taken.

use metrology::Axis;
use metrology::sample::{AxisState, PositioningTable, TestKind, TestSegment};
use metrology::stamp::{Host, Span, Stamp};

use super::linear::targets::SAME_PLACE;

/// Rest after which readings count.
const READING_SETTLE: Span = Span::from_nanos(200_000_000);
/// A command that moves by less rests, mm.
const SAME_MM: f64 = 1e-6;
/// Readings that a stop needs.
const LEAST_READINGS: u32 = 10;

/// One stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// Where the program sent the axis, mm.
    pub commanded_mm: f64,
    /// Position minus command, mm.
    pub deviation_mm: f64,
    /// Whether it was entered from smaller positions.
    pub up: bool,
}

impl Stop {
    /// Whether a position is the place of this stop.
    #[must_use]
    pub fn is_at(&self, position_mm: f64) -> bool {
        (self.commanded_mm - position_mm).abs() <= SAME_PLACE
    }
}

/// The stops of one verification.
#[derive(Clone, Debug, PartialEq)]
pub struct Stops {
    /// Its run.
    pub run: u32,
    /// The axis that moved.
    pub axis: Axis,
    /// Whether its linear scale was read.
    pub by_scale: bool,
    /// Whether anything was added to the commands.
    pub compensated: bool,
    /// In the order of the program.
    pub stops: Vec<Stop>,
}

impl Stops {
    /// Stops of one direction in the order of positions, one at each; of several the first.
    #[must_use]
    pub fn side(&self, up: bool) -> Vec<Stop> {
        let mut side: Vec<Stop> = self.stops.iter().filter(|s| s.up == up).copied().collect();
        side.sort_by(|a, b| a.commanded_mm.total_cmp(&b.commanded_mm));
        side.dedup_by(|later, first| first.is_at(later.commanded_mm));
        side
    }

    /// Deviations at every `step`-th of the positions that were stopped at in both directions, times `sign`.
    #[must_use]
    pub fn table(&self, step: usize, sign: f64) -> PositioningTable {
        let (up, down) = (self.side(true), self.side(false));
        let pairs = up
            .iter()
            .filter_map(|up| Some((up, down.iter().find(|down| down.is_at(up.commanded_mm))?)));
        let mut table = PositioningTable {
            at: Stamp::from_nanos(0),
            axis: self.axis,
            position: Vec::new(),
            deviation_up: Vec::new(),
            deviation_down: Vec::new(),
            n_runs: 1,
            weight: 0.0,
            sequence: 0,
        };
        for (up, down) in pairs.step_by(step.max(1)) {
            table.position.push(up.commanded_mm);
            table.deviation_up.push(sign * up.deviation_mm);
            table.deviation_down.push(sign * down.deviation_mm);
        }
        table
    }
}

/// A rest of the command.
#[derive(Clone, Copy, Debug)]
struct Rest {
    commanded_mm: [f64; 3],
    since: Stamp<Host>,
    /// Sums of position minus command, by axis: reported, scale.
    sums_mm: [[f64; 2]; 3],
    n: u32,
}

#[derive(Debug)]
struct Current {
    run: u32,
    compensated: bool,
    rest: Option<Rest>,
    done: Vec<Rest>,
}

/// Collects the stops of a recording.
#[derive(Debug, Default)]
pub struct StopRuns {
    current: Option<Current>,
    found: Vec<Stops>,
}

impl StopRuns {
    /// Begin or end of a test.
    pub fn segment(&mut self, segment: &TestSegment) {
        if segment.begin {
            self.current = (segment.kind == TestKind::Verification).then(|| Current {
                run: segment.run,
                compensated: false,
                rest: None,
                done: Vec::new(),
            });
        } else if let Some(mut current) = self.current.take()
            && segment.completed
            && segment.run == current.run
        {
            current.done.extend(current.rest);
            self.found.extend(current.finished());
        }
    }

    /// Something is added to the commands, or nothing.
    pub fn compensation(&mut self, acts: bool) {
        if let Some(current) = &mut self.current {
            current.compensated |= acts;
        }
    }

    /// Positions at one tick.
    pub fn axes(&mut self, state: &AxisState) {
        let Some(current) = &mut self.current else {
            return;
        };
        let commanded_mm = Axis::LINEAR.map(|axis| state.commanded[axis]);
        let same = |rest: &Rest| {
            let pairs = rest.commanded_mm.iter().zip(&commanded_mm);
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < SAME_MM
        };
        match &mut current.rest {
            Some(rest) if same(rest) => {
                if state.received_at - rest.since >= READING_SETTLE {
                    for (sums, axis) in rest.sums_mm.iter_mut().zip(Axis::LINEAR) {
                        sums[0] += state.motor[axis] - state.commanded[axis];
                        sums[1] += state.scale[axis] - state.commanded[axis];
                    }
                    rest.n += 1;
                }
            }
            rest => {
                current.done.extend(rest.replace(Rest {
                    commanded_mm,
                    since: state.received_at,
                    sums_mm: [[0.0; 2]; 3],
                    n: 0,
                }));
            }
        }
    }

    /// The verifications with stops, in the order of the recording.
    #[must_use]
    pub fn stops(self) -> Vec<Stops> {
        self.found
    }
}

impl Current {
    /// The stops, where one axis moved and no other.
    fn finished(self) -> Option<Stops> {
        // The first rest is where the machine happened to stand.
        let entered = || self.done.iter().skip(1);
        let is_stop = |rest: &&Rest| rest.n >= LEAST_READINGS;
        let span = |axis: usize| {
            let all = || {
                entered()
                    .filter(is_stop)
                    .map(|rest| rest.commanded_mm[axis])
            };
            all().fold(f64::NEG_INFINITY, f64::max) - all().fold(f64::INFINITY, f64::min)
        };
        let moved: Vec<usize> = (0..3).filter(|axis| span(*axis) > SAME_MM).collect();
        let [axis] = moved[..] else {
            return None;
        };
        let mut rests = entered().filter(is_stop);
        let by_scale = rests.all(|rest| rest.sums_mm[axis][1].is_finite());
        let pairs = self.done.windows(2).filter_map(|pair| match pair {
            [before, rest] if rest.n >= LEAST_READINGS => Some(Stop {
                commanded_mm: rest.commanded_mm[axis],
                deviation_mm: rest.sums_mm[axis][usize::from(by_scale)] / f64::from(rest.n),
                up: rest.commanded_mm[axis] > before.commanded_mm[axis],
            }),
            _ => None,
        });
        let stops: Vec<Stop> = pairs.collect();
        (!stops.is_empty()).then_some(Stops {
            run: self.run,
            axis: Axis::LINEAR[axis],
            by_scale,
            compensated: self.compensated,
            stops,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stops_a_few_nanometres_apart_are_one_place() {
        let stop = |commanded_mm: f64, up: bool| Stop {
            commanded_mm,
            deviation_mm: if up { 0.001 } else { -0.001 },
            up,
        };
        let stops = Stops {
            run: 1,
            axis: Axis::X,
            by_scale: true,
            compensated: false,
            stops: vec![
                stop(10.0 - 1.1e-6, true),
                stop(20.0, true),
                stop(20.0, false),
                stop(10.0 + 1.1e-6, false),
            ],
        };
        let table = stops.table(1, 1.0);
        assert_eq!(table.deviation_up, [0.001, 0.001]);
        assert_eq!(table.deviation_down, [-0.001, -0.001]);
    }
}
