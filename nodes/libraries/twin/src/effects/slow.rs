//! Slow series of a session, as heat makes them, added to a run.

use machine::file::SensorPlace;

use super::Scene;
use crate::Series;

impl Scene<'_> {
    /// Warming since its first reading of a thermometer at the first of these places that has one and was
    /// read, K.
    pub(super) fn warming_k(&self, places: &[SensorPlace]) -> Option<Vec<f64>> {
        self.sensors_at(places)
            .find_map(|sensor| self.history.warming_k(sensor))
    }

    /// Temperature less a reference of such a thermometer, K.
    pub(super) fn above_k(&self, places: &[SensorPlace], reference_degc: f64) -> Option<Vec<f64>> {
        self.sensors_at(places)
            .find_map(|sensor| self.history.above_k(sensor, reference_degc))
    }

    fn sensors_at(&self, places: &[SensorPlace]) -> impl Iterator<Item = &str> {
        let sensors = &self.machine.temperature_sensors;
        places.iter().flat_map(move |place| {
            let there = sensors.iter().filter(move |s| s.place == *place);
            there.map(|sensor| sensor.id.as_str())
        })
    }

    /// Adds a series of the session's history to one of the run's ticks, times a factor at each.
    pub(super) fn add_slow(&self, series: &[f64], sum: &mut Series, factor: impl Fn(usize) -> f64) {
        if series.is_empty() {
            return;
        }
        let times = &self.run.motion.time_s;
        for (tick, (sum, at_s)) in sum.iter_mut().zip(times).enumerate() {
            *sum += self.history.at(series, *at_s) * factor(tick);
        }
    }
}

/// Sum of series of one length, each times its amplitude; those of amplitude zero are not made.
pub(super) fn mixture(terms: &[(f64, &dyn Fn() -> Vec<f64>)]) -> Vec<f64> {
    let mut sum: Vec<f64> = vec![];
    for (amplitude, series) in terms {
        if amplitude.abs() > 0.0 {
            let series = series();
            sum.resize(series.len(), 0.0);
            for (sum, value) in sum.iter_mut().zip(series) {
                *sum += amplitude * value;
            }
        }
    }
    sum
}
