//! Breakdown of circles against a machine simulated in time.

#![expect(clippy::unwrap_used, reason = "a test that cannot evaluate has failed")]
#![expect(clippy::print_stderr, reason = "figures that module headers quote")]

mod alone;
mod coverage;
mod instrument;
mod machine;
mod props;
mod robust;
mod thinned;
mod told_apart;
mod val;

use iso230::breakdown::{Breakdown, BreakdownConfig, CircularRecording, PlaneBreakdown, evaluate};

/// Breaks down recordings of one plane with the default configuration.
pub fn breakdown(recordings: &[CircularRecording]) -> PlaneBreakdown {
    let Breakdown { mut planes } = evaluate(recordings, &BreakdownConfig::default()).unwrap();
    assert_eq!(planes.len(), 1);
    planes.remove(0)
}

/// Lines that say what a breakdown found, for a test that fails.
pub fn printed(plane: &PlaneBreakdown) -> String {
    use std::fmt::Write;
    let mut text = String::new();
    for row in plane.rows.iter().chain(&plane.setting_up) {
        writeln!(
            text,
            "{:60} {:12.4e} ± {:9.2e} {:?} span {:8.3} µm {:5.1} % shapley {:6.1} % incr {:6.1} % p {:.1e} {:?}",
            row.name,
            row.value,
            row.standard_uncertainty,
            row.unit,
            row.peak_to_peak_mm * 1e3,
            row.share_percent,
            row.variance_share_percent,
            row.incremental_percent,
            row.chance,
            row.details.iter().map(|d| (d.value, d.standard_uncertainty)).collect::<Vec<_>>(),
        )
        .unwrap();
    }
    writeln!(text, "{:?}\n{:?}", plane.noise, plane.not_found).unwrap();
    for recording in &plane.recordings {
        writeln!(text, "{recording:?}").unwrap();
    }
    text
}
