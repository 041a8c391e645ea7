//! What a programme will see is what it sees, and the fewest recordings are the fewest.

#![expect(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a test fails by panicking and shows its figures"
)]

use grid_encoder::basis::ModelComponent;
use grid_encoder::identify::{IdentifyOptions, default_basis};
use grid_encoder::preflight::{Choice, PlateRules, Search, candidates, choose, preflight};
use grid_encoder::recording::{Fixture, Place};
use grid_encoder::unknown::{Nuisances, Unknown};
use machine::Kinematics;
use metrology::PerAxis;
use metrology::sample::TestPlane;
use nalgebra::Vector3;

fn kinematics() -> Kinematics {
    Kinematics::of_chain("[w X' Y' b Z t]".parse().unwrap(), PerAxis::default())
}

/// The model with both yaws in the XY plane: 17 coefficients.
fn options() -> IdentifyOptions {
    let names = ["EXX", "EYY", "EXY", "EYX", "EC0Y", "ECX", "ECY"];
    let component = |name: &str| {
        let component = name.parse().unwrap();
        ModelComponent {
            component,
            basis: default_basis(component, 0.0, 3),
        }
    };
    IdentifyOptions {
        components: names.map(component).to_vec(),
        nuisances: Nuisances::PLATE,
        ..IdentifyOptions::of_chain(&"[w X' Y' b Z t]".parse().unwrap(), &PerAxis::default(), 3)
    }
}

fn circle(x: f64, y: f64, radius: f64, id: u32, tool_mm: Vector3<f64>) -> Place {
    let mut place = Place::circle(TestPlane::Xy, Vector3::new(x, y, 0.0), radius, 360);
    place.fixture = Fixture {
        zero_id: id,
        setup_id: id,
    };
    place.tool_offset_mm = tool_mm;
    place
}

fn is_yaw_of_y(unknown: &Unknown) -> bool {
    unknown.to_string().starts_with("ECY")
}

#[test]
fn two_radii_under_one_zero_see_all_but_the_yaw_of_y() {
    let places = [50.0, 25.0].map(|r| circle(0.0, 0.0, r, 1, Vector3::zeros()));
    let found = preflight(&kinematics(), &places, &options(), 1e-4).unwrap();
    assert_eq!((found.rank, found.unknowns.len()), (18, 20));
    let (_, u) = found.estimate(found.find("EXX1").unwrap()).unwrap();
    assert!(u > 0.0 && u < 1e-5, "{u}");
    assert!(found.estimate(found.find("ECY1").unwrap()).is_none());
}

#[test]
fn stated_noise_scales_every_uncertainty() {
    let places = [50.0, 25.0].map(|r| circle(0.0, 0.0, r, 1, Vector3::zeros()));
    let one = preflight(&kinematics(), &places, &options(), 1e-4).unwrap();
    let ten = preflight(&kinematics(), &places, &options(), 1e-3).unwrap();
    let ratio = ten.covariance[(0, 0)] / one.covariance[(0, 0)];
    assert!((ratio - 100.0).abs() < 1e-6, "{ratio}");
}

/// Yaw of Y needs a second tool offset along Y. Of the list only number 3 has one.
fn list() -> Vec<Place> {
    let arm = Vector3::new(0.0, 80.0, 0.0);
    vec![
        circle(0.0, 0.0, 50.0, 1, Vector3::zeros()),
        circle(0.0, 0.0, 25.0, 1, Vector3::zeros()),
        circle(100.0, 0.0, 50.0, 2, Vector3::zeros()),
        circle(0.0, 0.0, 50.0, 3, arm),
        circle(-100.0, 0.0, 50.0, 4, Vector3::zeros()),
        circle(0.0, 0.0, 25.0, 3, arm),
    ]
}

#[test]
fn the_yaw_of_y_needs_the_second_tool_offset() {
    let found = choose(
        &kinematics(),
        &list(),
        &options(),
        is_yaw_of_y,
        &Search::default(),
    )
    .unwrap();
    assert!(
        found.is_least && found.beyond_the_list.is_empty(),
        "{found:?}"
    );
    assert!(
        found.recordings.iter().any(|idx| *idx == 3 || *idx == 5),
        "{:?}",
        found.recordings
    );
    assert!(
        found.recordings.iter().any(|idx| *idx != 3 && *idx != 5),
        "{:?}",
        found.recordings
    );
    let seen = found.seen.unwrap();
    for name in ["ECY1", "ECY2", "ECY3"] {
        assert!(seen.estimate(seen.find(name).unwrap()).is_some(), "{name}");
    }
    println!("least programme {:?}", found.recordings);
}

#[test]
fn no_smaller_programme_does_what_the_least_one_does() {
    let places = list();
    let found = choose(
        &kinematics(),
        &places,
        &options(),
        is_yaw_of_y,
        &Search::default(),
    )
    .unwrap();
    let size = found.recordings.len();
    for mask in 1_u32..1 << places.len() {
        if mask.count_ones() as usize >= size {
            continue;
        }
        let some: Vec<Place> = (0..places.len())
            .filter(|k| mask & (1 << k) != 0)
            .map(|k| places[k])
            .collect();
        let seen = preflight(&kinematics(), &some, &options(), 1e-4).unwrap();
        let all = ["ECY1", "ECY2", "ECY3"]
            .iter()
            .all(|name| seen.estimate(seen.find(name).unwrap()).is_some());
        assert!(!all, "{mask:b}");
    }
}

#[test]
fn one_by_one_finds_a_programme_that_works_where_there_are_too_many() {
    let search = Search {
        programmes: 3,
        ..Search::default()
    };
    let found = choose(&kinematics(), &list(), &options(), is_yaw_of_y, &search).unwrap();
    assert!(!found.is_least);
    let seen = found.seen.unwrap();
    assert!(seen.estimate(seen.find("ECY1").unwrap()).is_some());
}

#[test]
fn what_the_whole_list_cannot_see_is_named() {
    let places = &list()[..3];
    let found = choose(
        &kinematics(),
        places,
        &options(),
        is_yaw_of_y,
        &Search::default(),
    )
    .unwrap();
    let names: Vec<_> = found
        .beyond_the_list
        .iter()
        .map(ToString::to_string)
        .collect();
    assert_eq!(names, ["ECY1", "ECY2"]);
    assert_eq!(
        found.recordings.len(),
        1,
        "ECY3 is seen by one circle of those"
    );
}

fn three_planes(tool_offsets_mm: Vec<Vector3<f64>>) -> (Vec<Place>, Choice) {
    let none = (0.0, 0.0);
    let travel = PerAxis([
        (-320.0, 320.0),
        (-240.0, 240.0),
        (-60.0, 440.0),
        none,
        none,
        none,
    ]);
    let rules = PlateRules {
        planes: vec![TestPlane::Xy, TestPlane::Yz, TestPlane::Zx],
        radii_mm: vec![90.0, 45.0],
        plate_radius_mm: 110.0,
        heights: vec![0.0, 0.6],
        tool_offsets_mm,
        rezeroed: false,
    };
    let list = candidates(&travel, &rules);
    let chain = "[w X' Y' b Z t]".parse().unwrap();
    let options = IdentifyOptions::of_chain(&chain, &PerAxis::default(), 3);
    let search = Search {
        programmes: 0,
        ..Search::default()
    };
    let found = choose(&kinematics(), &list, &options, |_| true, &search).unwrap();
    println!(
        "{} of {} recordings: {:?}",
        found.recordings.len(),
        list.len(),
        found.recordings
    );
    (list, found)
}

#[test]
fn all_21_errors_are_seen_by_a_programme_out_of_three_planes() {
    let arms = [[0.0, 0.0, 0.0], [60.0, -40.0, -100.0], [0.0, 60.0, -50.0]];
    let (list, found) = three_planes(arms.map(Vector3::from).to_vec());
    assert_eq!(list.len(), 3 * 3 * 2 * 5 * 2);
    assert!(
        found.beyond_the_list.is_empty(),
        "{:?}",
        found.beyond_the_list
    );
    assert!(found.recordings.len() <= 12);
    let seen = found.seen.unwrap();
    let estimable = (0..seen.n_coefficients).filter(|idx| seen.estimate(*idx).is_some());
    assert_eq!(estimable.count(), 51);
}

/// Z carries the tool and nothing else: a turn about the line through both offsets moves neither.
#[test]
fn two_tool_offsets_leave_the_turns_of_the_head_open() {
    let arms = [[0.0, 0.0, 0.0], [60.0, -40.0, -100.0]];
    let (_, found) = three_planes(arms.map(Vector3::from).to_vec());
    let names: Vec<_> = found
        .beyond_the_list
        .iter()
        .map(ToString::to_string)
        .collect();
    let turns = ["EAZ", "EBZ", "ECZ"].map(|name| [1, 2, 3].map(|k| format!("{name}{k}")));
    assert_eq!(names, turns.concat());
}
