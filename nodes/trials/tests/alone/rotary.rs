//! Effects of rotary axes: a table that turns about another line than the machine file's.

use std::collections::BTreeMap;

use fake_cnc::PlantFile;
use fake_cnc::plant::SquarenessEntry;
use machine::MachineFile;
use metrology::Axis;
use trials::Rig;

use crate::judge::{is_named, told};
use crate::rigs::repeating;

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
    let machine = include_str!("../../../../launch_configs/five_axis/machine.yaml");
    let plant = include_str!("../../../../launch_configs/five_axis/plant.yaml");
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
    rig.plant = own;
    rig.machine = MachineFile::parse(machine, "five_axis/machine.yaml").unwrap();
    rig.control = rig.machine.clone();
    rig
}

#[test]
fn a_table_that_turns_about_another_line_is_displaced() {
    let mut rig = five_axis();
    let table = rig.plant.geometry.rotary.get_mut(&Axis::C).unwrap();
    table.location_um[0] = 50.0;
    let size_um = is_named(&told(&[&rig]), "rotary_location", "X0C");
    assert!((size_um - 50.0).abs() < 3.0, "{size_um}");
}
