//! A rank-deficient fit against numpy's singular value decomposition and pseudoinverse.
//!
//! The numbers are in `numpy/radial_five_centres.txt`, which says how they were made. numpy builds its design
//! from the closed form of the chain, so levers and signs are compared as well.

#![expect(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a test fails by panicking and shows its figures"
)]

use grid_encoder::basis::ModelComponent;
use grid_encoder::identify::{
    Disturbed, IdentifyOptions, Noise, PlateCertificate, default_basis, identify,
};
use grid_encoder::recording::{Fixture, GridPoint, Place, Recording};
use grid_encoder::spectrum::Visibility;
use grid_encoder::unknown::Nuisances;
use machine::Kinematics;
use metrology::PerAxis;
use metrology::sample::TestPlane;
use nalgebra::Vector3;

const REFERENCE: &str = include_str!("../numpy/radial_five_centres.txt");
const STATIONS: u32 = 72;
/// Of the greatest number of each list.
const OF_DESIGN: f64 = 1e-11;
/// Readings of 200 mm are rounded to 3e-14 mm, deviations are 1e-3 mm.
const OF_READINGS: f64 = 1e-9;

fn numbers(name: &str) -> Vec<f64> {
    let line = REFERENCE
        .lines()
        .find_map(|line| line.strip_prefix(name))
        .unwrap();
    line.split_whitespace()
        .map(|n| n.parse().unwrap())
        .collect()
}

fn recordings() -> Vec<Recording> {
    let centres = [
        (0.0, 0.0),
        (150.0, 0.0),
        (-150.0, 0.0),
        (0.0, 150.0),
        (0.0, -150.0),
    ];
    let recording = |(circle, (x, y)): (u32, (f64, f64))| {
        let mut place = Place::circle(TestPlane::Xy, Vector3::new(x, y, 0.0), 50.0, STATIONS);
        place.fixture = Fixture {
            zero_id: circle,
            setup_id: 0,
        };
        let point = |k: u32| {
            let angle_rad = f64::from(k) * std::f64::consts::TAU / f64::from(STATIONS);
            let positions = place.on_circle_mm(angle_rad);
            let i = f64::from(circle * STATIONS + k);
            let deviation_mm = [1e-3 * (0.7 * i + 0.3).sin(), 1e-3 * (1.3 * i).cos()];
            GridPoint {
                positions,
                sense: Vector3::zeros(),
                velocity_mm_s: Vector3::zeros(),
                reading_mm: [
                    positions.0[0] + deviation_mm[0],
                    positions.0[1] + deviation_mm[1],
                ],
                standard_uncertainty_mm: [1e-4; 2],
                n_readings: 1,
            }
        };
        Recording {
            run: circle,
            place,
            points: (0..STATIONS).map(point).collect(),
        }
    };
    (0..).zip(centres).map(recording).collect()
}

fn check(what: &str, found: &[f64], expected: &[f64], limit: f64) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let size = expected.iter().fold(0.0_f64, |size, n| size.max(n.abs()));
    let apart = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
    let apart = apart.fold(0.0, f64::max) / size;
    println!("{what}: {apart:.1e} of the greatest");
    assert!(apart < limit, "{what}: {apart}");
}

#[test]
fn val_numpy_singular_values_and_pseudoinverse() {
    let kinematics = Kinematics::of_chain("[w X' Y' b Z t]".parse().unwrap(), PerAxis::default());
    let names = ["EXX", "EYY", "EXY", "EYX", "EC0Y", "ECY"];
    let component = |name: &str| {
        let component = name.parse().unwrap();
        ModelComponent {
            component,
            basis: default_basis(component, 0.0, 3),
        }
    };
    let options = IdentifyOptions {
        components: names.map(component).to_vec(),
        nuisances: Nuisances {
            zero_offset: true,
            ..Nuisances::NONE
        },
        radial_only: true,
        rank_tolerance: 1e-9,
        outlier_limit: f64::INFINITY,
        recording_noise: false,
        noise: Noise::AsStated,
        disturbed: Disturbed::Ignored,
        certificate: PlateCertificate::EXACT,
    };
    let found = identify(&kinematics, &recordings(), &options).unwrap();
    assert_eq!(vec![found.rank as f64], numbers("rank"));
    let scaled = |j: usize| found.values[j] / found.scale[j];
    let cofactor = |j: usize| found.covariance[(j, j)] / found.scale[j].powi(2);
    let n = found.unknowns.len();
    let seen: Vec<f64> = found
        .singular_values
        .iter()
        .copied()
        .take(found.rank)
        .collect();
    check("singular values", &seen, &numbers("singular"), OF_DESIGN);
    check(
        "minimum-norm solution",
        &(0..n).map(scaled).collect::<Vec<_>>(),
        &numbers("beta"),
        OF_READINGS,
    );
    check(
        "cofactors",
        &(0..n).map(cofactor).collect::<Vec<_>>(),
        &numbers("cofactor"),
        OF_DESIGN,
    );
    let of_residuals = found.residuals_mm.iter().flatten();
    let chi_square = of_residuals.map(|r| (r[0] / 1e-4).powi(2)).sum();
    check(
        "chi square",
        &[chi_square],
        &numbers("chi_square"),
        OF_READINGS,
    );
    for (j, share) in numbers("seen").into_iter().enumerate() {
        let estimable = found.visibility[j] == Visibility::Estimable;
        assert_eq!(estimable, share > 1.0 - 1e-9, "{}", found.unknowns[j]);
    }
}
