//! The motion that a measurement was made with, from the order of its rows.

use anyhow::{Result, bail};
use metrology::sample::{Sense, TestKind, TestPlane, TestSegment};
use metrology::{Axis, PerAxis, Stamp};
use nalgebra::Vector3;

use super::map::{Map, Plane, Test};
use super::table::Table;
use super::writer::Writer;

/// Spacing of the axis states, s.
const TICK_S: f64 = 0.01;
/// Rest before a run and between runs, s.
const REST_S: f64 = 2.0;
/// Readings at a stop.
const READINGS: u32 = 5;
/// Rest before the readings of a stop, s.
const SETTLE_S: f64 = 0.4;
/// Share of a turn that a circle runs ahead of its first row.
const AHEAD_RAD: f64 = std::f64::consts::FRAC_PI_2;

/// Writes every run of the table; gives their number.
///
/// # Errors
/// When rows contradict the map, or the bag cannot be written.
pub fn write(map: &Map, table: &Table, writer: &mut Writer) -> Result<u32> {
    let mut position = PerAxis::default();
    for (axis, mm) in &map.at_mm {
        position[*axis] = *mm;
    }
    let mut n = 0;
    if let Test::Log {
        axis,
        run,
        temperature_degc,
        ..
    } = &map.test
    {
        let sensors: Vec<&str> = temperature_degc.keys().map(String::as_str).collect();
        let begin_s = table.rows[0][usize::from(run.is_some())];
        let runs: Vec<&[Vec<f64>]> = match run {
            Some(_) => table.runs().collect(),
            None => vec![&table.rows],
        };
        for rows in runs {
            n += 1;
            let rows = rows.iter().map(|row| &row[usize::from(run.is_some())..]);
            log((*axis, n, begin_s), &sensors, rows, &position, writer)?;
        }
        return Ok(n);
    }
    for rows in table.runs() {
        n += 1;
        match &map.test {
            Test::Circle { .. } => circle(map, rows, n, &mut position, writer)?,
            _ => positioning(map, rows, n, &mut position, writer)?,
        }
    }
    Ok(n)
}

fn segment(kind: TestKind, run: u32, feed_mm_min: f64) -> TestSegment {
    TestSegment {
        at: Stamp::from_nanos(0),
        run,
        begin: true,
        kind,
        plane: TestPlane::None,
        centre_mm: Vector3::zeros(),
        radius_mm: 0.0,
        feed_mm_s: feed_mm_min / 60.0,
        sense: Sense::None,
        repeat: run - 1,
        stylus: String::new(),
        tool_offset_mm: Vector3::zeros(),
        stations: 0,
        zero_id: 1,
        setup_id: 1,
        cold: false,
        features: vec![],
        completed: true,
    }
}

/// Stands for a while.
fn rest(position: &PerAxis<f64>, time_s: f64, writer: &mut Writer) -> Result<()> {
    let mut left_s = time_s;
    while left_s > 0.0 {
        writer.tick(position)?;
        writer.wait(TICK_S);
        left_s -= TICK_S;
    }
    Ok(())
}

/// Goes along one axis.
fn go(
    position: &mut PerAxis<f64>,
    axis: Axis,
    to_mm: f64,
    feed_mm_s: f64,
    writer: &mut Writer,
) -> Result<()> {
    let step_mm = feed_mm_s * TICK_S;
    while (to_mm - position[axis]).abs() > 1e-9 {
        let way_mm = to_mm - position[axis];
        position[axis] = if way_mm.abs() <= step_mm {
            to_mm
        } else {
            position[axis] + way_mm.signum() * step_mm
        };
        writer.tick(position)?;
        writer.wait(TICK_S);
    }
    Ok(())
}

fn positioning(
    map: &Map,
    rows: &[Vec<f64>],
    run: u32,
    position: &mut PerAxis<f64>,
    writer: &mut Writer,
) -> Result<()> {
    let Test::Positioning {
        axis,
        feed_mm_min,
        dwell_s,
        overrun_mm,
        ..
    } = &map.test
    else {
        return Ok(());
    };
    if !(*feed_mm_min > 0.0 && *dwell_s > SETTLE_S && *overrun_mm > 0.0) {
        bail!("feed_mm_min and overrun_mm must be above 0, dwell_s above {SETTLE_S}");
    }
    let mut test = segment(TestKind::Positioning, run, *feed_mm_min);
    test.features = vec![axis.letter().to_owned()];
    test.stations = u32::try_from(rows.len()).unwrap_or(u32::MAX);
    let feed_mm_s = feed_mm_min / 60.0;
    // The first target is approached from the side that the second lies away from.
    let first_mm = rows[0][1];
    let towards = rows
        .iter()
        .map(|row| row[1] - first_mm)
        .find(|way| way.abs() > 1e-9);
    let before_mm = first_mm - towards.unwrap_or(1.0).signum() * overrun_mm;
    if run == 1 {
        position[*axis] = before_mm;
    }
    rest(position, REST_S, writer)?;
    writer.segment(&test, true)?;
    go(position, *axis, before_mm, feed_mm_s, writer)?;
    let mut last = before_mm;
    for row in rows {
        let (target_mm, deviation_um) = (row[1], row[2]);
        if (target_mm - position[*axis]).abs() < 1e-9 {
            // Measured from the other side: beyond it and back.
            let beyond_mm = target_mm + (target_mm - last).signum() * overrun_mm;
            go(position, *axis, beyond_mm, feed_mm_s, writer)?;
        }
        last = position[*axis];
        go(position, *axis, target_mm, feed_mm_s, writer)?;
        rest(position, SETTLE_S, writer)?;
        let spacing_s = (dwell_s - SETTLE_S) / f64::from(READINGS);
        for _ in 0..READINGS {
            writer.tick(position)?;
            writer.length(*axis, target_mm + deviation_um * 1e-3)?;
            writer.wait(spacing_s);
        }
    }
    writer.tick(position)?;
    writer.segment(&test, false)
}

fn circle(
    map: &Map,
    rows: &[Vec<f64>],
    run: u32,
    position: &mut PerAxis<f64>,
    writer: &mut Writer,
) -> Result<()> {
    let Test::Circle {
        plane,
        centre_mm,
        radius_mm,
        feed_mm_min,
        ..
    } = &map.test
    else {
        return Ok(());
    };
    if !(*feed_mm_min > 0.0 && *radius_mm > 0.0) {
        bail!("feed_mm_min and radius_mm must be above 0");
    }
    let (kind, axes) = match plane {
        Plane::Xy => (TestPlane::Xy, [Axis::X, Axis::Y]),
        Plane::Yz => (TestPlane::Yz, [Axis::Y, Axis::Z]),
        Plane::Zx => (TestPlane::Zx, [Axis::Z, Axis::X]),
    };
    let angles = unwrapped(rows.iter().map(|row| row[1].to_radians()));
    let sign = sense(&angles, run)?;
    let mut test = segment(TestKind::Circle, run, *feed_mm_min);
    test.plane = kind;
    test.centre_mm = Vector3::from(*centre_mm);
    test.radius_mm = *radius_mm;
    test.sense = if sign > 0.0 {
        Sense::CounterClockwise
    } else {
        Sense::Clockwise
    };
    for axis in Axis::LINEAR {
        position[axis] = centre_mm[axis.index()];
    }
    let to = |angle: f64, position: &mut PerAxis<f64>| {
        position[axes[0]] = centre_mm[axes[0].index()] + radius_mm * angle.cos();
        position[axes[1]] = centre_mm[axes[1].index()] + radius_mm * angle.sin();
    };
    let rate = feed_mm_min / 60.0 / radius_mm;
    let mut angle = angles[0] - sign * AHEAD_RAD;
    to(angle, position);
    rest(position, REST_S, writer)?;
    writer.segment(&test, true)?;
    for (row, next) in rows.iter().zip(&angles) {
        let ticks = ((next - angle).abs() / (rate * TICK_S)).ceil().max(1.0);
        let step = (next - angle) / ticks;
        let spacing_s = step.abs() / rate;
        let from = angle;
        let mut k = 1.0;
        while k <= ticks {
            writer.wait(spacing_s);
            angle = from + step * k;
            to(angle, position);
            writer.tick(position)?;
            k += 1.0;
        }
        writer.length(axes[0], radius_mm + row[2] * 1e-3)?;
    }
    writer.segment(&test, false)
}

/// Sign of the sense in which angles go round.
fn sense(angles: &[f64], run: u32) -> Result<f64> {
    let swept = angles.last().unwrap_or(&0.0) - angles.first().unwrap_or(&0.0);
    let sign = swept.signum();
    if angles.windows(2).any(|two| (two[1] - two[0]) * sign <= 0.0) {
        bail!("run {run}: angles must go round in one sense, in steps below half a turn");
    }
    Ok(sign)
}

/// Angles without their jumps of a turn.
fn unwrapped(angles: impl Iterator<Item = f64>) -> Vec<f64> {
    let turn = std::f64::consts::TAU;
    let mut all: Vec<f64> = vec![];
    for angle in angles {
        let near = all
            .last()
            .map_or(angle, |last| angle + turn * ((last - angle) / turn).round());
        all.push(near);
    }
    all
}

fn log<'a>(
    (axis, run, begin_s): (Axis, u32, f64),
    sensors: &[&str],
    rows: impl Iterator<Item = &'a [f64]>,
    position: &PerAxis<f64>,
    writer: &mut Writer,
) -> Result<()> {
    let test = segment(TestKind::Dwell, run, 0.0);
    let mut has_begun = false;
    for row in rows {
        writer.wait_until(row[0] - begin_s)?;
        if !has_begun {
            writer.segment(&test, true)?;
            has_begun = true;
        }
        writer.tick(position)?;
        writer.length(axis, position[axis] + row[1] * 1e-3)?;
        for (sensor, degc) in sensors.iter().zip(&row[2..]) {
            writer.temperature(sensor, *degc)?;
        }
    }
    writer.segment(&test, false)
}
