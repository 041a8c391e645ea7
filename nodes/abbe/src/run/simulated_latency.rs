//! The latency of the probe that a scenario's own LinuxCNC simulates, as its INI and HAL files state it.
//!
//! HAL delays the probe's signal by a `timedelay`, a whole number of servo periods, and contact falls anywhere in a period:
//!
//! ```text
//!   T = (ceil(D / Δ) - 1) Δ + Δ / 2                                           (1)
//! ```
//!
//! D is the on-delay, Δ the servo period. (1) is equation (3) of `linuxcnc_bridge`, which its tests hold against touches.
//! No node reads these files for it: it is for the page alone.

use std::path::Path;

use metrology::text::Comments;
use node_runtime::text_file;
use reports::evidence::Evidence;

use crate::launch::LaunchNode;
use crate::scenario::Scenario;

/// The node that starts a LinuxCNC.
const BRIDGE: &str = "linuxcnc_bridge";
/// Its parameter with the INI file.
const INI_PARAMETER: &str = "start_ini";
/// The delay in HAL between contact and the probe input, s.
const DELAY_PIN: &str = "probe-latency.on-delay";

/// Adds the true latency to `evidence` where a scenario's LinuxCNC simulates one and nobody has seen it.
pub fn state(evidence: &mut Evidence, scenario: &Scenario) {
    if evidence.true_latency_s.is_some() {
        return;
    }
    if let Some(delay) = scenario.nodes.iter().find_map(delay_of) {
        evidence.true_latency_s = Some(delay.latency_s());
        evidence.true_latency_source = Some(delay.in_words());
    }
}

/// A delay that HAL makes.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Delay {
    on_delay_s: f64,
    servo_period_s: f64,
}

impl Delay {
    /// (1).
    fn latency_s(self) -> f64 {
        let periods = (self.on_delay_s / self.servo_period_s - 1e-9).ceil();
        (periods - 0.5) * self.servo_period_s
    }

    fn in_words(self) -> String {
        format!(
            "on-delay of the simulated probe {:.3} ms, in whole servo periods of {:.3} ms, and half a period until the input is polled; no node knows it",
            self.on_delay_s * 1e3,
            self.servo_period_s * 1e3
        )
    }
}

fn delay_of(node: &LaunchNode) -> Option<Delay> {
    if node.exec != BRIDGE {
        return None;
    }
    let setup = node.setup().ok()?;
    let ini_path = setup.file_path(INI_PARAMETER).ok()?;
    let ini = text(&ini_path)?;
    let folder = ini_path.parent().unwrap_or(Path::new(""));
    let hal = settings(&ini, "HALFILE").filter_map(|name| text(&folder.join(name)));
    delay(&ini, &hal.collect::<String>())
}

fn text(path: &Path) -> Option<String> {
    text_file::read(path, Comments::Yaml).ok()
}

/// Values of a key of an INI file.
fn settings<'i>(ini: &'i str, key: &'static str) -> impl Iterator<Item = &'i str> {
    let pairs = ini.lines().filter_map(|line| line.split_once('='));
    pairs.filter_map(move |(name, value)| (name.trim() == key).then_some(value.trim()))
}

fn delay(ini: &str, hal: &str) -> Option<Delay> {
    let period_ns: f64 = settings(ini, "SERVO_PERIOD").next()?.parse().ok()?;
    let mut set = hal.lines().filter_map(|line| {
        let mut words = line.split_whitespace();
        let is_delay = words.next() == Some("setp") && words.next() == Some(DELAY_PIN);
        is_delay.then(|| words.next()).flatten()
    });
    // The last setting of a pin is the one that holds.
    let on_delay_s: f64 = set.next_back()?.parse().ok()?;
    let delay = Delay {
        on_delay_s,
        servo_period_s: period_ns * 1e-9,
    };
    (delay.on_delay_s > 0.0 && delay.servo_period_s > 0.0).then_some(delay)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The touches of `linuxcnc_bridge` at an on-delay of 4.2 ms give 4.504 ms (head of its crate).
    #[test]
    fn val_the_delay_of_the_shipped_scenario_is_what_its_touches_measure() {
        let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../launch_configs");
        for name in ["linuxcnc_latency", "linuxcnc_block_cycle"] {
            let scenario = Scenario::read(&shipped.join(name)).unwrap();
            let mut evidence = Evidence::default();
            state(&mut evidence, &scenario);
            let latency_s = evidence.true_latency_s.unwrap();
            assert!((latency_s - 0.004_504).abs() < 5e-6, "{name}: {latency_s}");
            let source = evidence.true_latency_source.unwrap();
            assert!(source.contains("4.200 ms"), "{source}");
            let mut seen = Evidence {
                true_latency_s: Some(0.1),
                ..Evidence::default()
            };
            state(&mut seen, &scenario);
            assert_eq!(seen.true_latency_source, None);
        }
    }

    #[test]
    fn eq1_counts_whole_periods_and_files_without_a_delay_state_none() {
        let ini = "[EMCMOT]\nSERVO_PERIOD = 1000000\n";
        for (on_delay, latency_s) in [("0.0042", 0.0045), ("0.004", 0.0035), ("0.0005", 0.0005)] {
            let hal =
                format!("setp probe-latency.on-delay 9\nsetp probe-latency.on-delay {on_delay}\n");
            let found = delay(ini, &hal).unwrap().latency_s();
            assert!((found - latency_s).abs() < 1e-12, "{on_delay}: {found}");
        }
        for (ini, hal) in [
            (ini, ""),
            (ini, "setp probe-latency.off-delay 0.001"),
            (ini, "setp probe-latency.on-delay x"),
            (ini, "setp probe-latency.on-delay 0"),
            ("", "setp probe-latency.on-delay 0.0042"),
        ] {
            assert_eq!(delay(ini, hal), None, "{ini:?} {hal:?}");
        }
    }
}
