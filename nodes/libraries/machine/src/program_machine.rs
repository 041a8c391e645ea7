//! For which machine file a program in machine coordinates was made.
//!
//! Approaches and touches of a generated program are near the surfaces that the machine file names. On a controller with
//! another machine file the ball may meet them in between. So the sequencer marks a program by `(machine: MARK)` behind
//! `(frame: machine)`, and a controller refuses a mark that is not that of its own file. A control that knows no such
//! comment passes over it.
//!
//! The mark is FNV-1a of 64 bits over what such programs are made from: chain, travels, rotary axes, probe, blocks,
//! artefacts, table and instruments, as they are understood. Layout, comments, gains and known effects make no
//! difference. It distinguishes files that differ by mistake; it is no signature.
//!
//! # References
//! G. Fowler, L. C. Noll, K.-P. Vo, D. Eastlake, "The FNV Non-Cryptographic Hash Algorithm", IETF draft-eastlake-fnv.

use std::collections::BTreeMap;

use metrology::Axis;

use crate::file::{AxisEntry, MachineFile};

/// The frame comment, behind which a mark stands.
const FRAME: &str = "(frame: machine)";
/// What stands in front of the mark.
const KEY: &str = "machine";
/// Hexadecimal digits of a mark.
const MARK_DIGITS: usize = 16;
const OFFSET_BASIS: u64 = 0xcbf2_9ce4_8422_2325;
const PRIME: u64 = 0x0000_0100_0000_01b3;

/// A program that was made for another machine file than the controller's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the program is made for another machine file (mark {of:016x}, the controller's is {own:016x}): give sequencer and controller the same machine_file, and the same version"
)]
pub struct OtherMachine {
    /// Mark of the program.
    pub of: u64,
    /// Mark of the controller's file.
    pub own: u64,
}

/// The mark of a machine file; `None` where it cannot be written down.
#[must_use]
pub fn mark_of(machine: &MachineFile) -> Option<u64> {
    let travels: BTreeMap<Axis, [f64; 2]> = { machine.axes.iter() }
        .map(|(axis, entry)| (*axis, travel(entry)))
        .collect();
    let places = (
        &machine.chain,
        travels,
        &machine.rotary,
        &machine.probe,
        &machine.blocks,
        &machine.artefacts,
        &machine.table,
        &machine.grid_encoder,
        &machine.length_reference,
    );
    let text = serde_saphyr::to_string(&places).ok()?;
    Some(fnv1a(text.as_bytes()))
}

/// Least and greatest position, mm or deg.
const fn travel(entry: &AxisEntry) -> [f64; 2] {
    match entry {
        AxisEntry::Linear(linear) => linear.travel_mm,
        AxisEntry::Rotary(rotary) => rotary.travel_deg,
    }
}

fn fnv1a(bytes: &[u8]) -> u64 {
    { bytes.iter() }.fold(OFFSET_BASIS, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(PRIME)
    })
}

/// The program with the mark behind the frame comment of its first line; one that does not begin with it, or has a mark,
/// stays as it is.
#[must_use]
pub fn marked(program: &str, mark: u64) -> String {
    match program.strip_prefix(FRAME) {
        Some(rest) if mark_in(program).is_none() => {
            format!("{FRAME} ({KEY}: {mark:0MARK_DIGITS$x}){rest}")
        }
        _ => program.to_owned(),
    }
}

/// The mark on the first line of a program. A comment that names a machine in words is not a mark.
#[must_use]
pub fn mark_in(program: &str) -> Option<u64> {
    let mut rest = program.lines().next().unwrap_or("").trim_start();
    while let Some((comment, behind)) = rest.strip_prefix('(').and_then(|open| open.split_once(')'))
    {
        if let Some((key, mark)) = comment.split_once(':')
            && key.trim().eq_ignore_ascii_case(KEY)
            && let mark = mark.trim()
            && mark.len() == MARK_DIGITS
            && let Ok(mark) = u64::from_str_radix(mark, 16)
        {
            return Some(mark);
        }
        rest = behind.trim_start();
    }
    None
}

/// Whether a controller whose machine file has the mark `own` may take a program.
///
/// # Errors
/// Both marks, where they differ.
pub fn check(program: &str, own: Option<u64>) -> Result<(), OtherMachine> {
    match (mark_in(program), own) {
        (Some(of), Some(own)) if of != own => Err(OtherMachine { of, own }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::program_frame::{HEAD, is_machine_frame};

    const MACHINE: &str = include_str!("../../../../launch_configs/first_run/machine.yaml");

    fn of(text: &str) -> u64 {
        mark_of(&MachineFile::parse(text, "m").unwrap()).unwrap()
    }

    #[test]
    fn the_hash_is_the_published_one() {
        assert_eq!(fnv1a(b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(fnv1a(b"a"), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(fnv1a(b"foobar"), 0x8594_4171_f739_67e8);
    }

    #[test]
    fn a_mark_changes_with_the_meaning_of_a_file_and_not_with_its_layout() {
        let own = of(MACHINE);
        for (from, to, is_same) in [
            ("effects: []", "effects: []  # none", true),
            (
                "travel_mm: [-320.0, 320.0]",
                "travel_mm: [-320, 320.00]",
                true,
            ),
            ("effects: []", "artefacts: []", true),
            (
                "effects: []",
                "effects: [{kind: backlash, axis: X, width_um: 0.7}]",
                true,
            ),
            (
                "position_gain_per_s: 60.0",
                "position_gain_per_s: 50.0",
                true,
            ),
            ("-180.0, 20.0]", "-180.0, 15.0]", false),
            ("radius_mm: 3.0, length", "radius_mm: 2.9, length", false),
            (
                "travel_mm: [-320.0, 320.0]",
                "travel_mm: [-320.0, 300.0]",
                false,
            ),
            (
                "travel_deg: [-120.0, 30.0]",
                "travel_deg: [-110.0, 30.0]",
                false,
            ),
            ("A: [0.0, 0.0, 50.0]", "A: [0.0, 0.0, 51.0]", false),
            (
                "centre_mm: [0.0, 0.0, 30.0]",
                "centre_mm: [0.0, 0.0, 31.0]",
                false,
            ),
            ("standoff_mm: 2.0", "standoff_mm: 2.001", false),
            ("[w C' A' Y' b X Z t]", "[w C' A' b Y X Z t]", false),
        ] {
            let changed = MACHINE.replacen(from, to, 1);
            assert_ne!(changed, MACHINE, "{from}");
            assert_eq!(of(&changed) == own, is_same, "{to}");
        }
    }

    #[test]
    fn a_marked_program_is_still_one_of_machine_coordinates_with_the_same_lines() {
        for mark in [0, 7, 0x0123_4567_89ab_cdef, u64::MAX] {
            for program in [HEAD, "(frame: machine)", "(frame: machine)\r\nG0 X1\nM2\n"] {
                let once = marked(program, mark);
                assert!(is_machine_frame(&once), "{once}");
                assert_eq!(once.lines().count(), program.lines().count());
                assert_eq!(mark_in(&once), Some(mark));
                assert_eq!(marked(&once, 1), once, "once");
            }
        }
        for own in ["G0 X1\nM2\n", "", "G21 (frame: machine)\n", "(a part)\n"] {
            assert_eq!(marked(own, 7), own);
            assert_eq!(mark_in(own), None);
        }
    }

    #[test]
    fn a_controller_refuses_another_mark_and_takes_its_own_and_none() {
        let own = of(MACHINE);
        let other = of(&MACHINE.replacen("-180.0, 20.0]", "-180.0, 15.0]", 1));
        let program = marked(HEAD, other);
        let said = check(&program, Some(own)).unwrap_err().to_string();
        let marks = [own, other].map(|mark| format!("{mark:016x}"));
        for word in [marks[0].as_str(), &marks[1], "same machine_file"] {
            assert!(said.contains(word), "{word}: {said}");
        }
        assert_eq!(check(&program, Some(other)), Ok(()));
        assert_eq!(check(&program, None), Ok(()));
        for of_an_author in [
            HEAD,
            "(frame: machine) (machine: vmc_5x)\nM2\n",
            "(machine: 12)\n",
            "(machine: ++++++++++++++++)\n",
            "G0 X1 (machine: 0123456789abcdef)\n",
        ] {
            assert_eq!(check(of_an_author, Some(own)), Ok(()), "{of_an_author}");
        }
    }
}
