//! Sessions with a past, touches and readings, for effects that are slow or that instruments see.

use std::collections::BTreeMap;

use machine::file::MachineFile;
use metrology::sample::{TestKind, TestPlane};
use metrology::{Axis, AxisSet, PerAxis};
use nalgebra::Vector3;
use twin::effects::Effect;
use twin::{Channel, History, Motion, Reading, Run, Session, Touch, Twin};

use crate::effects::scene::{self, effect, segment};

/// A run that is read at given instants with the axes standing at given places, one tick each.
pub fn stands(at_s: &[f64], position: impl Fn(usize) -> [f64; 3]) -> Run {
    let all = PerAxis::from_fn(|axis: Axis| {
        let ticks = 0..at_s.len();
        if axis.is_linear() {
            ticks.map(|k| position(k)[axis.index()]).collect()
        } else {
            vec![]
        }
    });
    Run {
        segment: segment(TestKind::Dwell, TestPlane::Xy),
        motion: Motion::new(at_s.to_vec(), AxisSet::XYZ, all).unwrap(),
        touches: vec![],
        readings: vec![],
    }
}

/// Instants spaced evenly from zero, s.
pub fn instants(n: usize, step_s: f64) -> Vec<f64> {
    (0..n).map(|k| k as f64 * step_s).collect()
}

/// Adds a reading of a channel at every tick.
pub fn read(run: &mut Run, channel: &Channel) {
    let of_tick = |at| Reading {
        channel: channel.clone(),
        at,
        fraction: 0.0,
        deviation: 0.0,
    };
    run.readings.extend((0..run.motion.len()).map(of_tick));
}

/// A touch at an instant and place, at a feed of mm/s.
pub fn touch(time_s: f64, position_mm: [f64; 3], approach: Vector3<f64>, feed_mm_s: f64) -> Touch {
    let [x, y, z] = position_mm;
    Touch {
        time_s,
        feature_id: String::from("face"),
        approach,
        feed_mm_s,
        position: PerAxis([x, y, z, 0.0, 0.0, 0.0]),
        tick: None,
    }
}

/// A run of touches and nothing else, each read once.
pub fn touching(touches: Vec<Touch>) -> Run {
    let readings = (0..touches.len()).map(|at| Reading {
        channel: Channel::Touch,
        at,
        fraction: 0.0,
        deviation: 0.0,
    });
    Run {
        segment: segment(TestKind::Touch, TestPlane::None),
        motion: Motion::default(),
        readings: readings.collect(),
        touches,
    }
}

/// Directions all round in XY, n of them.
pub fn all_round(n: usize) -> Vec<Vector3<f64>> {
    let angle = |k: usize| k as f64 * std::f64::consts::TAU / n as f64;
    (0..n)
        .map(|k| Vector3::new(angle(k).cos(), angle(k).sin(), 0.0))
        .collect()
}

/// A past of n entries with one axis in motion and one thermometer.
pub fn past(
    step_s: f64,
    n: usize,
    (axis, speed_mm_s): (Axis, &dyn Fn(f64) -> f64),
    (sensor, degc): (&str, &dyn Fn(f64) -> f64),
) -> History {
    let series = |of: &dyn Fn(f64) -> f64| -> Vec<f64> {
        (0..n).map(|k| of((k as f64 + 0.5) * step_s)).collect()
    };
    let mut speed: PerAxis<Vec<f64>> = PerAxis::from_fn(|_| vec![0.0; n]);
    let mut speed_squared = speed.clone();
    speed[axis] = series(speed_mm_s);
    speed_squared[axis] = speed[axis].iter().map(|v| v * v).collect();
    History {
        step_s,
        position: PerAxis::from_fn(|_| vec![0.0; n]),
        speed,
        speed_squared,
        temperature_degc: BTreeMap::from([(sensor.to_owned(), series(degc))]),
        ..History::default()
    }
}

/// A past without motion in which one thermometer was read.
pub fn warm(step_s: f64, n: usize, sensor: &str, degc: &dyn Fn(f64) -> f64) -> History {
    past(step_s, n, (Axis::X, &|_| 0.0), (sensor, degc))
}

/// What the readings of a run should show because of one effect.
pub fn predict(
    machine: &MachineFile,
    history: &History,
    run: &Run,
    (id, on): (&str, &str),
    given: &[(&str, f64)],
) -> Vec<f64> {
    with(
        machine,
        history,
        run,
        effect(machine, id, on, given).as_ref(),
        Twin::predict,
    )
}

/// The variance that they should show.
pub fn scatter(
    machine: &MachineFile,
    run: &Run,
    (id, on): (&str, &str),
    given: &[(&str, f64)],
) -> Vec<f64> {
    scatter_after(machine, &History::default(), run, (id, on), given)
}

/// The same after a past.
pub fn scatter_after(
    machine: &MachineFile,
    history: &History,
    run: &Run,
    (id, on): (&str, &str),
    given: &[(&str, f64)],
) -> Vec<f64> {
    let effect = effect(machine, id, on, given);
    with(machine, history, run, effect.as_ref(), Twin::variance)
}

fn with<'a>(
    machine: &'a MachineFile,
    history: &History,
    run: &Run,
    effect: &dyn Effect,
    ask: impl Fn(&Twin<'a>, &Session, &Run, &[&dyn Effect]) -> Vec<f64>,
) -> Vec<f64> {
    let session = Session {
        history: history.clone(),
        runs: vec![],
        first_bag_ends: None,
    };
    ask(&Twin::new(machine).unwrap(), &session, run, &[effect])
}

/// Where dy/dt = f(t, y) has led from a start at time 0, by n steps.
pub fn integrate<const N: usize>(
    f: impl Fn(f64, [f64; N]) -> [f64; N],
    start: [f64; N],
    end_s: f64,
    n: usize,
) -> [f64; N] {
    let way = scene::integrate(start, end_s / n as f64, n, n, |t, y| f(t, *y));
    *way.last().unwrap()
}
