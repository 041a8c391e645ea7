//! The temperatures that a plan is foreseen to have, from what moves in it.
//!
//! # Model
//!
//! ```text
//!   tau dT/dt = rise w(t) - T                                             (1)
//!   tau_room dR/dt = S sin(2 pi t / day) - R                              (2)
//!   reading = T_0 + R + sum over sources of T                             (3)
//! ```
//!
//! with w the speed of an axis over half its greatest, at most 1, or 1 while the spindle turns. Rise and tau are those of a
//! machining centre of usual size, as a designed programme has them; the room swings by S within a day, which a
//! shop without a climate has, and bodies follow it by their mass. The machine file says which thermometers there are.
//!
//! # Holds when
//! The plan begins on a cold machine. Lengths do not follow: an ideal machine does not grow. What a machine really does, its
//! thermometers show in the recording.

use std::f64::consts::TAU;

use machine::MachineFile;
use machine::file::{SensorEntry, SensorPlace};
use metrology::stamp::Span;
use metrology::{Axis, PerAxis};

use super::design::menu::Heat;
use super::design::temperatures::response;

/// T_0, degC.
pub const COLD_DEGC: f64 = 20.0;
/// S, K.
const ROOM_SWING_K: f64 = 2.0;
/// The period of (2), s.
const DAY_S: f64 = 86_400.0;
/// Step of (1) and (2), to the nearest period of motion, s.
const WARMING_STEP_S: f64 = 1.0;
/// What warms a machine.
const SOURCES: [Heat; 4] = [
    Heat::Axis(Axis::X),
    Heat::Axis(Axis::Y),
    Heat::Axis(Axis::Z),
    Heat::Spindle,
];

/// tau_room, min.
const fn room_tau_min(place: SensorPlace) -> f64 {
    match place {
        SensorPlace::Ambient => 1.0,
        SensorPlace::NutX | SensorPlace::NutY | SensorPlace::NutZ => 60.0,
        SensorPlace::SpindleFront | SensorPlace::SpindleRear => 90.0,
        SensorPlace::Column => 180.0,
        SensorPlace::Bed => 360.0,
    }
}

/// A first-order answer.
#[derive(Clone, Copy, Debug)]
struct Lag {
    tau_s: f64,
    value_k: f64,
}

impl Lag {
    fn new(tau_min: f64) -> Self {
        Self {
            tau_s: 60.0 * tau_min,
            value_k: 0.0,
        }
    }

    /// Exact while the target stands still over the time.
    fn follow(&mut self, target_k: f64, passed_s: f64) {
        let share = 1.0 - (-passed_s / self.tau_s).exp();
        self.value_k += share * (target_k - self.value_k);
    }
}

/// One thermometer: rise and (1) of each source that reaches it, and (2).
#[derive(Clone, Debug)]
struct Place {
    id: String,
    sources: Vec<(usize, f64, Lag)>,
    room: Lag,
    /// Least and greatest reading so far, degC.
    span_degc: [f64; 2],
}

impl Place {
    fn new(sensor: &SensorEntry) -> Self {
        let sources = SOURCES.iter().enumerate().filter_map(|(index, heat)| {
            let (rise_k, tau_min) = response(sensor.place, *heat)?;
            Some((index, rise_k, Lag::new(tau_min)))
        });
        Self {
            id: sensor.id.clone(),
            sources: sources.collect(),
            room: Lag::new(room_tau_min(sensor.place)),
            span_degc: [COLD_DEGC; 2],
        }
    }

    /// (3).
    fn reading_degc(&self) -> f64 {
        let sources = self.sources.iter().map(|(_, _, lag)| lag.value_k);
        COLD_DEGC + self.room.value_k + sources.sum::<f64>()
    }
}

/// The thermometers of a machine, and what has warmed them so far.
#[derive(Clone, Debug)]
pub struct Warming {
    places: Vec<Place>,
    /// Speed at which an axis warms fully, mm/s.
    full_mm_s: PerAxis<f64>,
    /// Integral of w since the last step, s, by source.
    driven_s: [f64; SOURCES.len()],
    passed_s: f64,
    at_s: f64,
}

impl Warming {
    /// A cold machine.
    pub fn new(machine: &MachineFile) -> Self {
        let full = |axis| {
            machine
                .linear(axis)
                .map_or(f64::INFINITY, |entry| 0.5 * entry.feed_limit_mm_min / 60.0)
        };
        Self {
            places: machine.temperature_sensors.iter().map(Place::new).collect(),
            full_mm_s: PerAxis::from_fn(full),
            driven_s: [0.0; SOURCES.len()],
            passed_s: 0.0,
            at_s: 0.0,
        }
    }

    /// One period of motion; `velocity` in mm/s.
    pub fn step(&mut self, velocity: &PerAxis<f64>, spindle_rpm: f64, period: Span) {
        let period_s = period.as_secs_f64();
        for (driven_s, heat) in self.driven_s.iter_mut().zip(SOURCES) {
            let drive = match heat {
                Heat::Axis(axis) => (velocity[axis].abs() / self.full_mm_s[axis]).min(1.0),
                Heat::Spindle => f64::from(spindle_rpm.abs() > 0.0),
            };
            *driven_s += drive * period_s;
        }
        self.passed_s += period_s;
        // The nearest: ten tenths of a second add up to a little less than one.
        if self.passed_s + 0.5 * period_s >= WARMING_STEP_S {
            self.warm();
        }
    }

    fn warm(&mut self) {
        let passed_s = self.passed_s;
        self.at_s += passed_s;
        let room_k = ROOM_SWING_K * (TAU * self.at_s / DAY_S).sin();
        for place in &mut self.places {
            for (source, rise_k, lag) in &mut place.sources {
                let drive = self.driven_s[*source] / passed_s;
                lag.follow(*rise_k * drive, passed_s); // (1)
            }
            place.room.follow(room_k, passed_s); // (2)
            let reading = place.reading_degc();
            let [low, high] = place.span_degc;
            place.span_degc = [low.min(reading), high.max(reading)];
        }
        self.driven_s = [0.0; SOURCES.len()];
        self.passed_s = 0.0;
    }

    /// (3) of a thermometer, degC; none where the machine has no such one.
    pub fn reading_degc(&self, id: &str) -> Option<f64> {
        let mut places = self.places.iter();
        let place = places.find(|place| place.id == id)?;
        Some(place.reading_degc())
    }

    /// How far each thermometer has changed, K, in the order of the machine file.
    pub fn changes_k(&self) -> impl Iterator<Item = (&str, f64)> {
        let places = self.places.iter();
        places.map(|place| {
            let [low, high] = place.span_degc;
            (place.id.as_str(), high - low)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MACHINE: &str = include_str!("../../../../launch_configs/first_run/machine.yaml");

    /// Readings after some minutes in which X moves at a speed and the spindle turns, or not.
    fn after(minutes: u32, speed_mm_s: f64, spindle_rpm: f64) -> Warming {
        let machine = MachineFile::parse(MACHINE, "machine.yaml").unwrap();
        let mut warming = Warming::new(&machine);
        let mut velocity = PerAxis::default();
        velocity[Axis::X] = -speed_mm_s;
        for _ in 0..minutes * 600 {
            warming.step(&velocity, spindle_rpm, Span::from_nanos(100_000_000));
        }
        warming
    }

    /// What a source adds over a machine that stands, K.
    fn rise_k(id: &str, warm: &Warming, minutes: u32) -> f64 {
        let still = after(minutes, 0.0, 0.0);
        warm.reading_degc(id).unwrap() - still.reading_degc(id).unwrap()
    }

    #[test]
    fn eq1_an_axis_at_full_speed_warms_its_own_nut_alone_by_63_percent_in_a_time_constant() {
        let warm = after(15, 1e4, 0.0);
        let wanted_k = 5.0 * (1.0 - (-1.0_f64).exp());
        assert!((rise_k("nut_x", &warm, 15) - wanted_k).abs() < 1e-9);
        for id in ["nut_y", "spindle_front", "ambient"] {
            assert!(rise_k(id, &warm, 15).abs() < 1e-12, "{id}");
        }
    }

    #[test]
    fn eq1_half_the_speed_warms_half_as_much_and_a_spindle_its_own_places() {
        let machine = MachineFile::parse(MACHINE, "machine.yaml").unwrap();
        let full_mm_s = 0.5 * machine.linear(Axis::X).unwrap().feed_limit_mm_min / 60.0;
        let [half, full] = [0.5, 1.0].map(|share| after(10, share * full_mm_s, 0.0));
        let ratio = rise_k("nut_x", &half, 10) / rise_k("nut_x", &full, 10);
        assert!((ratio - 0.5).abs() < 1e-9, "{ratio}");
        let spun = after(10, 0.0, 6000.0);
        assert!(rise_k("spindle_front", &spun, 10) > 5.0);
        assert!(rise_k("nut_x", &spun, 10).abs() < 1e-12);
    }

    #[test]
    fn eq2_the_room_swings_once_a_day_and_heavy_bodies_follow_late() {
        let morning = after(6 * 60, 0.0, 0.0);
        let of = |id: &str| morning.reading_degc(id).unwrap() - COLD_DEGC;
        assert!(
            (of("ambient") - ROOM_SWING_K).abs() < 0.01,
            "{}",
            of("ambient")
        );
        assert!(
            of("bed") > 0.0 && of("bed") < 0.7 * ROOM_SWING_K,
            "{}",
            of("bed")
        );
        assert_eq!(morning.reading_degc("none"), None);
    }
}
