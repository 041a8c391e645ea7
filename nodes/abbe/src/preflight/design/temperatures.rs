//! The temperatures that a warming test is foreseen to have: an ideal machine's stand still.
//!
//! # Model
//!
//! ```text
//!   tau dT/dt = rise w(t) - (T - T_0)                                     (1)
//! ```
//!
//! with w the speed of the warming axis over half its greatest, at most 1, or 1 while the spindle turns. Rise and tau are those
//! of a machining centre of usual size; what a machine really does, its thermometers show in the recording.

use machine::MachineFile;
use machine::file::SensorPlace;
use metrology::Axis;
use twin::Session;

use super::menu::Heat;

/// Temperature at the begin, degC.
const BEGIN_DEGC: f64 = 20.0;
/// Shortest pause between two tests that is one of warming, s.
const LEAST_PAUSE_S: f64 = 400.0;

/// Rise in the end, K, and time constant, min, of a place.
pub(in crate::preflight) const fn response(place: SensorPlace, heat: Heat) -> Option<(f64, f64)> {
    Some(match (place, heat) {
        (SensorPlace::NutX, Heat::Axis(Axis::X))
        | (SensorPlace::NutY, Heat::Axis(Axis::Y))
        | (SensorPlace::NutZ, Heat::Axis(Axis::Z)) => (5.0, 15.0),
        (SensorPlace::Bed, Heat::Axis(_)) => (0.3, 120.0),
        (SensorPlace::SpindleFront, Heat::Spindle) => (12.0, 10.0),
        (SensorPlace::SpindleRear, Heat::Spindle) => (9.0, 12.0),
        (SensorPlace::Column, Heat::Spindle) => (2.0, 60.0),
        _ => return None,
    })
}

/// Puts the foreseen temperatures into the past of a session.
pub fn foresee(session: &mut Session, machine: &MachineFile, heat: Heat) {
    let drive = drive(session, machine, heat);
    let step_s = session.history.step_s;
    for sensor in &machine.temperature_sensors {
        let Some((rise_k, tau_min)) = response(sensor.place, heat) else {
            continue;
        };
        let Some(series) = session.history.temperature_degc.get_mut(&sensor.id) else {
            continue;
        };
        let share = 1.0 - (-step_s / (60.0 * tau_min)).exp();
        let mut above_k = 0.0;
        for (value, drive) in series.iter_mut().zip(&drive) {
            above_k += share * (rise_k * drive - above_k); // (1)
            *value = BEGIN_DEGC + above_k;
        }
    }
}

/// w, by the entries of the past.
fn drive(session: &Session, machine: &MachineFile, heat: Heat) -> Vec<f64> {
    let history = &session.history;
    match heat {
        Heat::Axis(axis) => {
            let feed_mm_min = machine.linear(axis).map_or(1.0, |e| e.feed_limit_mm_min);
            let most_mm_s = 0.5 * feed_mm_min / 60.0;
            let speed = history.speed[axis].iter();
            speed.map(|speed| (speed / most_mm_s).min(1.0)).collect()
        }
        Heat::Spindle => {
            let mut drive = vec![0.0; history.len()];
            if let Some([from_s, to_s]) = spun_s(session) {
                for (k, value) in drive.iter_mut().enumerate() {
                    let at_s = k as f64 * history.step_s;
                    if (from_s..to_s).contains(&at_s) {
                        *value = 1.0;
                    }
                }
            }
            drive
        }
    }
}

/// The first long pause between two tests, s.
fn spun_s(session: &Session) -> Option<[f64; 2]> {
    let ends = session.runs.iter().filter_map(|run| {
        let times = run
            .readings
            .iter()
            .filter_map(|reading| run.time_of(reading));
        let [first, last] = times.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], at_s| {
            [low.min(at_s), high.max(at_s)]
        });
        (first <= last).then_some([first, last])
    });
    let ends: Vec<[f64; 2]> = ends.collect();
    let mut pairs = ends.windows(2);
    pairs.find_map(|pair| {
        let pause = [pair[0][1], pair[1][0]];
        (pause[1] - pause[0] >= LEAST_PAUSE_S).then_some(pause)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const MACHINE: &str = include_str!("../../../../../launch_configs/gap_first/machine.yaml");

    /// After one time constant at full speed a nut has 63 % of its rise, and nothing else has moved.
    #[test]
    fn eq1_a_nut_warms_with_its_axis_and_no_other_sensor_does() {
        let machine = MachineFile::parse(MACHINE, "machine.yaml").unwrap();
        let mut session = Session::default();
        let steps = 90;
        session.history.step_s = 10.0;
        for axis in Axis::LINEAR {
            session.history.speed[axis] = vec![0.0; steps];
        }
        session.history.speed[Axis::X] = vec![400.0; steps];
        for sensor in &machine.temperature_sensors {
            let series = vec![BEGIN_DEGC; steps];
            let _ = session
                .history
                .temperature_degc
                .insert(sensor.id.clone(), series);
        }
        foresee(&mut session, &machine, Heat::Axis(Axis::X));
        let last = |id: &str| session.history.temperature_degc[id][steps - 1];
        let wanted = BEGIN_DEGC + 5.0 * (1.0 - (-1.0_f64).exp());
        assert!((last("nut_x") - wanted).abs() < 1e-9, "{}", last("nut_x"));
        assert!((last("nut_y") - BEGIN_DEGC).abs() < 1e-12);
        assert!((last("ambient") - BEGIN_DEGC).abs() < 1e-12);
    }
}
