//! Effects of rotary axes: a table that turns about another line than the machine file's, by another angle than is read, or
//! stays behind after a reversal.

use std::collections::BTreeMap;

use fake_cnc::PlantFile;
use fake_cnc::plant::SquarenessEntry;
use machine::MachineFile;
use metrology::Axis;
use trials::Rig;

use crate::alone::judge::{is_named_with, told};
use crate::alone::rigs::repeating;

/// Two spheres at many poses; where they stand floats.
const SPHERES: [&str; 5] = [
    "artefact, id: high, points: 25",
    "rotary, sphere: high, planned: 20, points: 6, repeats: 4",
    "rotary, sphere: low, planned: 20, points: 6, repeats: 4",
    "rotary, sphere: high, planned: 8, points: 6, verification: true",
    "artefact, id: high, points: 25",
];

/// The five-axis machine of `launch_configs`, with linear axes and rotary axes that its file describes well.
fn five_axis() -> Rig {
    let machine = include_str!("../../../../../../launch_configs/five_axis/machine.yaml");
    let plant = include_str!("../../../../../../launch_configs/five_axis/plant.yaml");
    let mut rig = repeating(&SPHERES, 1);
    let mut own = PlantFile::from_yaml(plant).unwrap();
    let geometry = &mut own.geometry;
    geometry.linear.clone_from(&rig.plant.geometry.linear);
    for entry in geometry.linear.values_mut() {
        entry.lead_um_per_m = 0.0;
    }
    geometry.squareness_urad = SquarenessEntry {
        y_to_x: 0.0,
        z_to_x: 0.0,
        z_to_y: 0.0,
    };
    for entry in geometry.rotary.values_mut() {
        (entry.location_um, entry.tilt_urad) = ([0.0; 3], [0.0; 3]);
        (entry.run_out_um, entry.wobble_urad, entry.positioning_urad) = (0.05, 0.2, 0.2);
    }
    own.heat.shop_air.clone_from(&rig.plant.heat.shop_air);
    own.heat.standing_heat_w = BTreeMap::new();
    for screw in own.heat.screws.values_mut() {
        (screw.nut_torque_n_m, screw.bearing_torque_n_m) = (0.0, 0.0);
        screw.motor_loss_w_per_kn2 = 0.0;
    }
    rig.plant = own;
    rig.machine = MachineFile::parse(machine, "five_axis/machine.yaml").unwrap();
    rig.control = rig.machine.clone();
    rig
}

/// What the machine has besides: gears yield to the friction of their bearings (18 urad for C, 22 urad for A), the guides
/// of Y hold back the more the slower it goes.
const BESIDE: [&str; 2] = ["rotary_backlash", "feed_lost_motion"];

#[test]
fn a_table_that_turns_about_another_line_is_displaced() {
    let mut rig = five_axis();
    let table = rig.plant.geometry.rotary.get_mut(&Axis::C).unwrap();
    table.location_um[0] = 50.0;
    let size_um = is_named_with(&told(&[&rig]), "rotary_location", "X0C", &BESIDE);
    assert!((size_um - 50.0).abs() < 3.0, "{size_um}");
}

#[test]
fn a_ring_that_is_graduated_unevenly_is_an_error_of_the_turn() {
    let mut rig = five_axis();
    let table = rig.plant.geometry.rotary.get_mut(&Axis::C).unwrap();
    table.positioning_urad = 100.0;
    is_named_with(&told(&[&rig]), "rotary_motion", "CC", &BESIDE);
}

/// The play of a worn gear comes on top of what the gear yields.
#[test]
fn a_worm_with_play_is_backlash_of_its_table() {
    let mut rig = five_axis();
    let table = rig.plant.rotary_drives.get_mut(&Axis::C).unwrap();
    table.backlash_arcsec = 10.0;
    let size_urad = is_named_with(&told(&[&rig]), "rotary_backlash", "C", &BESIDE);
    let play_urad = (10.0_f64 / 3600.0).to_radians() * 1e6;
    assert!(
        (play_urad..play_urad + 25.0).contains(&size_urad),
        "{size_urad} {play_urad}"
    );
}
