//! Which keys of a budget the tests of a bag need.
//!
//! A key that no test needs may be absent: a budget for a laser states no grid encoder.

use anyhow::{Result, bail};
use metrology::sample::{FeatureKind, Rejection};

use super::Budget;
use crate::evaluate::Tests;
use crate::evaluate::circles::Instrument;
use crate::evaluate::correction::About;
use crate::evaluate::linear::{LinearTest, Reference};

/// Keys with the test that needs them.
type Needs = (Vec<&'static str>, String);

impl Budget {
    /// Refuses a budget that lacks a term of the uncertainty of a test.
    ///
    /// # Errors
    /// Names the keys and the first test that needs them.
    pub fn check_tests(&self, tests: &Tests) -> Result<()> {
        let circles = tests.circles.iter().map(|circle| {
            let keys = self.keys_of_circle(circle.instrument);
            (keys, format!("the circle of run {}", circle.segment.run))
        });
        let lines = tests.linear.iter().map(|test| {
            let name = format!("the test {}, run {} on", test.name, test.first_run);
            (self.keys_of_line(tests, test), name)
        });
        let logs = tests.drift.logs.iter().map(|log| {
            let name = format!("the log of thermal drift along {}", log.axis);
            (vec!["length_reference"], name)
        });
        let all = circles.chain(lines).chain(logs);
        for (keys, test) in all.chain(touches(tests)).chain(artefacts(tests)) {
            let lacking: Vec<&str> = keys.into_iter().filter(|key| !self.states(key)).collect();
            if !lacking.is_empty() {
                bail!(
                    "the budget states no {}: {test} needs it for its uncertainty",
                    lacking.join(", ")
                );
            }
        }
        Ok(())
    }

    fn states(&self, key: &str) -> bool {
        match key {
            "grid_encoder" => self.grid_encoder.is_some(),
            "length_reference" => self.length_reference.is_some(),
            "machine" => self.machine.is_some(),
            "device" => self.device.is_some(),
            "misalignment_mm" => self.misalignment_mm.is_some(),
            _ => self.environmental_drift_um.is_some(),
        }
    }

    fn keys_of_circle(&self, instrument: Instrument) -> Vec<&'static str> {
        match instrument {
            Instrument::GridEncoder => {
                let own = self.plate.is_none().then_some("device");
                let keys = ["grid_encoder", "machine", DRIFT].into_iter();
                keys.chain(own).collect()
            }
            // Without an entry of its own, what a ballbar read has no uncertainty.
            Instrument::Ballbar if self.ballbar.is_none() => vec![],
            Instrument::Ballbar => vec!["machine", DRIFT],
        }
    }

    fn keys_of_line(&self, tests: &Tests, test: &LinearTest) -> Vec<&'static str> {
        if test.reference == Reference::Scale {
            return vec![DRIFT];
        }
        let screw = About::line(test).led_by_motor(tests);
        let is_on_screw = screw.is_some_and(|axis| self.screws.contains_key(&axis));
        let carrier = (!is_on_screw).then_some("machine");
        let keys = ["length_reference", "device", "misalignment_mm", DRIFT].into_iter();
        keys.chain(carrier).collect()
    }
}

const DRIFT: &str = "environmental_drift_um";

/// The first touch that counts.
fn touches(tests: &Tests) -> Option<Needs> {
    let mut used = tests.touches.iter();
    let (segment, _) = used.find(|(_, point)| point.rejection == Rejection::None)?;
    Some((vec![DRIFT], format!("the touches of run {}", segment.run)))
}

/// The first round shape whose certificate is stated: its size changes with its temperature.
fn artefacts(tests: &Tests) -> Option<Needs> {
    let machine = tests.machine.as_ref()?;
    let mut round = { tests.features.iter() }.filter(|one| one.kind != FeatureKind::Plane);
    let found = round.find(|one| machine.certificate(&one.feature_id).is_some())?;
    let name = format!("the shape {} of run {}", found.feature_id, found.run);
    Some((vec!["machine", DRIFT], name))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::tests::WHOLE;
    use super::*;

    fn read(text: &str) -> Budget {
        Budget::read(text, Path::new("budget.yaml")).unwrap()
    }

    /// The whole budget without the lines of these keys.
    fn without(keys: &[&str]) -> Budget {
        let lines = WHOLE.lines();
        let is_kept = |line: &&str| !keys.iter().any(|key| line.starts_with(&format!("{key}:")));
        read(&lines.filter(is_kept).collect::<Vec<_>>().join("\n"))
    }

    fn laser(reference: Reference) -> Tests {
        let test = LinearTest {
            name: "X along_x".to_owned(),
            reference,
            ..LinearTest::along_x(3, vec![0.0, 100.0], vec![0.0; 2])
        };
        Tests {
            linear: vec![test],
            ..Tests::default()
        }
    }

    #[test]
    fn only_what_the_tests_use_is_needed_and_the_error_names_key_and_test() {
        let by_laser = laser(Reference::Length);
        without(&["grid_encoder"]).check_tests(&by_laser).unwrap();
        for key in [
            "length_reference",
            "machine",
            "device",
            "misalignment_mm",
            "environmental_drift_um",
        ] {
            let error = without(&[key]).check_tests(&by_laser).unwrap_err();
            let words = format!("states no {key}: the test X along_x, run 3 on needs it");
            assert!(error.to_string().contains(&words), "{error}");
        }
        let by_scale = laser(Reference::Scale);
        let drift_alone = read("environmental_drift_um: 0.6\n");
        drift_alone.check_tests(&by_scale).unwrap();
        assert!(drift_alone.check_tests(&by_laser).is_err());
        // Nothing is needed of a bag without tests.
        read("operator: A. B.\n")
            .check_tests(&Tests::default())
            .unwrap();
    }

    #[test]
    fn a_plate_and_a_screw_stand_for_the_device_and_the_machine() {
        let of_plate = "plate: {temperature_deviation_k: 0.0, temperature_half_width_k: 0.1, expansion_um_per_m_k: 0.0, expansion_half_width_um_per_m_k: 0.0}";
        let keys = |budget: &Budget| budget.keys_of_circle(Instrument::GridEncoder);
        assert!(keys(&without(&[])).contains(&"device"));
        assert!(!keys(&read(of_plate)).contains(&"device"));
        assert!(without(&[]).keys_of_circle(Instrument::Ballbar).is_empty());
        let of_screw = of_plate.replace("plate: {", "screws: {X: {") + "}";
        let tests = laser(Reference::Length);
        let keys = |budget: &Budget| budget.keys_of_line(&tests, &tests.linear[0]);
        assert!(keys(&without(&[])).contains(&"machine"));
        assert!(!keys(&read(&of_screw)).contains(&"machine"));
    }
}
