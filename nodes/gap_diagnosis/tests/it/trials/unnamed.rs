//! What no effect of the catalogue makes is called unknown; noise beyond the repeats' is said, and nothing named.

use gap_diagnosis::{GapConfig, Note, diagnose};

use crate::trials::plant::{Noise, State, diagnosed, machine, names, session, soft_play};

#[test]
fn without_the_classes_that_span_it_a_play_is_flagged_and_placed_by_its_reversals() {
    // Lost motion that hardly changes with the feed, below its own speed, is a play in all but name.
    let session = session(11, Noise::default(), &soft_play(0, 5e-3));
    let config = GapConfig {
        left_out: ["backlash", "feed_lost_motion"].map(str::to_owned).to_vec(),
        ..GapConfig::default()
    };
    let diagnosis = diagnose(&machine(), &session, &config).unwrap();
    assert!(diagnosis.report.unknown.flagged);
    let first = &diagnosis.report.r#where[0];
    assert_eq!(first.channel, "grid.u");
    assert_eq!(first.covariate, "sense*log_distance_since_reversal_x");
}

#[test]
fn an_error_of_no_class_is_flagged() {
    let wrong = |s: &State| {
        [
            2e-3 * (s.velocity[1] / 50.0).signum() * (s.position[0] / 50.0).powi(2),
            0.0,
        ]
    };
    let diagnosis = diagnosed(&session(12, Noise::default(), &wrong));
    assert!(diagnosis.report.unknown.flagged);
    assert!(names(&diagnosis).is_empty());
    let description = &diagnosis.report.unknown.description;
    let places = &diagnosis.report.r#where;
    assert_eq!(description.parity, "odd", "{description:?} {places:#?}");
}

#[test]
fn noise_beyond_the_repeats_is_said_and_nothing_is_named() {
    for seed in 20..24 {
        let noise = Noise {
            other_runs: 1.6,
            ..Noise::default()
        };
        let diagnosis = diagnosed(&session(seed, noise, &|_| [0.0; 2]));
        assert!(names(&diagnosis).is_empty());
        assert!(diagnosis.notes.iter().any(|note| matches!(
            note,
            Note::NotReproduced {
                withdraws: true,
                ..
            }
        )));
    }
}

#[test]
fn a_gap_much_larger_than_noise_is_unknown_also_where_the_noise_is_not_that_of_the_repeats() {
    // A waviness of the grid's own, in the direction of motion, of no class of the catalogue.
    let wrong = |s: &State| {
        let sense = (s.velocity[1] / 50.0).signum();
        [12e-3 * sense * (s.position[0] / 50.0).powi(2), 0.0]
    };
    for seed in 20..24 {
        let noise = Noise {
            other_runs: 3.0,
            ..Noise::default()
        };
        let report = diagnosed(&session(seed, noise, &wrong)).report;
        assert!(
            report.gap.rms_um > 4.0 * report.gap.floor_um,
            "{:?}",
            report.gap
        );
        assert!(report.unknown.flagged, "{seed}: {:?}", report.unknown);
    }
    // Noise alone, and worse than that of the repeats, is none.
    for seed in 20..24 {
        let noise = Noise {
            other_runs: 1.6,
            ..Noise::default()
        };
        let report = diagnosed(&session(seed, noise, &|_| [0.0; 2])).report;
        assert!(!report.unknown.flagged, "{seed}: {:?}", report.unknown);
    }
}

#[test]
fn a_session_without_repeats_has_the_noise_within_its_runs_and_names_nothing_of_it() {
    for seed in 30..36 {
        let mut session = session(seed, Noise::default(), &|_| [0.0; 2]);
        session.runs.retain(|run| run.segment.repeat == 0);
        let diagnosis = diagnosed(&session);
        assert!(names(&diagnosis).is_empty(), "{seed}");
        let is_within = |note: &Note| matches!(note, Note::NoiseWithin { lowers: true, .. });
        assert!(diagnosis.notes.iter().any(is_within), "{seed}");
    }
}
