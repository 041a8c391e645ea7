//! The diagnosis on the wire.

use abbe_msgs::{Wire, from_cdr, msg, to_cdr};
use metrology::Stamp;
use metrology::sample::{GapCause, GapParameter, GapStatus, GapSummary};

fn summary() -> GapSummary {
    GapSummary {
        at: Stamp::from_nanos(1_767_600_000_000_000_123),
        runs: vec![3, 4, 9],
        rms_mm: 0.0081,
        p95_mm: 0.014,
        floor_mm: 0.0003,
        above_floor: true,
        causes: vec![GapCause {
            effect: "backlash".to_owned(),
            axis: "X".to_owned(),
            status: GapStatus::Set,
            confidence: 0.97,
            whitened_size: 88.0,
            parameters: vec![GapParameter {
                name: "width_um".to_owned(),
                value: 5.9,
                low: 5.6,
                high: 6.2,
            }],
        }],
        has_unknown: false,
        unknown_covariate: String::new(),
        held_out_runs: vec![9],
        rms_before_mm: f64::NAN,
        rms_after_mm: f64::NAN,
        gap_closed: 0.995,
        next_experiment: "circle XY R50 F3000 both senses".to_owned(),
        json: "{}".to_owned(),
    }
}

#[test]
fn a_report_comes_back_in_millimetres() {
    let message = msg::GapReport::from_inner(&summary());
    assert!((message.rms_m - 8.1e-6).abs() < 1e-18);
    let back = from_cdr::<msg::GapReport>(&to_cdr(&message)).expect("a message");
    let back = back.into_inner().expect("a report");
    assert_eq!(back.causes, summary().causes);
    assert_eq!((back.at, &back.runs), (summary().at, &summary().runs));
    assert!((back.p95_mm - 0.014).abs() < 1e-15 && back.rms_before_mm.is_nan());
}

#[test]
fn a_size_that_is_no_number_and_an_unknown_status_are_refused() {
    let mut message = msg::GapReport::from_inner(&summary());
    message.rms_m = f64::NAN;
    let refused = message.to_inner().expect_err("no number").to_string();
    assert!(refused.contains("GapReport: rms_m"), "{refused}");
    let mut message = msg::GapReport::from_inner(&summary());
    message.causes[0].status = 7;
    let refused = message.to_inner().expect_err("no status").to_string();
    assert!(refused.contains("GapCause: status"), "{refused}");
}
