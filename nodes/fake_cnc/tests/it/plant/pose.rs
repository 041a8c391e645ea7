//! Where the tool is against the workpiece on machines of several chains.

use fake_cnc::plant::OilFilmEntry;
use fake_cnc::{Plant, PlantFile};
use metrology::{Axis, PerAxis};
use nalgebra::{Rotation3, Vector3};

use crate::plant::rig::{PERIOD, machine, perfect};

fn pose(x: f64, y: f64, z: f64, a_deg: f64, c_deg: f64) -> PerAxis<f64> {
    PerAxis([x, y, z, a_deg.to_radians(), 0.0, c_deg.to_radians()])
}

const POSES: [(f64, f64, f64, f64, f64); 4] = [
    (0.0, 0.0, 0.0, 0.0, 0.0),
    (120.0, -80.0, 60.0, 0.0, 90.0),
    (-200.0, 150.0, 200.0, -30.0, 0.0),
    (75.0, 210.0, 310.0, 25.0, -140.0),
];

fn plant(chain: &str, truth: &PlantFile) -> Plant {
    let mut machine = machine();
    machine.chain = chain.to_owned();
    Plant::new(&machine, truth).unwrap()
}

#[test]
fn eq2_a_perfect_table_table_machine_turns_points_back_by_a_and_c() {
    let mut plant = plant("[w C' A' Y' b X Z t]", &perfect());
    for (x, y, z, a, c) in POSES {
        let at = pose(x, y, z, a, c);
        plant.settle_at(&at);
        // p_machine = Rx(A) about the line (Y 0, Z 50), then Rz(C): p_w = Rz(-C) (Rx(-A) (p - o) + o).
        let line = Vector3::new(0.0, 0.0, 50.0);
        let tilt = Rotation3::from_axis_angle(&Vector3::x_axis(), -a.to_radians());
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), -c.to_radians());
        let expected = turn * (tilt * (Vector3::new(x, y, z) - line) + line);
        assert!((plant.tool_in_workpiece_mm() - expected).norm() < 1e-9);
        assert!(
            plant.tool_error_mm(&at).norm() < 1e-9,
            "a perfect cold machine has no error"
        );
    }
}

#[test]
fn eq2_the_order_of_linear_axes_does_not_matter_on_a_perfect_machine() {
    let chains = [
        "[w C' A' Y' b X Z t]",
        "[w C' A' X' Y' b Z t]",
        "[w C' A' b X Y Z t]",
    ];
    for (x, y, z, a, c) in POSES {
        let tips = chains.map(|chain| {
            let mut plant = plant(chain, &perfect());
            plant.settle_at(&pose(x, y, z, a, c));
            plant.tool_in_workpiece_mm()
        });
        // With X and Y under the tilting table their shifts act before the tilt, as they must.
        assert!((tips[0] - tips[2]).norm() < 1e-9);
        assert!((tips[0] - tips[1]).norm() < 1e-9);
    }
}

#[test]
fn eq1_a_shifted_table_axis_moves_points_as_r_minus_one_says() {
    let mut truth = perfect();
    if let Some(errors) = truth.geometry.rotary.get_mut(&metrology::Axis::C) {
        errors.location_um = [10.0, -4.0, 0.0];
    }
    let shift_mm = Vector3::new(0.010, -0.004, 0.0);
    let mut plant = plant("[w C' A' Y' b X Z t]", &truth);
    for c in [0.0, 90.0, 180.0] {
        let at = pose(50.0, 30.0, 100.0, 0.0, c);
        plant.settle_at(&at);
        let back = Rotation3::from_axis_angle(&Vector3::z_axis(), -f64::to_radians(c));
        // Table turned about c0 instead of 0: p_w = R^-1 (p - c0) + c0.
        let expected = shift_mm - back * shift_mm;
        assert!((plant.tool_error_mm(&at) - expected).norm() < 1e-9);
    }
}

#[test]
fn squareness_leans_an_axis_and_lead_stretches_it() {
    let mut truth = perfect();
    truth.geometry.squareness_urad.y_to_x = 20.0;
    if let Some(errors) = truth.geometry.linear.get_mut(&metrology::Axis::X) {
        errors.lead_um_per_m = 30.0;
    }
    let mut plant = plant("[w C' A' Y' b X Z t]", &truth);
    let at = pose(100.0, 200.0, 50.0, 0.0, 0.0);
    plant.settle_at(&at);
    let expected = Vector3::new(100.0 * 30e-6 + 200.0 * 20e-6, 0.0, 0.0);
    assert!((plant.tool_error_mm(&at) - expected).norm() < 1e-9);
}

#[test]
fn a_slide_on_oil_comes_back_to_another_place_after_a_while_and_at_once_to_the_same() {
    let at = pose(120.0, -80.0, 60.0, 0.0, 0.0);
    let mut truth = perfect();
    let film = OilFilmEntry {
        along_um: 0.2,
        across_um: 0.0,
        length_mm: 100.0,
        time_s: 20.0,
    };
    let mut dry = plant("[w C' A' Y' b X Z t]", &truth);
    truth.oil_film.insert(Axis::X, film);
    let mut oiled = plant("[w C' A' Y' b X Z t]", &truth);
    dry.settle_at(&at);
    oiled.settle_at(&at);
    let mut seen_um = Vec::new();
    for _ in 0..40 {
        let error_mm = oiled.tool_error_mm(&at) - dry.tool_error_mm(&at);
        assert_eq!(oiled.tool_error_mm(&at), oiled.tool_error_mm(&at));
        assert!(error_mm.yz().norm() < 1e-9, "across there is no float");
        seen_um.push(error_mm.x * 1e3);
        for plant in [&mut dry, &mut oiled] {
            for _ in 0..2000 {
                plant.step(&PerAxis::default(), 0.0, PERIOD);
            }
        }
    }
    let size_um = (seen_um.iter().map(|e| e * e).sum::<f64>() / 40.0).sqrt();
    // 80 s hold four correlation times: about four independent values.
    assert!((0.06..0.5).contains(&size_um), "{size_um}");
}

#[test]
fn oil_under_an_axis_that_is_not_there_is_refused() {
    let mut truth = perfect();
    let film = OilFilmEntry {
        along_um: 0.2,
        across_um: 0.2,
        length_mm: 100.0,
        time_s: 20.0,
    };
    truth.oil_film.insert(Axis::C, film);
    let told = Plant::new(&machine(), &truth).unwrap_err().to_string();
    assert_eq!(
        told,
        "oil_film.C: the machine file has no such axis of this kind"
    );
}
