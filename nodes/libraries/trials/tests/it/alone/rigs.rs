//! Machines, their programmes, and what stands on their tables.

use machine::MachineFile;
use machine::file::ArtefactEntry;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use sequencer::Plan;
use trials::{Arm, Rig, Trial};

/// Seed of every machine.
pub const SEED: u64 = 20_261_123;

/// A machine as blind trials draw it, with their programme of circles, positioning and touches, and nothing hidden.
pub fn with_circles() -> Rig {
    let mut rig = Trial::draw(Arm::Null, SEED, 0).unwrap().rig;
    rig.has_motors = true;
    rig
}

/// A machine that does some steps a number of times; each is a line of a plan.
pub fn repeating(steps: &[&str], times: usize) -> Rig {
    let mut rig = Rig::draw(&mut Pcg64Mcg::seed_from_u64(SEED), false).unwrap();
    rig.has_motors = true;
    rig.plan = plan(&steps.repeat(times));
    rig
}

/// A plan of steps, each a line.
pub fn plan(steps: &[&str]) -> Plan {
    let mut text = "title: one effect alone\nsteps:\n".to_owned();
    for step in steps {
        text.push_str("  - {do: ");
        text.push_str(step);
        text.push_str("}\n");
    }
    Plan::from_yaml(&text).unwrap()
}

/// Lets something change in the file that the diagnosis is told and in the one that the control has.
pub fn in_both_files(rig: &mut Rig, change: impl Fn(&mut MachineFile)) {
    change(&mut rig.machine);
    change(&mut rig.control);
}

/// Puts a ring gauge and a sphere on the table: `ring`, `ball`.
pub fn with_artefacts(mut rig: Rig) -> Rig {
    in_both_files(&mut rig, |file| {
        file.artefacts.push(ArtefactEntry::Bore {
            id: "ring".to_owned(),
            centre_mm: [0.0, 0.0, 60.0],
            radius_mm: 40.0,
        });
        file.artefacts.push(ArtefactEntry::Sphere {
            id: "ball".to_owned(),
            centre_mm: [100.0, 60.0, 60.0],
            radius_mm: 12.5,
        });
    });
    rig
}
