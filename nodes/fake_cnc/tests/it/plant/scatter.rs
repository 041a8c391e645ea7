//! Effects of the catalogue that only scatter readings, against what the plant's probe and its floor really do.

use fake_cnc::Plant;
use fake_cnc::plant::VibrationEntry;
use machine::file::EffectEntry;
use metrology::sample::{TestKind, TestPlane, TestSegment};
use metrology::{Axis, AxisSet, PerAxis, Stamp};
use nalgebra::Vector3;
use twin::effects::{self, Effect};
use twin::{Channel, Motion, Reading, Run, Session, Touch, Twin};

use crate::plant::rig::{Command, PERIOD, PERIOD_S, Servo, machine, perfect};
use crate::plant::touch::{before_x_face, touch};

/// Mean and variance.
fn spread(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|x| (x - mean).powi(2)).sum();
    (mean, squares / (n - 1.0))
}

fn segment(kind: TestKind, plane: TestPlane) -> TestSegment {
    TestSegment {
        plane,
        ..TestSegment::of_kind(kind, 1, Stamp::from_nanos(0))
    }
}

/// Variance of a run's one reading by effects of the catalogue, mm2.
fn by_the_twin(run: &Run, listed: &[(&str, Option<&str>, &str, f64)]) -> f64 {
    let machine = machine();
    let built: Vec<Box<dyn Effect>> = listed
        .iter()
        .map(|(kind, axis, name, value)| {
            let entry = EffectEntry {
                kind: (*kind).to_owned(),
                axis: axis.map(str::to_owned),
                parameters: [((*name).to_owned(), *value)].into(),
            };
            effects::from_entry(&machine, 0, &entry).unwrap()
        })
        .collect();
    let all: Vec<&dyn Effect> = built.iter().map(|effect| &**effect).collect();
    let twin = Twin::new(&machine).unwrap();
    twin.variance(&Session::default(), run, &all)[0]
}

fn one(channel: Channel) -> Vec<Reading> {
    vec![Reading {
        channel,
        at: 0,
        fraction: 0.0,
        deviation: 0.0,
    }]
}

#[test]
fn val_the_plants_trigger_scatters_with_the_feed() {
    let (jitter_ms, repeatability_um) = (0.3, 0.4);
    let mut truth = perfect();
    truth.touch_probe.jitter_ms = jitter_ms;
    truth.touch_probe.repeatability_um = repeatability_um;
    for feed_mm_s in [2.0, 10.0] {
        let mut plant = Plant::new(&machine(), &truth).unwrap();
        // Where the motor's encoder is when the signal arrives, as a latch catches it.
        let latched_mm: Vec<f64> = (0..600)
            .map(|_| {
                let seen = touch(&mut plant, &before_x_face(), Axis::X, 1.1, feed_mm_s, false);
                let closing = seen.edges.iter().find(|(_, edge)| edge.closed);
                closing.unwrap().1.motor_at_arrival[Axis::X]
            })
            .collect();
        let (_, seen_mm2) = spread(&latched_mm);
        let run = Run {
            segment: segment(TestKind::Touch, TestPlane::None),
            motion: Motion::default(),
            touches: vec![Touch {
                time_s: 0.0,
                feature_id: String::from("block_1.x"),
                approach: Vector3::x(),
                feed_mm_s,
                position: PerAxis::default(),
                tick: None,
            }],
            readings: one(Channel::Touch),
        };
        let listed = [
            ("latency_jitter", None, "jitter_ms", jitter_ms),
            ("probe_repeatability", None, "sigma_um", repeatability_um),
        ];
        let told_mm2 = by_the_twin(&run, &listed);
        let ratio = seen_mm2 / told_mm2;
        // Three standard deviations of a variance of 600.
        assert!((ratio - 1.0).abs() < 0.18, "{feed_mm_s}: {ratio}");
    }
}

#[test]
fn val_the_plants_shaking_has_half_the_square_of_its_amplitude() {
    let amplitude_um = [0.0, 0.6, 0.3];
    let mut truth = perfect();
    truth.vibration = Some(VibrationEntry {
        amplitude_um,
        frequency_hz: 43.0,
        wander_hz: 2.0,
        wander_time_s: 0.5,
    });
    let mut plant = Plant::new(&machine(), &truth).unwrap();
    let stand = before_x_face();
    plant.settle_at(&stand);
    let (mut servo, command) = (
        Servo::default(),
        Command {
            position: stand,
            ..Command::default()
        },
    );
    let places: Vec<Vector3<f64>> = (0..20_000)
        .map(|_| {
            let demand = servo.demand(&plant, &command);
            plant.step(&demand, 0.0, PERIOD);
            plant.tool_in_workpiece_mm()
        })
        .collect();
    let mut run = Run {
        segment: segment(TestKind::Dwell, TestPlane::Xy),
        motion: Motion::new(
            vec![0.0, PERIOD_S],
            AxisSet::XYZ,
            PerAxis::from_fn(|axis: Axis| {
                if axis.is_linear() {
                    vec![stand[axis]; 2]
                } else {
                    vec![]
                }
            }),
        )
        .unwrap(),
        touches: vec![],
        readings: one(Channel::GridV),
    };
    for (axis, channel) in [
        (Axis::Y, Channel::GridV),
        (Axis::Z, Channel::Length(Axis::Z)),
    ] {
        let along: Vec<f64> = places.iter().map(|place| place[axis.index()]).collect();
        let (_, seen_mm2) = spread(&along);
        run.readings = one(channel);
        let (name, size) = (axis.to_string(), amplitude_um[axis.index()]);
        let listed = [(
            "vibration_random",
            Some(name.as_str()),
            "amplitude_um",
            size,
        )];
        let ratio = seen_mm2 / by_the_twin(&run, &listed);
        assert!((ratio - 1.0).abs() < 0.03, "{axis}: {ratio}");
    }
}
