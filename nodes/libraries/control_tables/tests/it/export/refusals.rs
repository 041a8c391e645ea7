//! What no control is given, refused by name.

use control_tables::fanuc::{PitchTable, pitch_table, two_way_tables};
use control_tables::heidenhain::compensation_table;
use control_tables::linuxcnc::{FileType, compensation_file};
use control_tables::sinumerik::{
    CrossTable, EncoderTable, OtherAxes, Temperature, cross_table, encoder_table, temperature,
};
use control_tables::{AxisErrors, CrossErrors, ExportError, Grid, Sign, Unestimable};
use metrology::sample::{AxisDrift, ErrorCurve, PositioningTable};
use metrology::stamp::Stamp;
use metrology::{Axis, ErrorComponent};
use nalgebra::Vector3;

use crate::export::cross::{self, EC0Y, EXY, constant, grid, model, polynomial};
use crate::export::fanuc;
use crate::export::sinumerik::{drift, heat, thermal};

fn errors(at: &[f64], up: &[f64], down: &[f64]) -> Result<AxisErrors, ExportError> {
    AxisErrors::new(Axis::X, at.to_vec(), up.to_vec(), down.to_vec())
}

fn same(at: &[f64], e: &[f64]) -> AxisErrors {
    errors(at, e, e).unwrap()
}

/// So many points, 1 mm apart, without error.
fn long(n: usize) -> AxisErrors {
    let at: Vec<f64> = (0..n).map(|k| k as f64).collect();
    same(&at, &vec![0.0; n])
}

fn assert_says<T: std::fmt::Debug>(result: Result<T, ExportError>, words: &str) {
    let said = result.unwrap_err().to_string();
    assert!(said.contains(words), "{said}\nshould say: {words}");
}

fn encoder() -> EncoderTable {
    EncoderTable {
        machine_axis: "X1".to_owned(),
        encoder: 0,
        max_points: 200,
        reference: 0.0,
    }
}

#[test]
fn errors_that_are_no_table_are_refused() {
    assert_says(errors(&[0.0], &[0.0], &[0.0]), "1 points: at least 2");
    assert_says(errors(&[], &[], &[]), "0 points: at least 2");
    assert_says(
        errors(&[0.0, 1.0], &[0.0], &[0.0, 0.0]),
        "1 values of error up for 2 positions",
    );
    assert_says(
        errors(&[0.0, 0.0], &[0.0; 2], &[0.0; 2]),
        "position[1] = 0 mm does not lie above 0 mm",
    );
    assert_says(
        errors(&[0.0, 5.0, 3.0], &[0.0; 3], &[0.0; 3]),
        "position[2] = 3 mm does not lie above 5 mm",
    );
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_says(errors(&[bad, 1.0], &[0.0; 2], &[0.0; 2]), "position[0]");
        assert_says(errors(&[0.0, 1.0], &[0.0, bad], &[0.0; 2]), "error up[1]");
        assert_says(errors(&[0.0, 1.0], &[0.0; 2], &[bad, 0.0]), "error down[0]");
    }
    let table = PositioningTable {
        at: Stamp::from_nanos(0),
        axis: Axis::Y,
        position: vec![0.0, 10.0],
        deviation_up: vec![0.0, f64::NAN],
        deviation_down: vec![0.0, 0.0],
        n_runs: 5,
        weight: 0.2,
        sequence: 1,
    };
    assert_says(AxisErrors::from_table(&table), "axis Y: error up[1] = NaN");
}

#[test]
fn nothing_is_extrapolated_beyond_what_was_measured() {
    let measured = same(&[0.0, 100.0], &[0.0, 0.01]);
    let beyond = Grid::new(Axis::X, 0.0, 60.0, 3, (-500.0, 500.0)).unwrap();
    assert_says(
        measured.on_grid(&beyond),
        "point at 120 mm: measured from 0 mm to 100 mm",
    );
    let other = Grid::new(Axis::Y, 0.0, 50.0, 3, (-500.0, 500.0)).unwrap();
    assert_says(measured.on_grid(&other), "axis Y");
    let wide = Grid::new(Axis::Y, -300.0, 300.0, 3, (-300.0, 300.0)).unwrap();
    let sampled = CrossErrors::sample(
        &model(vec![polynomial(EXY, &[1e-6])]),
        &[EXY],
        Axis::X,
        &wide,
        Unestimable::Refuse,
    );
    assert_says(sampled, "point at -300 mm: measured from -250 mm to 250 mm");
}

#[test]
fn a_component_that_is_not_estimable_is_never_used_silently() {
    let mut curve = polynomial(EXY, &[1e-6, 2e-9]);
    curve.estimable[1] = false;
    let model = model(vec![curve]);
    let sample = |what| CrossErrors::sample(&model, &[EXY], Axis::X, &grid(), what);
    assert_says(
        sample(Unestimable::Refuse),
        "EXY: coefficient 1 is not estimable by itself",
    );
    assert!(sample(Unestimable::Accept).is_ok());
}

/// What the model of `curves` says of `components` in `direction`.
fn sampled(
    curves: Vec<ErrorCurve>,
    components: &[ErrorComponent],
    direction: Axis,
) -> Result<CrossErrors, ExportError> {
    let what = Unestimable::Accept;
    CrossErrors::sample(&model(curves), components, direction, &grid(), what)
}

#[test]
fn a_model_is_not_read_beyond_what_it_says() {
    let good = || polynomial(EXY, &[1e-6]);
    assert_says(
        sampled(vec![], &[EXY], Axis::X),
        "EXY: the model does not have it",
    );
    assert_says(
        sampled(vec![good()], &[], Axis::X),
        "no component in direction X was named",
    );
    assert_says(
        sampled(vec![good()], &[EXY], Axis::Z),
        "EXY has no effect in direction Z",
    );
    assert_says(
        sampled(vec![constant(EC0Y, 1e-5)], &[EC0Y], Axis::Y),
        "EC0Y has no effect in direction Y",
    );
    let exx = ErrorComponent::motion(Axis::X, Axis::X);
    assert_says(
        sampled(vec![polynomial(exx, &[1e-6])], &[exx], Axis::X),
        "as a function of axis Y",
    );
}

#[test]
fn a_curve_that_does_not_fit_its_form_is_refused() {
    let good = || polynomial(EXY, &[1e-6]);
    assert_says(
        sampled(
            vec![ErrorCurve {
                power: Vec::new(),
                ..good()
            }],
            &[EXY],
            Axis::X,
        ),
        "EXY: 1 coefficients need 1 powers, there are 0",
    );
    let no_origin = ErrorCurve {
        origin: f64::NAN,
        ..good()
    };
    assert_says(
        sampled(vec![no_origin], &[EXY], Axis::X),
        "EXY: origin[0] = NaN",
    );
    let malformed = [
        ErrorCurve {
            estimable: Vec::new(),
            ..good()
        },
        constant(EXY, 1.0),
    ];
    for curve in malformed {
        assert!(matches!(
            sampled(vec![curve], &[EXY], Axis::X),
            Err(ExportError::Malformed { .. })
        ));
    }
    assert_says(
        sampled(vec![polynomial(EXY, &[f64::NAN])], &[EXY], Axis::X),
        "coefficient[0] = NaN",
    );
    let nowhere = ErrorCurve {
        span: (f64::NAN, f64::NAN),
        ..good()
    };
    assert_says(
        sampled(vec![nowhere], &[EXY], Axis::X),
        "EXY: recorded span from NaN mm to NaN mm: must be finite and ascending",
    );
}

#[test]
fn linuxcnc_takes_256_points_and_no_two_at_one_place() {
    let file = |errors: &AxisErrors| compensation_file(errors, FileType::Offset);
    assert!(file(&long(256)).is_ok());
    assert_says(
        file(&long(257)),
        "257 points: LinuxCNC COMP_FILE takes at most 256",
    );
    assert_says(
        file(&same(&[0.0, 1e-6], &[0.0; 2])),
        "spacing 1e-6 mm: must be a finite number above 2e-6 mm",
    );
}

#[test]
fn sinumerik_needs_equal_spacing_one_direction_and_zero_at_the_reference() {
    let uneven = same(&[0.0, 10.0, 25.0], &[0.0; 3]);
    assert_says(
        encoder_table(&uneven, &encoder()),
        "spacing before point 2 is 15 mm, before point 1 10 mm",
    );
    assert_says(encoder_table(&long(201), &encoder()), "takes at most 200");
    let lost = errors(&[0.0, 10.0], &[0.0, 0.002], &[0.0, -0.002]).unwrap();
    assert_says(
        encoder_table(&lost, &encoder()),
        "differ by 0.004 mm at 10 mm",
    );
    let off = same(&[-10.0, 10.0], &[0.001, 0.003]);
    assert_says(
        encoder_table(&off, &encoder()),
        "error 0.002 mm at the reference point 0 mm",
    );
    assert!(encoder_table(&off.relative_to(0.0), &encoder()).is_ok());
    let nowhere = EncoderTable {
        reference: f64::NAN,
        ..encoder()
    };
    assert_says(encoder_table(&off, &nowhere), "reference[0] = NaN");
    let third = EncoderTable {
        encoder: 2,
        ..encoder()
    };
    assert_says(encoder_table(&off, &third), "encoder = 2: must be 0 or 1");
    let injected = EncoderTable {
        machine_axis: "X1]=0\nM30".to_owned(),
        ..encoder()
    };
    assert_says(encoder_table(&off, &injected), "must begin with a letter");
}

#[test]
fn sinumerik_cross_tables_keep_to_the_controls_tables_and_sum() {
    let of = |e: f64| {
        let (at, parts) = (vec![0.0, 10.0], vec![EXY]);
        CrossErrors::new(Axis::Y, Axis::X, at, vec![0.0, e], parts).unwrap()
    };
    let set_up = cross::set_up();
    assert_says(
        cross_table(&of(1.5), &set_up),
        "value 1.5 mm at 10 mm: SINUMERIK $AN_CEC takes at most 1 mm",
    );
    let ninth = CrossTable {
        table: 8,
        ..set_up.clone()
    };
    assert_says(
        cross_table(&of(0.0), &ninth),
        "table = 8: the control has fewer tables",
    );
    let short = CrossTable {
        max_points: 1,
        ..set_up.clone()
    };
    assert_says(cross_table(&of(0.0), &short), "takes at most 1");
    for max_sum in [0.0, f64::NAN, -1.0] {
        let bad = CrossTable {
            max_sum,
            ..set_up.clone()
        };
        assert_says(cross_table(&of(0.0), &bad), "max_sum");
    }
}

#[test]
fn sinumerik_takes_no_drift_that_is_doubtful() {
    let refused = |drift: AxisDrift| temperature(&thermal(drift), Axis::X, &heat());
    assert_says(
        refused(AxisDrift {
            offset_identifiable: false,
            ..drift(1.0)
        }),
        "offset of the thermal drift",
    );
    assert_says(
        refused(AxisDrift {
            k0_mm: f64::NAN,
            ..drift(1.0)
        }),
        "k0[0] = NaN",
    );
    assert_says(
        refused(AxisDrift {
            slope_mm_per_mm: 0.002,
            ..drift(1.0)
        }),
        "value 0.002 mm/mm",
    );
    let tilted = AxisDrift {
        cross_slope_mm_per_mm: Vector3::new(0.0, 2e-5, 0.0),
        ..drift(1.0)
    };
    assert_says(refused(tilted), "its drift changes with axis Y by 0.00002");
    let leave_out = Temperature {
        other_axes: OtherAxes::LeaveOut,
        ..heat()
    };
    assert!(temperature(&thermal(tilted), Axis::X, &leave_out).is_ok());
    let none = Temperature {
        max_slope: f64::NAN,
        ..heat()
    };
    assert_says(
        temperature(&thermal(drift(1.0)), Axis::X, &none),
        "max_slope = NaN",
    );
    assert_says(
        temperature(&thermal(drift(1.0)), Axis::Y, &heat()),
        "axis Y: the offset",
    );
    assert_says(
        temperature(&thermal(drift(1.0)), Axis::C, &heat()),
        "for linear axes only",
    );
    let mut doubtful = thermal(drift(1.0));
    doubtful.quarantined = true;
    assert_says(temperature(&doubtful, Axis::X, &heat()), "in quarantine");
}

#[test]
fn sinumerik_takes_no_drift_whose_sign_nobody_has_tried() {
    let untried = Temperature {
        sign: None,
        ..heat()
    };
    let untried = temperature(&thermal(drift(1.0)), Axis::X, &untried);
    assert_says(
        untried.clone(),
        "nothing is written without --sign plus|minus",
    );
    assert_says(untried, "SD43900 $SA_TEMP_COMP_ABS_VALUE = 0.010");
}

#[test]
fn heidenhain_takes_256_rows_of_one_axis_that_are_not_too_steep() {
    let table = |errors: &AxisErrors| compensation_table("X", errors, &[], Sign::Minus);
    assert!(table(&long(256)).is_ok());
    assert_says(table(&long(257)), "HEIDENHAIN .COM takes at most 256");
    assert_says(
        table(&same(&[0.0, 1.0], &[0.0, 0.02])),
        "value 0.02 mm at 1 mm",
    );
    assert_says(
        compensation_table("X AXIS", &long(2), &[], Sign::Minus),
        "name \"X AXIS\"",
    );
    let column = |base, direction, at: Vec<f64>| {
        let parts = vec![ErrorComponent::motion(direction, base)];
        [CrossErrors::new(base, direction, at, vec![0.0; 2], parts).unwrap()]
    };
    let moved = column(Axis::X, Axis::Y, vec![0.0, 2.0]);
    assert_says(
        compensation_table("X", &long(2), &moved, Sign::Minus),
        "EYX stands at other positions",
    );
    let of_y = column(Axis::Y, Axis::X, vec![0.0, 1.0]);
    assert_says(
        compensation_table("X", &long(2), &of_y, Sign::Minus),
        "EXY has no effect",
    );
}

#[test]
fn fanuc_takes_whole_intervals_from_the_reference_and_few_pulses() {
    let table = |errors: &AxisErrors| pitch_table(errors, &fanuc::set_up());
    let ramp = |e: f64| same(&[-10.0, 0.0, 10.0], &[0.0, 0.0, e]);
    assert!(table(&ramp(0.007)).is_ok());
    assert_says(
        table(&ramp(0.008)),
        "value -8 pulses at 10 mm: FANUC pitch error table takes at most 7 pulses",
    );
    assert_says(table(&ramp(1e300)), "pulses at 10 mm");
    assert_says(
        table(&same(&[-7.0, 3.0], &[0.0; 2])),
        "point at -7 mm is not a whole number of spacings of 10 mm",
    );
    assert_says(
        table(&same(&[0.0, 10.0, 25.0], &[0.0; 3])),
        "needs equal spacing",
    );
    assert_says(
        table(&errors(&[0.0, 10.0], &[0.0, 0.002], &[0.0, 0.0]).unwrap()),
        "differ by 0.002 mm",
    );
    let wrong = |change: fn(&mut PitchTable)| {
        let mut set_up = fanuc::set_up();
        change(&mut set_up);
        pitch_table(&ramp(0.001), &set_up)
    };
    assert_says(wrong(|s| s.detection_unit = 0.0), "detection_unit = 0");
    assert_says(
        wrong(|s| s.detection_unit = f64::NAN),
        "detection_unit = NaN",
    );
    assert_says(wrong(|s| s.magnification = 0), "magnification = 0");
    assert_says(wrong(|s| s.max_pulses = 0), "max_pulses = 0");
    assert_says(wrong(|s| s.reference = 500.0), "must lie among the points");
    assert_says(
        wrong(|s| s.reference = f64::NAN),
        "must lie among the points",
    );
    assert_says(wrong(|s| s.max_number = 40), "number of a point = 41");
    assert!(
        wrong(|s| s.reference_number = 1).is_ok(),
        "the least number is 1 here"
    );
    assert_says(
        wrong(|s| s.reference_number = u32::MAX),
        "number of a point",
    );
    let large = PitchTable {
        magnification: 2,
        ..fanuc::set_up()
    };
    assert_says(
        two_way_tables(&ramp(0.001), &large),
        "magnification = 2: must be 1 for a table in each direction",
    );
    let few = PitchTable {
        max_number: 42,
        ..fanuc::set_up()
    };
    assert_says(two_way_tables(&ramp(0.001), &few), "number of a point = 43");
}
