//! What one message may hold, and how large its numbers may be: more is refused by field, value and limit.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use abbe_msgs::msg::{
    AxisState, ErrorCurve, EstimableCombination, GeometryModel, PositioningTable, ProbeTrigger,
    TestSegment,
};
use abbe_msgs::sensor_msgs::msg::Temperature;
use abbe_msgs::{Wire, WireError};

fn said<M: Wire>(message: M) -> String
where
    M::Inner: std::fmt::Debug,
{
    message.into_inner().unwrap_err().to_string()
}

#[test]
fn long_names_and_lists_are_refused_by_field_and_limit() {
    let long = "x".repeat(256);
    let trigger = ProbeTrigger {
        feature_id: long.clone(),
        ..ProbeTrigger::default()
    };
    let of_trigger = said(trigger);
    assert!(
        of_trigger.contains("feature_id: 256 bytes of text: at most 255"),
        "{of_trigger}"
    );
    let mut warmth = Temperature::default();
    warmth.header.frame_id.clone_from(&long);
    assert!(said(warmth).contains("header.frame_id: 256 bytes"));
    let segment = TestSegment {
        features: vec!["a".to_owned(); 1_001],
        ..TestSegment::default()
    };
    assert!(said(segment).contains("features: 1001 entries: at most 1000"));
    let segment = TestSegment {
        features: vec![long],
        ..TestSegment::default()
    };
    assert!(said(segment).contains("features: 256 bytes"));
    let table = PositioningTable {
        axis: "X".to_owned(),
        position: vec![0.0; 100_001],
        deviation_up: vec![0.0; 100_001],
        deviation_down: vec![0.0; 100_001],
        ..PositioningTable::default()
    };
    assert!(said(table).contains("position: 100001 entries: at most 100000"));
}

fn curve(n: usize) -> ErrorCurve {
    ErrorCurve {
        component: "EXX".to_owned(),
        form: ErrorCurve::FORM_TABLE,
        position: vec![0.0; n],
        coefficient: vec![0.0; n],
        standard_uncertainty: vec![0.0; n],
        estimable: vec![true; n],
        ..ErrorCurve::default()
    }
}

#[test]
fn a_model_of_endless_size_is_refused_before_its_covariance_is_made() {
    let of_curves = |curves| GeometryModel {
        curves,
        ..GeometryModel::default()
    };
    assert!(said(of_curves(vec![curve(1); 201])).contains("curves: 201 entries: at most 200"));
    let coefficients = said(of_curves(vec![curve(1_001); 2]));
    assert!(
        coefficients.contains("coefficient: 2002 entries: at most 2000"),
        "{coefficients}"
    );
    let model = GeometryModel {
        combinations: vec![EstimableCombination::default(); 2_001],
        ..GeometryModel::default()
    };
    assert!(said(model).contains("combinations: 2001 entries: at most 2000"));
    let steep = ErrorCurve {
        form: ErrorCurve::FORM_POLYNOMIAL,
        position: vec![],
        power: vec![255],
        ..curve(1)
    };
    let power = said(of_curves(vec![steep]));
    assert!(
        power.contains("power") && power.contains("255") && power.contains("20"),
        "{power}"
    );
}

/// Finite where it is taken, refused where it is beyond what any machine has: no product of it is infinite inside.
#[test]
fn prop_a_number_is_finite_inside_or_refused() {
    for exponent in -320..=308 {
        for sign in [1.0, -1.0] {
            let number: f64 = sign * format!("1e{exponent}").parse::<f64>().unwrap();
            let state = AxisState {
                axis: vec!["X".to_owned()],
                commanded: vec![number],
                motor: vec![number],
                scale: vec![f64::NAN],
                velocity: vec![number],
                ..AxisState::default()
            };
            match state.into_inner() {
                Ok(inner) => assert!(inner.commanded.0[0].is_finite(), "{number}"),
                Err(error) => {
                    assert!(matches!(error, WireError::TooLarge { .. }), "{error}");
                    assert!(number.abs() > 1e17, "{error}");
                }
            }
        }
    }
}

#[test]
fn a_temperature_that_no_thermometer_reads_is_refused_with_value_and_range() {
    for (degc, is_taken) in [
        (20.0, true),
        (-200.0, true),
        (1_600.0, true),
        (-200.1, false),
        (-273.15, false),
        (-500.0, false),
        (3_276.7, false),
        (1e17, false),
        (1e308, false),
        (f64::NAN, false),
        (f64::NEG_INFINITY, false),
    ] {
        let warmth = Temperature {
            temperature: degc,
            ..Temperature::default()
        };
        match warmth.into_inner() {
            Ok(inner) => assert!(is_taken && inner.temperature_degc.is_finite(), "{degc}"),
            Err(error) => assert!(
                !is_taken && error.to_string().contains("temperature"),
                "{error}"
            ),
        }
    }
    let shown = said(Temperature {
        temperature: -500.0,
        ..Temperature::default()
    });
    let words = "temperature: temperature = -500 °C: must be from -200 to 1600 °C";
    assert!(shown.contains(words), "{shown}");
}

#[test]
fn a_positioning_table_is_refused_beyond_what_its_interface_file_and_a_machine_have() {
    let table = |axis: &str, change: fn(&mut PositioningTable)| {
        let mut table = PositioningTable {
            axis: axis.to_owned(),
            position: vec![0.0, 0.1],
            deviation_up: vec![0.0, 1e-5],
            deviation_down: vec![0.0, 1e-5],
            weight: 0.3,
            ..PositioningTable::default()
        };
        change(&mut table);
        table
    };
    for axis in ["X", "C"] {
        assert!(table(axis, |_| ()).into_inner().is_ok(), "{axis}");
        let far = said(table(axis, |t| t.position[1] = 1_000.1));
        assert!(far.contains("position: entry 1 = 1000.1"), "{far}");
    }
    for (of, words) in [
        (
            table("X", |t| t.weight = 7.0),
            "weight: value = 7: must be from 0 to 0.3",
        ),
        (table("X", |t| t.weight = -0.1), "weight: value = -0.1"),
        (
            table("X", |t| t.deviation_up[0] = 1_000.0),
            "deviation_up: entry 0 = 1000 m: must be from -0.1 to 0.1 m",
        ),
        (
            table("X", |t| t.deviation_down[1] = -0.11),
            "deviation_down: entry 1 = -0.11 m",
        ),
        (
            table("C", |t| t.deviation_up[1] = 1.1),
            "deviation_up: entry 1 = 1.1 rad: must be from -1 to 1 rad",
        ),
        (
            table("C", |t| t.deviation_up[1] = f64::NAN),
            "deviation_up[1]",
        ),
    ] {
        let refused = said(of);
        assert!(refused.contains(words), "{refused}");
    }
}
