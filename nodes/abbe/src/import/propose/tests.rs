//! Proposals are maps that are taken.

use super::*;
use machine::MachineFile;
use metrology::yaml;

fn proposed(name: &str, text: &str) -> (Proposal, Map) {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join(name);
    std::fs::write(&path, text).unwrap();
    let proposal = of(&path).unwrap();
    let map = yaml::read_letters(&proposal.map)
        .unwrap_or_else(|error| panic!("{error}: {}", proposal.map));
    (proposal, map)
}

#[test]
fn a_proposal_is_a_map_of_a_machine_that_can_be_read() {
    for (name, text, axis) in [
        (
            "lead_Y.csv",
            "run,direction,target_mm,deviation_um\n1,up,0,0.5\n1,up,40,2\n",
            Axis::Y,
        ),
        (
            "a.csv",
            "run,direction,target_deg,deviation_arcsec\n1,up,0,0.5\n1,up,40,2\n",
            Axis::C,
        ),
        (
            "b.txt",
            "Position [mm]\tRun 1 ↑\tRun 1 ↓\n0\t1.5\t2.5\n50\t1\t2\n",
            Axis::X,
        ),
        (
            "log.csv",
            "time_s,z_um,spindle nose [°C],2nd (°C)\n0,0.1,20.5,20.0\n60,1,21,20\n",
            Axis::Z,
        ),
        ("c.csv", "run,angle_deg,radial_um\n1,0,2\n1,10,3\n", Axis::X),
    ] {
        let (proposal, map) = proposed(name, text);
        let machine = MachineFile::parse(&machine_for(&map), "machine").unwrap();
        super::super::limits::check(&map, &machine)
            .unwrap_or_else(|error| panic!("{error:#}: {}", proposal.map));
        let found = match map.test {
            Test::Positioning { axis, .. } | Test::Log { axis, .. } => axis,
            Test::Circle { .. } => Axis::X,
        };
        assert_eq!(found, axis, "{name}");
        assert!(proposal.map.contains("NEEDED"), "{}", proposal.map);
    }
}

#[test]
fn units_that_cannot_be_right_are_asked_about_with_the_likely_one() {
    let (proposal, map) = proposed(
        "a.csv",
        "target,deviation\n0,0.001\n0.12,-0.004\n0.24,0.003\n",
    );
    assert_eq!(map.units.get("target"), Some(&Unit::Metre));
    assert_eq!(map.units.get("deviation"), Some(&Unit::Mm));
    let asked = proposal.needed.join("\n");
    assert!(asked.contains("too small for mm; m is likely"), "{asked}");
    assert!(asked.contains("too small for um; mm is likely"), "{asked}");
    let (_, map) = proposed("b.csv", "target,deviation\n0,1\n120,-4\n240,3\n");
    assert!(map.units.is_empty());
    assert!(
        doubt(&[0.01, -0.02], "d", ["um", "mm"])
            .unwrap()
            .contains("are they mm?")
    );
    assert_eq!(doubt(&[0.01, -0.2], "d", ["um", "mm"]), None);
}

#[test]
fn times_of_an_epoch_give_the_begin() {
    let (_, map) = proposed(
        "log_X.csv",
        "epoch,x_um\n1767600000250,0.1\n1767600060250,1\n",
    );
    assert_eq!(
        (map.start_s, map.units.get("epoch")),
        (1_767_600_000, Some(&Unit::Ms))
    );
    let (_, map) = proposed(
        "log_X.csv",
        "when;x_um\n2026-01-05 08:00:00;0,1\n2026-01-05 08:01:00;1,5\n",
    );
    assert_eq!(map.start_s, 1_767_600_000);
}

#[test]
fn a_table_of_nothing_known_names_its_columns() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("a.csv");
    std::fs::write(&path, "colour,weight\n1,2\n3,4\n").unwrap();
    let said = format!("{:#}", of(&path).unwrap_err());
    assert!(said.contains("columns colour, weight"), "{said}");
}
