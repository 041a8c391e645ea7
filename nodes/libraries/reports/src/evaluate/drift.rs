//! Displacements and temperatures over hours, as ISO 230-3 takes them: logs with standing axes, and what the machine did
//! meanwhile.
//!
//! Readings within one second are one reading, their mean: heat is slow beside it, and a recording of a day stays small.

use std::collections::BTreeMap;

use iso230::thermal::{DriftCause, height_of};
use metrology::sample::{
    AxisState, LengthSample, MachineValue, Quantity, TemperatureSample, TestKind, TestSegment,
    Verdict,
};
use metrology::stamp::{Host, Span, Stamp};
use metrology::{Axis, PerAxis};
use serde::Deserialize;
use serde::de::value::{Error, StrDeserializer};

/// Readings closer than this to the first of them are one.
const AT_ONCE: Span = Span::from_nanos(1_000_000_000);
/// Smaller changes of a command are noise, mm and rad.
const NO_MOTION: f64 = 1e-4;

/// A value over time, in order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// Instants and means.
    pub points: Vec<(Stamp<Host>, f64)>,
    in_last: u32,
}

impl Series {
    /// Takes a value; one from before the last is not of this time line.
    pub fn push(&mut self, at: Stamp<Host>, value: f64) {
        match self.points.last_mut() {
            Some((since, _)) if at < *since => {}
            Some((since, mean)) if at - *since < AT_ONCE => {
                self.in_last += 1;
                *mean += (value - *mean) / f64::from(self.in_last);
            }
            _ => {
                self.points.push((at, value));
                self.in_last = 1;
            }
        }
    }

    /// What lies between two instants, both included.
    pub fn between(&self, from: Stamp<Host>, to: Stamp<Host>) -> &[(Stamp<Host>, f64)] {
        let begin = self.points.partition_point(|(at, _)| *at < from);
        let end = self.points.partition_point(|(at, _)| *at <= to);
        self.points.get(begin..end).unwrap_or(&[])
    }
}

/// Displacements along one axis while a test of standing axes went on.
#[derive(Clone, Debug, PartialEq)]
pub struct DriftLog {
    /// Number of the run.
    pub run: u32,
    /// Along which axis.
    pub axis: Axis,
    /// What made the machine drift, as the recording says it.
    pub cause: DriftCause,
    /// Height of its sensor above any common level, along Z, where the recording states it, mm.
    pub height_mm: Option<f64>,
    /// Displacements, mm.
    pub displacements: Series,
    /// Whether the reference was zeroed anew on the way.
    pub zeroed_anew: bool,
}

/// What the machine did while parts were made.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Work {
    /// Axes that moved.
    pub moved: Vec<Axis>,
    /// Greatest speed of a spindle that was reported, rad/s; `None`: none was reported.
    pub spindle_rad_s: Option<f64>,
}

/// Everything of a bag that ISO 230-3 needs beside the blocks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drift {
    /// Logs in the order of the recording.
    pub logs: Vec<DriftLog>,
    /// Temperatures by sensor, degC.
    pub temperatures: BTreeMap<String, Series>,
    /// Readings of thermometers that could not be used.
    pub temperatures_left_out: u64,
    /// Work.
    pub work: Work,
}

/// A log that is being recorded.
#[derive(Debug)]
struct Open {
    begin: TestSegment,
    /// Heights of sensors by their zeros, mm; empty: not stated.
    heights_mm: BTreeMap<u32, f64>,
    /// Displacements with the zero of the reference, by axis and, where heights are stated, by the sensor's zero.
    of: BTreeMap<(Axis, Option<u32>), (Series, u32, bool)>,
}

/// Heights by zeros that a log names, mm.
fn heights_mm(begin: &TestSegment) -> BTreeMap<u32, f64> {
    let read = |name: &String| height_of(name);
    begin.features.iter().filter_map(read).collect()
}

/// Collects them while a bag is read.
#[derive(Debug, Default)]
pub struct Drifts {
    open: Option<Open>,
    is_production: bool,
    ends: Option<(PerAxis<f64>, PerAxis<f64>)>,
    found: Drift,
}

impl Drifts {
    /// Begin or end of a test.
    pub fn segment(&mut self, segment: &TestSegment) {
        self.is_production = segment.begin && segment.kind == TestKind::Production;
        if segment.begin {
            self.open = (segment.kind == TestKind::Dwell).then(|| Open {
                heights_mm: heights_mm(segment),
                begin: segment.clone(),
                of: BTreeMap::new(),
            });
        } else if let Some(open) = self.open.take()
            && segment.completed
            && segment.run == open.begin.run
        {
            let (run, cause) = (open.begin.run, cause(&open.begin));
            let logs = open.of.into_iter();
            self.found.logs.extend(logs.map(
                |((axis, sensor), (displacements, _, zeroed_anew))| DriftLog {
                    run,
                    axis,
                    cause,
                    height_mm: sensor.and_then(|zero| open.heights_mm.get(&zero).copied()),
                    displacements,
                    zeroed_anew,
                },
            ));
        }
    }

    /// One reading of a length reference.
    pub fn length(&mut self, sample: &LengthSample) {
        if let Some(open) = &mut self.open {
            let fresh = || (Series::default(), sample.zero_id, false);
            let stated = open.heights_mm.contains_key(&sample.zero_id);
            if !stated && !open.heights_mm.is_empty() {
                // A zero without a height: one of the sensors was zeroed anew, and nobody knows which.
                let all = open.of.iter_mut();
                let same_axis = all.filter(|((axis, _), _)| *axis == sample.axis);
                same_axis.for_each(|(_, (.., anew))| *anew = true);
                return;
            }
            let key = (sample.axis, stated.then_some(sample.zero_id));
            let (series, zero_id, zeroed_anew) = open.of.entry(key).or_insert_with(fresh);
            *zeroed_anew |= *zero_id != sample.zero_id;
            series.push(sample.at, sample.displacement_mm);
        }
    }

    /// One temperature.
    pub fn temperature(&mut self, sample: &TemperatureSample) {
        let known = &mut self.found.temperatures;
        let series = known.entry(sample.sensor.clone()).or_default();
        series.push(sample.at, sample.temperature_degc);
    }

    /// Positions at one tick.
    pub fn axes(&mut self, state: &AxisState) {
        if !self.is_production {
            return;
        }
        let (least, greatest) = self.ends.get_or_insert((state.commanded, state.commanded));
        for axis in state.axes.iter() {
            least[axis] = least[axis].min(state.commanded[axis]);
            greatest[axis] = greatest[axis].max(state.commanded[axis]);
        }
    }

    /// A value that the machine reports of itself.
    pub fn value(&mut self, value: &MachineValue) {
        if value.quantity == Quantity::SpindleSpeed && value.verdict == Verdict::Good {
            let known = &mut self.found.work.spindle_rad_s;
            *known = Some(known.unwrap_or(0.0).max(value.value.abs()));
        }
    }

    /// What was found.
    pub fn drift(mut self) -> Drift {
        if let Some((least, greatest)) = &self.ends {
            let moved = |axis: &Axis| greatest[*axis] - least[*axis] > NO_MOTION;
            self.found.work.moved = Axis::ALL.into_iter().filter(moved).collect();
        }
        self.found
    }
}

/// The cause that a log names behind its axis.
fn cause(begin: &TestSegment) -> DriftCause {
    let named = begin.features.get(1).map(String::as_str);
    let read = |name| DriftCause::deserialize(StrDeserializer::<Error>::new(name)).ok();
    named.and_then(read).unwrap_or(DriftCause::NotStated)
}

#[cfg(test)]
mod tests {
    use iso230::thermal::height_name;

    use super::*;

    fn at(ms: i64) -> Stamp<Host> {
        Stamp::from_nanos(ms * 1_000_000)
    }

    fn dwell(begin: bool, features: &[&str]) -> TestSegment {
        TestSegment {
            begin,
            completed: !begin,
            features: features.iter().map(|name| (*name).to_owned()).collect(),
            ..TestSegment::of_kind(TestKind::Dwell, 1, at(0))
        }
    }

    /// Logs of readings with a zero each.
    fn logs(features: &[&str], readings: &[(i64, u32, f64)]) -> Vec<DriftLog> {
        let mut drifts = Drifts::default();
        drifts.segment(&dwell(true, features));
        for (s, zero_id, displacement_mm) in readings {
            drifts.length(&LengthSample {
                at: at(1000 * s),
                axis: Axis::X,
                displacement_mm: *displacement_mm,
                zero_id: *zero_id,
            });
        }
        drifts.segment(&dwell(false, features));
        drifts.drift().logs
    }

    #[test]
    fn two_sensors_whose_heights_are_stated_are_two_logs() {
        let [low, high] = [(1, 100.0), (2, 260.5)].map(|(zero, mm)| height_name(zero, mm));
        let features = ["X", "spindle", low.as_str(), high.as_str()];
        let readings = [(0, 1, 0.1), (0, 2, 0.2), (60, 1, 0.3), (60, 2, 0.4)];
        let found = logs(&features, &readings);
        let heights: Vec<_> = found.iter().map(|log| log.height_mm).collect();
        assert_eq!(heights, [Some(100.0), Some(260.5)]);
        for (log, values) in found.iter().zip([[0.1, 0.3], [0.2, 0.4]]) {
            assert_eq!((log.cause, log.zeroed_anew), (DriftCause::Spindle, false));
            let read: Vec<f64> = log.displacements.points.iter().map(|p| p.1).collect();
            assert_eq!(read, values);
        }
        // A third zero is one of the two sensors zeroed anew.
        let anew = logs(&features, &[(0, 1, 0.1), (0, 2, 0.2), (60, 3, 0.3)]);
        assert!(
            anew.len() == 2 && anew.iter().all(|log| log.zeroed_anew),
            "{anew:?}"
        );
        // Without heights it is one sensor.
        let one = logs(&["X"], &readings);
        assert!(one.len() == 1 && one[0].zeroed_anew && one[0].height_mm.is_none());
        // Without a cause the heights are no cause.
        let bare = logs(&["X", &low], &[(0, 1, 0.1)]);
        assert_eq!(
            (bare[0].cause, bare[0].height_mm),
            (DriftCause::NotStated, Some(100.0))
        );
    }

    #[test]
    fn readings_of_one_second_are_one_and_those_that_go_back_none() {
        let mut series = Series::default();
        for (ms, value) in [(0, 1.0), (400, 2.0), (900, 6.0), (1000, 4.0)] {
            series.push(at(ms), value);
        }
        series.push(at(-1), 99.0);
        series.push(at(70_000), 5.0);
        let values: Vec<f64> = series.points.iter().map(|(_, value)| *value).collect();
        assert_eq!(series.points[1].0, at(1000));
        assert!((values[0] - 3.0).abs() < 1e-12, "{values:?}");
        assert_eq!(values[1..], [4.0, 5.0]);
        assert_eq!(series.between(at(1000), at(70_000)).len(), 2);
        assert_eq!(series.between(at(2000), at(3000)).len(), 0);
    }
}
