//! The session as it would go on with an experiment: its runs, and what they heat.

use std::collections::{BTreeMap, BTreeSet};

use metrology::PerAxis;
use nalgebra::Vector3;
use twin::{Channel, History, Instrument, Run, Session};

use super::Bench;
use crate::experiment::course::{self, Frame};
use crate::experiment::{Experiment, Pass};
use crate::noise::Noise;
use crate::search::rows::count;

/// Between passes, s.
const PAUSE_S: f64 = 5.0;

/// An experiment's runs in the time after the session.
pub struct Future {
    /// The runs, with the past that they and the session heat.
    pub session: Session,
    /// Time that the experiment takes, set-up included, min.
    pub minutes: f64,
}

/// The future with an experiment; none where nothing of it would be read.
pub fn future(
    bench: &Bench<'_>,
    experiment: &Experiment,
    noise: &BTreeMap<Channel, Noise>,
) -> Option<Future> {
    let session = bench.session;
    let segments = || session.runs.iter().map(|run| &run.segment);
    let setup = 1 + segments()
        .map(|s| s.setup_id.max(s.zero_id))
        .max()
        .unwrap_or(0);
    let frame = Frame {
        machine: bench.machine,
        rest: rest(session),
        beside: beside(session, noise),
        tool_offset_mm: tool_offset_mm(bench, experiment),
        setup,
        servo_s: 1e-3 * bench.machine.control.servo_period_ms,
    };
    let end_s = end_s(session);
    let mut at_s = end_s + 60.0 * experiment.setup_min;
    let mut history = session.history.clone();
    let mut runs: Vec<Run> = Vec::new();
    let first = 1 + segments().map(|s| s.run).max().unwrap_or(0);
    for pass in &experiment.passes {
        let number = first + u32::try_from(runs.len()).ok()?;
        let run = match pass {
            Pass::Again { run } => Some(again(session.runs.get(*run)?, at_s, setup, number)),
            _ => course::run(&frame, pass, number, at_s),
        };
        match run {
            Some(run) => {
                extend(&mut history, &run);
                at_s = run.motion.time_s.last().copied().unwrap_or(at_s) + PAUSE_S;
                runs.push(run);
            }
            None => {
                warm(&mut history, pass, at_s);
                at_s += course::duration_s(pass, bench.machine, |_| 0.0) + PAUSE_S;
            }
        }
    }
    (!runs.is_empty()).then_some(Future {
        session: Session {
            history,
            runs,
            first_bag_ends: None,
        },
        minutes: (at_s - end_s) / 60.0,
    })
}

fn end_s(session: &Session) -> f64 {
    let ends = session
        .runs
        .iter()
        .filter_map(|run| run.motion.time_s.last().copied());
    ends.fold(
        count(session.history.len()) * session.history.step_s,
        f64::max,
    )
}

/// Where the axes stood last.
fn rest(session: &Session) -> PerAxis<f64> {
    let last = session.runs.iter().rev().find(|run| !run.motion.is_empty());
    PerAxis::from_fn(|axis| {
        last.and_then(|run| run.motion.position[axis].last().copied())
            .unwrap_or(0.0)
    })
}

/// Encoders and scales that the session read.
fn beside(session: &Session, noise: &BTreeMap<Channel, Noise>) -> Vec<Channel> {
    let readings = session.runs.iter().flat_map(|run| &run.readings);
    let read: BTreeSet<&Channel> = readings.map(|reading| &reading.channel).collect();
    let is_encoder =
        |channel: &&&Channel| matches!(channel.instrument(), Instrument::Motor | Instrument::Scale);
    let known = read
        .iter()
        .filter(is_encoder)
        .filter(|channel| noise.contains_key(**channel));
    known.map(|channel| (**channel).clone()).collect()
}

/// From the axes' point to the measured one: of the session's runs there, of the machine file's placement.
fn tool_offset_mm(bench: &Bench<'_>, experiment: &Experiment) -> Vector3<f64> {
    let Some(Pass::Circle {
        plane, centre_mm, ..
    }) = experiment.passes.first()
    else {
        return Vector3::zeros();
    };
    let near = |at: Vector3<f64>| (at - Vector3::from(*centre_mm)).norm() < 1.0;
    let known = bench
        .session
        .runs
        .iter()
        .map(|run| &run.segment)
        .find(|s| s.plane == *plane && near(s.centre_mm));
    if let Some(segment) = known {
        return segment.tool_offset_mm;
    }
    let grid = bench
        .machine
        .grid_encoder
        .iter()
        .flat_map(|grid| &grid.placements);
    let mut there = grid.filter(|placement| near(placement.axes_at_centre_mm()));
    there.next().map_or_else(Vector3::zeros, |placement| {
        Vector3::from(placement.tool_offset_mm)
    })
}

/// A run once more, at another time and in another set-up.
fn again(run: &Run, at_s: f64, setup: u32, number: u32) -> Run {
    let mut run = run.clone();
    let first = run.motion.time_s.first().copied();
    let first = first
        .or_else(|| run.touches.first().map(|touch| touch.time_s))
        .unwrap_or(0.0);
    let by_s = at_s - first;
    for time_s in &mut run.motion.time_s {
        *time_s += by_s;
    }
    for touch in &mut run.touches {
        touch.time_s += by_s;
    }
    run.segment.run = number;
    run.segment.setup_id += setup;
    run.segment.zero_id += setup;
    run
}

/// Lengthens a history up to an instant: axes at rest, thermometers at their last reading.
fn lengthen(history: &mut History, until_s: f64) {
    let before = history.len();
    if before == 0 || history.step_s <= 0.0 {
        return;
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a time of some days at most"
    )]
    let length = ((until_s / history.step_s).ceil().max(0.0) as usize).max(before);
    let hold = |series: &mut Vec<f64>| {
        if let Some(last) = series.last().copied() {
            series.resize(length, last);
        }
    };
    history.position.0.iter_mut().for_each(hold);
    history.temperature_degc.values_mut().for_each(hold);
    for series in history
        .speed
        .0
        .iter_mut()
        .chain(&mut history.speed_squared.0)
    {
        if !series.is_empty() {
            series.resize(length, 0.0);
        }
    }
}

fn cell(history: &History, time_s: f64) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a time of some days at most"
    )]
    let at = (time_s.max(0.0) / history.step_s) as usize;
    at
}

/// Adds the motion of a run to the history.
fn extend(history: &mut History, run: &Run) {
    let Some(last_s) = run.motion.time_s.last() else {
        return;
    };
    lengthen(history, last_s + history.step_s);
    if history.is_empty() {
        return;
    }
    let step_s = history.step_s;
    for axis in run.motion.axes.iter() {
        let position = &run.motion.position[axis];
        for (tick, pair) in run.motion.time_s.windows(2).enumerate() {
            let at = cell(history, pair[1]);
            let (way, took_s) = (
                (position[tick + 1] - position[tick]).abs(),
                pair[1] - pair[0],
            );
            if let Some(speed) = history.speed[axis].get_mut(at) {
                *speed += way / step_s;
            }
            if let Some(square) = history.speed_squared[axis].get_mut(at) {
                *square += way * way / took_s / step_s;
            }
        }
    }
}

/// Adds the motion of a warming pass to the history.
fn warm(history: &mut History, pass: &Pass, at_s: f64) {
    let Pass::Warm {
        axis,
        between_mm,
        feed_mm_s,
        seconds,
    } = pass
    else {
        return;
    };
    lengthen(history, at_s + seconds + history.step_s);
    if history.is_empty() {
        return;
    }
    let middle = 0.5 * (between_mm[0] + between_mm[1]);
    for at in cell(history, at_s)..cell(history, at_s + seconds) {
        for (series, value) in [
            (&mut history.position[*axis], middle),
            (&mut history.speed[*axis], *feed_mm_s),
            (&mut history.speed_squared[*axis], feed_mm_s.powi(2)),
        ] {
            if let Some(entry) = series.get_mut(at) {
                *entry = value;
            }
        }
    }
}
