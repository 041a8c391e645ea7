//! Effects of scatter that the plant of `fake_cnc` lacks, each alone, from dice and mechanisms that the catalogue does not
//! know: named, or part of the noise floor.

use std::f64::consts::TAU;

use gap_diagnosis::report::{Cause, Status};
use metrology::Axis;
use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use twin::Channel;

use crate::trials::plant::{Noise, PROGRAM, diagnosed, names, session_of, told};
use crate::trials::scatter::{of, touched};

/// Seed that was fixed before anything was looked at.
const SEED: u64 = 20_261_123;
/// D above which an effect must be named.
const LEAST_D: f64 = 20.0;
/// Touches of a run.
const TOUCHES: usize = 1300;

fn normal(random: &mut Pcg64Mcg) -> f64 {
    StandardNormal.sample(random)
}

/// The only cause, with what else it could be.
fn only(causes: &[Cause], least_d: f64) -> (&Cause, Vec<&str>) {
    let mut kept = causes.iter().filter(|c| c.status != Status::Surrogate);
    let cause = kept.next().expect("a cause");
    eprintln!(
        "{} {}: D {:.1}, {:?}",
        cause.effect, cause.axis, cause.d, cause.parameters
    );
    assert!(kept.next().is_none(), "{causes:#?}");
    assert!(cause.d > least_d, "{cause:#?}");
    let open = cause.confusable_with.iter().filter(|o| !o.excluded);
    (cause, open.map(|o| o.effect.as_str()).collect())
}

/// A link that sends a trigger again where its first telegram was lost: about a quarter comes a slot later. By its
/// variance that is a jitter of slot sqrt(w (1 - w)).
#[test]
fn a_link_that_sends_again_is_jitter_or_two_modes() {
    let (slot_s, lost) = (1e-3, 0.25_f64);
    let session = touched(SEED, TOUCHES, |random, _, feed_mm_s| {
        let is_late = random.random::<f64>() < lost;
        let late_s = if is_late { slot_s } else { 0.0 };
        feed_mm_s * (late_s - lost * slot_s)
    });
    let diagnosis = of(&session);
    let (cause, open) = only(&diagnosis.report.causes, LEAST_D);
    let mut set = open;
    set.push(&cause.effect);
    assert!(
        set.iter()
            .all(|effect| ["latency_jitter", "latency_modes"].contains(effect))
    );
}

/// A seat that settles anew at each touch, in two angles and along the stylus: the ball's end of the lever moves further
/// than the seat, so that touches across the stylus scatter more.
#[test]
fn a_seat_that_settles_anew_is_the_probes_repeatability() {
    let (lever_mm, angle_rad, along_mm) = (50.0, 3e-5, 0.2e-3);
    let session = touched(SEED, TOUCHES, |random, approach, _| {
        let tilt = [normal(random), normal(random)].map(|draw| draw * angle_rad);
        let ball = Vector3::new(
            lever_mm * tilt[1],
            -lever_mm * tilt[0],
            along_mm * normal(random),
        );
        ball.dot(approach)
    });
    let diagnosis = of(&session);
    let (cause, open) = only(&diagnosis.report.causes, LEAST_D);
    let found = (cause.effect.as_str(), cause.status);
    assert_eq!(
        found,
        ("probe_repeatability", Status::Named),
        "{}",
        told(&diagnosis)
    );
    assert!(open.is_empty(), "{open:?}");
}

/// Balls that enter the nut knock at its slide by a momentum that goes with their speed, and it rings on at its own
/// frequency, with a phase that wanders: 8 um at 100 mm/s. Means of a few readings hardly show it.
#[test]
fn a_nut_whose_balls_knock_is_a_vibration_of_its_axis() {
    let mut session = session_of(&PROGRAM, SEED, Noise::default(), &|_| [0.0; 2]);
    let mut random = Pcg64Mcg::seed_from_u64(SEED);
    for run in &mut session.runs {
        let mut phase_rad = random.random_range(0.0..TAU);
        for reading in &mut run.readings {
            if reading.channel == Channel::GridU {
                phase_rad += TAU * 93.0 * 0.004 + 0.4 * normal(&mut random);
                let knock_mm = 8e-5 * run.motion.velocity[Axis::X][reading.at].abs();
                reading.deviation += knock_mm * phase_rad.sin();
            }
        }
    }
    let diagnosis = diagnosed(&session);
    let (cause, open) = only(&diagnosis.report.causes, LEAST_D);
    let size = &cause.parameters[0];
    assert_eq!(size.name, "free_with_speed_um");
    assert!((size.value - 8.0).abs() < 0.2, "{size:?}");
    let found = (cause.effect.as_str(), cause.axis.as_str(), cause.status);
    assert_eq!(
        found,
        ("vibration_random", "X", Status::Named),
        "{}",
        told(&diagnosis)
    );
    assert!(open.is_empty(), "{open:?}");
}

/// Steps of the readings scatter a whole channel evenly: that is what its noise floor is made of, and nothing is named.
#[test]
fn readings_in_steps_are_noise_and_no_cause() {
    let mut session = session_of(&PROGRAM, SEED, Noise::default(), &|_| [0.0; 2]);
    let step_mm = 2e-3;
    for reading in session.runs.iter_mut().flat_map(|run| &mut run.readings) {
        reading.deviation = (reading.deviation / step_mm).round() * step_mm;
    }
    let diagnosis = diagnosed(&session);
    assert_eq!(
        names(&diagnosis),
        Vec::<String>::new(),
        "{}",
        told(&diagnosis)
    );
    assert!(!diagnosis.report.unknown.flagged, "{}", told(&diagnosis));
    let not_shown = &diagnosis.report.not_excited;
    assert!(not_shown.iter().any(|e| e.effect == "quantisation"));
}
