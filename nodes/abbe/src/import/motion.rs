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
/// Longest motion that is made up for a table, s: a day.
const LONGEST_S: f64 = 86_400.0;
/// Slowest feed of one, mm/min.
const SLOWEST_MM_MIN: f64 = 0.01;
/// Targets nearer than this are one, mm.
const SAME_MM: f64 = 1e-9;
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
    check_time(&map.test, table)?;
    check_directions(table)?;
    for rows in table.runs() {
        n += 1;
        match &map.test {
            Test::Circle { .. } => circle(map, rows, n, &mut position, writer)?,
            _ => positioning(map, rows, n, &mut position, writer)?,
        }
    }
    Ok(n)
}

/// Refuses stops so far apart, or a feed so slow, that the motion would go on for days.
fn check_time(test: &Test, table: &Table) -> Result<()> {
    let (Test::Positioning { feed_mm_min, .. } | Test::Circle { feed_mm_min, .. }) = test else {
        return Ok(());
    };
    if feed_mm_min.is_nan() || *feed_mm_min < SLOWEST_MM_MIN {
        bail!("feed_mm_min = {feed_mm_min}: must be at least {SLOWEST_MM_MIN}");
    }
    let Test::Positioning {
        dwell_s,
        overrun_mm,
        ..
    } = test
    else {
        return Ok(());
    };
    let stops = table.rows.len() as f64;
    let targets_mm = table
        .rows
        .windows(2)
        .map(|two| (two[1][1] - two[0][1]).abs());
    let way_mm = targets_mm.sum::<f64>() + 2.0 * stops * overrun_mm;
    let time_s = way_mm / (feed_mm_min / 60.0) + stops * dwell_s;
    if time_s.is_nan() || time_s > LONGEST_S {
        bail!(
            "{stops} stops, {way_mm} mm of way at feed_mm_min = {feed_mm_min} take {time_s:.0} s: at most {LONGEST_S} s"
        );
    }
    Ok(())
}

/// Where the first target of a run is approached from, as a sign of the way: as it is told, or from the side that the
/// second one lies away from.
fn first_way(rows: &[Vec<f64>]) -> f64 {
    let first_mm = rows[0][1];
    let told = rows[0].get(3).copied();
    let mut ways = rows.iter().map(|row| row[1] - first_mm);
    told.unwrap_or_else(|| ways.find(|way| way.abs() > SAME_MM).unwrap_or(1.0).signum())
}

/// Refuses rows whose order makes another direction than their column tells.
fn check_directions(table: &Table) -> Result<()> {
    for rows in table.runs() {
        let mut way = first_way(rows);
        for (k, two) in rows.windows(2).enumerate() {
            let by_mm = two[1][1] - two[0][1];
            way = if by_mm.abs() > SAME_MM {
                by_mm.signum()
            } else {
                -way
            };
            if two[1].get(3).is_some_and(|told| *told * way < 0.0) {
                let (word, other) = if way > 0.0 {
                    ("up", "down")
                } else {
                    ("down", "up")
                };
                bail!(
                    "run {}, row {}: target {} mm after {} mm is approached {word}, and its direction says {other}: rows must be in the order of the measurement",
                    two[1][0],
                    k + 2,
                    two[1][1],
                    two[0][1]
                );
            }
        }
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

/// Goes along one axis.
fn go(
    position: &mut PerAxis<f64>,
    axis: Axis,
    to_mm: f64,
    feed_mm_s: f64,
    writer: &mut Writer,
) -> Result<()> {
    let step_mm = feed_mm_s * TICK_S;
    while (to_mm - position[axis]).abs() > SAME_MM {
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
    let before_mm = rows[0][1] - first_way(rows) * overrun_mm;
    if run == 1 {
        position[*axis] = before_mm;
    }
    rest(position, REST_S, writer)?;
    writer.segment(&test, true)?;
    go(position, *axis, before_mm, feed_mm_s, writer)?;
    let mut last = before_mm;
    for row in rows {
        let (target_mm, deviation_um) = (row[1], row[2]);
        if (target_mm - position[*axis]).abs() < SAME_MM {
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
    end(&test, writer)
}

/// Sign of the sense in which angles go round.
fn sense(angles: &[f64], run: u32) -> Result<f64> {
    let swept = angles.last().unwrap_or(&0.0) - angles.first().unwrap_or(&0.0);
    let sign = swept.signum();
    let goes_on = |two: &[f64]| {
        let step = (two[1] - two[0]) * sign;
        step > 0.0 && step <= std::f64::consts::PI
    };
    if !angles.windows(2).all(goes_on) {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn positioning(targets_mm: &[f64]) -> Result<()> {
        let test = Test::Positioning {
            axis: Axis::X,
            feed_mm_min: 6000.0,
            dwell_s: 2.0,
            overrun_mm: 5.0,
            run: "run".to_owned(),
            target_mm: "target".to_owned(),
            deviation_um: "deviation".to_owned(),
            direction: None,
        };
        let rows = targets_mm.iter().map(|mm| vec![1.0, *mm, 0.0]).collect();
        check_time(&test, &Table { rows })
    }

    #[test]
    fn stops_that_would_take_days_to_reach_are_refused_with_the_time() {
        assert!(positioning(&[0.0, 100.0, 200.0]).is_ok());
        for far_mm in [1e8, 1e300, f64::MAX] {
            let error = positioning(&[-far_mm, far_mm]).expect_err("without end");
            assert!(format!("{error}").contains("at most 86400 s"), "{error}");
        }
    }

    fn directions(rows: &[(f64, f64)]) -> Result<()> {
        let rows = rows.iter().map(|(mm, way)| vec![1.0, *mm, 0.0, *way]);
        check_directions(&Table {
            rows: rows.collect(),
        })
    }

    #[test]
    fn rows_whose_order_is_not_that_of_their_directions_are_refused_with_the_row() {
        let (up, down) = (1.0, -1.0);
        assert!(directions(&[(0.0, up), (9.0, up), (9.0, down), (0.0, down)]).is_ok());
        assert!(directions(&[(0.0, down), (0.0, up), (9.0, up), (9.0, down)]).is_ok());
        // Sorted by target.
        let sorted = directions(&[(0.0, down), (0.0, up), (9.0, down), (9.0, up)]);
        assert_eq!(
            format!("{}", sorted.expect_err("in another order")),
            "run 1, row 3: target 9 mm after 0 mm is approached up, and its direction says down: rows must be in the order of the measurement"
        );
    }

    #[test]
    fn angles_beyond_all_turns_are_refused_and_not_followed() {
        for far_deg in [1e18, 1e300, f64::MAX] {
            let angles = [0.0, 10.0, far_deg].map(f64::to_radians);
            assert!(sense(&unwrapped(angles.into_iter()), 1).is_err());
        }
        let turn = (0..=36).map(|k| f64::from(k * 10).to_radians());
        assert!(sense(&unwrapped(turn), 1).is_ok());
    }
}
