//! Whether a touch reaches its feed before contact and holds it there, equations (3) and (4), and the feed at
//! which a contact that nobody expects does no harm, equation (5).

use metrology::Axis;
use nalgebra::Vector3;

use crate::error::CycleError;
use crate::file::{LinearAxisEntry, MachineFile};

/// How far a surface may lie from its nominal place, mm.
const PLACEMENT_MM: f64 = 0.2;
/// Share of the feed that may still be missing at contact.
const SETTLED_SHARE: f64 = 0.01;
/// Latest that a control stops for its probe: a radio probe's filter and debounce, s.
const LATENCY_BOUND_S: f64 = 0.020;
/// From this feed on the guarded feed is a whole number of mm/min.
const WHOLE_FROM_MM_MIN: f64 = 10.0;
/// A direction cosine below this does not move its axis.
const MOVES: f64 = 1e-9;

/// Entry of a linear axis.
pub(super) fn linear(file: &MachineFile, axis: Axis) -> Result<&LinearAxisEntry, CycleError> {
    file.linear(axis).ok_or(CycleError::AxisMissing { axis })
}

/// Greatest acceleration along `direction` that no axis refuses, mm/s².
pub(super) fn acceleration_mm_s2(
    file: &MachineFile,
    direction: &Vector3<f64>,
) -> Result<f64, CycleError> {
    let mut least = f64::INFINITY;
    for axis in Axis::LINEAR {
        let cosine = direction[axis.index()].abs();
        if cosine > MOVES {
            least = least.min(linear(file, axis)?.acceleration_limit_mm_s2 / cosine);
        }
    }
    Ok(least)
}

/// Least stand-off at which `feed_mm_min` is reached at contact, mm, equation (3).
///
/// # Errors
/// When the machine lacks a linear axis that `approach` moves.
pub fn needed_standoff_mm(
    file: &MachineFile,
    approach: &Vector3<f64>,
    feed_mm_min: f64,
) -> Result<f64, CycleError> {
    let feed_mm_s = feed_mm_min / 60.0;
    let mut settling_s = 0.0_f64;
    for axis in Axis::LINEAR {
        if approach[axis.index()].abs() > MOVES {
            let entry = linear(file, axis)?;
            let missing = (1.0 - entry.velocity_feedforward) / SETTLED_SHARE;
            settling_s = settling_s.max(missing.max(1.0).ln() / entry.position_gain_per_s);
        }
    }
    let ramp_mm = feed_mm_s.powi(2) / (2.0 * acceleration_mm_s2(file, approach)?);
    Ok(ramp_mm + feed_mm_s * settling_s + PLACEMENT_MM)
}

/// Least overtravel at which the control does not brake before contact, mm, equation (4).
///
/// # Errors
/// When the machine lacks a linear axis that `approach` moves.
pub fn needed_overtravel_mm(
    file: &MachineFile,
    approach: &Vector3<f64>,
    feed_mm_min: f64,
) -> Result<f64, CycleError> {
    let feed_mm_s = feed_mm_min / 60.0;
    Ok(feed_mm_s.powi(2) / (2.0 * acceleration_mm_s2(file, approach)?) + PLACEMENT_MM)
}

/// Feed at which an axis stops within the probe's overtravel after a contact in any direction, equation (5),
/// and that no linear axis refuses, mm/min.
///
/// # Errors
/// When the machine lacks a linear axis.
pub fn guarded_feed_mm_min(file: &MachineFile) -> Result<f64, CycleError> {
    let (mut lag_s, mut limit_mm_min) = (0.0_f64, f64::INFINITY);
    let mut acceleration_mm_s2 = f64::INFINITY;
    for axis in Axis::LINEAR {
        let entry = linear(file, axis)?;
        lag_s = lag_s.max((1.0 - entry.velocity_feedforward) / entry.position_gain_per_s);
        limit_mm_min = limit_mm_min.min(entry.feed_limit_mm_min);
        acceleration_mm_s2 = acceleration_mm_s2.min(entry.acceleration_limit_mm_s2);
    }
    let latency_s = file
        .probe
        .latency_ms
        .map_or(0.0, |latency_ms| latency_ms / 1e3);
    let wait_s = latency_s.max(LATENCY_BOUND_S) + file.control.servo_period_ms / 1e3 + lag_s;
    let braking_s = (wait_s.powi(2) + 2.0 * file.probe.overtravel_mm / acceleration_mm_s2).sqrt();
    let feed_mm_min = 60.0 * acceleration_mm_s2 * (braking_s - wait_s);
    let feed_mm_min = feed_mm_min.min(limit_mm_min);
    Ok(if feed_mm_min < WHOLE_FROM_MM_MIN {
        feed_mm_min
    } else {
        feed_mm_min.floor()
    })
}

/// Refuses a feed that the axes or the distances of the machine file do not allow.
pub(super) fn check_feed(
    file: &MachineFile,
    feature: &str,
    approach: &Vector3<f64>,
    feed_mm_min: f64,
) -> Result<(), CycleError> {
    for axis in Axis::LINEAR {
        let share = approach[axis.index()].abs();
        let limit_mm_min = linear(file, axis)?.feed_limit_mm_min;
        if feed_mm_min * share > limit_mm_min {
            return Err(CycleError::FeedAboveLimit {
                feed_mm_min,
                axis,
                limit_mm_min,
            });
        }
    }
    let acceleration_mm_s2 = acceleration_mm_s2(file, approach)?;
    let needed_mm = needed_standoff_mm(file, approach, feed_mm_min)?;
    if file.probe.standoff_mm < needed_mm {
        return Err(CycleError::StandoffTooShort {
            feature: feature.to_owned(),
            feed_mm_min,
            standoff_mm: file.probe.standoff_mm,
            needed_mm,
            acceleration_mm_s2,
        });
    }
    let needed_mm = needed_overtravel_mm(file, approach, feed_mm_min)?;
    if file.probe.overtravel_mm < needed_mm {
        return Err(CycleError::OvertravelTooShort {
            feature: feature.to_owned(),
            feed_mm_min,
            overtravel_mm: file.probe.overtravel_mm,
            needed_mm,
            acceleration_mm_s2,
        });
    }
    Ok(())
}
