//! Defaults of a machine file: what the file leaves to them, and which of them the figures of a page use.

use std::collections::BTreeSet;

use gap_diagnosis::report::GapReport;
use machine::MachineFile;
use metrology::{Axis, yaml};
use serde_json::Value;
use twin::{Channel, Session};

use crate::evaluate::Tests;
use crate::positioning::axes_along;

/// Parts of a machine file that have defaults, by the start of their keys.
const WITH_DEFAULTS: [&str; 3] = ["axes.", "control.", "probe."];

/// Keys with their defaults, as `axes.X.lead_mm = 10.0`, that the text of `machine` does not have.
pub fn of(machine: &MachineFile, text: &str) -> Vec<String> {
    let mut leaves = vec![];
    let value = serde_json::to_value(machine).unwrap_or_default();
    collect("", &value, &mut leaves);
    // A text that is no YAML was refused before.
    let given: Value = yaml::read_letters(text).unwrap_or_default();
    let is_given = |key: &str| key.split('.').try_fold(&given, |at, name| at.get(name));
    leaves
        .into_iter()
        .filter(|(key, _)| WITH_DEFAULTS.iter().any(|part| key.starts_with(part)))
        .filter(|(key, _)| is_given(key).is_none())
        .map(|(key, value)| format!("{key} = {value}"))
        .collect()
}

/// Those of `left_out` (as [`of`] writes them) whose keys are in `used`.
fn among(left_out: &[String], used: &BTreeSet<String>) -> Vec<String> {
    let is_used = |entry: &&String| {
        let key = entry.split(" = ").next().unwrap_or_default();
        used.contains(key)
    };
    left_out.iter().filter(is_used).cloned().collect()
}

/// The defaults that the evaluation of `tests` uses, as [`of`] writes them.
///
/// Leads enter the figures of positioning runs (periodic error, targets on whole leads); repeatability and latch enter the
/// uncertainty of touches, the radius of the ball that of probed shapes.
#[must_use]
pub fn of_tests(tests: &Tests) -> Vec<String> {
    let mut used = BTreeSet::new();
    for axis in tests.linear.iter().flat_map(axes_along) {
        used.insert(format!("axes.{axis}.lead_mm"));
        let linear = tests.machine.as_ref().and_then(|file| file.linear(axis));
        if linear.is_some_and(|linear| linear.scale_signal_period_um.is_some()) {
            used.insert(format!("axes.{axis}.position_feedback"));
        }
    }
    if !(tests.touches.is_empty() && tests.features.is_empty() && tests.blocks.is_empty()) {
        let keys = [
            "probe.repeatability_um",
            "control.latch",
            "control.servo_period_ms",
        ];
        used.extend(keys.map(str::to_owned));
    }
    if !tests.features.is_empty() {
        used.extend(of_styli(tests.machine.as_ref(), "radius_mm"));
    }
    among(&tests.left_out, &used)
}

/// The defaults that a diagnosis uses, as [`of`] writes them, of those that the file of `machine` leaves out.
///
/// Each axis that moved is simulated with its control loop and its encoder; a lead, an encoder that closes the loop, and a
/// stylus are used where an effect that depends on them is named or could stand for one; limits where runs are proposed.
#[must_use]
pub fn of_diagnosis(
    machine: &MachineFile,
    left_out: &[String],
    session: &Session,
    report: &GapReport,
) -> Vec<String> {
    let mut used = BTreeSet::new();
    for axis in Axis::LINEAR {
        let mut keys = Vec::new();
        if moves(session, axis) {
            keys.extend(["position_gain_per_s", "velocity_feedforward"]);
        }
        if reads(session, &Channel::Motor(axis)) {
            keys.push("encoder_resolution_um");
        }
        if names(report, "cyclic_error", axis.letter()) {
            keys.push("lead_mm");
        }
        if names(report, "interpolation_error", axis.letter()) {
            keys.push("position_feedback");
        }
        if !report.next_experiments.is_empty() {
            keys.extend(["feed_limit_mm_min", "acceleration_limit_mm_s2"]);
        }
        used.extend(keys.iter().map(|key| format!("axes.{axis}.{key}")));
    }
    if session.runs.iter().any(|run| !run.touches.is_empty()) {
        used.insert("probe.standoff_mm".to_owned());
    }
    if names(report, "probe_pretravel", "") {
        used.insert("probe.mounted".to_owned());
        used.extend(of_styli(Some(machine), "length_mm"));
    }
    let mut found = among(left_out, &used);
    if names(report, "probe_pretravel", "") {
        found.extend(stems(machine, session));
    }
    found
}

/// Lengths that stand for those of the stems, where runs had styli of more than one length.
fn stems(machine: &MachineFile, session: &Session) -> Vec<String> {
    let touched = session.runs.iter().filter(|run| !run.touches.is_empty());
    let names: BTreeSet<&str> = touched.map(|run| run.segment.stylus.as_str()).collect();
    let used =
        machine.probe.styli.iter().filter(|(name, stylus)| {
            names.contains(name.as_str()) && stylus.stem_length_mm.is_none()
        });
    let stems = used.map(|(name, stylus)| {
        format!(
            "probe.styli.{name}.stem_length_mm = length_mm = {}",
            stylus.length_mm
        )
    });
    Some(stems.collect())
        .filter(|stems: &Vec<String>| stems.len() > 1)
        .unwrap_or_default()
}

/// A sentence that names the defaults in use; `None` without defaults.
#[must_use]
pub fn in_words(used: &[String]) -> Option<String> {
    let all = used.join(", ");
    (!used.is_empty()).then(|| format!("Defaults of the machine file in these figures: {all}."))
}

/// The keys of one value of each stylus.
fn of_styli(machine: Option<&MachineFile>, name: &str) -> Vec<String> {
    let Some(machine) = machine else {
        return Vec::new();
    };
    let styli = machine.probe.styli.keys();
    styli
        .map(|stylus| format!("probe.styli.{stylus}.{name}"))
        .collect()
}

/// Whether an axis is commanded to move in any run.
fn moves(session: &Session, axis: Axis) -> bool {
    let mut runs = session.runs.iter();
    runs.any(|run| run.motion.sense[axis].iter().any(|sense| *sense != 0))
}

/// Whether any run has readings of a channel.
fn reads(session: &Session, channel: &Channel) -> bool {
    let mut readings = session.runs.iter().flat_map(|run| &run.readings);
    readings.any(|reading| reading.channel == *channel)
}

/// Whether a report names an effect, or one that could stand for a named one; `axis` empty: of any target.
fn names(report: &GapReport, effect: &str, axis: &str) -> bool {
    let is_it = |found: &str, on: &str| found == effect && (axis.is_empty() || on == axis);
    report.causes.iter().any(|cause| {
        let mut others = cause.confusable_with.iter();
        is_it(&cause.effect, &cause.axis)
            || others.any(|other| !other.excluded && is_it(&other.effect, &other.axis))
    })
}

/// Numbers, words and lists with their keys; what is absent is left out.
fn collect(key: &str, value: &Value, leaves: &mut Vec<(String, String)>) {
    match value {
        Value::Object(entries) => {
            for (name, below) in entries {
                let key = if key.is_empty() {
                    name.clone()
                } else {
                    format!("{key}.{name}")
                };
                collect(&key, below, leaves);
            }
        }
        Value::Null => {}
        Value::String(word) => leaves.push((key.to_owned(), word.clone())),
        other => leaves.push((key.to_owned(), other.to_string())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MACHINE: &str = include_str!("../../../../launch_configs/gap_first/machine.yaml");

    #[test]
    fn what_a_file_states_is_no_default_whether_number_word_or_list() {
        let machine = MachineFile::parse(MACHINE, "machine.yaml").unwrap();
        let left_out = of(&machine, MACHINE);
        let wanted = ["X", "Y", "Z"].map(|axis| format!("axes.{axis}.position_feedback = motor"));
        assert_eq!(left_out, wanted);
        let text = MACHINE.replacen(" lead_mm: 10.0,", "", 1);
        let machine = MachineFile::parse(&text, "machine.yaml").unwrap();
        assert!(of(&machine, &text).contains(&"axes.X.lead_mm = 10.0".to_owned()));
    }

    const REPORT: &str = r#"{"schema": "abbe.gap/1", "inputs": {"bags": [], "machine_sha256": ""}, "noise_floor": [],
"gap": {"rms_um": 8.1, "p95_um": 14.0, "floor_um": 0.3, "above_floor": true, "per_channel": []}, "where": [],
"causes": [{"effect": "backlash", "axis": "X", "status": "named", "confidence": 0.97, "parameters": [], "D": 88.0,
"confusable_with": [{"effect": "cyclic_error", "axis": "Y", "cos": 0.6, "excluded": false}],
"constancy": {"passed": true, "worst_z": 1.2, "split_by": "feed"}}],
"unknown": {"flagged": false, "score": 1.4, "threshold": 3.1,
"description": {"covariate": "", "parity": "", "period": "", "feed_exponent": null, "time_constant_s": null}},
"shrink": {"fit_runs": [], "held_out_runs": [], "rms_um": {"before": null, "after": null},
"p95_um": {"before": null, "after": null}, "gap_closed": null, "leave_one_out": []},
"not_excited": [], "next_experiments": [], "runtime_s": 1.3}"#;

    #[test]
    fn a_diagnosis_uses_the_lead_of_the_axis_whose_cyclic_error_it_speaks_of() {
        let text = MACHINE.replace(" lead_mm: 10.0,", "");
        let machine = MachineFile::parse(&text, "machine.yaml").unwrap();
        let left_out = of(&machine, &text);
        let mut report: GapReport = serde_json::from_str(REPORT).unwrap();
        let session = Session::default();
        let used = |report: &GapReport| of_diagnosis(&machine, &left_out, &session, report);
        assert_eq!(used(&report), ["axes.Y.lead_mm = 10.0"]);
        let said = in_words(&used(&report)).unwrap();
        assert!(
            said.ends_with("in these figures: axes.Y.lead_mm = 10.0."),
            "{said}"
        );
        report.causes[0].confusable_with[0].excluded = true;
        assert_eq!(in_words(&used(&report)), None);
    }
}
