//! The plain table reads back as the same doubles, and its compensation cancels its error.

use control_tables::CrossErrors;
use control_tables::csv::{Known, covariance_of, table};
use metrology::sample::{AxisDrift, CurveForm, ErrorCurve, GeometryModel, ThermalModel};
use metrology::stamp::Stamp;
use metrology::{Axis, ErrorComponent, PerAxis};
use nalgebra::{DMatrix, Matrix4};

use crate::export::slide::{error_mm, left, look_up, measured};

#[test]
fn every_number_reads_back_and_the_compensation_is_what_is_added_to_the_command() {
    let yaw = CrossErrors::new(
        Axis::X,
        Axis::C,
        vec![0.0, 100.0],
        vec![0.0, 1e-5 / 3.0],
        vec![ErrorComponent::motion(Axis::C, Axis::X)],
    );
    let errors = measured(1.0);
    let known = Known::default();
    let file = table(std::slice::from_ref(&errors), &[yaw.unwrap()], &known);
    let mut lines = file.text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    assert!(rows.iter().all(|row| row.len() == names.len()));
    let cell =
        |row: &[&str], name: &str| row[names.iter().position(|n| *n == name).unwrap()].to_owned();
    let value = |row: &[&str], name: &str| cell(row, name).parse::<f64>().unwrap();

    let own: Vec<&Vec<&str>> = rows.iter().filter(|row| row[0] == "EXX").collect();
    for (row, (at, up)) in own.iter().zip(errors.position().iter().zip(errors.up())) {
        assert_eq!(value(row, "position").to_bits(), at.to_bits());
        assert_eq!(value(row, "error_up").to_bits(), up.to_bits());
    }
    let of = |name: &str| -> Vec<(f64, f64)> {
        own.iter()
            .map(|row| (value(row, "position"), value(row, name)))
            .collect()
    };
    let (up, down) = (of("compensation_up"), of("compensation_down"));
    left(error_mm, |command_mm, is_up| {
        let motor_mm = command_mm + look_up(if is_up { &up } else { &down }, command_mm);
        motor_mm + error_mm(motor_mm, is_up)
    })
    .assert_corrected("CSV", 0.0);

    let last = rows.last().unwrap();
    assert_eq!(
        (
            last[0],
            cell(last, "position_unit"),
            cell(last, "value_unit")
        ),
        ("ECX", "mm".to_owned(), "rad".to_owned())
    );
    assert_eq!(
        value(last, "error_up").to_bits(),
        (1e-5_f64 / 3.0).to_bits()
    );
}

/// ECX as a line and a bow, with the covariance of both: 1e-18 times [[4, 1], [1, 9]].
fn with_covariance(estimable: bool) -> GeometryModel {
    let curve = ErrorCurve {
        component: ErrorComponent::motion(Axis::C, Axis::X),
        form: CurveForm::Polynomial,
        origin: 10.0,
        power: vec![1, 2],
        position: vec![],
        coefficient: vec![1e-8, 2e-9],
        standard_uncertainty: vec![2e-9, 3e-9],
        estimable: vec![estimable; 2],
        span: (10.0, 14.0),
    };
    GeometryModel {
        at: Stamp::from_nanos(0),
        chain: String::new(),
        curves: vec![curve],
        covariance: DMatrix::from_row_slice(2, 2, &[4e-18, 1e-18, 1e-18, 9e-18]),
        combinations: vec![],
        n_samples: 9,
        n_unknowns: 2,
        rank: 2,
        residual_standard_deviation_mm: 0.0,
        sequence: 1,
    }
}

/// The last cell of every row.
fn uncertainties(known: &Known) -> Vec<String> {
    let file = table(&[], &[], known);
    let mut lines = file.text.lines();
    assert!(
        lines
            .next()
            .unwrap()
            .ends_with(",standard_uncertainty_if_known")
    );
    let last = lines.map(|line| line.rsplit(',').next().unwrap().to_owned());
    last.collect()
}

#[test]
fn a_component_has_the_uncertainty_of_its_covariance_by_hand() {
    let model = with_covariance(true);
    let mut known = Known::default();
    let covariance = covariance_of(&model, 0);
    known
        .add_curve(&model.curves[0], covariance.as_ref(), 2.0)
        .unwrap();
    // At 2 and 4 beyond the origin: 2² 4 + 2 2 4 1 + 4² 9 = 176 and 4² 4 + 2 4 16 1 + 16² 9 = 2496, times 1e-18.
    let expected = [0.0, 176e-18_f64.sqrt(), 2496e-18_f64.sqrt()];
    let found = uncertainties(&known);
    assert_eq!(found.len(), 3, "{found:?}");
    for (found, expected) in found.iter().zip(expected) {
        let found: f64 = found.parse().unwrap();
        assert!(
            (found - expected).abs() <= 1e-12 * expected,
            "{found} {expected}"
        );
    }
}

#[test]
fn what_is_not_known_has_an_empty_cell() {
    let model = with_covariance(false);
    let mut known = Known::default();
    let covariance = covariance_of(&model, 0);
    known
        .add_curve(&model.curves[0], covariance.as_ref(), 2.0)
        .unwrap();
    known
        .add_curve(&with_covariance(true).curves[0], None, 2.0)
        .unwrap();
    assert_eq!(uncertainties(&known), [""; 6]);
    let short = GeometryModel {
        covariance: DMatrix::zeros(1, 1),
        ..model
    };
    assert!(covariance_of(&short, 0).is_none());
}

#[test]
fn a_drift_has_the_uncertainty_at_its_place_by_hand() {
    let mut covariance = Matrix4::zeros();
    covariance[(0, 0)] = 4e-6;
    covariance[(1, 1)] = 2.5e-10;
    let drift = AxisDrift {
        k0_mm: 0.01,
        slope_mm_per_mm: 1e-5,
        covariance,
        span_mm: (0.0, 200.0),
        offset_identifiable: true,
        slope_identifiable: true,
        ..AxisDrift::default()
    };
    let mut axes: PerAxis<Option<AxisDrift>> = PerAxis::default();
    axes[Axis::X] = Some(drift);
    let model = ThermalModel {
        at: Stamp::from_nanos(1_767_600_000_000_000_000),
        axes,
        valid_from: Stamp::from_nanos(0),
        valid_until: Stamp::from_nanos(1_767_602_400_000_000_001),
        n_blocks: 2,
        lack_of_fit_p: f64::NAN,
        quarantined: false,
        sequence: 1,
    };
    let mut known = Known::default();
    known.add_drift(&model, Axis::X).unwrap();
    // By `date -u -d @1767600000`, and 40 minutes later.
    let notes = table(&[], &[], &known).text;
    let times = "fitted at 2026-01-05 08:00:00 UTC and valid until 2026-01-05 08:40:00 UTC of the host's clock";
    assert!(notes.contains(times), "{notes}");
    // 2 µm at the reference; at 200 mm sqrt(4 + 200² 2.5e-4) = sqrt(14) µm.
    let found: Vec<f64> = uncertainties(&known)
        .iter()
        .map(|u| u.parse().unwrap())
        .collect();
    for (found, expected) in found.iter().zip([0.002, 14e-6_f64.sqrt()]) {
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }
    assert_eq!(found.len(), 2);
}
