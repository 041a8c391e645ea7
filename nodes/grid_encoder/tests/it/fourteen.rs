//! The published separation from any 14 of 360 stations against numpy's pseudoinverse.
//!
//! The numbers are in `numpy/fourteen_of_360.txt`, which says how they were made.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use grid_encoder::comparison::compare;
use grid_encoder::recording::{GridPoint, Place, Recording};
use machine::Kinematics;
use metrology::PerAxis;
use metrology::sample::TestPlane;
use nalgebra::Vector3;

const REFERENCE: &str = include_str!("../numpy/fourteen_of_360.txt");
const STATIONS: u32 = 360;
/// Rounding of readings of 50 mm, 7e-15 mm, through a system of condition 1e3 or so; errors are 1e-3 mm.
const LIMIT_MM: f64 = 1e-9;

fn numbers(name: &str) -> Vec<f64> {
    let line = REFERENCE
        .lines()
        .find_map(|line| line.strip_prefix(&format!("{name} ")));
    let words = line.unwrap().split_whitespace();
    words.map(|n| n.parse().unwrap()).collect()
}

fn circle(stations: u32) -> Recording {
    let place = Place::circle(TestPlane::Xy, Vector3::zeros(), 50.0, stations);
    let point = |k: u32| {
        let i = f64::from(k);
        let positions = place.on_circle_mm(i * std::f64::consts::TAU / f64::from(stations));
        let [x, y] = [positions.0[0], positions.0[1]];
        GridPoint {
            positions,
            sense: Vector3::zeros(),
            velocity_mm_s: Vector3::zeros(),
            reading_mm: [
                x * (1.0 + 1e-4) + 1e-3 * (0.7 * i + 0.3).sin(),
                y + 1e-3 * (1.3 * i).cos(),
            ],
            standard_uncertainty_mm: [1e-4; 2],
            n_readings: 55,
        }
    };
    Recording {
        run: 1,
        points: (0..stations).map(point).collect(),
        place,
    }
}

fn kinematics() -> Kinematics {
    Kinematics::of_chain("[w X' Y' b Z t]".parse().unwrap(), PerAxis::default())
}

#[test]
fn val_numpy_any_fourteen_of_360_stations() {
    let found = compare(&kinematics(), &circle(STATIONS), 0.005)
        .unwrap()
        .unwrap();
    let two = found.fourteen.as_ref().unwrap();
    assert_eq!(two.stations[0][..4], [0, 25, 51, 77]);
    assert_eq!(two.stations[1][..4], [12, 38, 64, 90]);
    let near = |found: &[f64], expected: &[f64]| {
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < LIMIT_MM, "{found} {expected}");
        }
    };
    let all: Vec<f64> = found.unknowns.iter().map(|c| c.published_mm).collect();
    near(&all, &numbers("all"));
    near(&two.beta_mm[0], &numbers("first"));
    near(&two.beta_mm[1], &numbers("second"));
    near(&[two.apart_mm], &numbers("apart"));
    near(&[two.traces_apart_mm], &numbers("traces_apart"));
    assert!((found.readings_per_station - 55.0).abs() < 1e-12);
    // A micrometre of noise decides what 14 stations print.
    assert!(two.apart_mm > 1e-3, "{}", two.apart_mm);
}

#[test]
fn a_circle_of_fewer_than_28_stations_has_no_two_choices() {
    let found = compare(&kinematics(), &circle(27), 0.005).unwrap().unwrap();
    assert!(found.fourteen.is_none());
}
