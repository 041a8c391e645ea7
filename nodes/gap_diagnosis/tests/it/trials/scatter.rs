//! Effects of scatter: named with their size from touches and circles of a plant with its own dice.

use gap_diagnosis::report::{Cause, Status};
use gap_diagnosis::{Diagnosis, GapConfig, diagnose};
use metrology::sample::{TestKind, TestSegment};
use metrology::stamp::Stamp;
use metrology::{Axis, AxisSet, PerAxis};
use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use twin::{Channel, Motion, Reading, Run, Session, Touch};

use crate::trials::plant::{machine, told};

/// Touches of three faces at three feeds, over and over, in each of four runs; the seat of the probe scatters by 0.4 µm,
/// and `more_mm` says what comes beside it at an approach and a feed, mm and mm/s.
pub fn touched(
    seed: u64,
    touches_per_run: usize,
    mut more_mm: impl FnMut(&mut Pcg64Mcg, &Vector3<f64>, f64) -> f64,
) -> Session {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut session = Session::default();
    let mut start_s = 10.0;
    for run in 0..4_u32 {
        let (mut touches, mut readings) = (vec![], vec![]);
        for k in 0..touches_per_run {
            let approach = [Vector3::x(), Vector3::y(), -Vector3::z()][k % 3];
            let feed_mm_s = [2.0, 6.0, 18.0][(k / 3) % 3];
            let mut position = PerAxis::default();
            position[Axis::X] = 40.0 * approach.x;
            let seat: f64 = StandardNormal.sample(&mut random);
            let beside_mm = more_mm(&mut random, &approach, feed_mm_s);
            touches.push(Touch {
                time_s: start_s + 4.0 * k as f64,
                feature_id: format!("face_{}", k % 3),
                approach,
                feed_mm_s,
                position,
                tick: None,
            });
            readings.push(Reading {
                channel: Channel::Touch,
                at: k,
                fraction: 0.0,
                deviation: 0.4e-3 * seat + beside_mm + 3e-3 * approach.y,
            });
        }
        session.runs.push(Run {
            segment: segment(run),
            motion: Motion::new(vec![start_s], AxisSet::XYZ, PerAxis::from_fn(|_| vec![0.0]))
                .expect("one tick"),
            touches,
            readings,
        });
        start_s += 4.0 * touches_per_run as f64 + 40.0;
    }
    session
}

/// The same with a trigger that is polled every `period_s`: it is late by anything between nothing and the period.
fn polled(seed: u64, period_s: f64) -> Session {
    touched(seed, 90, |random, _, feed_mm_s| {
        feed_mm_s * period_s * random.random::<f64>()
    })
}

fn segment(run: u32) -> TestSegment {
    TestSegment {
        feed_mm_s: 2.0,
        repeat: run,
        stylus: "ruby_6".to_owned(),
        setup_id: 1,
        ..TestSegment::of_kind(TestKind::Latency, run, Stamp::from_nanos(0))
    }
}

pub fn of(session: &Session) -> Diagnosis {
    diagnose(&machine(), session, &GapConfig::default()).expect("the plant is sound")
}

fn cause<'d>(diagnosis: &'d Diagnosis, effect: &str) -> &'d Cause {
    let found = diagnosis
        .report
        .causes
        .iter()
        .find(|cause| cause.effect == effect);
    found.unwrap_or_else(|| {
        panic!(
            "{effect}: {:#?} {:?}",
            diagnosis.report.causes, diagnosis.notes
        )
    })
}

/// A poll every 1 ms delays by 0.5 ms on average with a standard deviation of 1 ms / sqrt 12 = 0.289 ms.
#[test]
fn val_a_polled_trigger_is_a_latency_of_half_a_period_and_its_jitter() {
    for seed in [81, 82, 83] {
        let diagnosis = of(&polled(seed, 1e-3));
        let jitter = cause(&diagnosis, "latency_jitter");
        // Two modes of latency have the same variance: only the triggers one by one tell them apart.
        assert_eq!(
            jitter.status,
            Status::Set,
            "{jitter:?} {:?}",
            diagnosis.notes
        );
        let open: Vec<&str> = jitter
            .confusable_with
            .iter()
            .filter(|o| !o.excluded)
            .map(|o| o.effect.as_str())
            .collect();
        assert_eq!(open, ["latency_modes"]);
        let size = &jitter.parameters[0];
        assert!(size.low < 0.289 && 0.289 < size.high, "{size:?}");
        assert!(size.high - size.low < 0.15, "{size:?}");
        let latency = cause(&diagnosis, "probe_latency");
        let size = &latency.parameters[0];
        assert!((size.value - 0.5).abs() < 0.1, "{}", told(&diagnosis));
        assert!(
            diagnosis
                .effects
                .iter()
                .all(|effect| effect.kind == "probe_latency")
        );
    }
}

#[test]
fn touches_that_scatter_alike_at_all_feeds_have_no_jitter() {
    for seed in 90..98 {
        let diagnosis = of(&polled(seed, 0.0));
        assert!(diagnosis.effects.is_empty(), "{:?}", diagnosis.effects);
        let shown = diagnosis
            .report
            .not_excited
            .iter()
            .any(|e| e.effect == "latency_jitter");
        assert!(!shown, "three feeds would show it");
    }
}
