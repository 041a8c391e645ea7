//! Part programs of a plan, read as the fake machine's control reads them before anything moves.
//!
//! Where the axes stand when a program begins is known at run time alone. Each program is therefore read twice, from two
//! places within the travel: what is refused alike from both is a mistake, and what differs is noted.

use std::path::{Path, PathBuf};

use anyhow::Result;
use fake_cnc::config::Settings;
use fake_cnc::rs274::{self, Envelope};
use machine::MachineFile;
use metrology::PerAxis;
use sequencer_node::{read_plan, read_programs};

use super::Findings;
use crate::launch::LaunchNode;

/// The two places, as shares of each travel.
const PLACES: [f64; 2] = [0.37, 0.61];

/// Reads the programs of every sequencer with the control of its namespace. A control other than `fake_cnc` has words of its own.
pub fn check(launched: &[LaunchNode], findings: &mut Findings) {
    for sequencer in launched.iter().filter(|node| node.exec == "sequencer") {
        // What cannot be read here was reported by building the node.
        let Ok(programs) = programs_of(sequencer) else {
            continue;
        };
        let is_its =
            |node: &&LaunchNode| node.exec == "fake_cnc" && node.namespace == sequencer.namespace;
        for control in launched.iter().filter(is_its) {
            let Ok(control) = Control::of(control) else {
                continue;
            };
            for (path, text) in &programs {
                read(path, text, &control, findings);
            }
        }
    }
}

/// Paths and texts of the programs of a sequencer's plan.
fn programs_of(sequencer: &LaunchNode) -> Result<Vec<(PathBuf, String)>> {
    let setup = sequencer.setup()?;
    let config: sequencer::Config = setup.config()?;
    if config.plan_file.is_empty() {
        return Ok(vec![]);
    }
    let (path, text) = setup.file_text("plan_file")?;
    let programs = read_programs(&read_plan(&text, &path)?, &path)?;
    let folder = path.parent().map(PathBuf::from).unwrap_or_default();
    Ok(programs
        .into_iter()
        .map(|(name, text)| (folder.join(name), text))
        .collect())
}

/// What a control checks programs against.
struct Control {
    envelope: Envelope,
    machine: MachineFile,
}

impl Control {
    fn of(control: &LaunchNode) -> Result<Self> {
        let setup = control.setup()?;
        let config: fake_cnc::Config = setup.config()?;
        let (path, text) = setup.file_text("machine_file")?;
        let machine = MachineFile::parse(&text, &path.display().to_string())?;
        Self::new(&config, machine)
    }

    fn new(config: &fake_cnc::Config, machine: MachineFile) -> Result<Self> {
        let envelope = Settings::new(config, &machine)?.envelope().clone();
        Ok(Self { envelope, machine })
    }
}

fn read(path: &Path, text: &str, control: &Control, findings: &mut Findings) {
    let Control { envelope, machine } = control;
    let from = |share: f64| {
        let start = PerAxis::from_fn(|axis| {
            let [least, greatest] = envelope.travel[axis];
            least + share * (greatest - least)
        });
        let program = rs274::read(text, envelope, &start);
        let has_device =
            |id: &str| machine.grid_placement(id).is_some() || machine.beam(id).is_some();
        { program.and_then(|program| program.check_devices(has_device)) }.err()
    };
    let [Some(one), Some(other)] = PLACES.map(from) else {
        return;
    };
    let shown = path.display().to_string().replace("/hosts/../", "/");
    if one == other {
        findings.mistake(format!("program {shown}: {one}"));
    } else {
        findings.note(format!(
            "program {shown}: refused from two places within the travel, for what depends on where the axes stand: {one}; and {other}"
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MACHINE: &str = include_str!("../../../../launch_configs/gap_first/machine.yaml");

    fn found(text: &str) -> Findings {
        let machine = MachineFile::parse(MACHINE, "m").unwrap();
        let control = Control::new(&fake_cnc::Config::default(), machine).unwrap();
        let mut findings = Findings::default();
        let path = PathBuf::from("cell/part.ngc");
        read(&path, text, &control, &mut findings);
        findings
    }

    #[test]
    fn a_program_that_cannot_run_is_a_mistake_with_file_line_and_word() {
        for (text, words) in [
            ("G0 Z100\nG1 X1\nM2\n", ["line 2", "needs a feed, F is 0"]),
            ("QQ\nM2\n", ["line 1", "Q"]),
            ("root:x:0:0\n", ["line 1", "column"]),
            ("G0 X1\n", ["line 1", "without M2"]),
            ("G0 X99999\nM2\n", ["line 1", "limit"]),
        ] {
            let findings = found(text);
            let said = findings.mistakes.join("\n");
            assert!(
                said.starts_with("program cell/part.ngc: "),
                "{text}: {said}"
            );
            for word in words {
                assert!(said.contains(word), "{text}: {said}");
            }
        }
    }

    #[test]
    fn a_placement_or_beam_that_the_machine_file_has_not_is_a_mistake_as_at_the_run() {
        let machine = MachineFile::parse(MACHINE, "m").unwrap();
        let grid = machine.grid_encoder.iter().flat_map(|it| &it.placements);
        let length = machine.length_reference.iter().flat_map(|it| &it.beams);
        let known = grid.map(|it| &it.id).chain(length.map(|it| &it.id));
        let known: Vec<&String> = known.collect();
        assert!(!known.is_empty());
        for name in known {
            let findings = found(&format!("(mount: {name})\nG4 P1\nM2\n"));
            assert!(findings.mistakes.is_empty(), "{:?}", findings.mistakes);
        }
        for name in ["midle", "TABLE?", "x y", "1"] {
            let said = found(&format!("G21\n(mount: {name})\nM2\n")).mistakes;
            let said = said.join("\n");
            for words in [
                "line 2, column 1",
                name,
                "placement or beam of the machine file",
            ] {
                assert!(said.contains(words), "{name}: {said}");
            }
        }
    }

    #[test]
    fn what_depends_on_where_the_axes_stand_is_no_mistake() {
        let passes = found("G91 G0 X1\nM2\n");
        assert_eq!((passes.mistakes.len(), passes.notes.len()), (0, 0));
        let beyond = found("G91 G0 X99999\nM2\n");
        assert_eq!((beyond.mistakes.len(), beyond.notes.len()), (0, 1));
        assert!(beyond.notes[0].contains("line 1"), "{:?}", beyond.notes);
    }
}
