//! Against a published test report: a real axis, evaluated by other people's program.
//!
//! Axis 1 of a slit set of the BIFROST instrument (European Spallation Source), five targets, five runs each way, read by
//! an optical sensor; report of 2021-11-03 in `tests_2/11358/axis1` of github.com/anderssandstrom/ecmc_bifrost_slits_sat,
//! evaluated by the authors' own ISO 230-2 program. Its readings and figures are quoted, to their last printed digit
//! (10 nm). Two of its figures are not those of the standard and are not compared as such: its R is the greater of
//! R↑ and R↓, without the reversal, and its E that of one direction.

use iso230::ExpandedLength;
use iso230::positioning::PositioningRuns;

use crate::iso230::{evaluated, near};

const TARGETS_MM: [f64; 5] = [15.0, 25.2, 35.4, 45.6, 55.8];
/// Readings at each target, runs 1 to 5.
const UP_MM: [[f64; 5]; 5] = [
    [15.00335, 15.00233, 15.00172, 15.00213, 15.00172],
    [25.19974, 25.20015, 25.20096, 25.20056, 25.20056],
    [35.40102, 35.3996, 35.40225, 35.40306, 35.40449],
    [45.59151, 45.5909, 45.59212, 45.5909, 45.58947],
    [55.80583, 55.80624, 55.80685, 55.80562, 55.80562],
];
const DOWN_MM: [[f64; 5]; 5] = [
    [15.00518, 15.00518, 15.00416, 15.00335, 15.00314],
    [25.19628, 25.19607, 25.19567, 25.19587, 25.19526],
    [35.39817, 35.39837, 35.3998, 35.39939, 35.4],
    [45.59232, 45.59191, 45.59293, 45.59191, 45.59151],
    [55.80705, 55.80725, 55.80705, 55.80705, 55.80644],
];
/// Reversal, standard deviations up and down, and bi-directional repeatability at each target, mm.
const AT_TARGETS_MM: [[f64; 4]; 5] = [
    [-0.00196, 0.00067, 0.00097, 0.00524],
    [0.00456, 0.00046, 0.00039, 0.00628],
    [0.00293, 0.00188, 0.00083, 0.00835],
    [-0.00114, 0.00098, 0.00054, 0.00419],
    [-0.00094, 0.00052, 0.00031, 0.00259],
];
/// Half a unit of the last printed digit, and what the readings have lost the same way: twice of 4 s.
const PRINTED_MM: f64 = 1.6e-5;

/// Deviations run by run.
fn runs(readings_mm: &[[f64; 5]; 5]) -> Vec<Vec<f64>> {
    let of_run = |run: usize| {
        let pairs = readings_mm.iter().zip(TARGETS_MM);
        pairs.map(|(at, target_mm)| at[run] - target_mm).collect()
    };
    (0..5).map(of_run).collect()
}

#[test]
fn val_iso230_2_report_of_a_slit_axis() {
    let result = evaluated(&PositioningRuns {
        targets_mm: TARGETS_MM.to_vec(),
        up_mm: runs(&UP_MM),
        down_mm: runs(&DOWN_MM),
        zero_mm: 0.0,
        periods_mm: vec![],
    });
    for (point, [reversal_mm, up_mm, down_mm, repeatability_mm]) in
        result.points.iter().zip(AT_TARGETS_MM)
    {
        near("B_i", point.reversal_mm, reversal_mm, PRINTED_MM);
        near("s_i up", point.up.standard_deviation_mm, up_mm, PRINTED_MM);
        near(
            "s_i down",
            point.down.standard_deviation_mm,
            down_mm,
            PRINTED_MM,
        );
        near("R_i", point.repeatability_mm, repeatability_mm, PRINTED_MM);
    }
    let figure = |what, of: ExpandedLength, printed_mm| {
        near(what, of.value_mm, printed_mm, PRINTED_MM);
    };
    figure("B", result.reversal, 0.00456);
    figure("mean B", result.mean_reversal, 0.00069);
    figure("R up", result.up.repeatability, 0.0075);
    figure("R down", result.down.repeatability, 0.00388);
    figure("E up", result.up.systematic_error, 0.01505);
    figure("E down", result.down.systematic_error, 0.01485);
    figure("M", result.mean_systematic_error, 0.01495);
    figure("A up", result.up.accuracy, 0.01806);
    figure("A down", result.down.accuracy, 0.01655);
    figure("A", result.accuracy, 0.01858);
    // From the report's own figures at its targets by equations (4) and (5).
    figure("R", result.repeatability, 0.00835);
    figure("E", result.systematic_error, 0.00697 + 0.00902);
}
