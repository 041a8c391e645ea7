//! What an instrument reads when it shows the machine as it was a moment ago.
//!
//! ```text
//!   reading(t) - position(t) = p(t - o) - p(t), along the instrument      (1)
//! ```

use metrology::Axis;
use nalgebra::Vector3;

use super::Scene;
use crate::simulate::{beam, plate};
use crate::{Channel, Instrument, Reading, Response, Run};

/// Adds (1) to the readings of an instrument whose clock is behind by `offset_s` of the instant.
pub(super) fn add(
    scene: &Scene<'_>,
    instrument: Instrument,
    response: &mut Response,
    offset_s: impl Fn(f64) -> f64,
) {
    let run = scene.run;
    let mut cached: Option<(&Channel, Vector3<f64>)> = None;
    let rows = run.readings.iter().zip(&mut response.reading);
    for (reading, sum) in rows.filter(|(r, _)| r.channel.instrument() == instrument) {
        let Some(at_s) = run.time_of(reading) else {
            continue;
        };
        let (now, then) = (position(run, at_s), position(run, at_s - offset_s(at_s)));
        if reading.channel == Channel::Radial {
            *sum += radius_mm(run, then) - radius_mm(run, now);
            continue;
        }
        let direction = match cached {
            Some((channel, direction)) if *channel == reading.channel => direction,
            _ => along(run, reading),
        };
        cached = Some((&reading.channel, direction));
        *sum += (then - now).dot(&direction);
    }
}

fn position(run: &Run, at_s: f64) -> Vector3<f64> {
    Vector3::from_fn(|k, _| run.motion.position_at(Axis::LINEAR[k], at_s))
}

fn radius_mm(run: &Run, at_mm: Vector3<f64>) -> f64 {
    let centre_mm = run.segment.centre_mm;
    let (u, v) = (plate(run, 0), plate(run, 1));
    let from_mm = at_mm - centre_mm;
    from_mm.dot(&u).hypot(from_mm.dot(&v))
}

fn along(run: &Run, reading: &Reading) -> Vector3<f64> {
    match reading.channel {
        Channel::GridU => plate(run, 0),
        Channel::GridV => plate(run, 1),
        Channel::Length(axis) => beam(run, axis),
        _ => Vector3::zeros(),
    }
}
