//! Two effects that look alike in a poor programme, both of them hidden in the plant: nothing is named; the run that is
//! asked for is made on the same machine, and with it both are named.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use gap_diagnosis::report::{Cause, Status};
use gap_diagnosis::session::{Input, SessionBuilder, SessionConfig};
use gap_diagnosis::{Diagnosis, GapConfig, diagnose};
use machine::MachineFile;
use sequencer::{Plan, extra_run};
use trials::effect::Hidden;
use trials::{Arm, Class, Rig, Sample, Trial, measure};

/// Circles of one sense at one angular speed: an oval at 45 degrees may be a lean or a lag.
const ONE_SENSE: &str = "title: one sense
steps:
  - {do: grid, placement: middle, trajectory: circle, radius_mm: 80.0, feed_mm_min: 3200.0, on_the_fly: true, repeats: 3}
  - {do: grid, placement: middle, trajectory: circle, radius_mm: 50.0, feed_mm_min: 2000.0, on_the_fly: true, repeats: 3}
  - {do: grid, placement: middle, trajectory: circle, radius_mm: 65.0, feed_mm_min: 2600.0, on_the_fly: true}
  - {do: grid, placement: middle, trajectory: circle, radius_mm: 80.0, feed_mm_min: 3200.0, on_the_fly: true}
";
/// What is hidden: a lean, urad, and a lag, ms. In this sense both make an oval the same way.
const LEAN_URAD: f64 = -30.0;
const LAG_MS: f64 = 0.06;
/// How often a run that is asked for is made: what a single run decides does not hold once that run is left out.
const TIMES: usize = 3;

fn input(sample: Sample) -> Input {
    match sample {
        Sample::State(sample) => Input::State(sample),
        Sample::Grid(sample) => Input::Grid(sample),
        Sample::Length(sample) => Input::Length(sample),
        Sample::Trigger(sample) => Input::Trigger(sample),
        Sample::Temperature(sample) => Input::Temperature(sample),
        Sample::Segment(sample) => Input::Segment(sample),
    }
}

/// A machine that its file describes well but for the two.
fn rig() -> Rig {
    let mut rig = Trial::draw(Arm::Null, 5, 0).unwrap().rig;
    rig.plan = Plan::from_yaml(ONE_SENSE).unwrap();
    // Motors would tell a lag at once.
    rig.has_motors = false;
    let effects = [
        (Class::Squareness, "XY", LEAN_URAD),
        (Class::ServoLag, "X", LAG_MS),
    ];
    for (class, axis, size) in effects {
        let hidden = Hidden {
            class,
            axis,
            size,
            is_foreign: false,
            shape: [0.3, 0.6],
        };
        hidden.hide(&mut rig).unwrap();
    }
    rig
}

/// The bags so far.
struct Recorded {
    machine: MachineFile,
    builder: SessionBuilder,
}

impl Recorded {
    /// What is said with another bag beside the others.
    fn with(&mut self, rig: &Rig) -> Diagnosis {
        self.builder.next_bag();
        measure(rig, &mut |_, sample| self.builder.take(input(sample))).unwrap();
        self.builder.end_bag();
        diagnose(&self.machine, &self.builder.so_far(), &GapConfig::default()).unwrap()
    }

    /// What is said once the run that was asked for is made on the same machine, an hour later and [`TIMES`] times.
    fn made(&mut self, rig: &Rig, before: &Diagnosis) -> Diagnosis {
        let next = &before.report.next_experiments[0];
        assert!(next.delta >= 9.0, "{next:?}");
        let mut plan = extra_run(&rig.machine, &rig.plan, &next.run).unwrap();
        plan.steps = vec![plan.steps; TIMES].concat();
        self.with(&rig.later(plan))
    }
}

/// What could stand in the place of a cause.
fn open(cause: &Cause) -> Vec<String> {
    let open = cause.confusable_with.iter().filter(|other| !other.excluded);
    open.map(|o| format!("{} {}", o.effect, o.axis)).collect()
}

fn told(diagnosis: &Diagnosis) -> String {
    let of = |cause: &Cause| {
        let size = &cause.parameters[0];
        let sized = format!("{:.3} ({:.3} to {:.3})", size.value, size.low, size.high);
        let (name, others) = (&cause.effect, open(cause).join(", "));
        format!(
            "{name} {} {:?} {sized} or {others}",
            cause.axis, cause.status
        )
    };
    let causes = diagnosis.report.causes.iter().map(of);
    let next = diagnosis.report.next_experiments.iter();
    let next =
        next.map(|next| format!("next: {} {:?} {:.0}", next.run, next.separates, next.delta));
    let notes = diagnosis.notes.iter().map(ToString::to_string);
    causes
        .chain(next)
        .chain(notes)
        .collect::<Vec<_>>()
        .join("\n")
}

/// The cause of an effect, whose interval holds the truth and which is known to an eighth.
fn sized<'d>(diagnosis: &'d Diagnosis, effect: &str, truth: f64) -> &'d Cause {
    let mut causes = diagnosis.report.causes.iter();
    let cause = causes.find(|cause| cause.effect == effect).unwrap();
    let size = &cause.parameters[0];
    assert!((size.low..=size.high).contains(&truth), "{size:?}");
    assert!((size.value - truth).abs() < 0.125 * truth.abs(), "{size:?}");
    assert!(size.high - size.low < 0.3 * truth.abs(), "{size:?}");
    cause
}

#[test]
fn a_lean_and_a_lag_at_once_are_a_set_and_both_are_named_with_the_run_that_is_asked_for() {
    let rig = rig();
    let mut recorded = Recorded {
        machine: rig.machine.clone(),
        builder: SessionBuilder::new(&rig.machine, SessionConfig::default()).unwrap(),
    };
    let first = recorded.with(&rig);
    let [cause] = &first.report.causes[..] else {
        panic!("{}", told(&first));
    };
    assert_eq!(cause.status, Status::Set);
    let mut both = open(cause);
    both.push(format!("{} {}", cause.effect, cause.axis));
    for effect in ["squareness XY", "servo_lag X"] {
        assert!(both.iter().any(|own| own == effect), "{both:?}");
    }
    assert!(first.effects.is_empty(), "a set is not written");

    // The other sense tells the lean from a lag.
    let second = recorded.made(&rig, &first);
    let named = second.report.causes.iter();
    assert!(
        named.clone().all(|cause| cause.status == Status::Named),
        "{}",
        told(&second)
    );
    assert_eq!(named.len(), 2, "{}", told(&second));
    for (effect, axis, truth) in [("squareness", "XY", LEAN_URAD), ("servo_lag", "X", LAG_MS)] {
        let cause = sized(&second, effect, truth);
        assert_eq!(cause.axis, axis);
        assert!(open(cause).is_empty(), "{}", told(&second));
    }
    assert_eq!(second.effects.len(), 2);
}
