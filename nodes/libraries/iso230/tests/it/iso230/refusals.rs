//! What is refused, in which words, and that nothing panics.

use iso230::circular::{self, CircularBudget, CircularTest, CircularTrace};
use iso230::conformance::{Policy, Specification, decide};
use iso230::diagonal::{self, DiagonalRuns, SpaceDiagonal};
use iso230::positioning::budget::PositioningBudget;
use iso230::positioning::{self, PositioningRuns};
use iso230::thermal::{
    self, Artefact, ArtefactTemperature, DriftBudget, DriftCause, DriftChannel, DriftTest,
    GrowthReads,
};
use iso230::{ExpandedLength, Iso230Error, probing};
use metrology::Axis;
use proptest::collection::vec;
use proptest::prelude::*;

use crate::iso230::{EXACT, EXACT_DEVICE, RIGID, evaluated};

fn good() -> PositioningRuns {
    PositioningRuns {
        targets_mm: vec![0.0, 110.0, 205.0],
        up_mm: vec![vec![0.0, 0.001, 0.002]; 5],
        down_mm: vec![vec![-0.001, 0.0, 0.001]; 5],
        zero_mm: 0.0,
        periods_mm: vec![10.0],
    }
}

fn words(change: impl FnOnce(&mut PositioningRuns)) -> String {
    let mut runs = good();
    change(&mut runs);
    positioning::evaluate(&runs, &EXACT)
        .unwrap_err()
        .to_string()
}

#[test]
fn bad_positioning_runs_are_refused_with_place_value_and_limit() {
    for (found, expected) in [
        (
            words(|r| r.targets_mm.swap(1, 2)),
            "targets_mm[2] = 110 mm follows 205 mm: must be greater",
        ),
        (
            words(|r| r.targets_mm[1] = 0.0),
            "targets_mm[1] = 0 mm is the target before it once more",
        ),
        (
            words(|r| r.targets_mm.truncate(1)),
            "targets_mm: 1 points were given, at least 2 are needed",
        ),
        (
            words(|r| r.targets_mm[2] = f64::INFINITY),
            "targets_mm[0], value 2 is inf: must be finite",
        ),
        (
            words(|r| r.up_mm[3][1] = f64::NAN),
            "up_mm[3], value 1 is NaN: must be finite",
        ),
        (
            words(|r| r.down_mm[4].truncate(2)),
            "down_mm[4] has 2 values, but 3 belong there",
        ),
        (
            words(|r| r.up_mm.truncate(1)),
            "up_mm: 1 runs were given, at least 2 are needed",
        ),
        (
            words(|r| r.down_mm.clear()),
            "no run down: a bi-directional test needs both directions",
        ),
        (
            words(|r| r.up_mm.truncate(4)),
            "4 runs up and 5 runs down: must be equally many",
        ),
        (
            words(|r| r.periods_mm[0] = 0.0),
            "periods_mm = 0 mm: must be above 0",
        ),
        (
            words(|r| r.zero_mm = f64::NAN),
            "zero_mm[0], value 0 is NaN: must be finite",
        ),
    ] {
        assert_eq!(found, expected);
    }
}

#[test]
fn a_budget_with_a_negative_entry_is_refused() {
    let budget = PositioningBudget {
        environmental_drift_mm: -0.001,
        ..EXACT
    };
    assert_eq!(
        positioning::evaluate(&good(), &budget)
            .unwrap_err()
            .to_string(),
        "environmental_drift_mm = -0.001 mm: must be at least 0"
    );
    let mut budget = EXACT;
    budget.device.coverage_factor = 0.0;
    assert!(positioning::evaluate(&good(), &budget).is_err());
}

#[test]
fn results_are_json_and_inputs_are_read_from_it() {
    let result = serde_json::to_value(evaluated(&good())).unwrap();
    assert_eq!(result["reversal"]["value_mm"], 0.001);
    assert_eq!(result["remarks"][0]["kind"], "few_targets");
    assert!(result["points"][0]["up"]["interval"]["degrees_of_freedom"].is_null());
    let text = serde_json::to_string(&good()).unwrap();
    assert_eq!(
        serde_json::from_str::<PositioningRuns>(&text).unwrap(),
        good()
    );
    let unknown = text.replace("zero_mm", "zero_um");
    let error = serde_json::from_str::<PositioningRuns>(&unknown).unwrap_err();
    assert!(
        error.to_string().contains("unknown field `zero_um`"),
        "{error}"
    );
    let trace = r#"{"radial": {"angles_rad": [0.0], "deviations_mm": [0.1]}}"#;
    assert!(serde_json::from_str::<CircularTrace>(trace).is_ok());
}

const CERTAIN: CircularBudget = CircularBudget {
    displacement: EXACT_DEVICE,
    length: None,
    machine: RIGID,
    device_expansion: RIGID,
    environmental_drift_mm: 0.0,
    environmental_unrest_mm: None,
};

#[test]
fn circles_that_are_none_are_refused() {
    let refused = |clockwise, nominal_radius_mm| {
        let test = CircularTest {
            nominal_radius_mm,
            clockwise,
            counter_clockwise: None,
        };
        circular::evaluate(&test, &CERTAIN).unwrap_err()
    };
    assert_eq!(refused(None, 50.0), Iso230Error::NoTrace);
    let few = CircularTrace::PointsMm(vec![[1.0, 0.0]; 3]);
    assert_eq!(
        refused(Some(few), 50.0).to_string(),
        "clockwise: 3 points were given, at least 36 are needed"
    );
    let still = CircularTrace::PointsMm(vec![[1.0, 0.0]; 40]);
    assert!(matches!(
        refused(Some(still.clone()), 50.0),
        Iso230Error::AngularGap { .. }
    ));
    assert_eq!(
        refused(Some(still), -1.0).to_string(),
        "nominal_radius_mm = -1 mm: must be above 0"
    );
    let unequal = CircularTrace::Radial {
        angles_rad: vec![0.0; 40],
        deviations_mm: vec![0.0; 39],
    };
    assert!(matches!(
        refused(Some(unequal), 50.0),
        Iso230Error::Lengths {
            n: 39,
            expected: 40,
            ..
        }
    ));
    let nan = CircularTrace::PointsMm(vec![[f64::NAN, 0.0]; 40]);
    assert!(matches!(
        refused(Some(nan), 50.0),
        Iso230Error::NotFinite { .. }
    ));
}

fn drift() -> DriftTest {
    DriftTest {
        cause: DriftCause::Environment,
        times_s: (0..100).map(|k| 60.0 * f64::from(k)).collect(),
        channels: vec![DriftChannel {
            axis: Axis::X,
            height_mm: 10.0,
            displacements_mm: vec![0.0; 100],
        }],
        drift_after_s: 3600.0,
        rate_window_s: 3600.0,
        longest_gap_s: 90.0,
    }
}

#[test]
fn drift_tests_that_cannot_be_evaluated_are_refused() {
    let words = |change: fn(&mut DriftTest)| {
        let mut test = drift();
        change(&mut test);
        let budget = DriftBudget {
            sensor: EXACT_DEVICE,
            reading_scatter_mm: 0.0,
            sensor_error_period_mm: None,
            artefact: None,
        };
        thermal::evaluate(&test, &budget).unwrap_err().to_string()
    };
    for (found, expected) in [
        (
            words(|t| t.drift_after_s = 6000.0),
            "times: 5940 s are covered, 6000 s are needed",
        ),
        (
            words(|t| t.longest_gap_s = 30.0),
            "times: a gap of 60 s behind 0 s, at most 30 s are allowed",
        ),
        (
            words(|t| t.times_s[5] = 240.0),
            "times_s[5] = 240 s follows 240 s: must be greater",
        ),
        (
            words(|t| t.channels.clear()),
            "channels: 0 points were given, at least 1 are needed",
        ),
        (
            words(|t| t.channels.push(t.channels[0].clone())),
            "axis X has 2 channels: two channels at one height make no angle",
        ),
        (
            words(|t| t.channels[0].axis = Axis::C),
            "axis C has 1 channels: displacements are along X, Y or Z",
        ),
        (
            words(|t| {
                t.channels[0].axis = Axis::Z;
                t.channels.push(t.channels[0].clone());
            }),
            "axis Z has 2 channels: heights are along Z, so Z has one channel",
        ),
        (
            words(|t| {
                for _ in 0..2 {
                    t.channels.push(t.channels[0].clone());
                }
            }),
            "axis X has 3 channels: at most two heights make an angle",
        ),
        (
            words(|t| t.rate_window_s = 60.0),
            "rate_window_s: 2 points were given, at least 3 are needed",
        ),
    ] {
        assert_eq!(found, expected);
    }
}

fn artefact(temperature: ArtefactTemperature) -> Artefact {
    Artefact {
        length_mm: 200.0,
        expansion_per_k: 11.5e-6,
        expansion_half_width_per_k: 1e-6,
        temperature,
    }
}

fn read(degc: Vec<f64>, half_width_k: f64) -> Artefact {
    artefact(ArtefactTemperature::Read {
        degc,
        half_width_k,
        growth_reads: GrowthReads::Less,
    })
}

#[test]
fn artefacts_that_cannot_grow_so_are_refused() {
    let words = |artefact: Artefact| {
        let budget = DriftBudget {
            sensor: EXACT_DEVICE,
            reading_scatter_mm: 0.0,
            sensor_error_period_mm: None,
            artefact: Some(artefact),
        };
        thermal::evaluate(&drift(), &budget)
            .unwrap_err()
            .to_string()
    };
    let known = || read(vec![20.0; 100], 0.1);
    let changed = |change: fn(&mut Artefact)| {
        let mut artefact = known();
        change(&mut artefact);
        words(artefact)
    };
    let nan_at_7 = (0..100).map(|k| if k == 7 { f64::NAN } else { 20.0 });
    for (found, expected) in [
        (
            changed(|a| a.length_mm = -1.0),
            "artefact.length_mm = -1 mm: must be at least 0",
        ),
        (
            changed(|a| a.expansion_per_k = f64::NAN),
            "artefact.expansion_per_k = NaN",
        ),
        (
            changed(|a| a.expansion_half_width_per_k = -1e-6),
            "artefact.expansion_half_width_per_k = -",
        ),
        (
            words(read(vec![20.0; 100], -0.1)),
            "artefact.temperature.half_width_k = -0.1 K: must be at least 0",
        ),
        (
            words(read(vec![20.0; 100], f64::INFINITY)),
            "artefact.temperature.half_width_k = inf",
        ),
        (
            words(read(vec![20.0; 99], 0.1)),
            "artefact.temperature.degc[0] has 99 values, but 100 belong there",
        ),
        (
            words(read(nan_at_7.collect(), 0.1)),
            "artefact.temperature.degc[0], value 7 is NaN: must be finite",
        ),
        (
            words(artefact(ArtefactTemperature::Range { range_k: -2.0 })),
            "artefact.temperature.range_k = -2 K: must be at least 0",
        ),
        (
            words(artefact(ArtefactTemperature::Range { range_k: f64::NAN })),
            "artefact.temperature.range_k = NaN",
        ),
    ] {
        assert!(found.starts_with(expected), "{found}: {expected}");
    }
}

#[test]
fn diagonals_that_are_missing_or_twice_there_are_named() {
    let given = |diagonal| DiagonalRuns {
        diagonal,
        runs: good(),
    };
    let three: Vec<_> = SpaceDiagonal::ALL.into_iter().take(3).map(given).collect();
    assert_eq!(
        diagonal::evaluate(&three, &EXACT).unwrap_err().to_string(),
        "space diagonal PPN was given 0 times: must be once"
    );
    let mut five: Vec<_> = SpaceDiagonal::ALL.into_iter().map(given).collect();
    five.push(given(SpaceDiagonal::Pnp));
    assert_eq!(
        diagonal::evaluate(&five, &EXACT).unwrap_err().to_string(),
        "space diagonal PNP was given 2 times: must be once"
    );
}

#[test]
fn verdicts_without_a_zone_or_a_majority_are_refused() {
    let figure = ExpandedLength::new(0.005, 0.001);
    let refused = |lower_mm, upper_mm, policy| {
        let zone = Specification { lower_mm, upper_mm };
        decide(&figure, &zone, policy).unwrap_err().to_string()
    };
    assert_eq!(
        refused(None, None, Policy::Simple),
        "lower limit none and upper limit none specify nothing: the lower one must be below the upper one"
    );
    assert_eq!(
        refused(Some(1.0), Some(0.5), Policy::Simple),
        "lower limit 1 mm and upper limit 0.5 mm specify nothing: the lower one must be below the upper one"
    );
    assert_eq!(
        refused(None, Some(1.0), Policy::Probability { at_least: 0.4 }),
        "policy.probability.at_least = 0.4: must be from 0.5 to 1"
    );
    assert!(refused(None, Some(f64::NAN), Policy::Simple).contains("NaN"));
}

#[test]
fn probing_with_too_little_is_refused() {
    assert!(probing::single_point(&[1.0], 0.0).is_err());
    assert!(probing::single_point(&[1.0, f64::NAN], 0.0).is_err());
    assert!(probing::single_point(&[1.0, 2.0], -1.0).is_err());
    assert!(probing::location::<2>(&[], 0.0).is_err());
    let artefact = probing::Artefact {
        diameter_mm: 25.0,
        diameter_uncertainty: EXACT_DEVICE,
        form_mm: 0.0,
        form_standard_uncertainty_mm: 0.0,
        expansion: RIGID,
        stylus_radius_mm: 0.0,
        side: probing::Side::Outside,
    };
    assert!(matches!(
        probing::sphere(&[], &artefact, 0.0),
        Err(Iso230Error::Shape(_))
    ));
}

/// Any number at all.
fn any() -> impl Strategy<Value = f64> {
    prop_oneof![proptest::num::f64::ANY, -1.0..1.0, Just(0.0)]
}

proptest! {
    #[test]
    fn prop_no_input_makes_an_evaluation_panic(
        targets_mm in vec(any(), 0..5),
        up_mm in vec(vec(any(), 0..5), 0..4),
        down_mm in vec(vec(any(), 0..5), 0..4),
        periods_mm in vec(any(), 0..2),
        drift in any(),
        n_harmonics in 0..9_usize,
    ) {
        let budget = PositioningBudget { environmental_drift_mm: drift, ..EXACT };
        let run = positioning::periodic::PeriodicRun {
            positions_mm: targets_mm.clone(),
            deviations_mm: up_mm.first().cloned().unwrap_or_default(),
            period_mm: drift,
            n_harmonics,
        };
        let _ = positioning::periodic::evaluate(&run, &EXACT);
        let _ = probing::single_point(&targets_mm, drift);
        let runs = PositioningRuns { targets_mm, up_mm, down_mm, zero_mm: drift, periods_mm };
        let _ = positioning::evaluate(&runs, &budget);
    }

    #[test]
    fn prop_no_shape_of_valid_length_makes_an_evaluation_panic(
        values in vec(any(), 40), radius in any(), after in any(), window in any(),
        temperatures_degc in vec(any(), 40), half_width in any(),
    ) {
        let trace = CircularTrace::Radial {
            angles_rad: values.iter().enumerate().map(|(k, v)| k as f64 * 0.16 + v * 1e-3).collect(),
            deviations_mm: values.clone(),
        };
        let test = CircularTest {
            nominal_radius_mm: radius,
            clockwise: Some(trace.clone()),
            counter_clockwise: Some(trace),
        };
        let _ = circular::evaluate(&test, &CERTAIN);
        let mut sorted = values.clone();
        sorted.sort_by(f64::total_cmp);
        let test = DriftTest {
            times_s: sorted,
            channels: vec![DriftChannel {
                axis: Axis::Y,
                height_mm: radius,
                displacements_mm: values,
            }],
            drift_after_s: after,
            rate_window_s: window,
            longest_gap_s: f64::MAX,
            ..drift()
        };
        let budget = DriftBudget {
            sensor: EXACT_DEVICE,
            reading_scatter_mm: 0.0,
            sensor_error_period_mm: None,
            artefact: Some(read(temperatures_degc, half_width)),
        };
        let _ = thermal::evaluate(&test, &budget);
    }
}
