//! One component at a time.

use machine::volumetric::{components_of, has_component, sensitivity};
use machine::{Kinematics, TableSense};
use metrology::{Axis, ErrorComponent, PerAxis};
use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::volumetric::bodies::Bodies;
use crate::volumetric::{CHAINS, machine};

const ORIGIN: Vector3<f64> = Vector3::new(0.0, 0.0, 0.0);

fn of(kinematics: &Kinematics, at: [f64; 6], tool: Vector3<f64>, name: &str) -> Vector3<f64> {
    sensitivity(kinematics, &PerAxis(at), &tool, name.parse().unwrap())
}

/// Cx and Cy of one component at z = 0 without a tool, as (Cx, Cy).
fn in_plane(chain: &str, x: f64, y: f64, name: &str) -> (f64, f64) {
    let c = of(&machine(chain), [x, y, 0.0, 0.0, 0.0, 0.0], ORIGIN, name);
    assert!(c.z.abs() < 1e-15, "{chain} {name}");
    (c.x, c.y)
}

#[test]
fn eq6_a_table_on_a_saddle_has_the_plane_formula() {
    let (x, y) = (30.0, 40.0);
    let expected = [
        ("EXX", (1.0, 0.0)),
        ("EXY", (1.0, 0.0)),
        ("EYX", (0.0, 1.0)),
        ("EYY", (0.0, 1.0)),
        ("ECX", (-y, x)),
        ("ECY", (-y, 0.0)),
        ("EC0Y", (-y, 0.0)),
    ];
    for (name, c) in expected {
        assert_eq!(in_plane("[w X' Y' b Z t]", x, y, name), c, "{name}");
    }
}

#[test]
fn eq1_other_orders_differ_in_the_yaw_terms_alone() {
    let (x, y) = (30.0, 40.0);
    let yaws = [
        ("[w Y' X' b Z t]", (0.0, x), (-y, x)),
        ("[w b X Y Z t]", (-y, 0.0), (0.0, 0.0)),
        ("[w b Y X Z t]", (0.0, 0.0), (0.0, x)),
        ("[w X' b Y Z t]", (-y, x), (0.0, 0.0)),
    ];
    for (chain, ecx, ecy) in yaws {
        assert_eq!(in_plane(chain, x, y, "ECX"), ecx, "{chain}");
        assert_eq!(in_plane(chain, x, y, "ECY"), ecy, "{chain}");
        assert_eq!(in_plane(chain, x, y, "EC0Y"), (-y, 0.0), "{chain}");
        for (name, c) in [
            ("EXX", (1.0, 0.0)),
            ("EXY", (1.0, 0.0)),
            ("EYX", (0.0, 1.0)),
        ] {
            assert_eq!(in_plane(chain, x, y, name), c, "{chain} {name}");
        }
    }
}

#[test]
fn the_yaw_of_the_innermost_table_axis_cancels_on_every_circle_about_the_origin() {
    let (x, y) = (30.0, 40.0);
    let (cx, cy) = in_plane("[w X' Y' b Z t]", x, y, "ECX");
    assert!((x * cx + y * cy).abs() < 1e-12);
    let (cx, cy) = in_plane("[w b X Y Z t]", x, y, "ECX");
    assert!((x * cx + y * cy + x * y).abs() < 1e-12);
}

#[test]
fn eq2_squareness_leans_the_path_of_the_tool() {
    for chain in CHAINS {
        let kinematics = machine(chain);
        let at = [10.0, 20.0, 30.0, 0.0, 0.0, 0.0];
        let lean = |name| of(&kinematics, at, Vector3::new(1.0, 2.0, -150.0), name);
        assert_eq!(lean("EC0Y"), Vector3::new(-20.0, 0.0, 0.0), "{chain}");
        assert_eq!(lean("EB0Z"), Vector3::new(30.0, 0.0, 0.0), "{chain}");
        assert_eq!(lean("EA0Z"), Vector3::new(0.0, -30.0, 0.0), "{chain}");
    }
}

#[test]
fn a_long_tool_swings_with_the_head_and_not_with_the_table_beside_it() {
    let kinematics = machine("[w X' Y' b Z t]");
    let tool = Vector3::new(0.0, 0.0, -150.0);
    let at = [0.0, 0.0, 100.0, 0.0, 0.0, 0.0];
    // A head that nods about +Y swings a tip below it towards -X.
    assert_eq!(
        of(&kinematics, at, tool, "EBZ"),
        Vector3::new(-150.0, 0.0, 0.0)
    );
    // A table feels the tip where it is: 50 mm below the machine's origin.
    assert_eq!(
        of(&kinematics, at, tool, "EBX"),
        Vector3::new(-50.0, 0.0, 0.0)
    );
}

/// A table whose line lies 1 mm further in X, turned by half a turn: what was 40 mm from the nominal
/// line on its other side is 42 mm from the workpiece's origin, for the tool stands 41 mm from the
/// true line, which is at 1 mm.
#[test]
fn eq4_a_displaced_table_is_seen_twice_at_half_a_turn() {
    let kinematics =
        Kinematics::of_chain("[w C' A' Y' b X Z t]".parse().unwrap(), PerAxis::default());
    let at = [-40.0, 0.0, 0.0, 0.0, 0.0, std::f64::consts::PI];
    let c = of(&kinematics, at, ORIGIN, "EX0C");
    assert!((c - Vector3::new(2.0, 0.0, 0.0)).norm() < 1e-14, "{c}");
    let zero = of(
        &kinematics,
        [10.0, 20.0, 30.0, 0.0, 0.0, 0.0],
        ORIGIN,
        "EX0C",
    );
    assert_eq!(zero, Vector3::zeros());
}

#[test]
fn location_errors_of_rotary_axes_vanish_at_rotary_zero_but_for_the_tilt_of_the_tool() {
    let tool = Vector3::new(2.0, -3.0, -120.0);
    for chain in CHAINS {
        let kinematics = machine(chain);
        let lines = components_of(kinematics.chain())
            .into_iter()
            .filter(|c| c.is_location && !c.of.is_linear());
        for component in lines {
            let at = PerAxis([50.0, -60.0, 70.0, 0.0, 0.0, 0.0]);
            let c = sensitivity(&kinematics, &at, &tool, component);
            assert_eq!(
                c == Vector3::zeros(),
                component.direction != component.of,
                "{chain} {component}"
            );
        }
    }
}

#[test]
fn eq5_the_zero_position_of_the_table_at_the_workpiece_has_no_effect() {
    let kinematics = machine("[w C' A' Y' b X Z t]");
    let at = [50.0, -60.0, 70.0, 0.4, 0.0, 2.0];
    let tool = Vector3::new(2.0, -3.0, -120.0);
    assert!(of(&kinematics, at, tool, "EC0C").norm() < 1e-12);
    // That of the trunnion is a tilt of C's line about A's: EA0C and, as the lines do not meet, EY0C.
    let arm = kinematics.origin_mm(Axis::C) - kinematics.origin_mm(Axis::A);
    let as_lines = of(&kinematics, at, tool, "EA0C") - arm.z * of(&kinematics, at, tool, "EY0C");
    // The tool turns by +1 relative to the table, so the table's line turns by -1.
    assert!((of(&kinematics, at, tool, "EA0A") + as_lines).norm() < 1e-12);
}

#[test]
fn a_component_that_the_chain_lacks_has_no_effect() {
    let kinematics = machine("[w X' Y' b Z t]");
    let at = [1.0, 2.0, 3.0, 0.4, 0.5, 0.6];
    for name in ["EXC", "EA0A", "EX0B"] {
        assert_eq!(of(&kinematics, at, Vector3::x(), name), Vector3::zeros());
    }
}

#[test]
fn prop_sensitivity_is_the_central_difference_of_the_product_of_bodies() {
    let mut rng = Pcg64Mcg::seed_from_u64(17);
    let step = 1e-5;
    let mut greatest = 0.0_f64;
    for chain in CHAINS {
        for sense in [TableSense::Table, TableSense::Tool] {
            let kinematics = machine(chain).with_table_sense(sense);
            let all = Axis::ALL.into_iter().flat_map(|of| {
                let locations = Axis::ALL.map(|direction| ErrorComponent::location(direction, of));
                ErrorComponent::motions_of(of).into_iter().chain(locations)
            });
            for component in all.filter(|c| has_component(kinematics.chain(), *c)) {
                let positions = PerAxis::from_fn(|axis| {
                    let range = if axis.is_linear() { 300.0 } else { 2.0 };
                    rng.random_range(-range..range)
                });
                let tool = Vector3::from_fn(|_, _| rng.random_range(-150.0..150.0));
                let tip = |value| {
                    let values = vec![(component, value)];
                    Bodies {
                        kinematics: &kinematics,
                        values,
                    }
                    .tip(&positions, &tool)
                };
                let difference = (tip(step) - tip(-step)) / (2.0 * step);
                let found = sensitivity(&kinematics, &positions, &tool, component);
                let off = (found - difference).norm();
                assert!(
                    off < 2e-7,
                    "{chain} {component} {off:e} {found} {difference}"
                );
                greatest = greatest.max(off);
            }
        }
    }
    assert!(greatest > 0.0);
    eprintln!("greatest disagreement {greatest:e} mm per unit");
}
