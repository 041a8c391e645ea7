//! What each measuring programme can see, against a table that was worked out by hand and with numpy.
//!
//! Rows: data; columns: models A (yaw of the Y saddle), A2 (yaw of X), AF (both) of `[w X' Y' b Z t]`.

#![expect(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a test fails by panicking and shows its figures"
)]

use grid_encoder::basis::{Basis, ModelComponent};
use grid_encoder::identify::{
    Disturbed, Identification, IdentifyOptions, Noise, PlateCertificate, default_basis, identify,
};
use grid_encoder::recording::{Fixture, GridPoint, Place, Recording};
use grid_encoder::unknown::Nuisances;
use machine::Kinematics;
use metrology::PerAxis;
use metrology::sample::TestPlane;
use nalgebra::Vector3;

const STATIONS: u32 = 72;

#[derive(Clone, Copy)]
enum Model {
    A,
    A2,
    Af,
}

fn components(model: Model) -> Vec<ModelComponent> {
    let yaw: &[&str] = match model {
        Model::A => &["ECY"],
        Model::A2 => &["ECX"],
        Model::Af => &["ECX", "ECY"],
    };
    let names = ["EXX", "EYY", "EXY", "EYX", "EC0Y"].iter().chain(yaw);
    names
        .map(|name| {
            let component = name.parse().unwrap();
            ModelComponent {
                component,
                basis: default_basis(component, 0.0, 3),
            }
        })
        .collect()
}

/// Circles (centre x, centre y, radius, zero), all in one set-up.
fn recordings(circles: &[(f64, f64, f64, u32)]) -> Vec<Recording> {
    let recording = |(run, (x, y, r, zero_id)): (usize, &(f64, f64, f64, u32))| {
        let mut place = Place::circle(TestPlane::Xy, Vector3::new(*x, *y, 0.0), *r, STATIONS);
        place.fixture = Fixture {
            zero_id: *zero_id,
            setup_id: 1,
        };
        let points = (0..STATIONS)
            .map(|k| {
                let angle_rad = f64::from(k) * std::f64::consts::TAU / f64::from(STATIONS);
                let positions = place.on_circle_mm(angle_rad);
                // What is read does not decide the rank; a plausible reading keeps the turn at zero.
                GridPoint {
                    positions,
                    sense: Vector3::zeros(),
                    velocity_mm_s: Vector3::zeros(),
                    reading_mm: [positions.0[0], positions.0[1]],
                    standard_uncertainty_mm: [1e-4; 2],
                    n_readings: 55,
                }
            })
            .collect();
        Recording {
            run: u32::try_from(run).unwrap(),
            place,
            points,
        }
    };
    circles.iter().enumerate().map(recording).collect()
}

struct Row {
    circles: Vec<(f64, f64, f64, u32)>,
    radial_only: bool,
    nuisances: Nuisances,
    /// (rank, unknowns) for A, A2, AF.
    expected: [(usize, usize); 3],
}

fn run(row: &Row, model: Model) -> Identification {
    let kinematics = Kinematics::of_chain("[w X' Y' b Z t]".parse().unwrap(), PerAxis::default());
    let options = IdentifyOptions {
        components: components(model),
        nuisances: row.nuisances,
        radial_only: row.radial_only,
        rank_tolerance: 1e-9,
        outlier_limit: f64::INFINITY,
        recording_noise: false,
        noise: Noise::AsStated,
        disturbed: Disturbed::Ignored,
        certificate: PlateCertificate::EXACT,
    };
    identify(&kinematics, &recordings(&row.circles), &options).unwrap()
}

fn with(zero_offset: bool, plate_rotation: bool, radius: bool) -> Nuisances {
    Nuisances {
        zero_offset,
        plate_rotation,
        radius,
        ..Nuisances::NONE
    }
}

/// 0, ±d along x, ±d along y, each with its own zero.
fn cross(d: f64, r: f64) -> Vec<(f64, f64, f64, u32)> {
    vec![
        (0.0, 0.0, r, 1),
        (d, 0.0, r, 2),
        (-d, 0.0, r, 3),
        (0.0, d, r, 4),
        (0.0, -d, r, 5),
    ]
}

fn one_zero(mut circles: Vec<(f64, f64, f64, u32)>) -> Vec<(f64, f64, f64, u32)> {
    for circle in &mut circles {
        circle.3 = 1;
    }
    circles
}

/// Rows: circles, radii only, offsets free, rotation free, radii free, (rank, unknowns) of A, A2, AF.
type Line = (
    Vec<(f64, f64, f64, u32)>,
    bool,
    [bool; 3],
    [(usize, usize); 3],
);

fn table() -> Vec<Row> {
    let one = vec![(0.0, 0.0, 50.0, 1)];
    let two = vec![(0.0, 0.0, 50.0, 1), (0.0, 0.0, 25.0, 2)];
    let (y, n) = (true, false);
    let wide = cross(150.0, 50.0);
    let lines: [Line; 9] = [
        (one.clone(), y, [n, n, n], [(10, 14), (9, 14), (10, 17)]),
        (one.clone(), y, [y, n, y], [(10, 17), (9, 17), (10, 20)]),
        (two.clone(), y, [y, n, n], [(14, 18), (13, 18), (14, 21)]),
        (wide.clone(), y, [y, n, n], [(22, 24), (24, 24), (25, 27)]),
        (one, n, [y, n, n], [(12, 16), (13, 16), (14, 19)]),
        (two.clone(), n, [y, y, n], [(15, 19), (17, 19), (18, 22)]),
        (one_zero(two), n, [y, y, n], [(15, 17), (17, 17), (18, 20)]),
        (
            one_zero(cross(40.0, 50.0)),
            y,
            [y, n, n],
            [(14, 16), (16, 16), (17, 19)],
        ),
        (wide, n, [y, y, n], [(23, 25), (25, 25), (26, 28)]),
    ];
    let row = |(circles, radial_only, [offset, rotation, radius], expected): Line| Row {
        circles,
        radial_only,
        nuisances: with(offset, rotation, radius),
        expected,
    };
    lines.into_iter().map(row).collect()
}

#[test]
fn val_numpy_rank_table_of_the_measuring_programmes() {
    for (number, row) in table().iter().enumerate() {
        for (model, (rank, unknowns)) in [Model::A, Model::A2, Model::Af]
            .into_iter()
            .zip(row.expected)
        {
            let found = run(row, model);
            println!(
                "row {number}: {} of {}, condition {:.0}, kept {:.1e}, dropped {:.1e}",
                found.rank,
                found.unknowns.len(),
                found.condition,
                found.gap.kept,
                found.gap.dropped
            );
            assert_eq!(
                (found.rank, found.unknowns.len()),
                (rank, unknowns),
                "row {number}"
            );
            assert!(found.gap.kept > 1e5 * found.gap.dropped, "row {number}");
        }
    }
}

#[test]
fn where_two_unknowns_are_left_they_are_the_yaw_of_y_and_the_straightness_of_y() {
    for number in [3, 6, 7, 8] {
        for model in [Model::A, Model::Af] {
            let found = run(&table()[number], model);
            let names: Vec<_> = found
                .combinations
                .iter()
                .map(|c| found.name_of(c))
                .collect();
            assert_eq!(names, ["EXY2|ECY1", "EXY3|ECY2"], "row {number}");
            // C_x = EXY2 y² − y ECY1 y: only EXY2 − ECY1 is seen.
            for combination in &found.combinations {
                let ratio = combination.weights[1].1 / combination.weights[0].1;
                assert!((ratio + 1.0).abs() < 1e-6, "{ratio}");
            }
        }
    }
}

#[test]
fn a_column_of_zeros_is_unseen_and_not_rank() {
    let mut row = table().swap_remove(0);
    row.expected = [(0, 0); 3];
    let found = run(&row, Model::A2);
    use grid_encoder::spectrum::Visibility;
    for name in ["ECX1", "ECX2", "ECX3"] {
        let idx = found.find(name).unwrap();
        assert_eq!(found.visibility[idx], Visibility::Unseen, "{name}");
        assert!(found.estimate(idx).is_none());
    }
}

#[test]
fn a_constant_stays_a_constant_in_any_basis() {
    assert_eq!(
        default_basis("EC0Y".parse().unwrap(), 5.0, 3),
        Basis::Constant
    );
}
