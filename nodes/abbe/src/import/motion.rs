//! The motion that a measurement was made with, from the order of its rows.

use anyhow::{Context as _, Result, bail};
use iso230::thermal::{DriftCause, height_name};
use metrology::number::number;
use metrology::sample::{Sense, TestKind, TestPlane, TestSegment};
use metrology::{Axis, PerAxis, Stamp};
use nalgebra::Vector3;

use super::limits::SETTLE_S;
use super::map::{Map, Plane, Test, units};
use super::runs::{Runs, SAME_TARGET_MM, first_way};
use super::table::Row;
use super::times;
use super::writer::Writer;

/// Spacing of the axis states, s.
const TICK_S: f64 = 0.01;
/// Rest before a run and between runs, s.
const REST_S: f64 = 2.0;
/// Readings at a stop.
const READINGS: u32 = 5;
/// Longest motion that is made up for a table, s: a day.
const LONGEST_MOTION_S: f64 = 86_400.0;
/// Most rows of a log, a week of one a second: every row is written, and read again.
const MOST_LOG_ROWS: usize = 604_800;
/// Share of a turn that a circle runs ahead of its first row.
const AHEAD_RAD: f64 = std::f64::consts::FRAC_PI_2;
/// The shortest arc that is a test of circles, deg.
const LEAST_ARC_DEG: f64 = 20.0;

/// Writes every run of a table; gives their number.
///
/// # Errors
/// When rows contradict the map, or the bag cannot be written.
pub fn write(map: &Map, runs: &Runs, writer: &mut Writer) -> Result<u32> {
    let mut position = PerAxis::default();
    for (axis, mm) in &map.at_mm {
        position[*axis] = *mm;
    }
    let mut n = 0;
    check_time(&map.test, &runs.runs)?;
    if let Test::Log { run, .. } = &map.test {
        let column = usize::from(run.is_some());
        let n: usize = runs.runs.iter().map(Vec::len).sum();
        if n > MOST_LOG_ROWS {
            bail!(
                "{n} rows of a log: must be at most {MOST_LOG_ROWS}: keep every {}th row",
                n / MOST_LOG_ROWS + 1
            );
        }
        times::check(runs.runs.iter().flatten().map(|row| row.cells[column]))?;
    }
    for rows in &runs.runs {
        n += 1;
        match &map.test {
            Test::Circle { .. } => circle(map, rows, n, &mut position, writer)?,
            Test::Positioning { .. } => positioning(map, rows, n, &mut position, writer)?,
            Test::Touches { .. } => bail!("touches have no motion"),
            Test::Log {
                axis,
                cause,
                run,
                second_displacement_um,
                heights_mm,
                temperature_degc,
                ..
            } => {
                let sensors: Vec<&str> = temperature_degc.keys().map(String::as_str).collect();
                let first = usize::from(run.is_some());
                let begin_s = runs.runs[0][0].cells[first];
                let rows = rows.iter().map(|row| (row.line, &row.cells[first..]));
                let mut test = segment(TestKind::Dwell, n, 0.0);
                test.features = named((*axis, *cause), heights_mm);
                let displacements = 1 + usize::from(second_displacement_um.is_some());
                let columns = (displacements, sensors.as_slice());
                log((*axis, &test, begin_s), columns, rows, &position, writer)?;
            }
        }
    }
    Ok(n)
}

/// Refuses stops so far apart, or a feed so slow, that the motion would go on for days.
fn check_time(test: &Test, runs: &[Vec<Row>]) -> Result<()> {
    let (Test::Positioning { feed_mm_min, .. } | Test::Circle { feed_mm_min, .. }) = test else {
        return Ok(());
    };
    if let Test::Circle { radius_mm, .. } = test {
        return check_circle_time(*radius_mm, *feed_mm_min, runs);
    }
    let Test::Positioning {
        axis,
        dwell_s,
        overrun_mm,
        ..
    } = test
    else {
        return Ok(());
    };
    let targets: Vec<f64> = runs.iter().flatten().map(|row| row.cells[1]).collect();
    let stops = targets.len() as f64;
    let ways_mm = targets.windows(2).map(|two| (two[1] - two[0]).abs());
    let way_mm = ways_mm.sum::<f64>() + 2.0 * stops * overrun_mm;
    let time_s = way_mm / (feed_mm_min / 60.0) + stops * dwell_s;
    if time_s.is_nan() || time_s > LONGEST_MOTION_S {
        let units = units(*axis);
        bail!(
            "{stops} stops, {} {} of way at {} = {feed_mm_min} {} of the map take {} s: at most {LONGEST_MOTION_S} s; state a shorter dwell_s (above 0.4) or a higher feed, or part the table",
            number(way_mm),
            units.target,
            units.keys[0],
            units.feed,
            number(time_s)
        );
    }
    Ok(())
}

/// Refuses circles that would take days at their feed.
fn check_circle_time(radius_mm: f64, feed_mm_min: f64, runs: &[Vec<Row>]) -> Result<()> {
    let turned_deg: f64 = runs
        .iter()
        .map(|rows| {
            let steps = rows.windows(2);
            steps
                .map(|two| (two[1].cells[1] - two[0].cells[1]).abs())
                .sum::<f64>()
        })
        .sum();
    let way_mm = turned_deg.to_radians() * radius_mm;
    let n = runs.len() as f64;
    let way_mm = way_mm + n * AHEAD_RAD * radius_mm;
    let time_s = way_mm / (feed_mm_min / 60.0) + n * REST_S;
    if time_s.is_nan() || time_s > LONGEST_MOTION_S {
        bail!(
            "{n} runs, {} mm of arc at feed_mm_min = {feed_mm_min} mm/min of the map take {} s: at most {LONGEST_MOTION_S} s",
            number(way_mm),
            number(time_s)
        );
    }
    Ok(())
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

/// The place a tick later on the way to another, at a speed; what counts as one place with the end is the end.
fn next_place(at: f64, to: f64, (step, same): (f64, f64)) -> f64 {
    let way = to - at;
    if way.abs() <= step + same {
        to
    } else {
        at + way.signum() * step
    }
}

/// Goes along one axis, at a speed, and stands at the end exactly: a place beside it may be another one to an evaluation.
fn go(
    position: &mut PerAxis<f64>,
    axis: Axis,
    to: f64,
    (per_s, same): (f64, f64),
    writer: &mut Writer,
) -> Result<()> {
    if (to - position[axis]).abs() <= same {
        position[axis] = to;
    }
    while position[axis].total_cmp(&to).is_ne() {
        position[axis] = next_place(position[axis], to, (per_s * TICK_S, same));
        writer.tick(position)?;
        writer.wait(TICK_S);
    }
    Ok(())
}

fn positioning(
    map: &Map,
    rows: &[Row],
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
    // From here on in the inner units of the axis: mm, or rad.
    let units = units(*axis);
    let inner = units.target_inner;
    let (feed_s, overrun) = (feed_mm_min * inner / 60.0, overrun_mm * inner);
    let same = SAME_TARGET_MM * inner;
    let mut test = segment(TestKind::Positioning, run, 0.0);
    // A feed of degrees is no speed of the wire.
    test.feed_mm_s = if axis.is_linear() { feed_s } else { 0.0 };
    test.features = vec![axis.letter().to_owned()];
    test.stations = u32::try_from(rows.len()).unwrap_or(u32::MAX);
    let before = rows[0].cells[1] * inner - first_way(rows) * overrun;
    if run == 1 {
        position[*axis] = before;
    }
    rest(position, REST_S, writer)?;
    writer.segment(&test, true)?;
    go(position, *axis, before, (feed_s, same), writer)?;
    let mut last = before;
    for row in rows {
        let target = row.cells[1] * inner;
        let read = target + row.cells[2] * units.deviation_inner;
        if (target - position[*axis]).abs() < same {
            // Measured from the other side: beyond it and back.
            let beyond = target + (target - last).signum() * overrun;
            go(position, *axis, beyond, (feed_s, same), writer)?;
        }
        last = position[*axis];
        go(position, *axis, target, (feed_s, same), writer)?;
        rest(position, SETTLE_S, writer)?;
        let spacing_s = (dwell_s - SETTLE_S) / f64::from(READINGS);
        for _ in 0..READINGS {
            writer.tick(position)?;
            // A stop without a reading is a stop all the same.
            match (read.is_finite(), axis.is_linear()) {
                (false, _) => {}
                (true, true) => writer.length(*axis, read)?,
                (true, false) => writer.angle(*axis, read)?,
            }
            writer.wait(TICK_S);
            rest(position, spacing_s - TICK_S, writer)?;
        }
    }
    writer.tick(position)?;
    end(&test, writer)
}

/// Ends a run; what comes next is a tick later.
fn end(test: &TestSegment, writer: &mut Writer) -> Result<()> {
    writer.segment(test, false)?;
    writer.wait(TICK_S);
    Ok(())
}

fn circle(
    map: &Map,
    rows: &[Row],
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
    let (kind, axes) = match plane {
        Plane::Xy => (TestPlane::Xy, [Axis::X, Axis::Y]),
        Plane::Yz => (TestPlane::Yz, [Axis::Y, Axis::Z]),
        Plane::Zx => (TestPlane::Zx, [Axis::Z, Axis::X]),
    };
    let angles = unwrapped(rows.iter().map(|row| row.cells[1].to_radians()));
    let sign = sense(&angles, rows, run)?;
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
        if row.cells[2].is_finite() {
            writer.length(axes[0], radius_mm + row.cells[2] * 1e-3)?;
        }
    }
    end(&test, writer)
}

/// Sign of the sense in which angles go round.
fn sense(angles: &[f64], rows: &[Row], run: u32) -> Result<f64> {
    let swept = angles.last().unwrap_or(&0.0) - angles.first().unwrap_or(&0.0);
    let sign = swept.signum();
    let goes_on = |two: &[f64]| {
        let step = (two[1] - two[0]) * sign;
        step > 0.0 && step <= std::f64::consts::PI
    };
    if let Some(at) = angles.windows(2).position(|two| !goes_on(two)) {
        let line = rows.get(at + 1).map_or(0, |row| row.line);
        let [from, to] = [at, at + 1].map(|k| rows.get(k).map_or(f64::NAN, |row| row.cells[1]));
        bail!(
            "line {line}: run {run}: {to} deg after {from} deg: angles must go round in one sense, in steps below half a turn; a circle the other way round is a run of its own"
        );
    }
    let swept_deg = swept.abs().to_degrees();
    if swept_deg < LEAST_ARC_DEG {
        let line = rows.first().map_or(0, |row| row.line);
        let remedy = if swept_deg <= 2.0 * std::f64::consts::TAU {
            "; where they are radians, convert them to degrees"
        } else {
            ""
        };
        bail!(
            "line {line}: run {run}: angles sweep {} deg, a circle at least {LEAST_ARC_DEG} deg{remedy}",
            number(swept_deg)
        );
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

/// What a log is of: its axis, the cause of the drift and the heights of its sensors where they are stated, as
/// `reports::evaluate::drift` reads them.
fn named((axis, cause): (Axis, Option<DriftCause>), heights_mm: &[f64]) -> Vec<String> {
    let cause = match cause {
        None | Some(DriftCause::NotStated) => None,
        Some(DriftCause::Environment) => Some("environment"),
        Some(DriftCause::Spindle) => Some("spindle"),
        Some(DriftCause::LinearAxis) => Some("linear_axis"),
        Some(DriftCause::RotaryAxis) => Some("rotary_axis"),
    };
    let names = std::iter::once(axis.letter())
        .chain(cause)
        .map(str::to_owned);
    let heights = (1..).zip(heights_mm);
    names
        .chain(heights.map(|(zero_id, height_mm)| height_name(zero_id, *height_mm)))
        .collect()
}

fn log<'a>(
    (axis, test, begin_s): (Axis, &TestSegment, f64),
    (displacements, sensors): (usize, &[&str]),
    rows: impl Iterator<Item = (u64, &'a [f64])>,
    position: &PerAxis<f64>,
    writer: &mut Writer,
) -> Result<()> {
    let mut has_begun = false;
    for (line, row) in rows {
        writer
            .begin_row(row[0] - begin_s)
            .with_context(|| format!("line {line}: time {} s", row[0]))?;
        if !has_begun {
            writer.segment(test, true)?;
            has_begun = true;
        }
        writer.tick(position)?;
        let (of_lengths, of_sensors) = row[1..].split_at(displacements);
        for (zero_id, um) in (1..).zip(of_lengths).filter(|(_, um)| um.is_finite()) {
            writer.length_of((axis, zero_id), position[axis] + um * 1e-3)?;
        }
        let read = sensors.iter().zip(of_sensors);
        for (sensor, degc) in read.filter(|(_, degc)| degc.is_finite()) {
            writer.temperature(sensor, *degc)?;
        }
    }
    writer.segment(test, false)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn positioning(targets_mm: &[f64]) -> Result<()> {
        let test = Test::Positioning {
            axis: Axis::X,
            feed_mm_min: 6000.0,
            dwell_s: 2.0,
            overrun_mm: 5.0,
            run: Some("run".to_owned()),
            target_mm: "target".to_owned(),
            deviation_um: Some("deviation".to_owned()),
            measured_mm: None,
            passes_um: vec![],
            direction: None,
            same_target_um: None,
        };
        let row = |mm: &f64| Row {
            line: 2,
            cells: vec![1.0, *mm, 0.0],
        };
        check_time(&test, &[targets_mm.iter().map(row).collect()])
    }

    #[test]
    fn a_way_ends_exactly_at_its_target_whatever_its_unit_and_decimals() {
        let step = 1000.0 / 60.0 * TICK_S;
        let mut n = 0;
        for spacing_mm in [10, 20, 25, 35, 50] {
            for decimals in [5, 6, 7, 8, 9, 15] {
                // As a table has them: rounded in inches.
                let size = 10.0_f64.powi(decimals);
                let inches = (-8..8).map(|k| f64::from(k * spacing_mm) / 25.4);
                let places: Vec<f64> = inches.map(|x| (x * size).round() / size * 25.4).collect();
                for [from, to] in places
                    .windows(2)
                    .flat_map(|two| [[two[0], two[1]], [two[1], two[0]]])
                {
                    let mut at = from - (to - from).signum();
                    let mut ticks = 0;
                    while at.total_cmp(&to).is_ne() && ticks < 1000 {
                        at = next_place(at, to, (step, SAME_TARGET_MM));
                        ticks += 1;
                    }
                    assert!(at.total_cmp(&to).is_eq(), "{from} to {to}: {at}");
                    n += 1;
                }
            }
        }
        assert_eq!(n, 5 * 6 * 30);
    }

    #[test]
    fn circles_that_would_take_days_are_refused_with_the_time() {
        let of = |feed_mm_min: f64, last_deg: f64| {
            let test = Test::Circle {
                plane: Plane::Xy,
                centre_mm: [0.0; 3],
                radius_mm: 100.0,
                feed_mm_min,
                run: "run".to_owned(),
                angle_deg: "angle".to_owned(),
                radial_um: "radial".to_owned(),
            };
            let row = |deg: f64| Row {
                line: 2,
                cells: vec![1.0, deg, 0.0],
            };
            check_time(&test, &[vec![row(0.0), row(last_deg)]])
        };
        assert!(of(1000.0, 360.0).is_ok());
        for (feed_mm_min, last_deg) in [(0.1, 360.0), (1000.0, 360e9), (1000.0, f64::MAX)] {
            let error = of(feed_mm_min, last_deg).expect_err("days");
            assert!(format!("{error}").contains("at most 86400 s"), "{error}");
        }
    }

    #[test]
    fn stops_that_would_take_days_to_reach_are_refused_with_the_time() {
        assert!(positioning(&[0.0, 100.0, 200.0]).is_ok());
        for far_mm in [1e8, 1e300, f64::MAX] {
            let error = positioning(&[-far_mm, far_mm]).expect_err("without end");
            assert!(format!("{error}").contains("at most 86400 s"), "{error}");
        }
    }

    #[test]
    fn a_turn_in_radians_is_refused_with_what_to_do() {
        let turn = |least: f64, greatest: f64| {
            let angle = move |k: i32| least + (greatest - least) * f64::from(k) / 360.0;
            let angles: Vec<f64> = (0..=360).map(|k| angle(k).to_radians()).collect();
            sense(&angles, &[], 3).map_err(|error| error.to_string())
        };
        let tau = std::f64::consts::TAU;
        for (least, greatest) in [(0.0, tau), (tau, 0.0), (-tau / 2.0, tau / 2.0)] {
            let error = turn(least, greatest).expect_err("radians");
            assert!(
                error.contains("run 3: angles sweep 6.28319 deg") && error.contains("radians"),
                "{error}"
            );
        }
        // Arcs of ballbars, from a part of a turn to a turn with its overshoot.
        for swept_deg in [30.0, 220.0, 360.0, -360.0, 540.0] {
            assert!(turn(0.0, swept_deg).is_ok(), "{swept_deg}");
        }
    }

    #[test]
    fn angles_beyond_all_turns_are_refused_and_not_followed() {
        for far_deg in [1e18, 1e300, f64::MAX] {
            let angles = [0.0, 10.0, far_deg].map(f64::to_radians);
            assert!(sense(&unwrapped(angles.into_iter()), &[], 1).is_err());
        }
        let turn = (0..=36).map(|k| f64::from(k * 10).to_radians());
        assert!(sense(&unwrapped(turn), &[], 1).is_ok());
    }
}
