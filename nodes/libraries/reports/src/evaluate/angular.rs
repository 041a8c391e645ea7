//! Positioning runs of rotary axes: what the angular reference read while the axis rested at each target.
//!
//! Stops, targets and directions are found as those of linear axes ([`super::linear`]). The reading is that of the angular
//! reference; an axis' own encoder says nothing about its positioning. A reference or a control that wraps at a turn does
//! no harm: deviations are taken without whole turns from the first one.

use iso230::positioning::rotary::within_half_a_turn_rad;
use metrology::Axis;
use metrology::sample::{AngleSample, AxisState, TestKind, TestSegment};
use metrology::stamp::{Host, Span, Stamp};

use super::linear::against::{Pair, against};
use super::linear::joined::{Readings, StopRead, is_by_stamp};
use super::linear::slips::Outlying;
use super::linear::targets::{Places, left_out, targets};
use super::linear::unusable::{Contradiction, Extent, take_out, why_not};
use super::linear::{STOP_SETTLE, Visits, axis_of, is_of_one_test, level};

/// A command that moves by less rests, deg.
const SAME_DEG: f64 = 1e-6;

/// Runs of one rotary axis, up and down.
#[derive(Clone, Debug, PartialEq)]
pub struct RotaryTest {
    /// The axis.
    pub axis: Axis,
    /// Number of its first run.
    pub first_run: u32,
    /// When that began.
    pub began: Stamp<Host>,
    /// Targets, ascending, rad.
    pub targets_rad: Vec<f64>,
    /// Deviations per run and target towards greater angles, their mean over all taken out, rad.
    pub up_rad: Vec<Vec<f64>>,
    /// The same towards smaller angles, rad. One of the two is empty where all targets were approached from one side.
    pub down_rad: Vec<Vec<f64>>,
    /// That mean: what the zero of the reference and the zero of the axis differ by, without whole turns, rad.
    pub mean_rad: f64,
    /// Readings far from the others of their targets.
    pub outlying: Outlying,
    /// Places with readings that are no targets, and runs that do not count; each with the reason.
    pub left_out: Vec<String>,
    /// Longest rest of the command; none: nothing rested.
    pub longest_rest: Option<Span>,
    /// Whether the angular reference read anything.
    pub has_readings: bool,
}

/// One rest of the command.
#[derive(Clone, Copy, Debug)]
struct Stop {
    at_rad: f64,
    from_rad: f64,
    since: Stamp<Host>,
    until: Stamp<Host>,
    /// Sum of the readings less the first one, and how many.
    sum_rad: f64,
    first_rad: f64,
    /// Of the readings less the first one.
    extent: Extent,
    /// How far two readings of one stamp lie apart, where they contradict each other, rad.
    clash_rad: Option<f64>,
    n: u32,
}

#[derive(Clone, Debug)]
struct Run {
    begin: TestSegment,
    axis: Axis,
    stops: Vec<Stop>,
    /// Every reading, rad.
    angles: Readings,
}

/// Collects the runs of a recording.
#[derive(Debug, Default)]
pub struct RotaryRuns {
    current: Option<Run>,
    done: Vec<Run>,
}

impl RotaryRuns {
    /// Begin or end of a test.
    pub fn segment(&mut self, segment: &TestSegment) {
        if segment.begin {
            let axis = axis_of(segment).filter(|axis| !axis.is_linear());
            let axis = axis.filter(|_| segment.kind == TestKind::Positioning);
            self.current = axis.map(|axis| Run {
                begin: segment.clone(),
                axis,
                stops: vec![],
                angles: Readings::default(),
            });
        } else if let Some(run) = self.current.take()
            && segment.completed
            && segment.run == run.begin.run
        {
            self.done.push(run.joined());
        }
    }

    /// Positions at one tick.
    pub fn axes(&mut self, state: &AxisState) {
        let Some(run) = &mut self.current else {
            return;
        };
        let at_rad = state.commanded[run.axis];
        let last_was_passed = run
            .stops
            .last()
            .is_some_and(|stop| stop.until == stop.since);
        match run.stops.last_mut() {
            Some(stop) if (stop.at_rad - at_rad).to_degrees().abs() < SAME_DEG => {
                stop.until = state.received_at;
            }
            last => {
                let from_rad = last.map_or(at_rad, |before| before.at_rad);
                // Of a place that was only passed nothing is left.
                if last_was_passed {
                    run.stops.pop();
                }
                run.stops.push(Stop {
                    at_rad,
                    from_rad,
                    since: state.received_at,
                    until: state.received_at,
                    sum_rad: 0.0,
                    first_rad: 0.0,
                    extent: Extent::default(),
                    clash_rad: None,
                    n: 0,
                });
            }
        }
    }

    /// One reading of the angular reference.
    pub fn angle(&mut self, sample: &AngleSample) {
        if let Some(run) = &mut self.current
            && sample.axis == run.axis
        {
            run.angles.take(sample.at, sample.angle_rad);
            if let Some(stop) = run.stops.last_mut()
                && sample.at - stop.since >= STOP_SETTLE
            {
                stop.take(sample.angle_rad);
            }
        }
    }

    /// The tests: runs that repeat one another belong together.
    #[must_use]
    pub fn tests(self) -> Vec<RotaryTest> {
        let groups = self
            .done
            .chunk_by(|a, b| a.axis == b.axis && is_of_one_test(&a.begin, &b.begin));
        groups.filter_map(test).collect()
    }
}

fn test(group: &[Run]) -> Option<RotaryTest> {
    let first = group.first()?;
    let read = || group.iter().flat_map(|run| &run.stops);
    let zero_rad = read().find_map(Stop::deviation_rad);
    let places = Places::of(read().filter(|stop| stop.is_approach()).map(Stop::at_deg));
    let mut runs: Vec<Visits> = group
        .iter()
        .map(|run| visits(run, zero_rad.unwrap_or(0.0), &places))
        .collect();
    let mut numbers: Vec<u32> = group.iter().map(|run| run.begin.run).collect();
    let own = group.iter().map(|run| {
        let against = against(false, &run.pairs());
        why_not(&run.contradictions(), against)
    });
    let unusable = take_out(&mut runs, &mut numbers, own.collect());
    let (targets, sides) = targets(&runs);
    let mut left_out = left_out(&runs, &numbers, (&targets, sides), (&places, "deg"));
    let of = |side: usize| {
        if !sides.contains(&side) {
            return vec![];
        }
        let row = |run: &Visits| targets.iter().map(|place| run[place][side][0]).collect();
        runs.iter().map(row).collect::<Vec<Vec<f64>>>()
    };
    let (mut up_rad, mut down_rad) = (of(0), of(1));
    let targets_deg = places.at(&targets);
    let targets_rad: Vec<f64> = targets_deg.iter().map(|deg| deg.to_radians()).collect();
    let sides = [&mut up_rad, &mut down_rad];
    let outlying = Outlying::of(false, &targets_rad, &mut numbers, sides).with(unusable);
    left_out.extend(outlying.left_out());
    let mean_rad = zero_rad.unwrap_or(0.0) + level(&mut up_rad, &mut down_rad);
    Some(RotaryTest {
        axis: first.axis,
        first_run: first.begin.run,
        began: first.begin.at,
        targets_rad,
        up_rad,
        down_rad,
        mean_rad: within_half_a_turn_rad(mean_rad),
        outlying,
        left_out,
        longest_rest: read().map(|stop| stop.until - stop.since).max(),
        has_readings: zero_rad.is_some(),
    })
}

impl Run {
    /// The same, where each reading belongs to one stop.
    fn joined(mut self) -> Self {
        self.angles.sort();
        let stamped: Vec<Stop> = (self.stops.iter())
            .map(|stop| stop.with(self.angles.within(stop.since, stop.until)))
            .collect();
        if is_by_stamp(&reads(&self.stops), &reads(&stamped)) {
            self.stops = stamped;
        }
        for stop in &mut self.stops {
            stop.clash_rad = self.angles.clash(false, (stop.since, stop.until));
        }
        self.angles = Readings::default();
        self
    }

    /// The stops with readings, their deviations without whole turns from one to the next.
    fn pairs(&self) -> Vec<Pair> {
        let mut deviation = None;
        let read = self.stops.iter().filter(|stop| stop.is_approach());
        let pairs = read.filter_map(|stop| {
            let own = stop.deviation_rad()?;
            let last = *deviation.get_or_insert(own);
            let next = last + within_half_a_turn_rad(own - last);
            deviation = Some(next);
            Some(Pair {
                at: stop.at_rad,
                deviation: next,
            })
        });
        pairs.collect()
    }

    /// The stops whose readings contradict each other.
    fn contradictions(&self) -> Vec<Contradiction> {
        let of = |stop: &Stop| {
            let apart_rad = stop.extent.contradiction(false);
            Some(Contradiction {
                is_linear: false,
                at: stop.at_deg(),
                is_up: stop.way_deg() > 0.0,
                apart: apart_rad.or(stop.clash_rad)?,
                is_of_one_stamp: apart_rad.is_none(),
            })
        };
        let stops = self.stops.iter().filter(|stop| stop.is_approach());
        stops.filter_map(of).collect()
    }
}

/// What the angular reference read at the stops, without whole turns from the first one.
fn reads(stops: &[Stop]) -> Vec<StopRead> {
    let read = || stops.iter().filter(|stop| stop.n > 0);
    let zero_rad = read().find_map(Stop::deviation_rad).unwrap_or(0.0);
    let all = read().filter_map(|stop| {
        Some(StopRead {
            extent: stop.extent,
            deviation: within_half_a_turn_rad(stop.deviation_rad()? - zero_rad),
            n: stop.n,
        })
    });
    all.collect()
}

impl Stop {
    fn take(&mut self, angle_rad: f64) {
        if self.n == 0 {
            self.first_rad = angle_rad;
        }
        let beside_rad = within_half_a_turn_rad(angle_rad - self.first_rad);
        self.sum_rad += beside_rad;
        self.extent.add(beside_rad);
        self.n += 1;
    }

    /// The same with these readings, rad.
    fn with(&self, angles_rad: impl Iterator<Item = f64>) -> Self {
        let mut stop = Self {
            sum_rad: 0.0,
            first_rad: 0.0,
            extent: Extent::default(),
            n: 0,
            ..*self
        };
        angles_rad.for_each(|angle_rad| stop.take(angle_rad));
        stop
    }

    fn at_deg(&self) -> f64 {
        self.at_rad.to_degrees()
    }

    fn way_deg(&self) -> f64 {
        (self.at_rad - self.from_rad).to_degrees()
    }

    /// Whether it was read and come to.
    fn is_approach(&self) -> bool {
        self.n > 0 && self.way_deg().abs() > SAME_DEG
    }

    /// Mean reading minus command, by whole turns anything, rad.
    fn deviation_rad(&self) -> Option<f64> {
        let mean_rad = self.first_rad + self.sum_rad / f64::from(self.n.max(1));
        (self.n > 0).then_some(mean_rad - self.at_rad)
    }
}

fn visits(run: &Run, zero_rad: f64, places: &Places) -> Visits {
    let mut visits = Visits::new();
    for stop in run.stops.iter().filter(|stop| stop.is_approach()) {
        if let Some(deviation_rad) = stop.deviation_rad() {
            let [up, down] = visits.entry(places.number(stop.at_deg())).or_default();
            let side = if stop.way_deg() > 0.0 { up } else { down };
            side.push(within_half_a_turn_rad(deviation_rad - zero_rad));
        }
    }
    visits
}
