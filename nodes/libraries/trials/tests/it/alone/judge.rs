//! Measures machines with the plant, has them diagnosed, and judges what is named.

use gap_diagnosis::report::{Cause, GapReport, Status};
use gap_diagnosis::session::{Input, SessionBuilder, SessionConfig};
use gap_diagnosis::{GapConfig, diagnose};
use trials::{Rig, Sample, measure};

/// D above which a cause must be named.
pub const LEAST_D: f64 = 20.0;

/// A sample as the builder of sessions takes it.
pub fn heard(sample: Sample) -> Input {
    match sample {
        Sample::State(sample) => Input::State(sample),
        Sample::Grid(sample) => Input::Grid(sample),
        Sample::Length(sample) => Input::Length(sample),
        Sample::Trigger(sample) => Input::Trigger(sample),
        Sample::Temperature(sample) => Input::Temperature(sample),
        Sample::Segment(sample) => Input::Segment(sample),
    }
}

/// The report on what the plants of some rigs show, a bag each, by the machine file of the first.
pub fn told(rigs: &[&Rig]) -> GapReport {
    told_as_heard(rigs, heard)
}

/// The same of samples that something changes on their way to the recorder.
pub fn told_as_heard(rigs: &[&Rig], mut heard: impl FnMut(Sample) -> Input) -> GapReport {
    let machine = &rigs[0].machine;
    let mut builder = SessionBuilder::new(machine, SessionConfig::default()).unwrap();
    for rig in rigs {
        builder.next_bag();
        measure(rig, &mut |_, sample| builder.take(heard(sample))).unwrap();
        builder.end_bag();
    }
    let (session, _) = builder.finish().unwrap();
    let diagnosis = diagnose(machine, &session, &GapConfig::default()).unwrap();
    for cause in &diagnosis.report.causes {
        println!("{}", words(cause));
    }
    diagnosis.report
}

/// Status, size and what else it could be.
fn words(cause: &Cause) -> String {
    let sizes = cause.parameters.iter().map(|of| {
        let [value, low, high] = [of.value, of.low, of.high];
        format!("{} {value:.3} ({low:.3} to {high:.3})", of.name)
    });
    format!(
        "{} {}: {:?}, D {:.1}, {}, open {:?}",
        cause.effect,
        cause.axis,
        cause.status,
        cause.d,
        sizes.collect::<Vec<_>>().join(", "),
        open(cause)
    )
}

/// What a cause could be as well.
fn open(cause: &Cause) -> Vec<&str> {
    let open = cause.confusable_with.iter().filter(|other| !other.excluded);
    open.map(|other| other.effect.as_str()).collect()
}

/// The cause of a class and axis, which must be the only one but for what the same part of the plant brings along.
fn only<'r>(report: &'r GapReport, effect: &str, axis: &str, brought: &[&str]) -> &'r Cause {
    let said: Vec<String> = report.causes.iter().map(words).collect();
    let of_it = |cause: &&Cause| cause.effect == effect && cause.axis == axis;
    let own = report.causes.iter().find(of_it);
    let own = own.unwrap_or_else(|| panic!("{effect} {axis} is not told of: {said:#?}"));
    let others = report.causes.iter().filter(|cause| {
        cause.status != Status::Surrogate
            && !of_it(cause)
            && !brought.contains(&cause.effect.as_str())
    });
    assert_eq!(others.count(), 0, "{said:#?}");
    own
}

/// Asserts that a cause is named with its class and axis, alone, at D above [`LEAST_D`]; its first parameter's value.
pub fn is_named(report: &GapReport, effect: &str, axis: &str) -> f64 {
    is_named_with(report, effect, axis, &[])
}

/// The same where one part of the plant has other effects as well, which may be named beside it.
pub fn is_named_with(report: &GapReport, effect: &str, axis: &str, brought: &[&str]) -> f64 {
    let own = only(report, effect, axis, brought);
    assert_eq!(own.status, Status::Named, "{}", words(own));
    assert!(own.d > LEAST_D, "{}", words(own));
    own.parameters[0].value
}

/// Asserts that a class on an axis is named, alone or before one of a set, above a D; its first parameter's value.
pub fn leads(report: &GapReport, of: (&str, &str), set: &[&str], least_d: f64) -> f64 {
    let own = only(report, of.0, of.1, &[]);
    assert_ne!(own.status, Status::Surrogate, "{}", words(own));
    let is_in_set = open(own).iter().all(|other| set.contains(other));
    assert!(is_in_set, "{}", words(own));
    assert!(own.d > least_d, "{}", words(own));
    own.parameters[0].value
}

/// Asserts that nothing is named where only this effect was hidden.
pub fn names_nothing(report: &GapReport, effect: &str) {
    let named = report
        .causes
        .iter()
        .filter(|cause| cause.status != Status::Surrogate);
    let named: Vec<String> = named.map(words).collect();
    assert!(named.is_empty(), "{effect}: {named:#?}");
}
